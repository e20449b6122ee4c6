//! What the report says in words. Prose is made last and decides nothing.

use std::collections::BTreeMap;

use kort_identify::fit::Fit;
use kort_identify::scores::{self, ChannelReport, HeldOut, ParameterReport, parameters};
use kort_identify::simulate::{Problem, Stack};
use kort_thruster::effects::{Descriptor, OF_THE_COMMAND};
use kort_thruster::rig::AmplifierKind;

use crate::choices::choices;
use crate::flexible;
use crate::locate;
use crate::report::{
    Alternative, Baseline, EmpiricalTerm, Finding, Mismatch, NextExperiment, Remainder, Verdict,
};
use crate::search::{Disguised, Set};

/// Standard deviations from what is stated beyond which a coefficient is spoken of.
const STRAINED: f64 = 2.6;

/// One sentence on an effect.
pub fn statement(effect: &Descriptor) -> String {
    format!("The model leaves out {}: {}.", effect.id.replace('_', " "), effect.what)
}

/// Numbers of an effect with the unit that the rig's drive is told in, where they are in that of the command.
pub fn in_units(mut values: Vec<ParameterReport>, drive: AmplifierKind) -> Vec<ParameterReport> {
    let unit = match drive {
        AmplifierKind::Current => "A",
        AmplifierKind::Voltage => "V",
        AmplifierKind::Speed => "rad/s",
    };
    values.iter_mut().filter(|p| p.unit == OF_THE_COMMAND).for_each(|p| p.unit = unit.into());
    values
}

/// What speaks for an effect.
pub fn evidence(
    effect: Option<&Descriptor>,
    heldout: &HeldOut,
    located: Option<&locate::Place>,
    at_bound: bool,
) -> Vec<String> {
    let mut out = vec![format!(
        "with it, {:.0} % of the error above the noise goes on data it was not fitted to (95 % interval {:.0} to {:.0} %)",
        100.0 * heldout.excess_error_removed,
        100.0 * heldout.interval_95[0],
        100.0 * heldout.interval_95[1]
    )];
    if let Some(place) = located {
        out.push(format!("the error it removes shows most in {}, {}", place.channel, place.regime));
    }
    if let Some(effect) = effect {
        out.push(format!("expected signature: {}", effect.signature));
    }
    if at_bound {
        out.push(
            "a value stands at the edge of what is allowed: a symptom of another form, not a size".into(),
        );
    }
    out
}

/// Why a member of the best set is not stated.
pub const TOO_LITTLE: &str =
    "nothing explains the recordings better: it is not stated because they have too little in them";

/// Why an effect was set aside: how much worse the best set with it is, what the best set gains in all, and the odds that
/// are made of it.
pub fn why_not(worse: f64, gained: f64, temper: f64, nothing_found: bool) -> String {
    let odds = (worse / (2.0 * temper)).exp();
    let odds = match odds {
        few if few < 10.0 => format!("odds of {few:.1} to 1"),
        many if many < 1e6 => format!("odds of {many:.0} to 1"),
        _ => "odds of more than a million to 1".into(),
    };
    let against = format!("in twice the log-evidence, which counts as {odds} against it");
    if nothing_found {
        return format!("adding it costs {worse:.0} more than it gains, {against}");
    }
    let of = if gained > 0.0 { format!(" (it gains {gained:.0} over the baseline)") } else { String::new() };
    format!("the best set with it is worse than the best of all{of} by {worse:.0}, {against}")
}

/// A nameless term with its numbers.
pub fn empirical(
    problem: &Problem,
    fit: &Fit,
    std_errors: &[f64],
    id: &str,
    heldout: HeldOut,
) -> EmpiricalTerm {
    let slot = fit.hypothesis.effects.iter().position(|m| m.effect.id == id).unwrap_or(0);
    let member = &problem.members(&fit.hypothesis, &fit.values)[slot];
    let (enters, over) = flexible::enters(member.effect);
    let column = problem.recordings.iter().find_map(|r| r.extra.clone());
    let over = column.filter(|_| over == "a column").unwrap_or_else(|| over.into());
    let values: Vec<ParameterReport> = parameters(fit, std_errors, Some(slot));
    EmpiricalTerm {
        path: member.effect.path.name().into(),
        enters: enters.into(),
        expression: flexible::expression(member.effect, &member.values),
        variables: vec![over],
        parameters: values,
        heldout,
    }
}

/// Root mean square error over full scale, by channel.
pub fn nrmse(problem: &Problem, residual: &Stack) -> BTreeMap<String, f64> {
    let full = scores::full_scales(problem);
    scores::sums(problem, residual, |r, row| !problem.masked[r][row])
        .into_iter()
        .map(|(name, (sum, n))| (name.to_string(), (sum / n.max(1) as f64).sqrt() / full[name]))
        .collect()
}

/// That something else would be told if what it leaves could be noise.
pub fn overtaken(by_odds: Option<&Set>, told: Option<&Set>) -> Option<String> {
    let (by_odds, told) = (by_odds?, told?);
    (by_odds != told).then(|| {
        let names: Vec<String> = by_odds.iter().map(|id| plain(id)).collect();
        format!(
            "by its odds {} would be told; it leaves more than noise of such sensors can be, so something without a name would have to act beside it, and that has odds of its own",
            if names.is_empty() { "the baseline alone".into() } else { names.join(" and ") }
        )
    })
}

/// A name that is likely and of no size.
pub fn negligible(id: &str, share: f64) -> String {
    format!(
        "{} would fit, but does no more than {:.2} % of full scale, less than the equations themselves may err: it is not stated",
        capital(&plain(id)),
        100.0 * share
    )
}

/// A name that the data would rather have than a plainer one, and that is hardly more than it.
pub fn disguised(disguised: &Disguised) -> String {
    format!(
        "{} would fit better than {}, but differs from it by no more than {:.2} % of full scale, less than the equations themselves may err: the plainer name is stated",
        capital(&plain(disguised.effect)),
        plain(disguised.plainer),
        100.0 * disguised.share
    )
}

/// That two names only undo each other.
pub fn cancelling(a: &str, b: &str) -> String {
    let (a, b) = (plain(a), plain(b));
    format!(
        "{} and {b} mostly undo each other: what is left of both may be one thing that is neither",
        capital(&a)
    )
}

/// Coefficients that the baseline's fit needs far from what the rig states: a symptom even where the fit
/// is good.
pub fn strained(baseline: &Fit) -> Option<String> {
    let far: Vec<String> = baseline
        .hypothesis
        .free
        .iter()
        .zip(&baseline.values)
        .filter(|(free, value)| free.stated && free.score(**value).abs() > STRAINED)
        .map(|(free, value)| {
            format!(
                "{} {:+.0} % (stated to {:.0} %)",
                free.name,
                100.0 * (value / free.mean - 1.0),
                200.0 * (free.sigma / free.mean).abs()
            )
        })
        .collect();
    (!far.is_empty()).then(|| {
        format!(
            "the baseline fits only with coefficients far from what the rig states: {}. Check what is stated: they may hide physics that the model leaves out",
            far.join(", ")
        )
    })
}

/// What a summary is told from.
pub struct Told<'a> {
    /// The outcome.
    pub verdict: Verdict,
    /// Names, in the order of what each removes.
    pub findings: &'a [Finding],
    /// Where.
    pub mismatch: &'a [Mismatch],
    /// What is known without a name.
    pub term: Option<&'a EmpiricalTerm>,
    /// What that term is, in words.
    pub without_name: &'a str,
    /// What is left.
    pub remainder: Option<&'a Remainder>,
    /// The name without which that is left, if it is what a name in doubt takes.
    pub in_doubt: Option<&'a str>,
    /// What to run next.
    pub next: Option<&'a NextExperiment>,
    /// The baseline.
    pub baseline: &'a Baseline,
    /// Why the recordings cannot tell, if so.
    pub thin: Option<&'a str>,
    /// Names that were set aside.
    pub alternatives: &'a [Alternative],
}

/// Standard deviations from which a mismatch that names might explain is real.
const REAL_SIGMA: f64 = 3.0;
/// From this probability on a name is likelier there than not.
const LIKELY: f64 = 0.5;
/// From this probability on a name that is not stated cannot be excluded either.
const POSSIBLE: f64 = 0.2;

/// One paragraph to act on.
pub fn summary(told: &Told) -> String {
    let model = &told.baseline.model;
    let mut text = match told.verdict {
        Verdict::NoMismatch => {
            let missing = match possible(told.alternatives) {
                Some(names) => {
                    format!("this excitation shows nothing that is missing, and cannot exclude {names}")
                }
                None => "nothing is missing that this excitation can show".into(),
            };
            match above_noise(told.baseline) {
                None => format!(
                    "{model}, re-fitted within the stated tolerances, explains the recording down to its noise: {missing}."
                ),
                Some(left) => {
                    format!(
                        "No effect in the catalogue improves {model}, re-fitted within the stated tolerances, by more than it costs. It leaves {left}, which follows nothing clearly enough to be told from slow noise."
                    ) + &possible(told.alternatives)
                        .map_or(String::new(), |names| format!(" It cannot exclude {names}."))
                }
            }
        }
        Verdict::Explained => format!("{model} leaves out {}.{}", named(told.findings), shows(told)),
        Verdict::PartlyExplained => {
            let (likely, perhaps): (Vec<Finding>, Vec<Finding>) =
                told.findings.iter().cloned().partition(|f| f.probability >= LIKELY);
            let mut text = match (likely.is_empty(), perhaps.is_empty()) {
                (true, _) | (_, true) => format!("{model} leaves out {}.", named(told.findings)),
                _ => format!("{model} leaves out {}, perhaps also {}.", named(&likely), named(&perhaps)),
            };
            text.push_str(&shows(told));
            if let Some(left) = told.remainder {
                let (who, what) = match told.in_doubt {
                    Some(effect) => ("Those that are likely", format!("it may be {}", plain(effect))),
                    None => ("They", "that has no name here".into()),
                };
                text.push_str(&format!(
                    " {who} leave {} of the error above the noise, on the {} path, most in {}, {}: {what}.",
                    percent(left.share_of_excess_error),
                    left.path,
                    left.channel,
                    left.regime
                ));
            }
            text
        }
        Verdict::Ambiguous => {
            let doubtful: Vec<&Finding> =
                told.findings.iter().filter(|f| !f.confounded_with.is_empty()).collect();
            let places: Vec<_> =
                doubtful.iter().map(|f| (f.effect.as_str(), f.confounded_with.as_slice())).collect();
            let sure: Vec<Finding> =
                told.findings.iter().filter(|f| f.confounded_with.is_empty()).cloned().collect();
            let beside = if sure.is_empty() {
                String::new()
            } else {
                format!(" {model} also leaves out {}.", named(&sure))
            };
            format!(
                "{model} leaves something out{}, and this excitation cannot tell which of these it is: {}.{beside}",
                one_path(&doubtful),
                choices(&places).join("; and which of these: "),
            )
        }
        Verdict::Unexplained => {
            let explains = if told.findings.is_empty() {
                let nearest = possible(told.alternatives);
                let nearest = nearest.map_or(String::new(), |names| format!("; nearest is {names}"));
                format!("no effect in the catalogue explains it{nearest}")
            } else {
                format!("no name is likely enough to be believed; nearest is {}", named(told.findings))
            };
            let shows = |m: &Mismatch| m.significance_sigma >= REAL_SIGMA;
            let real = told.findings.is_empty() || told.mismatch.first().is_none_or(shows);
            let is = if real { "The mismatch is real" } else { "That something is missing is not sure" };
            let mut text = format!(
                "{is} ({} path, most in {}, {}), and {explains}.",
                told.mismatch.first().map_or("?", |m| &m.path),
                told.mismatch.first().map_or("?", |m| &m.channel),
                told.mismatch.first().map_or("?", |m| &m.regime),
            );
            if let Some(term) = told.term {
                let removed = term.heldout.excess_error_removed;
                let held_out = if removed > 0.0 {
                    format!("removes {:.0} % of what it is about on held-out data", 100.0 * removed)
                } else {
                    "removes nothing on held-out data: where to look, and no more".into()
                };
                text.push_str(&format!(
                    " Described by {}: {} over {}: {} ({held_out}).",
                    told.without_name,
                    term.enters,
                    term.variables.join(", "),
                    term.expression,
                ));
            }
            text
        }
        Verdict::InsufficientData => {
            format!("The recording cannot tell: {}.", told.thin.unwrap_or("too little changes in it"))
        }
    };
    if let Some(next) = told.next {
        text.push_str(&format!(" Run next: {}.", next.excitation));
    }
    text
}

/// An error so many times the sensor's noise is more than that noise.
const ABOVE_NOISE: f64 = 2.0;

/// A share as per cent; what is there is not nothing.
fn percent(share: f64) -> String {
    if (0.0..0.005).contains(&share) { "less than 1 %".into() } else { format!("{:.0} %", 100.0 * share) }
}

/// What a baseline leaves beyond the noise from sample to sample, in the channel where that is most; none where it is
/// about the noise.
fn above_noise(baseline: &Baseline) -> Option<String> {
    let times = |c: &ChannelReport| c.nrmse_train / c.noise_floor.max(1e-9);
    let (channel, most) = baseline.channels.iter().max_by(|a, b| times(a.1).total_cmp(&times(b.1)))?;
    (times(most) > ABOVE_NOISE).then(|| {
        format!(
            "{:.2} % of full scale in {channel} (its noise from sample to sample is {:.2} %)",
            100.0 * most.nrmse_train,
            100.0 * most.noise_floor
        )
    })
}

/// The path that these findings share, if they do.
fn one_path(findings: &[&Finding]) -> String {
    match findings {
        [first, rest @ ..] if rest.iter().all(|f| f.path == first.path) => {
            format!(" on the {} path", first.path)
        }
        _ => String::new(),
    }
}

/// Names that are not stated and cannot be excluded.
fn possible(alternatives: &[Alternative]) -> Option<String> {
    let names: Vec<String> = alternatives
        .iter()
        .filter(|a| a.probability >= POSSIBLE)
        .map(|a| format!("{} (probability {:.2})", plain(&a.effect), a.probability))
        .collect();
    (!names.is_empty()).then(|| names.join(" or "))
}

fn named(findings: &[Finding]) -> String {
    findings
        .iter()
        .map(|f| format!("{} ({}, probability {:.2})", plain(&f.effect), f.path, f.probability))
        .collect::<Vec<_>>()
        .join(" and ")
}

fn shows(told: &Told) -> String {
    let (Some(finding), Some(place)) = (told.findings.first(), told.mismatch.first()) else {
        return String::new();
    };
    format!(
        " {} removes {:.0} % of the error above the noise that is left without it, on data it was not fitted to. It shows most in {}, {}.",
        capital(&plain(&finding.effect)),
        100.0 * finding.heldout.excess_error_removed,
        place.channel,
        place.regime
    )
}

pub(crate) fn plain(id: &str) -> String {
    id.replace('_', " ")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
