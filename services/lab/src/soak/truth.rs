//! What is true of the thruster in a run, by scenario and seed; the controllers do not know it.

use std::collections::HashMap;

use kort_thruster::effects::{self, Descriptor, Scale};
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::plant::Plant;
use kort_thruster::rig::Rig;
use rand_distr::{Distribution, StandardNormal};

use super::chain::Chain;
use super::run::{Prepared, stream};

/// The stated parameters, the scenario's factors, and a spread drawn from the seed.
pub fn parameters(prepared: &Prepared, seed: u64) -> Parameters {
    let truth = &prepared.scenario.truth;
    let mut p = Parameters::stated(prepared.rig);
    let mut random = stream(seed, 4);
    for parameter in
        [Parameter::LiftMax, Parameter::DragMax, Parameter::FluxCoefficient, Parameter::AddedMassCoefficient]
    {
        let normal: f64 = StandardNormal.sample(&mut random);
        p.set(parameter, p.get(parameter) * (truth.spread * normal).exp());
    }
    change(&mut p, &truth.factors);
    p
}

/// Factors on what was true before.
pub fn change(p: &mut Parameters, factors: &HashMap<Parameter, f64>) {
    for (parameter, factor) in factors {
        p.set(*parameter, p.get(*parameter) * factor);
    }
}

/// The rig as it would be stated by someone who knows the true parameters.
pub fn told(rig: &Rig, p: &Parameters) -> Rig {
    use Parameter as P;
    let mut rig = rig.clone();
    if let Some(propeller) = &mut rig.propeller {
        propeller.radius_m.value = p.get(P::RadiusM);
        propeller.duct_length_m.value = p.get(P::DuctLengthM);
        propeller.pitch_rad.value = p.get(P::PitchRad);
        propeller.lift_max.value = p.get(P::LiftMax);
        propeller.drag_max.value = p.get(P::DragMax);
    }
    rig.flow.density_kg_m3.value = p.get(P::DensityKgM3);
    rig.flow.flux_coefficient.value = p.get(P::FluxCoefficient);
    rig.flow.added_mass_coefficient.value = p.get(P::AddedMassCoefficient);
    rig.motor.inertia_kg_m2.value = p.get(P::InertiaKgM2);
    rig.motor.torque_constant_nm_a.value = p.get(P::TorqueConstantNmA);
    if let Some(friction) = &mut rig.motor.viscous_friction_nm_s {
        friction.value = p.get(P::ViscousFrictionNmS);
    }
    if let Some(resistance) = &mut rig.motor.winding_resistance_ohm {
        resistance.value = p.get(P::WindingResistanceOhm);
    }
    rig.amplifier.time_constant_s.value = p.get(P::TimeConstantS);
    rig
}

/// The plant that parameters and the scenario's effects make.
pub fn plant(prepared: &Prepared, truth: &Parameters, chain: &Chain, dt: f64) -> Plant {
    let scenario = prepared.scenario;
    let model = chain.controller().nominal();
    let scale = Scale {
        shaft_speed_rad_s: model.speed_max_rad_s,
        torque_n_m: model.torque_constant_nm_a * model.current_limit_a,
        thrust_n: model.thrust_max_n,
        flow_m_s: model.map.flow_m * model.speed_max_rad_s,
        current_a: model.current_limit_a,
        command: model.current_limit_a,
        supply_v: model.supply_v.unwrap_or(0.0),
        inertia_kg_m2: model.inertia_kg_m2,
        tick_s: dt,
        duration_s: scenario.duration_s,
    };
    let hooked: Vec<(&Descriptor, Vec<f64>)> = scenario
        .effects
        .iter()
        .filter_map(|spec| {
            let descriptor = effects::find(&spec.id)?;
            let values = (descriptor.parameters)(&scale)
                .iter()
                .map(|p| spec.values.get(p.name).copied().unwrap_or(p.start))
                .collect();
            Some((descriptor, values))
        })
        .collect();
    let effects: Vec<(&Descriptor, &[f64])> = hooked.iter().map(|(d, v)| (*d, v.as_slice())).collect();
    Plant::new(scenario.model, prepared.rig, truth, &effects, dt).with_encoder_quantised(true)
}
