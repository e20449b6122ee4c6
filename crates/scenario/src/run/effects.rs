//! The effects at work in a simulation, by name, with a value for every parameter.

use std::collections::BTreeMap;

use kort_thruster::effects::{self, Descriptor, Scale, Spec};

use crate::{Scenario, ScenarioError};

/// An effect of the catalogue and its parameters' values in order.
pub type Used = (&'static Descriptor, Vec<f64>);

/// All effects of a scenario.
pub(super) fn used(scenario: &Scenario, scale: &Scale) -> Result<Vec<Used>, ScenarioError> {
    let effects = scenario.effects.iter().enumerate();
    effects
        .map(|(i, wanted)| {
            let (named, given) = (format!("effects[{i}].effect"), format!("effects[{i}].parameters"));
            used_effect((&named, &wanted.effect), (&given, &wanted.parameters), scale)
        })
        .collect()
}

/// One effect: its identifier, and its values by parameter, each behind the key at which they stand.
///
/// # Errors
/// [`ScenarioError`] names the key of an effect or a parameter that there is not, of a value out of range, and of one
/// that is missing.
pub fn used_effect(
    (named, id): (&str, &str),
    (given, values): (&str, &BTreeMap<String, f64>),
    scale: &Scale,
) -> Result<Used, ScenarioError> {
    let Some(descriptor) = effects::find(id) else {
        let ids: Vec<&str> = effects::ALL.iter().map(|d| d.id).collect();
        let (key, found) = (named.into(), format!("\"{id}\""));
        return Err(ScenarioError::Unknown { key, found, hint: nearest(id, &ids) });
    };
    let specs = (descriptor.parameters)(scale);
    if let Some(name) = values.keys().find(|name| !specs.iter().any(|s| s.name == *name)) {
        let names: Vec<&str> = specs.iter().map(|s| s.name).collect();
        let (key, found) = (given.into(), format!("\"{name}\""));
        return Err(ScenarioError::Unknown { key, found, hint: nearest(name, &names) });
    }
    let value = |spec: &Spec| {
        let key = format!("{given}.{}", spec.name);
        let range = format!("{} to {} {}", spec.low, spec.high, spec.unit);
        match values.get(spec.name) {
            None => Err(ScenarioError::Missing { key, hint: format!("{range}, for example {}", spec.start) }),
            Some(v) if *v >= spec.low && *v <= spec.high => Ok(*v),
            Some(v) => Err(ScenarioError::Value { key, found: v.to_string(), allowed: range }),
        }
    };
    Ok((descriptor, specs.iter().map(value).collect::<Result<_, _>>()?))
}

/// The name that was meant, perhaps, and all there are.
fn nearest(wanted: &str, names: &[&str]) -> String {
    let best = names
        .iter()
        .max_by(|a, b| strsim::jaro_winkler(wanted, a).total_cmp(&strsim::jaro_winkler(wanted, b)));
    best.map_or("it has none".to_string(), |n| format!("did you mean `{n}`? known are {}", names.join(", ")))
}
