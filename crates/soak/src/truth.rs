//! What is true of the thruster in a run, by scenario and seed; the controllers do not know it.

use std::collections::HashMap;

use kort_control::ControlModel;
use kort_thruster::effects::{self, Context, Descriptor, Scale, Spec};
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::place;
use kort_thruster::plant::Plant;
use kort_thruster::rig::Rig;
use rand_distr::{Distribution, StandardNormal};

use crate::run::{Prepared, stream};
use crate::scenario::{EffectSpec, Scenario};

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

/// An effect of the catalogue with values for its parameters.
pub type Hooked = (&'static Descriptor, Vec<f64>);

/// Most continuous states that a plant has for effects.
const EFFECT_STATES: usize = 8;

/// The scenario's effects; a parameter left out stands where a fit would start.
///
/// # Errors
/// All that is wrong, in words that name the effect, its parameter, the value and what is allowed.
pub fn effects(scenario: &Scenario, rig: &Rig, model: &ControlModel) -> Result<Vec<Hooked>, Vec<String>> {
    let scale = model.scale(rig, scenario.duration_s);
    let parameters = Parameters::stated(rig);
    let context = Context { parameters: &parameters, rig, tick_s: model.period_s };
    let (mut states, mut wrong) = (0, Vec::new());
    let mut hooked = Vec::with_capacity(scenario.effects.len());
    for spec in &scenario.effects {
        let Some(descriptor) = effects::find(&spec.id) else {
            wrong.push(no_effect(&spec.id));
            continue;
        };
        let before = wrong.len();
        let values = valued(spec, &(descriptor.parameters)(&scale), &scale, &mut wrong);
        if wrong.len() == before {
            states += (descriptor.build.plain)(&values, &context).states();
            hooked.push((descriptor, values));
        }
    }
    if states > EFFECT_STATES {
        wrong.push(format!(
            "the effects have {states} states of their own together, at most {EFFECT_STATES} can be simulated\nhint: take an [[effect]] away"
        ));
    }
    if wrong.is_empty() { Ok(hooked) } else { Err(wrong) }
}

/// Words for an identifier that the catalogue has not.
fn no_effect(id: &str) -> String {
    let known: Vec<_> = effects::ALL.iter().map(|d| d.id).collect();
    let near = place::near(id, known.iter().copied());
    let near = near.map(|near| format!("did you mean `{near}`? ")).unwrap_or_default();
    format!("effect `{id}` is not in the catalogue\nhint: {near}known are {}", known.join(", "))
}

/// The values of an effect's parameters in order, as far as nothing is wrong with them.
fn valued(effect: &EffectSpec, specs: &[Spec], scale: &Scale, wrong: &mut Vec<String>) -> Vec<f64> {
    let EffectSpec { id, values, shares } = effect;
    for unknown in values.keys().chain(shares.keys()).filter(|k| specs.iter().all(|s| s.name != k.as_str())) {
        let known: Vec<_> = specs.iter().map(|s| s.name).collect();
        wrong.push(format!("effect `{id}` has no value `{unknown}`\nhint: it has {}", known.join(", ")));
    }
    let mut chosen = Vec::with_capacity(specs.len());
    for spec in specs {
        let share = match shares.get(spec.name).map(|share| Ok(share * largest(scale, id, spec)?)).transpose()
        {
            Ok(share) => share,
            Err(words) => {
                wrong.push(words);
                continue;
            }
        };
        let stated = values.get(spec.name).copied();
        if let (Some(value), Some(share)) = (stated, shares.get(spec.name)) {
            wrong.push(format!(
                "`{id}.{}` is {value} under `values` and {share} of the rig's largest under `shares`\nhint: leave one of them out",
                spec.name
            ));
        }
        let stated = stated.or(share);
        let value = stated.unwrap_or(spec.start);
        if stated.is_some() && !(value >= spec.low && value <= spec.high) {
            wrong.push(format!(
                "`{id}.{}` = {value} is outside what is allowed: {} to {} ({})\nhint: {} is small but visible",
                spec.name, spec.low, spec.high, spec.unit, spec.start
            ));
        }
        chosen.push(value);
    }
    chosen
}

/// What a share of 1 of a unit stands for on the rig.
fn largest(scale: &Scale, id: &str, spec: &Spec) -> Result<f64, String> {
    match spec.unit {
        "N m" => Ok(scale.torque_n_m),
        "rad/s" => Ok(scale.shaft_speed_rad_s),
        "N" => Ok(scale.thrust_n),
        "m/s" => Ok(scale.flow_m_s),
        "A" => Ok(scale.current_a),
        "V" => Ok(scale.supply_v),
        other => Err(format!(
            "`{id}.{}` in [{other}] cannot be given as a share of the rig's largest\nhint: give it under values",
            spec.name
        )),
    }
}

/// The plant that parameters and the scenario's effects make.
pub fn plant(prepared: &Prepared, truth: &Parameters, dt: f64) -> Plant {
    let effects: Vec<(&Descriptor, &[f64])> =
        prepared.effects.iter().map(|(d, v)| (*d, v.as_slice())).collect();
    Plant::new(prepared.scenario.model, prepared.rig, truth, &effects, dt).with_encoder_quantised(true)
}

/// The same plant under other parameters, going on from where it is.
pub fn changed(prepared: &Prepared, truth: &Parameters, before: &Plant, dt: f64) -> Plant {
    let (at, sensed) = (*before.truth(), before.sensed());
    let mut plant = plant(prepared, truth, dt);
    plant.start(at.time_s, at.shaft_speed_rad_s, at.axial_m_s, sensed.current_a, at.shaft_angle_rad);
    plant
}
