//! What the places of a search come to: who stands beside others, who is in doubt, and the verdict.

use kort_thruster::effects::{Descriptor, Path};

use crate::judge::{Outcome, Place, mates};
use crate::library::is_term;
use crate::report::{Finding, Verdict};
use crate::rules;
use crate::search::Search;
use crate::words;

/// Share of the held-out error above the noise that a find must remove beside others.
pub(crate) fn least_beside_others(search: &Search, place: &Place, gains: &[(&Descriptor, f64)]) -> f64 {
    // What is free in time follows a relative with a form of its own, and overshadows none.
    let overshadows = |other: &(&Descriptor, f64)| {
        mates(place.chosen, other.0)
            && other.1 > rules::RELATIVE_GAIN * place.gain
            && !search.free_in_time(other.0)
    };
    if gains.len() == 1 {
        f64::NEG_INFINITY
    } else if gains.iter().all(|other| other.1 <= place.gain) {
        rules::LEAST_OF_A_FINDING
    } else if search.free_in_time(place.chosen) || gains.iter().any(overshadows) {
        rules::LEAST_OF_A_RELATIVE
    } else {
        rules::LEAST_OF_A_LATER_FINDING
    }
}

/// Whether both are losses at the blade that are known to be confused.
pub(crate) fn kin(a: &Descriptor, b: &Descriptor) -> bool {
    a.path == Path::Blade && b.path == Path::Blade && mates(a, b)
}

/// Places that both hold losses at the blade which are known to be confused.
pub(crate) fn kin_of(places: &[Place]) -> impl Iterator<Item = (&Place, &Place)> {
    let pairs = places.iter().enumerate().flat_map(|(i, a)| places[i + 1..].iter().map(move |b| (a, b)));
    pairs.filter(|(a, b)| kin(a.chosen, b.chosen))
}

/// Two losses at the blade that are known to be confused part only by how they set in, and the onset of a
/// real one has another form than either of ours: what looks like both may be one of them.
pub(crate) fn doubt_kin(places: &[Place], findings: &mut [(f64, Finding)]) {
    for (a, b) in kin_of(places) {
        for (one, other) in [(a, b), (b, a)] {
            for (_, finding) in findings.iter_mut().filter(|f| f.1.effect == one.chosen.id) {
                finding.probability *= one.gain / (one.gain + other.gain);
                finding.confounded_with.push(other.chosen.id.into());
                finding.evidence.push(words::kin(one.chosen, other.chosen));
            }
        }
    }
}

/// `total_gain` is that of all that was fitted, also of names set aside since.
pub(crate) fn verdict(outcome: &Outcome, findings: &[Finding], total_gain: f64, thin: bool) -> Verdict {
    let removed = findings.iter().map(|f| f.heldout.excess_error_removed).fold(0.0, f64::max);
    let named: f64 = outcome.places.iter().filter(|p| !is_term(p.chosen)).map(|p| p.gain).sum();
    if outcome.places.is_empty() && outcome.excess.is_some() && !thin {
        Verdict::Unexplained
    } else if outcome.places.is_empty() {
        if thin { Verdict::InsufficientData } else { Verdict::NoMismatch }
    } else if total_gain - named > rules::UNNAMED_SHARE * total_gain
        || outcome.excess.is_some() && removed < rules::LEAST_REMOVED
    {
        Verdict::Unexplained
    } else if findings.iter().any(|f| !f.confounded_with.is_empty()) {
        Verdict::Ambiguous
    } else {
        Verdict::Explained
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::HeldOut;
    use kort_thruster::effects;

    fn place(id: &str, gain: f64) -> Place {
        Place { chosen: effects::find(id).unwrap(), rivals: Vec::new(), aside: Vec::new(), gain }
    }

    fn finding(place: &Place) -> (f64, Finding) {
        let heldout =
            HeldOut { channels: Default::default(), excess_error_removed: 0.9, interval_95: [0.8, 1.0] };
        let found = Finding {
            effect: place.chosen.id.into(),
            path: place.chosen.path.name().into(),
            probability: 0.9,
            statement: String::new(),
            equation: String::new(),
            parameters: Vec::new(),
            heldout,
            confounded_with: Vec::new(),
            evidence: Vec::new(),
        };
        (place.gain, found)
    }

    fn doubted(ids: [&str; 2]) -> Vec<Finding> {
        let places = [place(ids[0], 3000.0), place(ids[1], 1000.0)];
        let mut findings: Vec<(f64, Finding)> = places.iter().map(finding).collect();
        doubt_kin(&places, &mut findings);
        findings.into_iter().map(|f| f.1).collect()
    }

    #[test]
    fn two_losses_at_the_blade_that_are_confused_are_in_doubt_by_what_they_gain() {
        let found = doubted(["cavitation", "ventilation"]);
        assert_eq!(found[0].confounded_with, ["ventilation"]);
        assert_eq!(found[1].confounded_with, ["cavitation"]);
        assert!((found[0].probability - 0.675).abs() < 1e-12, "{}", found[0].probability);
        assert!((found[1].probability - 0.225).abs() < 1e-12, "{}", found[1].probability);
    }

    #[test]
    fn frictions_that_stand_together_are_not() {
        let found = doubted(["coulomb_friction", "viscous_friction"]);
        assert!(found.iter().all(|f| f.confounded_with.is_empty() && f.probability == 0.9));
    }
}
