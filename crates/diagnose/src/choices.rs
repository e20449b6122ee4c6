//! Names that a recording cannot tell apart, in words: one choice for each place, and what stands there only together
//! said together.

use std::collections::BTreeSet;

use kort_thruster::effects;

use crate::words::plain;

/// Each place's choice, from the names found with those that each is confused with: `a or b with c`.
pub fn choices(found: &[(&str, &[String])]) -> Vec<String> {
    let mut places: Vec<BTreeSet<&str>> = Vec::new();
    for (effect, others) in found {
        let place = others.iter().map(String::as_str).chain([*effect]).collect();
        if !places.contains(&place) {
            places.push(place);
        }
    }
    let names = |place: &BTreeSet<&str>| -> Vec<&str> {
        found.iter().map(|(effect, _)| *effect).filter(|effect| place.contains(effect)).collect()
    };
    places.iter().map(|place| choice(&names(place))).collect()
}

fn choice(names: &[&str]) -> String {
    let of = |name: &&str| effects::find(name).map_or(&[][..], |effect| effect.same_as);
    let whole = |same: &&&[&str]| same.iter().all(|id| names.contains(id));
    let together: Vec<&[&str]> = names.iter().flat_map(of).filter(whole).copied().collect();
    let alone = names.iter().filter(|name| !together.iter().any(|same| same.contains(name)));
    let alone = alone.map(|name| plain(name));
    let joined =
        together.iter().map(|same| same.iter().map(|id| plain(id)).collect::<Vec<_>>().join(" with "));
    alone.chain(joined).collect::<Vec<_>>().join(" or ")
}

#[cfg(test)]
mod tests {
    use super::choices;

    fn said(found: &[(&str, &[&str])]) -> Vec<String> {
        let owned: Vec<(&str, Vec<String>)> =
            found.iter().map(|(e, others)| (*e, others.iter().map(|o| (*o).to_owned()).collect())).collect();
        choices(&owned.iter().map(|(e, others)| (*e, others.as_slice())).collect::<Vec<_>>())
    }

    #[test]
    fn what_does_the_same_only_together_is_said_together() {
        let of = [
            ("direction_dependent_friction", &["coulomb_friction", "torque_channel_bias"][..]),
            ("coulomb_friction", &["direction_dependent_friction", "torque_channel_bias"]),
            ("torque_channel_bias", &["direction_dependent_friction", "coulomb_friction"]),
        ];
        assert_eq!(said(&of), ["direction dependent friction or coulomb friction with torque channel bias"]);
        assert_eq!(
            said(&[
                ("coulomb_friction", &["command_dead_band"]),
                ("command_dead_band", &["coulomb_friction"])
            ]),
            ["coulomb friction or command dead band"]
        );
    }

    #[test]
    fn every_place_is_a_choice_of_its_own() {
        let of = [
            ("coulomb_friction", &["command_dead_band"][..]),
            ("transport_delay", &["amplifier_lag"]),
            ("command_dead_band", &["coulomb_friction"]),
            ("amplifier_lag", &["transport_delay"]),
        ];
        assert_eq!(said(&of), ["coulomb friction or command dead band", "transport delay or amplifier lag"]);
    }
}
