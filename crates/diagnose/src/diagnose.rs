//! The diagnosis: prepare, search, decide, check on held-out data, and write the report.

use std::collections::BTreeMap;

use kort_identify::data::{DataError, Series, available};
use kort_identify::hypothesis::Hypothesis;
use kort_identify::setup::Setup;
use kort_thruster::effects::{self, Available, Descriptor};
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;
use serde::Serialize;

use crate::constants::Constants;
use crate::posterior::{Fitted, Posterior};
use crate::report::Report;
use crate::search::{Search, Set};
use crate::traces::Traces;
use crate::unfinished::unfinished;
use crate::unknown;
use crate::words;
use crate::write::Writer;

/// How to diagnose.
#[derive(Clone)]
pub struct Options {
    /// Baseline model.
    pub model: ModelName,
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Effects taken as present.
    pub with: Vec<&'static Descriptor>,
}

/// A diagnosis: the report, and traces for its plots.
pub struct Diagnosis {
    /// The report.
    pub report: Report,
    /// For plots.
    pub traces: Traces,
    /// Every set that was fitted: what odds are made of.
    pub evidence: Vec<Evidence>,
}

/// What speaks for a set of effects, apart from how much of it is believed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evidence {
    /// The set.
    pub effects: Set,
    /// Twice the negative log of what the data say for it.
    pub cost: f64,
    /// Negative log of its prior odds.
    pub rarity: f64,
}

/// Diagnoses recordings of one rig together.
///
/// # Errors
/// [`DataError`] if a recording cannot be compared with a model at all, or the stated rig cannot be simulated.
pub fn diagnose(
    series: &[Series],
    rig: &Rig,
    options: &Options,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Diagnosis, DataError> {
    let constants = Constants::built_in();
    let mut setup = Setup::of_stretches(series, rig, options.model, constants.criterion)?;
    let pushed = setup.pushed();
    let held = rig.clone().exact_in(&pushed);
    let rig = if pushed.is_empty() { rig } else { &held };
    if !pushed.is_empty() {
        setup = Setup::of_stretches(series, rig, options.model, constants.criterion)?;
        setup.notes.push(format!(
            "the recordings push {} of the rig's [[effects]] to the edge of what is stated: it is held at its stated value, and what is there instead is looked for",
            pushed.join(", ")
        ));
    }
    let Setup { series, problem, baseline, mut notes, thin, .. } = setup;
    let baseline = baseline.with_present(&options.with, &problem.scale);
    let offered = available(options.model, &series, &problem.recordings);
    let candidates = candidates(rig, &offered, &baseline);
    let mut search = Search::new(&problem, candidates, &constants);
    let best = search.run(&baseline, progress);
    if search.fits[&Set::new()].broke_down() {
        let recording = series.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(DataError::BrokeDown { recording });
    }
    progress("looking for what has no name");
    unknown::look(&mut search, &best, rig, &offered, progress);
    progress("weighing what leaves more than noise");
    let before = explanations(&search, &constants, &BTreeMap::new());
    let unfinished = unfinished(&search, &before);
    let explanations = explanations(&search, &constants, &unfinished);
    let told = |posterior: &Posterior| posterior.told().map(|e| e.set().clone());
    notes.extend(words::overtaken(told(&before).as_ref(), told(&explanations).as_ref()));
    notes.extend(told(&explanations).and_then(|set| search.in_disguise(&set)).map(words::disguised));
    progress("scoring on held-out data");
    let evidence = search.fits.iter().map(|(set, fit)| Evidence {
        effects: set.clone(),
        cost: fit.cost(),
        rarity: search.rarity(set) + unfinished.get(set).unwrap_or(&0.0),
    });
    let evidence = evidence.collect();
    let (report, traces) = Writer::new(&search, explanations, &series, rig, options).write(notes, thin);
    Ok(Diagnosis { report, traces, evidence })
}

/// Probabilities of all sets that were fitted. Some leave more than noise; what must be there beside those makes them rarer.
fn explanations(search: &Search, constants: &Constants, beside: &BTreeMap<Set, f64>) -> Posterior {
    let temper = search.temper();
    let fitted = search.fits.iter().map(|(set, fit)| Fitted {
        set: set.clone(),
        alone: fit.cost(),
        cost: search.cost(set) + 2.0 * temper * beside.get(set).unwrap_or(&0.0),
        unfinished: beside.contains_key(set),
    });
    Posterior::new(fitted.collect(), temper, &constants.posterior)
}

/// Effects that can act here and are no part of the baseline.
fn candidates(rig: &Rig, offered: &Available, baseline: &Hypothesis) -> Vec<&'static Descriptor> {
    let more = |e: &&'static Descriptor| (e.needs)(rig, offered).is_ok() && !baseline.has(e.id);
    effects::ALL.iter().copied().filter(more).collect()
}
