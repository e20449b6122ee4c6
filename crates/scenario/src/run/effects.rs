//! The effects at work in a simulation, by name, with a value for every parameter.

use std::collections::BTreeMap;

use kort_thruster::effects::{self, Descriptor, Scale};
use kort_thruster::place::near;

use crate::{Scenario, ScenarioError};

/// An effect of the catalogue and its parameters' values in order.
pub type Used = (&'static Descriptor, Vec<f64>);

/// All effects of a scenario, or all that is wrong with them.
pub(crate) fn used(scenario: &Scenario, scale: &Scale) -> Result<Vec<Used>, Vec<ScenarioError>> {
    let (mut all, mut wrong) = (Vec::new(), Vec::new());
    for (i, wanted) in scenario.effects.iter().enumerate() {
        let (named, given) = (format!("effects[{i}].effect"), format!("effects[{i}].parameters"));
        match used_effect((&named, &wanted.effect), (&given, &wanted.parameters), scale) {
            Ok(used) => all.push(used),
            Err(errors) => wrong.extend(errors),
        }
    }
    if wrong.is_empty() { Ok(all) } else { Err(wrong) }
}

/// One effect: its identifier, and its values by parameter, each behind the key at which they stand.
///
/// # Errors
/// Each [`ScenarioError`] names the key of an effect or a parameter that there is not, of a value out of range, or of one
/// that is missing; one that is told as misspelt is not missing too.
pub fn used_effect(
    (named, id): (&str, &str),
    (given, values): (&str, &BTreeMap<String, f64>),
    scale: &Scale,
) -> Result<Used, Vec<ScenarioError>> {
    let Some(descriptor) = effects::find(id) else {
        let ids: Vec<&str> = effects::ALL.iter().map(|d| d.id).collect();
        let (key, found) = (named.into(), format!("\"{id}\""));
        return Err(vec![ScenarioError::Unknown { key, found, hint: nearest(id, &ids) }]);
    };
    let specs = (descriptor.parameters)(scale);
    let names: Vec<&str> = specs.iter().map(|s| s.name).collect();
    let unknown: Vec<&String> = values.keys().filter(|name| !names.contains(&name.as_str())).collect();
    let mut wrong: Vec<ScenarioError> = unknown
        .iter()
        .map(|name| {
            let (key, found) = (given.into(), format!("\"{name}\""));
            ScenarioError::Unknown { key, found, hint: nearest(name, &names) }
        })
        .collect();
    let (mut used, mut missing) = (Vec::with_capacity(specs.len()), Vec::new());
    for spec in &specs {
        let key = format!("{given}.{}", spec.name);
        let unit = if spec.unit == "1" { String::new() } else { format!(" {}", spec.unit) };
        let range = format!("{} to {}{unit}", spec.low, spec.high);
        let meant = |name: &&String| near(name, [spec.name]).is_some();
        match values.get(spec.name) {
            None if unknown.iter().any(meant) => {}
            None => missing.push((key, format!("{range}, for example {}", spec.start), spec.name)),
            Some(v) if *v >= spec.low && *v <= spec.high => used.push(*v),
            Some(v) => wrong.push(ScenarioError::Value { key, found: v.to_string(), allowed: range }),
        }
    }
    // Those of one effect at once, as of a rig's.
    let hint = match missing.as_slice() {
        [] => None,
        [(_, hint, _)] => Some(hint.clone()),
        several => Some(
            several.iter().map(|(_, hint, name)| format!("{name}: {hint}")).collect::<Vec<_>>().join("; "),
        ),
    };
    if let Some(hint) = hint {
        let keys: Vec<_> = missing.into_iter().map(|(key, ..)| key).collect();
        wrong.push(ScenarioError::Missing { key: keys.join("`, `"), hint });
    }
    if wrong.is_empty() { Ok((descriptor, used)) } else { Err(wrong) }
}

/// The name that was meant, perhaps, and all there are.
fn nearest(wanted: &str, names: &[&str]) -> String {
    let known = format!("known are {}", names.join(", "));
    match near(wanted, names.iter().copied()) {
        Some(near) => format!("did you mean `{near}`? {known}"),
        None if names.is_empty() => "it has none".to_owned(),
        None => known,
    }
}
