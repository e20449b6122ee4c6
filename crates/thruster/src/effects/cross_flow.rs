//! Flow across the axis takes thrust.

use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec, one_start, wet};
use crate::plant::{Balance, Drive, Local, Tick};
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "cross_flow",
    path: Path::Flow,
    what: "flow across the axis, as when the vehicle sways or yaws, takes thrust whichever side it comes from",
    equation: "T/(1 + c (n - n0)^2); n the recorded transverse flow (standardised), c, n0 [1]; to first order T (1 - c n^2)",
    signature: "thrust falls with the square of transverse speed, alike to both sides",
    confused_with: &["ambient_axial_flow", "thrust_deduction_interaction"],
    separated_by: "a yaw sweep in towed runs",
    reference: "physics.md C3",
    parameters,
    starts: one_start,
    needs,
    build: |values, _| Box::new(CrossFlow { loss: values[0], centre: values[1], across: 0.0 }),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("loss", "1", 0.02, 0.0, 1.0),
        Spec::shape("centre", "1", 0.0, -3.0, 3.0),
    ]
}

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    wet(rig, available)?;
    if available.has(super::EXTRA) { Ok(()) } else { Err("no flow across the axis is recorded") }
}

struct CrossFlow {
    loss: f64,
    centre: f64,
    across: f64,
}

impl Effect for CrossFlow {
    fn hooks(&self) -> Hooks {
        Hooks { drive: true, balance: true, ..Hooks::NONE }
    }

    fn drive(&mut self, tick: &Tick, _: &mut Drive) {
        self.across = tick.extra - self.centre;
    }

    fn balance(&self, _: &Local, _: &[f64], balance: &mut Balance, _: &mut [f64]) {
        balance.thrust_n /= 1.0 + self.loss * self.across * self.across;
    }
}
