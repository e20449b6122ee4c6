//! A hull or a neighbouring thruster takes part.

use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec, one_start, thrust_measured, wet};
use crate::plant::{Balance, Drive, Local, Tick};
use crate::real::Real;
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "thrust_deduction_interaction",
    path: Path::Flow,
    what: "the jet of a neighbouring thruster feeds or starves this one, and suction on the hull takes some of the thrust",
    equation: "va += C n; y = T (1 - t); n a neighbour's recorded signal over its standard deviation, 0 where it is at rest [1], C [m/s], t [1]",
    signature: "thrust and flow follow another thruster's command; thrust is low in proportion, which a force sensor's gain \
                looks just like",
    confused_with: &[
        "ambient_axial_flow",
        "ambient_flow_unsteady",
        "thrust_bias_gain_hysteresis",
        "duct_loss",
    ],
    separated_by: "the thrusters run one by one, then together; known static loads, which a hull takes nothing of",
    reference: "Carlton, Marine Propellers and Propulsion (thrust deduction, interaction)",
    commonness: 1.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[1], &[0, 1]],
    parameters,
    starts: one_start,
    needs,
    build: both!(|values, _| Box::new(Interaction {
        flow_m_s: values[0],
        deduction: values[1],
        neighbour: 0.0
    })),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = scale.flow_m_s;
    vec![
        Spec::strength("neighbour_flow_m_s", "m/s", 0.03 * full, -full, full).sigma(0.2 * full),
        Spec::strength("deduction", "1", 0.02, -0.3, 0.6).sigma(0.1),
    ]
}

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    wet(rig, available)?;
    // What a hull takes shows in the thrust, no neighbour needed.
    if available.has(super::EXTRA) || thrust_measured(rig, available).is_ok() {
        Ok(())
    } else {
        Err("neither the thrust nor a signal of a neighbouring thruster is recorded")
    }
}

struct Interaction<T> {
    flow_m_s: T,
    deduction: T,
    neighbour: f64,
}

impl<T: Real> Effect<T> for Interaction<T> {
    fn hooks(&self) -> Hooks {
        Hooks { drive: true, balance: true, ..Hooks::NONE }
    }

    fn drive(&mut self, tick: &Tick, _: &mut Drive<T>) {
        // A neighbour at rest has no jet.
        self.neighbour = tick.extra - tick.extra_at_zero;
    }

    fn balance(&self, _: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.ambient_m_s += self.flow_m_s * self.neighbour;
        balance.stand_n -= self.deduction * balance.thrust_n;
    }
}
