//! The run that would settle what this one cannot: of the shipped test signals, the one on which
//! the rivals' fitted models differ most.

use kort_scenario::Scenario;
use kort_thruster::effects::{Descriptor, Scale};
use kort_thruster::rig::{Load, Rig};

use crate::decide::{Decision, Named};
use crate::differs::{RANDOM_LEVELS, STAIRCASE, where_they_differ};
use crate::flexible::SHAFT_OVER_ANGLE;
use crate::load_steps::LOAD_STEPS;
use crate::report::{Mismatch, NextExperiment, Remainder, Verdict};
use crate::search::{Search, Set};

/// What a recording leaves open beside its names.
#[derive(Clone, Copy)]
pub struct Open<'a> {
    /// The path on which what is left acts, where that is more than noise.
    pub path: Option<&'a str>,
    /// Why the recordings have too little in them to tell anything.
    pub thin: Option<&'a str>,
}

impl<'a> Open<'a> {
    /// What stands in a report.
    pub fn of(
        decision: &Decision,
        remainder: Option<&'a Remainder>,
        mismatch: &'a [Mismatch],
        thin: Option<&'a str>,
    ) -> Self {
        let nameless = mismatch.first().filter(|_| decision.named.is_empty()).map(|m| m.path.as_str());
        Self {
            path: remainder.map(|r| r.path.as_str()).or(nameless),
            thin: thin.filter(|_| decision.verdict == Verdict::InsufficientData),
        }
    }
}

/// The next experiment, if anything is left open: what moves enough to tell anything; what parts a name from its rivals;
/// what shows more of a term without a name; what shows whether a name in doubt is there; what shows more of what is left
/// without either.
pub fn next(
    search: &Search,
    decision: &Decision,
    best: &Set,
    rig: &Rig,
    open: Open,
) -> Option<NextExperiment> {
    let mut members = decision.named.iter().filter(|n| best.contains(&n.effect));
    let contested = members.clone().find(|n| !n.rivals.is_empty());
    let doubted = members.find(|n| !n.believed);
    let term = decision.term.and_then(|id| search.descriptor(id));
    let found = too_little(open)
        .or_else(|| from_rivals(search, best, rig, contested?))
        .or_else(|| steady_levels(of_unknown(term?, rig, STAIRCASE.1)))
        .or_else(|| from_absence(search, best, rig, doubted?))
        .or_else(|| steady_levels((STAIRCASE.1.into(), along(open.path?))));
    found.map(|mut next| {
        if let Err(key) = rig.amplifier.largest_command(rig.motor.torque_constant_nm_a.value) {
            next.why += &format!("; its levels are shares of the largest command: state {key} in the rig");
        }
        next
    })
}

/// Of recordings with too little in them: the signal that moves everything.
fn too_little(open: Open) -> Option<NextExperiment> {
    let why = format!("{}; this moves all that is to be told", open.thin?);
    unknown(RANDOM_LEVELS.0, "move-everything", (RANDOM_LEVELS.1.into(), why))
}

/// Of what has no name: steady levels, described by what to run and why.
fn steady_levels(told: (String, String)) -> Option<NextExperiment> {
    unknown(STAIRCASE.0, "locate-the-unknown", told)
}

fn unknown(text: &str, name: &str, (excitation, why): (String, String)) -> Option<NextExperiment> {
    let mut scenario: Scenario = toml::from_str(text).ok()?;
    scenario.name = name.into();
    Some(NextExperiment {
        separates: vec!["unknown".into()],
        excitation,
        why,
        scenario: serde_json::to_value(&scenario).ok()?,
    })
}

/// The signal that parts a name best from the likeliest of its rivals.
fn from_rivals(search: &Search, best: &Set, rig: &Rig, place: &Named) -> Option<NextExperiment> {
    let rival = *place.rivals.first()?;
    // A rival may stand there with another beside it: what counts is the likeliest set that has it in the place.
    let in_place = |set: &&Set| {
        let rest = best.iter().filter(|id| **id != place.effect);
        set.contains(&rival) && !set.contains(&place.effect) && rest.into_iter().all(|id| set.contains(id))
    };
    let other =
        search.fits.keys().filter(in_place).min_by(|a, b| search.cost(a).total_cmp(&search.cost(b)))?;
    let (chosen, rival) = (search.descriptor(place.effect)?, search.descriptor(rival)?);
    let mut most = where_they_differ(search, rig, best, other)?;
    most.scenario.what = format!("Parts {} from {}: {}", chosen.id, rival.id, most.words);
    most.scenario.name = format!("separate-{}-{}", chosen.id, rival.id).replace('_', "-");
    let separates = std::iter::once(place.effect).chain(place.rivals.iter().copied());
    let (sizes, advice) = why(search, chosen, rival, &most.most());
    most.told(separates, sizes, advice)
}

/// The signal on which a name in doubt shows most.
fn from_absence(search: &Search, best: &Set, rig: &Rig, place: &Named) -> Option<NextExperiment> {
    let without: Set = best.iter().copied().filter(|id| *id != place.effect).collect();
    let chosen = search.descriptor(place.effect)?;
    let mut most = where_they_differ(search, rig, best, &without)?;
    most.scenario.what = format!("Shows whether {} is there: {}", chosen.id, most.words);
    most.scenario.name = format!("show-{}", chosen.id).replace('_', "-");
    let size = if free_in_time(chosen, &search.problem.scale) {
        format!("{} changes freely with time and would come back another way", chosen.id)
    } else {
        format!("as fitted to this recording, {} would then make {}", chosen.id, most.most())
    };
    most.told(std::iter::once(place.effect), size, chosen.separated_by)
}

/// How much two rivals differ on a signal, and what the catalogue says parts them.
fn why(search: &Search, chosen: &Descriptor, rival: &Descriptor, most: &str) -> (String, &'static str) {
    match (free_in_time(chosen, &search.problem.scale), free_in_time(rival, &search.problem.scale)) {
        (false, false) => (
            format!("fitted to this recording, {} and {} would then differ by {most}", chosen.id, rival.id),
            chosen.separated_by,
        ),
        (true, true) => (
            format!("{} and {} change freely with time and come again another way", chosen.id, rival.id),
            chosen.separated_by,
        ),
        (chosen_is_free, _) => {
            let (formed, free) = if chosen_is_free { (rival, chosen) } else { (chosen, rival) };
            let text = format!(
                "{} would come back as fitted to this recording and differ from its absence by up to {most}, {} changes freely with time and would come back another way",
                formed.id, free.id
            );
            (text, formed.separated_by)
        }
    }
}

/// What to run for a term without a name, of which a signal both ways tells most, and why.
fn of_unknown(term: &Descriptor, rig: &Rig, both_ways: &str) -> (String, String) {
    let why = along(term.path.name());
    if term.id == LOAD_STEPS.id {
        let why = "with the change in force and without it, current recorded: a load takes the same torque at every level, a drive that loses gain a share of it";
        return (both_ways.into(), why.into());
    }
    if term.id == SHAFT_OVER_ANGLE.id && rig.load == Load::None {
        let again =
            "this recording again, with what hangs on the shaft (a weight, a spring) stated in the rig";
        let weight = "torque that goes with the shaft's angle is what a weight on an arm, a wheel out of balance, a spring or a cable does, and it hides all else; \
                      a weight is stated as [load] kind = \"pendulum\", mass_kg, length_m";
        return (
            format!("{again}; where nothing does, {both_ways}"),
            format!("{weight}. Where nothing hangs there, {why}"),
        );
    }
    (both_ways.into(), why)
}

fn along(path: &str) -> String {
    format!(
        "steady levels both ways show on the {path} path how the unknown goes with speed and direction; then repeat this run to see whether it stays"
    )
}

/// Whether an effect changes freely with time, and so comes again another way.
pub fn free_in_time(effect: &Descriptor, scale: &Scale) -> bool {
    (effect.parameters)(scale).iter().any(|s| s.acts.is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flexible::TERMS;

    const SERVO: &str =
        "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.006\ntorque_constant_nm_a = 0.35\n";
    const WEIGHT: &str = "[load]\nkind = \"pendulum\"\nmass_kg = 0.5\nlength_m = 0.1\n";

    #[test]
    fn what_pulls_at_an_angle_is_asked_for_where_the_rig_states_no_load() {
        let [bare, loaded] =
            [SERVO.to_string(), format!("{SERVO}{WEIGHT}")].map(|text| Rig::from_toml(&text).unwrap());
        for term in TERMS {
            let (excitation, why) = of_unknown(term, &bare, "a staircase");
            let asked = term.id == SHAFT_OVER_ANGLE.id;
            assert_eq!(excitation.contains("hangs on the shaft"), asked, "{}: {excitation}", term.id);
            assert_eq!(why.contains("[load]"), asked, "{}: {why}", term.id);
            assert!(excitation.contains("a staircase"));
            assert_eq!(of_unknown(term, &loaded, "a staircase").0, "a staircase");
        }
    }
}
