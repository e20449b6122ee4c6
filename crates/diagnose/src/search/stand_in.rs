//! What together does the same as one member.

use kort_identify::hypothesis::Member;
use kort_thruster::effects::{Descriptor, Scale};

use super::{Search, Set, with, without};

impl Search<'_, '_> {
    /// Fits what does the same as a member in its place: the data part them no further than their prior odds. The
    /// best set.
    pub(super) fn stand_in(&mut self, set: &Set) -> Set {
        let mut tried = Vec::new();
        for member in set {
            for same in self.descriptor(member).map_or(&[][..], |effect| effect.same_as) {
                let offered: Vec<_> = self.effects.iter().copied().filter(|e| same.contains(&e.id)).collect();
                if offered.len() < same.len() || same.iter().any(|id| set.contains(id)) {
                    continue;
                }
                tried.push(self.stand_together(set, member, &offered));
            }
        }
        self.better(set.clone(), tried)
    }

    /// Fits these in a member's place: one after the other, and all at once from its sizes, all else where the set's fit
    /// has it. A shaft that sticks has places to get lost in on the way.
    fn stand_together(&mut self, set: &Set, member: &str, offered: &[&'static Descriptor]) -> Set {
        let scale = self.problem.scale;
        let mut place = without(set, member);
        self.ensure(&place, set);
        for effect in offered {
            let Some(parent) = self.fits.get(&place).cloned() else { break };
            let hypothesis = parent.hypothesis.with(&parent.values, Member::new(effect, &scale), &scale);
            place = with(&place, effect.id);
            self.fit_set(place.clone(), &hypothesis, &parent.columns);
        }
        let together = offered.iter().fold(without(set, member), |place, effect| with(&place, effect.id));
        if let Some(from) = self.fits.get(set) {
            let mut members = self.problem.members(&from.hypothesis, &from.values);
            if let Some(at) = members.iter().position(|m| m.effect.id == member) {
                let old = members.remove(at);
                members.extend(offered.iter().map(|effect| taking_over(effect, &old, &scale)));
                let (hypothesis, columns) = self.problem.recompose(from, &members);
                self.fit_set(together.clone(), &hypothesis, &columns);
            }
        }
        self.reshape(&together);
        together
    }
}

/// An effect that begins with the sizes of another on the same path: each with the mean of those of its unit.
pub(super) fn taking_over(effect: &'static Descriptor, old: &Member, scale: &Scale) -> Member {
    let mut new = Member::new(effect, scale);
    if effect.path != old.effect.path {
        return new;
    }
    let was = (old.effect.parameters)(scale);
    for (value, spec) in new.values.iter_mut().zip((effect.parameters)(scale)) {
        let alike = was.iter().zip(&old.values).filter(|(w, _)| w.unit == spec.unit && !w.shape && !w.held);
        let alike: Vec<f64> = alike.map(|(_, value)| *value).collect();
        if !alike.is_empty() && !spec.shape && !spec.held {
            *value = (alike.iter().sum::<f64>() / alike.len() as f64).clamp(spec.low, spec.high);
        }
    }
    new
}

#[cfg(test)]
mod tests {
    use kort_identify::hypothesis::Member;
    use kort_thruster::effects::{Scale, find};

    use super::taking_over;

    #[test]
    fn sizes_of_one_unit_are_taken_over_by_their_mean_and_those_of_another_path_are_not() {
        let effect = |id: &str| find(id).unwrap();
        let mut old = Member::new(effect("direction_dependent_friction"), &Scale::ANY);
        let specs = (old.effect.parameters)(&Scale::ANY);
        for (value, spec) in old.values.iter_mut().zip(&specs) {
            *value = match spec.name {
                "dry_ahead_n_m" => 0.2 * spec.high,
                "dry_astern_n_m" => 0.1 * spec.high,
                _ => *value,
            };
        }
        let dry = specs.iter().find(|s| s.name == "dry_ahead_n_m").unwrap().high;
        let coulomb = taking_over(effect("coulomb_friction"), &old, &Scale::ANY);
        assert!((coulomb.values[0] - 0.15 * dry).abs() < 1e-9 * dry, "{:?}", coulomb.values);
        let bias = taking_over(effect("torque_channel_bias"), &old, &Scale::ANY);
        assert_eq!(bias.values, Member::new(effect("torque_channel_bias"), &Scale::ANY).values);
    }
}
