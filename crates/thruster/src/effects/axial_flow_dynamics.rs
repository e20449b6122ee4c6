//! The water through the propeller has a speed of its own.

use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec, wet};
use crate::models::ModelName;
use crate::parameters::{Parameter as P, Parameters};
use crate::real::Real;
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "axial_flow_dynamics",
    path: Path::Flow,
    what: "the axial flow through the propeller is a state of its own: Models 0 and 1 tie thrust and load to the shaft \
           speed alone, while the water needs time to follow",
    equation: "T = rho a l gam vp' + dbeta rho a vp|vp|, with lift and drag of the blade in (0.7 r Om, vp): Model 2; \
               fitted as factors on the stated CLmax, CDmax, dbeta, gam and pitch",
    signature: "thrust and load after a step of the shaft speed are two to three times their steady values and settle as \
                the water comes up; the flow meter lags behind the shaft",
    confused_with: &["stand_resonance", "inertia_added_mass_error", "amplifier_lag"],
    separated_by: "steps of several sizes: the flow settles over shaft angle, a lag or a resonance over seconds",
    reference: "Healey et al. 1995 (IEEE JOE 20:354); Whitcomb & Yoerger 1999, Models 2 and 3",
    commonness: 3.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: |_| vec![vec![1.0, 1.0, 1.0, 2.5, 1.0]],
    needs: static_baseline,
    build: both!(|values, _| Box::new(AxialFlowDynamics {
        factors: [values[0], values[1], values[2], values[3], values[4]]
    })),
};

/// Factors on what the rig states.
fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::shape("lift_factor", "1", 1.0, 0.2, 5.0).sigma(0.4),
        Spec::shape("drag_factor", "1", 1.0, 0.2, 5.0).sigma(0.4),
        Spec::shape("flux_factor", "1", 1.0, 0.2, 5.0).sigma(0.4),
        Spec::shape("added_mass_factor", "1", 1.0, 0.3, 5.0).sigma(0.6),
        Spec::shape("pitch_factor", "1", 1.0, 0.8, 1.25).sigma(0.08),
    ]
}

fn static_baseline(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.axial_flow_modelled {
        return Err("the baseline model holds the axial flow already");
    }
    wet(rig, available)
}

struct AxialFlowDynamics<T> {
    factors: [T; 5],
}

impl<T: Real> Effect<T> for AxialFlowDynamics<T> {
    fn hooks(&self) -> Hooks {
        Hooks::NONE
    }

    /// Models 0 and 1 give way to Model 2; a model that has the flow keeps its equations.
    fn amend(&self, model: &mut ModelName, parameters: &mut Parameters<T>) {
        if matches!(model, ModelName::Model0 | ModelName::Model1) {
            *model = ModelName::Model2;
        }
        let water = [P::LiftMax, P::DragMax, P::FluxCoefficient, P::AddedMassCoefficient, P::PitchRad];
        for (parameter, factor) in water.into_iter().zip(self.factors) {
            parameters.set(parameter, factor * parameters.get(parameter));
        }
    }
}
