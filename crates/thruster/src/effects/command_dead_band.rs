//! The drive ignores small commands.

use super::{Descriptor, Effect, Hooks, OF_THE_COMMAND, Path, Scale, Spec, commanded};
use crate::plant::{Drive, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "command_dead_band",
    path: Path::Drive,
    what: "the drive ignores commands near its neutral, as speed controllers for brushless motors do",
    equation: "u* = u - (u0 + clamp(u - u0, -d, d)) (1 - k s(|u - u0|/d)); d, u0 in the command's unit, u0 the drive's \
               neutral; k = 0: shifted by d beyond the band, k = 1: passed on as it is",
    signature: "no current and no motion for small commands, the same way up and down (no hysteresis); large commands \
                are off by d or not at all",
    confused_with: &["coulomb_friction", "torque_channel_bias", "gear_backlash", "command_curve"],
    separated_by: "a slow ramp through zero with current recorded: with dry friction current flows and nothing moves",
    reference: "Bessa, Dutra, Kreuzer (thruster dead zone); ArduSub's simulated ESC: 1475 to 1525 us",
    commonness: 1.5,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[0, 2], &[0, 1], &[0, 1, 2]],
    parameters,
    starts: |scale| {
        let full = scale.command;
        [(0.02, 1.0), (0.06, 0.0), (0.06, 1.0), (0.15, 1.0)]
            .iter()
            .map(|(d, kept)| vec![d * full, 0.0, *kept])
            .collect()
    },
    needs: commanded,
    build: both!(|values, _| Box::new(CommandDeadBand {
        half_width: values[0],
        centre: values[1],
        kept: values[2]
    })),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = scale.command;
    vec![
        Spec::strength("half_width", OF_THE_COMMAND, 0.02 * full, 0.0, 0.5 * full).sigma(0.07 * full),
        Spec::shape("centre", OF_THE_COMMAND, 0.0, -0.2 * full, 0.2 * full).sigma(0.03 * full),
        Spec::shape("kept_outside", "1", 0.0, 0.0, 1.0).prior(0.0, 0.6),
    ]
}

struct CommandDeadBand<T> {
    half_width: T,
    centre: T,
    kept: T,
}

impl<T: Real> Effect<T> for CommandDeadBand<T> {
    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }

    /// Beyond the band the passed-on form returns to the command over a quarter of the band.
    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        let (d, u) = (self.half_width, drive.command - self.centre);
        let out = if d > 0.0 { ((u.abs() - d) / (d * 0.25)).clamp(T::ZERO, T::ONE) } else { T::ONE };
        let smooth = out * out * (T::from(3.0) - out * 2.0);
        let side = if u == T::ZERO { 0.0 } else { u.re().signum() };
        let held_back = if u.abs() < d { u } else { d * side };
        drive.command -= (held_back + self.centre) * (T::ONE - self.kept * smooth);
    }
}
