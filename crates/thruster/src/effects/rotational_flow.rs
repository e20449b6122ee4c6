//! The wake turns with the propeller: swirl unloads the blades.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, wet};
use crate::blade::{Inflow, Swirl};
use crate::parameters::Parameter as P;
use crate::plant::{Balance, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "rotational_flow",
    path: Path::Blade,
    what: "the water behind the propeller turns with it (swirl), which lowers the speed of the blade through the water",
    equation: "ut = 0.7 r Om - us; rho a l gr us' = Q/(0.7 r) - dbr rho a |vp| us; us [m/s], gr, dbr [1]; \
               fitted as swirl_yield = 1/dbr and swirl_lag_ratio = gr/dbr",
    signature: "shaft speed overshoots after a torque step by the same percentage at all torques, because swirl is not \
                yet washed out while axial flow is low",
    confused_with: &[
        "entrained_water_inertia",
        "unsteady_lift_lag",
        "nonsinusoidal_lift_drag",
        "inertia_added_mass_error",
    ],
    separated_by: "steps of several sizes both ways with shaft speed and thrust logged: the pair of overshoots; a probe for tangential flow",
    reference: "Bachmayer, Whitcomb, Grosenbaugh 2000 (IEEE JOE 25:146); the equation's form is kort's",
    commonness: 1.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: |_| vec![vec![0.1, 0.08], vec![0.1, 1.5]],
    needs: wet,
    build: both!(|values, context| {
        let p = context.parameters;
        let flux_kg_m = p.get(P::DensityKgM3) * p.area_m2();
        let law =
            Swirl { share: values[0], mass_kg: values[1] * p.duct_mass_kg(), flux_kg_m, ..Swirl::new(p) };
        Box::new(RotationalFlow { law, tick_s: context.tick_s })
    }),
};

/// The published pair (`dbr`, `gr`) divided by `dbr`, so that the effect vanishes at zero yield.
fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("swirl_yield", "1", 0.1, 0.0, 3.0).sigma(0.6),
        Spec::shape("swirl_lag_ratio", "1", 0.4, 0.005, 8.0).sigma(0.5),
    ]
}

struct RotationalFlow<T> {
    law: Swirl<T>,
    tick_s: f64,
}

impl<T: Real> Effect<T> for RotationalFlow<T> {
    fn states(&self) -> usize {
        1
    }

    fn hooks(&self) -> Hooks {
        Hooks { inflow: true, balance: true, ..Hooks::NONE }
    }

    fn inflow(&self, _: &Local<T>, own: &[T], inflow: &mut Inflow<T>) {
        inflow.tangential_m_s -= own[0];
    }

    /// The swirl's lag is never shorter than a tick, which the integrator could not follow.
    fn balance(&self, at: &Local<T>, own: &[T], balance: &mut Balance<T>, rates: &mut [T]) {
        rates[0] = self.law.acceleration(balance.blade_torque_n_m, at.axial_m_s, own[0], self.tick_s);
    }
}
