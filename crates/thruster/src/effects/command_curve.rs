//! The drive's throttle is not linear in what it drives.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, commanded};
use crate::plant::{Drive, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "command_curve",
    path: Path::Drive,
    what: "the drive's output is a curve of its command, not a line: a speed controller's throttle, an amplifier that bends",
    equation: "u* = u (1 + c2 (|u|/U - 1) + c3 ((u/U)^2 - 1)), the same as given at full command U; c2, c3 [1], U in the \
               command's unit",
    signature: "middle commands are off by a share that vanishes at full command, the same way up and down and in both \
                directions (no hysteresis)",
    confused_with: &[
        "voltage_limit_backemf",
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
    forms: &[&[0], &[0, 1]],
    parameters,
    starts: |scale| vec![vec![0.1, 0.03, scale.command], vec![-0.1, -0.03, scale.command]],
    needs: commanded,
    build: both!(|values, _| {
        Box::new(CommandCurve { second: values[0], third: values[1], full: values[2] })
    }),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = scale.command;
    vec![
        Spec::strength("second_degree_share", "1", 0.05, -0.6, 0.95).sigma(0.2),
        Spec::strength("third_degree_share", "1", 0.03, -0.3, 0.6).sigma(0.1),
        Spec::held("full_command", "of the command", full, 0.01 * full, 100.0 * full),
    ]
}

struct CommandCurve<T> {
    second: T,
    third: T,
    full: T,
}

impl<T: Real> Effect<T> for CommandCurve<T> {
    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }

    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        let share = (drive.command / self.full).abs();
        drive.command *= self.second * (share - 1.0) + self.third * (share * share - 1.0) + 1.0;
    }
}
