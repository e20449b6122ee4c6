//! Blades, hub and duct work differently astern.

use super::{Context, Descriptor, Effect, Hooks, Path, Scale, Spec, one_start, wet};
use crate::parameters::Parameter as P;
use crate::plant::{Balance, Foil, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "forward_reverse_asymmetry",
    path: Path::Blade,
    what: "cambered blades, the hub or the duct give another lift, drag or flux coefficient when turning astern",
    equation: "astern: CL (1 + el), CD (1 + ed), dbeta (1 + ef); el, ed, ef [1]",
    signature: "thrust over speed squared differs between the directions by the same percentage at all speeds",
    confused_with: &["ambient_axial_flow", "thrust_bias_gain_hysteresis", "torque_channel_bias"],
    separated_by: "a staircase in both directions; the thruster turned end for end on the stand",
    reference: "maker's curves of a T200-size unit: reverse over forward thrust 0.75 to 0.785",
    commonness: 1.5,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[1], &[2], &[0, 1], &[0, 1, 2]],
    parameters,
    starts: one_start,
    needs: wet,
    build: both!(build),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("reverse_lift_error", "1", -0.04, -0.8, 1.0).sigma(0.15),
        Spec::strength("reverse_drag_error", "1", 0.05, -0.8, 2.0).sigma(0.15),
        Spec::strength("reverse_flux_error", "1", 0.05, -0.8, 2.0).sigma(0.15),
    ]
}

fn build<T: Real>(values: &[T], context: &Context<T>) -> Box<dyn Effect<T>> {
    let p = context.parameters;
    Box::new(Asymmetry {
        lift: values[0],
        drag: values[1],
        flux_kg_m: values[2] * p.get(P::FluxCoefficient) * p.get(P::DensityKgM3) * p.area_m2(),
    })
}

struct Asymmetry<T> {
    lift: T,
    drag: T,
    flux_kg_m: T,
}

impl<T: Real> Effect<T> for Asymmetry<T> {
    fn hooks(&self) -> Hooks {
        Hooks { foil: true, balance: true, ..Hooks::NONE }
    }

    /// Goes over smoothly as the flow along the chord turns round: 0 ahead, 1 astern.
    fn foil(&self, _: &Local<T>, _: &[T], foil: &mut Foil<T>) {
        let along = foil.chordwise_m_s / foil.speed_m_s;
        let astern = T::from(0.5) - along * 0.25 * (T::from(3.0) - along * along);
        foil.lift *= self.lift * astern + 1.0;
        foil.drag *= self.drag * astern + 1.0;
    }

    /// The flux itself vanishes where the flow turns round.
    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        if at.axial_m_s < 0.0 {
            balance.flux_kg_m += self.flux_kg_m;
        }
    }
}
