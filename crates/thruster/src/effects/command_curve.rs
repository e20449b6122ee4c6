//! The drive's throttle is not linear in what it drives.

use super::{Descriptor, Effect, Hooks, OF_THE_COMMAND, Path, Scale, Spec, commanded};
use crate::plant::{Drive, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "command_curve",
    path: Path::Drive,
    what: "the drive's output is a curve of its command, not a line: a speed controller's throttle, an amplifier that bends",
    equation: "u* = u (1 + c2 (|u|/U - 1) + c3 ((u/U)^2 - 1)) + U sgn(u) p(|u|/U), the same as given at full command U; p \
               straight between 0 at 0, p1 to p4 at 0.2, 0.4, 0.6, 0.8 and 0 at 1; c2, c3, p [1], U in the command's unit",
    signature: "middle commands are off by a share that vanishes at full command, the same way up and down and in both \
                directions (no hysteresis)",
    confused_with: &[
        "voltage_limit_backemf",
        "supply_sag",
        "command_dead_band",
        "torque_constant_saturation",
        "windage_drag",
    ],
    separated_by: "a staircase with the motor current or the supply logged",
    reference: "odd polynomial of second and third degree; measured on a speed controller: 4.3 to 2.4 % of full scale by the \
                second",
    commonness: 1.5,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[0, 1], &[3, 4, 5, 6]],
    parameters,
    starts: |scale| {
        let table = [0.02, 0.03, 0.03, 0.02];
        let from = |c2: f64, c3: f64| [c2, c3, scale.command].into_iter().chain(table).collect();
        vec![from(0.1, 0.03), from(-0.1, -0.03)]
    },
    needs: commanded,
    build: both!(|values, _| {
        Box::new(CommandCurve {
            second: values[0],
            third: values[1],
            full: values[2],
            points: [values[3], values[4], values[5], values[6]],
        })
    }),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = scale.command;
    let point = |name| Spec::strength(name, "1", 0.03, -0.2, 0.2).sigma(0.05);
    vec![
        Spec::strength("second_degree_share", "1", 0.05, -0.6, 0.95).sigma(0.2),
        Spec::strength("third_degree_share", "1", 0.03, -0.3, 0.6).sigma(0.1),
        Spec::held("full_command", OF_THE_COMMAND, full, 0.01 * full, 100.0 * full),
        point("point_at_0_2"),
        point("point_at_0_4"),
        point("point_at_0_6"),
        point("point_at_0_8"),
    ]
}

struct CommandCurve<T> {
    second: T,
    third: T,
    full: T,
    /// Output above the straight line at a fifth, two, three and four fifths of full command, over full command.
    points: [T; 4],
}

impl<T: Real> Effect<T> for CommandCurve<T> {
    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }

    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        let share = (drive.command / self.full).abs();
        let fifths = share * 5.0;
        let at = |k: usize| if (1..5).contains(&k) { self.points[k - 1] } else { T::ZERO };
        let whole = (fifths.re() as usize).min(5);
        let part = fifths - whole as f64;
        let above = at(whole) + (at(whole + 1) - at(whole)) * part;
        let side = if drive.command.re() < 0.0 { -1.0 } else { 1.0 };
        drive.command *= self.second * (share - 1.0) + self.third * (share * share - 1.0) + 1.0;
        drive.command += self.full * above * side;
    }
}
