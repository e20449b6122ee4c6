//! The drive does not brake: its current dies in diodes.

use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec, commanded, free_shaft};
use crate::plant::{Drive, Tick};
use crate::real::Real;
use crate::rig::{AmplifierKind, Rig};

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "drive_freewheels",
    path: Path::Drive,
    what: "the drive does not brake: where the shaft turns faster than its command its current dies in diodes and the shaft coasts, as with \
           speed controllers without active (damped, complementary) braking",
    equation: "R im = u - (1 - g) e - g clamp(e, -|u|, |u|), e = ke Om; g [1], 1 gives no braking current at all",
    signature: "a step up is answered as ever, a step down and a release slowly, by friction and load alone; settled levels fit",
    confused_with: &[
        "viscous_friction",
        "command_dead_band",
        "direction_dependent_friction",
        "windage_drag",
        "command_curve",
    ],
    separated_by: "steps up and down between the same two levels; the motor's current while the shaft slows down",
    reference: "Mohan, Undeland, Robbins, Power Electronics (dc motor drives); Krishnan, Electric Motor Drives",
    commonness: 1.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: |_| [0.4, 0.9].map(|share| vec![share]).to_vec(),
    needs,
    build: both!(|values, _| Box::new(Freewheels { share: values[0] })),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![Spec::strength("freewheeling_share", "1", 0.4, 0.0, 1.0).sigma(0.5)]
}

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    commanded(rig, available)?;
    free_shaft(rig, available)?;
    if rig.amplifier.kind == AmplifierKind::Voltage {
        Ok(())
    } else {
        Err("only a drive that is told a voltage or a duty leaves its current to the back-EMF")
    }
}

struct Freewheels<T> {
    share: T,
}

impl<T: Real> Effect<T> for Freewheels<T> {
    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }

    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        drive.freewheels = self.share;
    }
}
