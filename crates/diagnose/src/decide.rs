//! What the posterior comes to: names, rivals, verdict. One pure function; words come later and decide nothing.

use kort_identify::thin::Thin;

use crate::flexible::is_term;
use crate::posterior::{Beside, NEAR, Posterior};
use crate::report::Verdict;
use crate::search::Set;

/// A name that stands in the report, with those that this recording cannot part from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// The effect.
    pub effect: &'static str,
    /// Probability that it is present.
    pub probability: f64,
    /// Effects that would do as well in its place.
    pub rivals: Vec<&'static str>,
    /// Whether the data speak for it enough, and for none in its place.
    pub believed: bool,
}

/// What was decided.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// The outcome.
    pub verdict: Verdict,
    /// Names, members of the told set each followed by its rivals.
    pub named: Vec<Named>,
    /// The nameless term that the told set holds, if any.
    pub term: Option<&'static str>,
}

impl Decision {
    /// Whether a name is in doubt beside others that are believed: what it takes may be something else's.
    pub fn doubts(&self, effect: &str) -> bool {
        self.verdict == Verdict::PartlyExplained
            && self.named.iter().any(|n| n.effect == effect && !n.believed)
    }
}

/// From this probability on a name is believed.
pub const BELIEVED: f64 = 0.7;
/// No name that only undoes another is likelier than this: what is left of both may be neither.
const EVEN: f64 = 0.5;
/// A remainder below this share of what was to be explained is of no practical size.
const PRACTICAL: f64 = 0.1;

/// What is known before deciding.
#[derive(Clone, Debug, Default)]
pub struct Circumstances {
    /// Members of the told set that do less than our equations may err by: nothing to state.
    pub negligible: Vec<&'static str>,
    /// Why the recordings have too little in them, if so.
    pub thin: Option<Thin>,
    /// Members of the told set with what the data alone do not part from them.
    pub unparted: Vec<(&'static str, &'static str)>,
    /// Members of the told set that do the same all the time: of one operating point they tell one number.
    pub steady: Vec<&'static str>,
    /// Members of the told set that mostly undo each other.
    pub cancelling: Vec<(&'static str, &'static str)>,
    /// The simulation breaks down on the stated rig.
    pub broke_down: bool,
    /// Share of the squared error above the noise that the told set's names leave.
    pub left: f64,
    /// Whether the told set leaves more than noise of such sensors can be.
    pub more_than_noise: bool,
}

impl Circumstances {
    /// What names are stated less likely for.
    pub const fn beside(&self) -> Beside {
        if self.more_than_noise { Beside::Everything } else { Beside::Terms }
    }
}

/// Decides from the posterior over sets.
pub fn decide(posterior: &Posterior, circumstances: &Circumstances) -> Decision {
    let empty: Set = Vec::new();
    let best = posterior.told().map_or(&empty, |e| e.set());
    let term = best.iter().copied().find(|id| is_term(id));
    let stands = |id: &&'static str| !is_term(id) && !circumstances.negligible.contains(id);
    let members: Vec<&'static str> = best.iter().copied().filter(stands).collect();
    let undone = |effect: &str| circumstances.cancelling.iter().any(|(a, b)| *a == effect || *b == effect);
    let in_place = posterior.in_place(circumstances.beside());
    let in_catalogue = posterior.in_place(Beside::Nothing);
    let stated = |effect: &str| {
        let most = if undone(effect) { EVEN } else { 1.0 };
        in_place.probability(effect).min(most)
    };
    let mut named: Vec<Named> = Vec::new();
    for member in &members {
        let taken = |id: &&'static str| named.iter().any(|n| n.effect == *id);
        let rivals: Vec<&'static str> = rivals(posterior, best, member, &circumstances.unparted)
            .into_iter()
            .filter(|id| !taken(id))
            .collect();
        let place: Vec<&'static str> = std::iter::once(*member).chain(rivals).collect();
        for effect in &place {
            let rivals: Vec<&'static str> = place.iter().copied().filter(|id| id != effect).collect();
            let believed =
                in_catalogue.probability(effect) >= BELIEVED && rivals.is_empty() && !undone(effect);
            named.push(Named { effect, probability: stated(effect), rivals, believed });
        }
    }
    // Names that cannot be parted are an answer where it is likelier one of them than none.
    let in_doubt = |n: &Named| {
        let of_place =
            named.iter().filter(|other| other.effect == n.effect || n.rivals.contains(&other.effect));
        !n.rivals.is_empty() && of_place.map(|n| n.probability).sum::<f64>() >= 0.5
    };
    let changes = |n: &Named| !circumstances.steady.contains(&n.effect);
    let verdict = if circumstances.broke_down
        || circumstances.thin.as_ref().is_some_and(|thin| thin.still)
        // Steady data cannot part physics from parameters; that something changed in mid-run they show, and which
        // physics it could be.
        || circumstances.thin.is_some()
            && term.is_none()
            && !named.iter().any(|n| n.believed && changes(n) || !n.rivals.is_empty())
    {
        Verdict::InsufficientData
    } else if named.is_empty() {
        if term.is_some() || circumstances.more_than_noise {
            Verdict::Unexplained
        } else {
            Verdict::NoMismatch
        }
    } else if named.iter().any(in_doubt) {
        Verdict::Ambiguous
    } else if !named.iter().all(|n| n.believed) {
        if named.iter().any(|n| n.believed) { Verdict::PartlyExplained } else { Verdict::Unexplained }
    } else if term.is_some() && circumstances.left > PRACTICAL || circumstances.more_than_noise {
        Verdict::PartlyExplained
    } else {
        Verdict::Explained
    };
    if verdict == Verdict::InsufficientData {
        return Decision { verdict, named: Vec::new(), term: None };
    }
    Decision { verdict, named, term }
}

/// Effects that stand in a member's place, alone or two together, in sets that are else the same and likely enough
/// to be stated, or as good by the data alone.
fn rivals(
    posterior: &Posterior,
    best: &Set,
    member: &str,
    unparted: &[(&'static str, &'static str)],
) -> Vec<&'static str> {
    let rest: Vec<&str> = best.iter().copied().filter(|id| *id != member).collect();
    let likely = posterior.told().map_or(0.0, |e| e.probability);
    // What stands beside a name as often as in its place is no rival for that.
    let instead = |new: &str, of: &str| -> f64 {
        let sets = posterior.sets.iter().filter(|e| e.set().contains(&new) && !e.set().contains(&of));
        sets.map(|e| e.probability).sum()
    };
    let mut out = Vec::new();
    for other in &posterior.sets {
        let new: Vec<&'static str> = other.set().iter().copied().filter(|id| !best.contains(id)).collect();
        let near = match new[..] {
            [new] => {
                instead(new, member) >= NEAR * posterior.presence(member)
                    || unparted.iter().any(|(of, rival)| *of == member && *rival == new)
            }
            [_, _] => other.probability >= NEAR * likely,
            _ => false,
        };
        if near
            && other.set().len() == rest.len() + new.len()
            && rest.iter().all(|id| other.set().contains(id))
            && !new.iter().any(|id| is_term(id))
        {
            new.into_iter().for_each(|id| {
                if !out.contains(&id) {
                    out.push(id);
                }
            });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::{Constants, PosteriorConstants};
    use crate::posterior::Fitted;

    fn decided(costs: &[(&[&'static str], f64)], circumstances: &Circumstances) -> Decision {
        let of = |(set, cost): &(&[&'static str], f64)| Fitted {
            set: set.to_vec(),
            alone: *cost,
            cost: *cost,
            unfinished: false,
        };
        let constants =
            PosteriorConstants { surprise: 5.0, beside_unknown: 0.75, ..Constants::built_in().posterior };
        let fitted = costs.iter().map(of).collect();
        decide(&Posterior::new(fitted, 3.0, &constants), circumstances)
    }

    #[test]
    fn verdicts_follow_from_the_posterior() {
        let usual = Circumstances::default();
        let left = Circumstances { left: 0.4, ..usual.clone() };
        let thin = Circumstances {
            thin: Some(Thin { why: String::new(), still: false, of_the_log: false }),
            ..usual.clone()
        };
        let still = Circumstances {
            thin: Some(Thin { why: String::new(), still: true, of_the_log: false }),
            ..usual.clone()
        };
        let much = Circumstances { more_than_noise: true, ..usual.clone() };
        let one_point = Circumstances { steady: vec!["windage_drag"], ..thin.clone() };
        let broke_down = Circumstances { broke_down: true, ..usual.clone() };
        let tiny = Circumstances { negligible: vec!["windage_drag"], ..usual.clone() };
        let (usual, left, thin, still, much) = (&usual, &left, &thin, &still, &much);
        let (one_point, broke_down, tiny) = (&one_point, &broke_down, &tiny);
        type Case<'a> = (&'a [(&'a [&'static str], f64)], &'a Circumstances, Verdict);
        let table: &[Case] = &[
            (&[(&[], 0.0), (&["windage_drag"], 12.0)], usual, Verdict::NoMismatch),
            (&[(&["windage_drag"], 0.0), (&[], 80.0)], usual, Verdict::Explained),
            (&[(&["windage_drag"], 0.0), (&["duct_loss"], 2.0), (&[], 80.0)], usual, Verdict::Ambiguous),
            // That it is neither is likelier than both together.
            (&[(&["windage_drag"], 0.0), (&["duct_loss"], 0.5), (&[], 3.0)], usual, Verdict::Unexplained),
            (&[(&["unknown_shaft_step"], 0.0), (&["windage_drag"], 90.0)], usual, Verdict::Unexplained),
            (
                &[(&["unknown_shaft_step"], 0.0), (&[], 0.5), (&["windage_drag"], 0.5)],
                usual,
                Verdict::NoMismatch,
            ),
            (
                &[(&["unknown_shaft_step"], 0.0), (&[], 0.5), (&["windage_drag"], 0.5)],
                much,
                Verdict::Unexplained,
            ),
            (&[(&["unknown_shaft_step", "windage_drag"], 0.0), (&[], 80.0)], left, Verdict::PartlyExplained),
            (&[(&["unknown_shaft_step", "windage_drag"], 0.0), (&[], 80.0)], usual, Verdict::Explained),
            (
                &[(&["unknown_shaft_step", "windage_drag"], 0.0), (&["unknown_shaft_step"], 1.0)],
                left,
                Verdict::Unexplained,
            ),
            (&[(&[], 0.0), (&["windage_drag"], 12.0)], much, Verdict::Unexplained),
            (&[(&["windage_drag"], 0.0), (&[], 80.0)], much, Verdict::PartlyExplained),
            (&[(&["windage_drag"], 0.0), (&[], 80.0)], tiny, Verdict::NoMismatch),
            (&[(&["duct_loss", "windage_drag"], 0.0), (&[], 80.0)], tiny, Verdict::Explained),
            (&[(&[], 0.0)], thin, Verdict::InsufficientData),
            (&[(&["windage_drag"], 0.0), (&[], 80.0)], thin, Verdict::Explained),
            (&[(&["windage_drag"], 0.0), (&[], 80.0)], one_point, Verdict::InsufficientData),
            (&[(&["windage_drag"], 0.0), (&[], 80.0)], still, Verdict::InsufficientData),
            (&[(&["unknown_shaft_step"], 0.0), (&[], 90.0)], still, Verdict::InsufficientData),
            (&[(&["windage_drag"], 0.0), (&["duct_loss"], 2.0), (&[], 80.0)], one_point, Verdict::Ambiguous),
            (&[], broke_down, Verdict::InsufficientData),
        ];
        for (costs, circumstances, verdict) in table {
            assert_eq!(decided(costs, circumstances).verdict, *verdict, "{costs:?}");
        }
    }

    #[test]
    fn beside_more_than_noise_a_name_is_stated_lower_and_still_believed() {
        let costs: &[(&[&'static str], f64)] = &[(&["windage_drag"], 0.0), (&[], 80.0)];
        let usual = Circumstances::default();
        let much = Circumstances { more_than_noise: true, ..usual.clone() };
        let (alone, beside) = (decided(costs, &usual), decided(costs, &much));
        assert!((beside.named[0].probability - 0.75 * alone.named[0].probability).abs() < 1e-12);
        // The factor is not counted again where a nameless term stands in the set already.
        let with_term: &[(&[&'static str], f64)] =
            &[(&["unknown_shaft_step", "windage_drag"], 0.0), (&[], 80.0)];
        let (once, twice) = (decided(with_term, &usual), decided(with_term, &much));
        assert!((once.named[0].probability - twice.named[0].probability).abs() < 1e-12);
        assert_eq!(beside.verdict, Verdict::PartlyExplained);
    }

    #[test]
    fn names_that_only_undo_each_other_are_never_sure() {
        let costs: &[(&[&'static str], f64)] = &[
            (&["command_curve", "command_dead_band"], 0.0),
            (&["command_curve"], 300.0),
            (&["command_dead_band"], 400.0),
            (&[], 500.0),
        ];
        let usual = Circumstances::default();
        let undone =
            Circumstances { cancelling: vec![("command_curve", "command_dead_band")], ..usual.clone() };
        assert_eq!(decided(costs, &usual).verdict, Verdict::Explained);
        let decision = decided(costs, &undone);
        assert_eq!(decision.verdict, Verdict::Unexplained);
        assert!(decision.named.iter().all(|n| n.probability <= 0.5 && !n.believed), "{:?}", decision.named);
    }

    #[test]
    fn what_only_a_common_effect_s_odds_part_is_not_told_apart() {
        let costs: &[(&[&'static str], f64)] =
            &[(&["thrust_sensor_lag"], 0.0), (&["clock_skew"], 11.0), (&[], 90.0)];
        let usual = Circumstances::default();
        assert_eq!(decided(costs, &usual).verdict, Verdict::Explained, "odds of six to one");
        let unparted = vec![("thrust_sensor_lag", "clock_skew")];
        let decision = decided(costs, &Circumstances { unparted, ..usual });
        assert_eq!(decision.verdict, Verdict::Ambiguous);
        assert_eq!(decision.named[0].rivals, ["clock_skew"]);
        assert!(decision.named[0].probability > 0.8, "and how likely each is, is said as before");
    }

    #[test]
    fn two_effects_in_the_place_of_one_are_its_rivals() {
        let usual = Circumstances::default();
        let with = |cost: f64| {
            let pair: &[&'static str] = &["coulomb_friction", "torque_channel_bias"];
            decided(&[(&["direction_dependent_friction"], 0.0), (pair, cost), (&[], 90.0)], &usual)
        };
        let (near, far) = (with(6.0), with(30.0));
        assert_eq!(near.verdict, Verdict::Ambiguous);
        assert_eq!(near.named[0].rivals, ["coulomb_friction", "torque_channel_bias"]);
        assert_eq!(far.verdict, Verdict::Explained);
        assert_eq!(far.named.len(), 1);
    }

    #[test]
    fn what_stands_beside_a_name_is_no_rival_of_it() {
        let costs: &[(&[&'static str], f64)] = &[
            (&["windage_drag"], 0.0),
            (&["duct_loss", "windage_drag"], 1.0),
            (&["duct_loss"], 30.0),
            (&[], 90.0),
        ];
        let decision = decided(costs, &Circumstances::default());
        assert_eq!(decision.named.len(), 1, "{:?}", decision.named);
        assert!(decision.named[0].believed);
    }

    #[test]
    fn a_rival_stands_behind_its_place_and_each_names_the_other() {
        let decision = decided(
            &[
                (&["duct_loss", "windage_drag"], 0.0),
                (&["duct_loss", "coulomb_friction"], 1.0),
                (&["duct_loss"], 70.0),
                (&[], 140.0),
            ],
            &Circumstances::default(),
        );
        let names: Vec<&str> = decision.named.iter().map(|n| n.effect).collect();
        assert_eq!(names, ["duct_loss", "windage_drag", "coulomb_friction"]);
        assert!(decision.named[0].rivals.is_empty() && decision.named[0].probability > 0.9);
        assert_eq!(decision.named[1].rivals, ["coulomb_friction"]);
        assert_eq!(decision.named[2].rivals, ["windage_drag"]);
    }
}
