//! `kort diagnose`: what the model left out.

use std::path::PathBuf;

use clap::Args;
use kort_diagnose::diagnose::{Diagnosis, Options, diagnose};
use kort_diagnose::report::Report;
use kort_thruster::rig::Rig;

use crate::believed::{DIAGNOSED, believed, left_out};
use crate::failure::{Failure, Outcome, print, print_json, write_text};
use crate::fitted_rig::with_fitted_effects;
use crate::input::{Input, Loaded};
use crate::outputs::Named;
use crate::progress::Steps;
use crate::render;

const EXAMPLE: &str = "\
Example: kort diagnose tests/recordings/example-cases/rotational-flow.csv.gz \\
           --rig tests/recordings/example-cases/rotational-flow.rig.toml --html report.html

Exit codes: 0 whatever the verdict; 2 unreadable input; 3 done, but rows were lost in
reading or left out because a sensor misbehaves there (the notes say which).
How to read the report: docs/reading-a-report.md";

/// Locate a mismatch between model and recording, name the omitted physics, show the fit improve
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub struct Diagnose {
    #[command(flatten)]
    input: Input,
    /// Write the rig description with what was found as its [[effects]], which fit, diagnose, simulate and
    /// soak then use: names of probability 0.7 and more that have no rival and a size that can be told from nothing,
    /// and those of --with
    #[arg(short, long, value_name = "RIG2")]
    output: Option<PathBuf>,
    /// Print one JSON document (kort.diagnosis/2)
    #[arg(long)]
    json: bool,
    /// Write the report as one self-contained page
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// A job of the service, which has this process id: each step on a line of its own, nothing else disturbed
    #[arg(long, value_name = "PID", hide = true)]
    job: Option<u32>,
}

/// What stands behind each value of an effect that nobody found: the command line has it.
const TOLD: &str = "taken as known, fitted by kort diagnose";

/// Diagnoses what was read.
///
/// # Errors
/// A recording cannot be compared with the model at all.
pub fn diagnosis(input: &Input, loaded: &Loaded, told: &(dyn Fn(&str) + Sync)) -> Result<Diagnosis, Failure> {
    let options = Options { model: input.model, seed: input.seed, with: input.known_effects()? };
    let diagnosis = input.on_threads(|| diagnose(&loaded.series, &loaded.rig, &options, told))?;
    let mut diagnosis = diagnosis.map_err(Failure::input)?;
    diagnosis.report.notes.splice(0..0, loaded.notes.iter().cloned());
    Ok(diagnosis)
}

/// The rig description with what is believed of a diagnosis, and what it was told is there, as its `[[effects]]`; their
/// names, and why something is not among them.
///
/// # Errors
/// The text is no rig description (it was one when it was read).
pub fn adopted(loaded: &Loaded, report: &Report) -> Result<(String, Vec<String>, Vec<String>), Failure> {
    let found = believed(report);
    let mut told = report.baseline.effects.clone();
    told.retain(|told| loaded.rig.effects.iter().all(|stated| stated.effect != told.effect));
    let text = Rig::with_effects_toml(&loaded.rig_text, &found, DIAGNOSED).map_err(Failure::failed)?;
    let (text, not_told) = with_fitted_effects(&text, &told, &[], TOLD).map_err(Failure::failed)?;
    let refused = left_out(report).map(|(effect, why)| format!("{effect} is left out: {why}"));
    let written = Rig::from_toml(&text).map_err(Failure::failed)?;
    told.retain(|told| written.effects.iter().any(|known| known.effect == told.effect));
    let names = found.iter().map(|f| f.effect).chain(told.iter().map(|t| t.effect.as_str()));
    Ok((text, names.map(String::from).collect(), refused.chain(not_told).collect()))
}

impl Diagnose {
    /// The service's process that this is a job of.
    pub fn job_of(&self) -> Option<u32> {
        self.job
    }

    /// The files that it reads, and those that it writes.
    pub fn named(&self) -> Named {
        let named = self.input.named().writes_toml("-o", self.output.as_deref());
        named.writes("--html", self.html.as_deref())
    }

    /// Does it.
    ///
    /// # Errors
    /// Unreadable input, or an output file that cannot be written.
    pub fn run(self) -> Result<Outcome, Failure> {
        let loaded = self.input.load()?;
        let steps = Steps::new(self.job);
        let diagnosis = diagnosis(&self.input, &loaded, &|step: &str| steps.tell(step))?;
        drop(steps);
        // The result is printed whatever becomes of its files.
        let written = self.write(&diagnosis, &loaded);
        if self.json {
            print_json(&diagnosis.report)?;
        } else {
            print(&render::verdict::text(&diagnosis.report, &loaded.rig))?;
        }
        written.map(|()| Outcome::with_loss(loaded.lossy))
    }

    fn write(&self, diagnosis: &Diagnosis, loaded: &Loaded) -> Result<(), Failure> {
        if let Some(path) = &self.html {
            write_text(path, &render::diagnosis::page(diagnosis, &loaded.rig))?;
            eprintln!("wrote {}", path.display());
        }
        if let Some(path) = &self.output {
            let (text, names, left_out) = adopted(loaded, &diagnosis.report)?;
            write_text(path, &text)?;
            left_out.iter().for_each(|why| eprintln!("{}: {why}", path.display()));
            let names = if names.is_empty() { "nothing".to_string() } else { names.join(", ") };
            eprintln!("wrote {} with {names}", path.display());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use kort_diagnose::report::{Baseline, FittedEffect, ParameterReport, Verdict};

    use super::*;

    #[test]
    fn what_was_told_is_written_as_that_and_named_where_it_is_written() {
        let told = |effect: &str, name: &str, value: f64| FittedEffect {
            effect: effect.into(),
            path: String::new(),
            equation: String::new(),
            parameters: vec![ParameterReport {
                name: name.into(),
                value,
                unit: "1".into(),
                std_error: 1e-3,
                stated: None,
                at_bound: Some(value == 0.0),
            }],
        };
        let effects =
            vec![told("transport_delay", "delay_s", 0.0), told("thrust_sensor_lag", "thrust_lag_s", 0.04)];
        let report = Report {
            schema: String::new(),
            kort_version: String::new(),
            recordings: Vec::new(),
            rig: String::new(),
            seed: 1,
            seconds: 1.0,
            verdict: Verdict::NoMismatch,
            summary: String::new(),
            baseline: Baseline {
                model: String::new(),
                parameters: Vec::new(),
                effects,
                channels: Default::default(),
            },
            mismatch: Vec::new(),
            findings: Vec::new(),
            explanations: Vec::new(),
            remainder: None,
            alternatives: Vec::new(),
            empirical_term: None,
            next_experiment: None,
            notes: Vec::new(),
        };
        let rig_text = include_str!("../../../../config/thrusters/t200.toml").to_owned();
        let rig = Rig::from_toml(&rig_text).unwrap();
        let loaded = Loaded { rig_text, rig, series: Vec::new(), notes: Vec::new(), lossy: false };
        let (text, names, left_out) = adopted(&loaded, &report).unwrap();
        assert_eq!(names, ["thrust_sensor_lag"]);
        assert!(
            left_out.len() == 1 && left_out[0].starts_with("transport_delay is left out"),
            "{left_out:?}"
        );
        assert!(text.contains(TOLD) && !text.contains(DIAGNOSED), "{text}");
    }
}
