//! `kort prove`: the proof of `kort diagnose`, on cases of a truth simulation and on recordings that
//! others measured. The engine is `kort_proof`; here files are read, seeds entered into the ledger,
//! and results written.

mod calibrate;
mod diagnosis;
mod ledger;
mod measured;
mod page;
mod stamp;

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use kort_proof::blind;
use kort_proof::tally::Proof;
use kort_truth::{CaseKind, MachineKind, Selection, families};
use rayon::prelude::*;

use crate::failure::{Failure, Outcome, print, print_json, write_text};
use crate::outputs::Named;
use crate::progress;

const EXAMPLE: &str = "\
Example: kort prove --quick --html proof.html                  (seeds nobody has looked at; enters them into the ledger)
         kort prove --markdown docs/proof.md                   (360 cases; the reported run)
         kort prove --tuning --seed 1 --cases 40 --kind pair   (seeds below 1000000: never reported)
         kort prove --tuning --seed 1 --family cavitation,ventilation --kind single --cases 12
         kort prove --tuning --seed 1 --write-cases /tmp/cases --cases 20   (cases to look at; nothing is diagnosed)
         kort prove --measured DIR --concealed --markdown docs/measured-recordings.md
         kort prove --tuning --seed 1 --calibrate records.jsonl --folds 5 --fold-by effect

A reported proof fails (exit code 1) on seeds that were used before: docs/proof-ledger.toml holds them.
DIR has a folder for each set, with recordings, rig.toml and a key, answers.toml (docs/measured-recordings.md).";

/// Prove `diagnose`: hide physics, diagnose the recordings alone, open the answers
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub struct Prove {
    /// Cases in all, split as in the full proof (150 single, 100 clean, 30 pair, 20 several, 30 confounded, 30 outside)
    #[arg(long, value_name = "N", conflicts_with = "quick", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    cases: Option<u32>,
    /// A twentieth of the full proof
    #[arg(long)]
    quick: bool,
    /// First seed of the cases [default: the first million that the ledger does not hold]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// The seeds are for tuning (below 1000000): nothing is entered into the ledger, nothing is to be reported
    #[arg(long)]
    tuning: bool,
    /// Kinds of cases; may be given several times
    #[arg(long, value_name = "KIND", value_enum, value_delimiter = ',')]
    kind: Vec<Kind>,
    /// Effects that may be hidden, by their catalogue ids
    #[arg(long, value_name = "ID", value_delimiter = ',', value_parser = family)]
    family: Vec<String>,
    /// Effects that may not be hidden
    #[arg(long, value_name = "ID", value_delimiter = ',', value_parser = family)]
    families_left_out: Vec<String>,
    /// Kinds of noise that may not be drawn
    #[arg(long, value_name = "NOISE", value_delimiter = ',', value_parser = noise)]
    noise_left_out: Vec<String>,
    /// Machines
    #[arg(long, value_name = "MACHINE", value_enum)]
    machine: Option<Machine>,
    /// Threads to use [default: one a core]; the verdicts are the same whatever their number
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Print one JSON document (kort.prove/1)
    #[arg(long)]
    json: bool,
    /// Write the proof as one self-contained page
    #[arg(long, value_name = "FILE", conflicts_with = "measured")]
    html: Option<PathBuf>,
    /// Write the proof as a Markdown page; with --measured, the part of it between its marks
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Write the cases (recording.csv, rig.toml, answer.json) and diagnose nothing
    #[arg(long, value_name = "DIR", conflicts_with_all = ["json", "html", "markdown", "measured", "calibrate"])]
    write_cases: Option<PathBuf>,
    /// Write what was stated and what became of it, a JSON line a finding, for fitting constants
    #[arg(long, value_name = "FILE", conflicts_with = "measured")]
    calibrate: Option<PathBuf>,
    /// Folds of the records
    #[arg(long, value_name = "N", default_value_t = 5, requires = "calibrate", value_parser = clap::value_parser!(u16).range(1..=100))]
    folds: u16,
    /// What parts the records into folds
    #[arg(long, value_name = "WHAT", value_enum, default_value = "effect", requires = "calibrate")]
    fold_by: FoldBy,
    /// Diagnose recordings that others measured, and hold the reports against their keys
    #[arg(long, value_name = "DIR", conflicts_with_all = ["cases", "quick", "seed", "kind", "family", "families_left_out", "machine"])]
    measured: Option<PathBuf>,
    /// Sets to take of it, by their folders
    #[arg(long, value_name = "NAME", value_delimiter = ',', requires = "measured")]
    set: Vec<String>,
    /// Also hide exact changes in them (delay, lag, bias, dead band, …) and see whether they are found
    #[arg(long, requires = "measured")]
    concealed: bool,
    /// Seeds that were used
    #[arg(long, value_name = "FILE", default_value = "docs/proof-ledger.toml")]
    ledger: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    Single,
    Clean,
    Pair,
    Several,
    Confounded,
    Outside,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Machine {
    /// A thruster
    Thruster,
    /// A dry shaft: servo axis, gear motor, belt drive, motor without a load, servo with a weight on an arm, blower, carriage on an incline
    Dry,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum FoldBy {
    /// The hidden effect
    Effect,
    /// The machine
    Rig,
    /// The kinds of noise
    Noise,
}

fn family(id: &str) -> Result<String, String> {
    let ids: Vec<&str> = families::ALL.iter().map(|family| family.id).collect();
    if ids.contains(&id) { Ok(id.to_owned()) } else { Err(format!("allowed: {}", ids.join(", "))) }
}

fn noise(name: &str) -> Result<String, String> {
    let names: Vec<&str> = kort_truth::noises::ALL.iter().map(|kind| kind.name).collect();
    if names.contains(&name) { Ok(name.to_owned()) } else { Err(format!("allowed: {}", names.join(", "))) }
}

impl Prove {
    /// The files that it reads, and those that it writes.
    pub fn named(&self) -> Named {
        let named = Named::default().writes("--html", self.html.as_deref());
        let named = named.writes("--markdown", self.markdown.as_deref());
        named.writes("--calibrate", self.calibrate.as_deref())
    }

    /// Does it.
    ///
    /// # Errors
    /// Seeds that may not be used, a folder that cannot be read, an output file that cannot be written.
    pub fn run(self) -> Result<Outcome, Failure> {
        let threads = self.jobs.map_or(0, usize::from);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(Failure::failed)?;
        if let Some(folder) = &self.measured {
            return pool.install(|| measured::run(folder, &self));
        }
        let ledger = ledger::open(&self.ledger)?;
        let seed = self.seed.unwrap_or(if self.tuning { 1 } else { ledger.seeds.free() });
        let kinds: Vec<CaseKind> = self.kind.iter().map(|kind| CaseKind::from(*kind)).collect();
        let wanted = if self.quick { Some(18) } else { self.cases };
        let plan = blind::plan(wanted, seed, &kinds);
        let seeds = blind::seeds(&plan);
        ledger.seeds.allow(&seeds, self.tuning).map_err(Failure::failed)?;
        let stamp = stamp::stamp();
        if !self.tuning {
            ledger.enter(
                &seeds,
                &stamp,
                if self.write_cases.is_some() { "cases written" } else { "blind proof" },
            )?;
        }
        let selection = self.selection();
        if let Some(folder) = &self.write_cases {
            let bar = progress::bar(plan.len() as u64, "cases written");
            let write = |&(kind, seed): &(CaseKind, u64)| {
                write_case(folder, kind, seed, &selection).inspect(|()| bar.inc(1))
            };
            pool.install(|| plan.par_iter().try_for_each(write))?;
            drop(bar);
            eprintln!("wrote {} cases under {}", plan.len(), folder.display());
            return Ok(Outcome::Done);
        }
        let started = Instant::now();
        let bar = progress::bar(plan.len() as u64, "cases diagnosed");
        let mut results = Vec::with_capacity(plan.len());
        let prove = |&(kind, seed): &(CaseKind, u64)| {
            let result = blind::prove_one(kind, seed, &selection, &diagnosis::Ours);
            bar.inc(1);
            result
        };
        pool.install(|| plan.par_iter().map(prove).collect_into_vec(&mut results));
        drop(bar);
        eprintln!("{} cases diagnosed in {:.0} s", plan.len(), started.elapsed().as_secs_f64());
        // The result is printed whatever becomes of its files.
        let records = match &self.calibrate {
            Some(path) => calibrate::write(path, &results, self.fold_by, usize::from(self.folds)),
            None => Ok(()),
        };
        let scored = results.into_iter().map(|(scored, ..)| scored).collect();
        let shown = self.show(&Proof::new(seed, self.tuning, stamp, scored));
        records.and(shown)
    }

    fn show(&self, proof: &Proof) -> Result<Outcome, Failure> {
        let write = |path: &Option<PathBuf>, page: fn(&Proof) -> String| match path {
            Some(path) => write_text(path, &page(proof)).inspect(|()| eprintln!("wrote {}", path.display())),
            None => Ok(()),
        };
        let (html, markdown) = (write(&self.html, page::html), write(&self.markdown, page::markdown));
        if self.json {
            print_json(&proof.json())?
        } else {
            print(&page::text(proof))?
        }
        html.and(markdown).map(|()| Outcome::Done)
    }

    fn selection(&self) -> Selection {
        Selection {
            machine: self.machine.map(|machine| match machine {
                Machine::Thruster => MachineKind::Thruster,
                Machine::Dry => MachineKind::Dry,
            }),
            families: self.family.clone(),
            without: self.families_left_out.clone(),
            without_noise: self.noise_left_out.clone(),
            ..Selection::default()
        }
    }
}

impl From<Kind> for CaseKind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Single => CaseKind::Single,
            Kind::Clean => CaseKind::Clean,
            Kind::Pair => CaseKind::Pair,
            Kind::Several => CaseKind::Several,
            Kind::Confounded => CaseKind::Confounded,
            Kind::Outside => CaseKind::Outside,
        }
    }
}

/// Writes one case to a folder of its own.
fn write_case(folder: &Path, kind: CaseKind, seed: u64, selection: &Selection) -> Result<(), Failure> {
    let case = kort_truth::case(kind, seed, selection);
    let place = folder.join(format!("{}-{seed}", kind.name()));
    std::fs::create_dir_all(&place).map_err(|error| Failure::unwritten(&place, error))?;
    let answer = serde_json::to_string_pretty(&case.answer).map_err(Failure::failed)?;
    write_text(&place.join("recording.csv"), &case.recording_csv)?;
    write_text(&place.join("rig.toml"), &case.rig_toml)?;
    write_text(&place.join("answer.json"), &answer)
}
