//! Physics that a rig is known to have (`[[effects]]`): effects of the catalogue with their sizes.

use serde::Serialize;

use super::keys::{near, nearest, value_error};
use super::read::quantity;
use super::{Quantity, Rig, RigError};
use crate::effects::{self, Descriptor, Scale, Spec};

/// Most effects a rig may state, so that their states find room in a plant beside those that a fit tries.
const MOST: usize = 8;

/// One effect that is known to be there.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KnownEffect {
    /// Its identifier in the catalogue.
    pub effect: &'static str,
    /// All its values, in the order of its parameters.
    pub parameters: Vec<(&'static str, Quantity)>,
}

impl KnownEffect {
    /// Its entry in the catalogue.
    pub fn descriptor(&self) -> Option<&'static Descriptor> {
        effects::find(self.effect)
    }

    /// Its stated values, in the order of its parameters.
    pub fn values(&self) -> impl Iterator<Item = f64> + '_ {
        self.parameters.iter().map(|(_, quantity)| quantity.value)
    }

    /// Why it does nothing, where every strength is stated as zero.
    pub fn idle(&self) -> Option<&'static str> {
        let specs = self.descriptor().map_or_else(Vec::new, |effect| (effect.parameters)(&Scale::ANY));
        let mut strengths = specs.iter().zip(self.values()).filter(|(spec, _)| !spec.shape).peekable();
        let idle = strengths.peek().is_some() && strengths.all(|(_, value)| value == 0.0);
        idle.then_some("its size is zero: as the rig states it, it does nothing")
    }

    /// A value by its name; zero if it has none of that name.
    pub fn value(&self, name: &str) -> f64 {
        self.parameters.iter().find(|(n, _)| *n == name).map_or(0.0, |(_, quantity)| quantity.value)
    }
}

impl Rig {
    /// The same rig, with some of the effects that it is known to have stated as exact.
    pub fn exact_in(mut self, effects: &[&str]) -> Self {
        let some = self.effects.iter_mut().filter(|known| effects.contains(&known.effect));
        some.flat_map(|known| &mut known.parameters).for_each(|(_, quantity)| quantity.tol = None);
        self
    }
}

/// The list `[[effects]]`; empty without one.
///
/// A strength that is not stated is zero. A shape that is not stated stays at its usual value where what is
/// stated makes sense without it (a form of the effect), and is missing otherwise.
pub(super) fn read(table: &toml::Table, wrong: &mut Vec<RigError>) -> Vec<KnownEffect> {
    let mut known = Vec::<KnownEffect>::new();
    let Some(list) = table.get("effects") else { return known };
    let form = "a list: [[effects]] before each";
    let hint = "write [[effects]], below it effect = \"coulomb_friction\" and its parameters";
    let Some(list) = list.as_array() else {
        wrong.push(value_error("effects", "a table or a value", form, hint));
        return known;
    };
    if list.len() > MOST {
        wrong.push(value_error("effects", list.len(), "at most 8 effects", "keep those that matter most"));
    }
    for (k, entry) in list.iter().enumerate() {
        let at = format!("effects[{k}]");
        let Some(entry) = entry.as_table() else {
            wrong.push(value_error(&at, entry, form, hint));
            continue;
        };
        let Some(one) = read_one(&at, entry, wrong) else { continue };
        if known.iter().any(|other| other.effect == one.effect) {
            let key = format!("{at}.effect");
            wrong.push(value_error(&key, one.effect, "each effect once", "put the values in one entry"));
        }
        known.push(one);
    }
    known
}

/// One of the list; none where it is not known which effect it is.
fn read_one(at: &str, entry: &toml::Table, wrong: &mut Vec<RigError>) -> Option<KnownEffect> {
    let descriptor = named(at, entry).map_err(|error| wrong.push(error)).ok()?;
    let specs = (descriptor.parameters)(&Scale::ANY);
    let names = specs.iter().map(|s| s.name);
    // What misspelt keys were meant to be is not missing besides.
    let mut meant = Vec::new();
    for odd in entry.keys().filter(|k| *k != "effect" && specs.iter().all(|s| s.name != k.as_str())) {
        meant.extend(near(odd, names.clone()));
        wrong.push(RigError::UnknownKey { key: format!("{at}.{odd}"), hint: nearest(odd, names.clone()) });
    }
    let stated: Vec<usize> = (0..specs.len()).filter(|k| entry.contains_key(specs[*k].name)).collect();
    let (mut parameters, mut missing) = (Vec::new(), Vec::new());
    for (k, spec) in specs.iter().enumerate() {
        let value = match entry.get(spec.name) {
            Some(found) => {
                let key = format!("{at}.{}", spec.name);
                let value = quantity(&key, found, wrong);
                let value = value.and_then(|value| in_range(&key, value, spec, wrong));
                // Never seen: a rig with which something is wrong is none.
                value.unwrap_or(Quantity::exact(f64::NAN))
            }
            None if !spec.shape => Quantity::exact(if spec.held { spec.mean } else { 0.0 }),
            None if needed(descriptor, &specs, &stated, k) => {
                missing.push(spec);
                continue;
            }
            None => Quantity::exact(spec.mean),
        };
        parameters.push((spec.name, value));
    }
    missing.retain(|spec| !meant.contains(&spec.name));
    let strength = |k: &Spec| !k.shape && !k.held;
    let (any, stated) = (specs.iter().any(strength), stated.iter().any(|k| !specs[*k].shape));
    if !missing.is_empty() {
        let keys: Vec<_> = missing.iter().map(|s| format!("{at}.{}", s.name)).collect();
        let add: Vec<_> = missing.iter().map(|s| format!("{} = …{}", s.name, unit(s))).collect();
        wrong.push(RigError::Missing {
            key: keys.join("`, `"),
            hint: format!("add {} to the effect", add.join(", ")),
        });
    } else if any && !stated && !specs.iter().any(|s| !s.shape && meant.contains(&s.name)) {
        let names: Vec<_> = specs.iter().filter(|s| !s.shape).map(|s| s.name).collect();
        let hint = format!("the effect is nothing without one of {}", names.join(", "));
        wrong.push(RigError::Missing { key: format!("{at}.{}", names[0]), hint });
    }
    Some(KnownEffect { effect: descriptor.id, parameters })
}

/// The effect of the catalogue that an entry names.
fn named(at: &str, entry: &toml::Table) -> Result<&'static Descriptor, RigError> {
    let key = format!("{at}.effect");
    let id = match entry.get("effect") {
        Some(toml::Value::String(id)) => id,
        Some(other) => return Err(value_error(&key, other, "a text in quotes", "the effect's identifier")),
        None => {
            return Err(RigError::Missing { key, hint: "name it: effect = \"coulomb_friction\"".into() });
        }
    };
    let Some(descriptor) = effects::find(id) else {
        let hint = nearest(id, effects::ALL.iter().map(|d| d.id));
        return Err(value_error(&key, id, "an identifier of the catalogue (`kort explain`)", &hint));
    };
    if descriptor.nonparametric {
        let hint = format!("{id} changes freely with time and has no lasting sizes; leave it out");
        return Err(value_error(&key, id, "an effect with lasting sizes", &hint));
    }
    Ok(descriptor)
}

/// A parameter's unit in brackets; a number has none.
fn unit(spec: &Spec) -> String {
    if spec.unit == "1" { String::new() } else { format!(" [{}]", spec.unit) }
}

/// A value whose sign the effect allows; how large it may be depends on the rig.
fn in_range(key: &str, quantity: Quantity, spec: &Spec, wrong: &mut Vec<RigError>) -> Option<Quantity> {
    let value = quantity.value;
    let (allowed, fits) = if spec.low > 0.0 {
        ("above 0", value > 0.0)
    } else if spec.low == 0.0 {
        ("0 or above", value >= 0.0)
    } else {
        ("a finite number", true)
    };
    if fits && value.is_finite() {
        return Some(quantity);
    }
    let allowed = format!("{allowed}{}", unit(spec));
    wrong.push(value_error(key, value, &allowed, "`kort explain` tells its equation"));
    None
}

/// Whether the shape at this place must be stated, with those that are.
fn needed(effect: &Descriptor, specs: &[Spec], stated: &[usize], place: usize) -> bool {
    if specs[place].held {
        // It belongs to the strengths that follow it up to the next of its kind, or to all.
        let group = specs[place + 1..].iter().take_while(|s| !(s.held && s.shape)).count();
        return group == 0 || stated.iter().any(|k| *k > place && *k <= place + group);
    }
    let fits = |form: &Vec<usize>| stated.iter().all(|k| specs[*k].held || form.contains(k));
    let forms = effect.forms(specs);
    let fitting: Vec<_> = forms.iter().filter(|form| fits(form)).collect();
    fitting.iter().all(|form| form.contains(&place))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_that_an_effect_lacks_is_said_at_once() {
        let lacks = |effect: &Descriptor| {
            let table: toml::Table = format!("effect = \"{}\"", effect.id).parse().unwrap();
            let mut wrong = Vec::new();
            read_one("effects[0]", &table, &mut wrong);
            wrong.first().map(RigError::to_string)
        };
        let mut several = 0;
        for effect in effects::ALL {
            let specs = (effect.parameters)(&Scale::ANY);
            let needed = (0..specs.len()).filter(|k| specs[*k].shape && needed(effect, &specs, &[], *k));
            let names: Vec<_> = needed.map(|k| specs[k].name).collect();
            if names.len() < 2 || effect.nonparametric {
                continue;
            }
            several += 1;
            let said = lacks(effect).unwrap();
            assert!(names.iter().all(|name| said.contains(&format!("`effects[0].{name}`"))), "{said}");
            assert!(!said.contains("[1]"), "{said}");
        }
        assert!(several > 0, "no effect needs two shapes");
    }
}
