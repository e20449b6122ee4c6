//! The drive limits its current below the stated limit.

use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec, commanded};
use crate::plant::{Drive, Tick};
use crate::real::Real;
use crate::rig::{AmplifierKind, Rig};

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "current_saturation",
    path: Path::Drive,
    what: "the drive limits its current below the stated limit, or where none is stated",
    equation: "|im| <= (1 - c) Imax; c [1]; Imax [A] the rig's, or limit_taken_a where it states none: the largest command of the \
               recordings",
    signature: "large commands alone are off: the current's top is flat and the shaft accelerates at a clipped rate; \
                small commands fit",
    confused_with: &["voltage_limit_backemf", "torque_constant_saturation", "cavitation"],
    separated_by: "steps of rising size; the supply voltage varied (a current limit stays)",
    reference: "Whitcomb & Yoerger, Comparative Experiments in the Dynamics and Model-Based Control of Marine Thrusters (their current amplifier: 9 A)",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: |scale| [0.05, 0.25, 0.4, 0.6].iter().map(|cut| vec![*cut, limit_taken_a(scale)]).collect(),
    needs,
    build: both!(|values, _| Box::new(CurrentSaturation { cut: values[0], limit_taken_a: values[1] })),
};

/// The limit is sharp, as a drive's is; a recording's response is still smooth in it, since each
/// sample crosses it at another time.
fn parameters(scale: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("limit_cut", "1", 0.15, 0.0, 0.9).sigma(0.3),
        Spec::taken("limit_taken_a", "A", limit_taken_a(scale)),
    ]
}

/// The limit that stands for one that is not stated, A; nothing where one is.
fn limit_taken_a(scale: &Scale) -> f64 {
    if scale.current_limit_a.is_finite() { 0.0 } else { scale.command }
}

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    commanded(rig, available)?;
    // Of a current drive, what was commanded tells where a limit may be.
    if rig.amplifier.current_limit_a.is_finite() || rig.amplifier.kind == AmplifierKind::Current {
        Ok(())
    } else {
        Err("the rig states no current limit")
    }
}

struct CurrentSaturation<T> {
    cut: T,
    limit_taken_a: T,
}

impl<T: Real> Effect<T> for CurrentSaturation<T> {
    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }

    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        // A rig may state the effect and no limit: nothing is cut off then.
        if !drive.current_limit_a.re().is_finite() && self.limit_taken_a > 0.0 {
            drive.current_limit_a = self.limit_taken_a;
        }
        drive.current_limit_a *= T::ONE - self.cut;
    }
}
