//! `kort fit`: the parameters of a model from recordings.

use std::collections::BTreeSet;
use std::path::PathBuf;

use clap::Args;
use kort_diagnose::constants::Constants;
use kort_identify::data::KNOWN;
use kort_identify::identify::{FitReport, Options, identify};
use kort_recording::columns::find;

use crate::failure::{Failure, Outcome, print, print_json, write_text};
use crate::fitted_rig::with_fit;
use crate::input::{Input, Loaded};
use crate::outputs::Named;
use crate::progress::Steps;
use crate::render;

const EXAMPLE: &str = "\
Example: kort fit tests/recordings/example-cases/clean.csv.gz \\
           --rig tests/recordings/example-cases/clean.rig.toml -o fitted.toml

Exit code 3 means that the fit was done but rows were lost in reading or left out
because a sensor misbehaves there; the notes say which.";

/// The drive's switch, a column that the model reads though it is none of the contract's and drives nothing.
const ENABLED: &str = "torque_enable";

/// Identify a model's parameters, with standard errors and a held-out score
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub struct Fit {
    #[command(flatten)]
    input: Input,
    /// Write the rig description with the fitted values, those of effects among its [[effects]]; tol = two
    /// standard errors; what the recordings do not fix stays as stated
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Fits from this many starts within the stated tolerances
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=100))]
    starts: u16,
    /// Fit viscous friction without prior and across zero: a negative value tells of physics left out
    #[arg(long)]
    free_friction: bool,
    /// Print one JSON document (kort.fit/1)
    #[arg(long)]
    json: bool,
    /// A job of the service, which has this process id: each step on a line of its own, nothing else disturbed
    #[arg(long, value_name = "PID", hide = true)]
    job: Option<u32>,
}

/// Fits what was read.
///
/// # Errors
/// A recording cannot be compared with the model at all.
pub fn fit(
    input: &Input,
    loaded: &Loaded,
    starts: usize,
    free_friction: bool,
    told: &(dyn Fn(&str) + Sync),
) -> Result<FitReport, Failure> {
    let options = Options {
        model: input.model,
        seed: input.seed,
        starts,
        open_friction: free_friction,
        with: input.known_effects()?,
        criterion: Constants::built_in().criterion,
    };
    let report = input.on_threads(|| identify(&loaded.series, &loaded.rig, &options, told))?;
    let mut report = report.map_err(Failure::input)?;
    report.notes.splice(0..0, loaded.notes.iter().cloned());
    let columns = loaded.series.iter().flat_map(|series| &series.columns);
    let unknown: BTreeSet<&str> = columns
        .map(|(name, _)| name.as_str())
        .filter(|name| find(name).is_none() && !KNOWN.contains(name) && *name != ENABLED)
        .collect();
    if !unknown.is_empty() {
        let unknown: Vec<&str> = unknown.into_iter().collect();
        report.notes.push(format!("columns not used: {}", unknown.join(", ")));
    }
    Ok(report)
}

impl Fit {
    /// The service's process that this is a job of.
    pub fn job_of(&self) -> Option<u32> {
        self.job
    }

    /// The files that it reads, and those that it writes.
    pub fn named(&self) -> Named {
        self.input.named().writes_toml("-o", self.output.as_deref())
    }

    /// Does it.
    ///
    /// # Errors
    /// Unreadable input, or an output file that cannot be written.
    pub fn run(self) -> Result<Outcome, Failure> {
        let loaded = self.input.load()?;
        let steps = Steps::new(self.job);
        let told = |step: &str| steps.tell(step);
        let report = fit(&self.input, &loaded, usize::from(self.starts), self.free_friction, &told)?;
        drop(steps);
        // The result is printed whatever becomes of its file.
        let written = self.write(&report, &loaded);
        if self.json {
            print_json(&report)?;
        } else {
            print(&render::fit::text(&report, &loaded.rig))?;
        }
        written.map(|()| Outcome::with_loss(loaded.lossy))
    }

    fn write(&self, report: &FitReport, loaded: &Loaded) -> Result<(), Failure> {
        if let Some(path) = &self.output {
            let (text, left_out) = with_fit(&loaded.rig_text, report).map_err(Failure::failed)?;
            write_text(path, &text)?;
            for why in left_out {
                eprintln!("note: {}: {why}", path.display());
            }
        }
        Ok(())
    }
}
