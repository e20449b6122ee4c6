//! Flow across the axis takes thrust.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, wet};
use crate::plant::{Balance, Drive, Local, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "cross_flow",
    path: Path::Flow,
    what: "flow across the axis, from a current or as the vehicle sways or yaws, takes thrust whichever side it comes from",
    equation: "T (1 - c vt^2/(vp^2 + vt^2)), vt = v0 + v1 n; c [1], v0, v1 [m/s], n a recorded signal of the transverse \
               flow (standardised; 0 where none is recorded)",
    signature: "thrust is low in proportion at small axial flow and less so at full thrust, alike in both directions and \
                for flow from both sides",
    confused_with: &["ambient_axial_flow", "thrust_deduction_interaction", "duct_loss", "blade_stall"],
    separated_by: "a yaw sweep in towed runs; the transverse flow recorded",
    reference: "T (1 - c (vt/vp)^2), here bounded where vp is small; kort's form",
    commonness: 0.2,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0, 1], &[0, 1, 2]],
    parameters,
    starts: |scale| {
        let full = scale.flow_m_s;
        let start = |loss, steady, per_signal| vec![loss, steady * full, per_signal * full];
        // Mostly without the signal: a column of something else drags the flow to where it fits nothing.
        vec![
            start(0.1, 0.1, 0.0),
            start(0.1, 0.5, 0.0),
            start(0.5, 0.15, 0.0),
            start(0.5, 0.3, 0.0),
            start(0.1, 0.1, 0.3),
        ]
    },
    needs: wet,
    build: both!(|values, _| {
        Box::new(CrossFlow {
            loss: values[0],
            steady_m_s: values[1],
            per_signal_m_s: values[2],
            across_m2_s2: Real::ZERO,
        })
    }),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = scale.flow_m_s;
    vec![
        Spec::strength("thrust_loss", "1", 0.1, 0.0, 1.0).sigma(0.4),
        Spec::shape("cross_flow_m_s", "m/s", 0.25 * full, 0.02 * full, 2.0 * full).sigma(0.4 * full),
        Spec::shape("cross_flow_per_signal_m_s", "m/s", 0.25 * full, -2.0 * full, 2.0 * full)
            .prior(0.0, 0.4 * full),
    ]
}

struct CrossFlow<T> {
    loss: T,
    steady_m_s: T,
    per_signal_m_s: T,
    across_m2_s2: T,
}

impl<T: Real> Effect<T> for CrossFlow<T> {
    fn hooks(&self) -> Hooks {
        Hooks { drive: true, balance: true, ..Hooks::NONE }
    }

    fn drive(&mut self, tick: &Tick, _: &mut Drive<T>) {
        self.across_m2_s2 = (self.steady_m_s + self.per_signal_m_s * tick.extra).squared();
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        // The small term keeps still water without cross flow from dividing by zero.
        let all = at.axial_m_s * at.axial_m_s + self.across_m2_s2 + 1e-12;
        balance.thrust_n *= T::ONE - self.loss * self.across_m2_s2 / all;
    }
}
