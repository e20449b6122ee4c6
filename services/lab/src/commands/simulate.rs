//! `kort simulate`: a recording from a model, with the stand's sensors.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use clap::Args as ClapArgs;
use kort_recording::{Column, Format, Recording, TOPIC, Writer};
use kort_scenario::{Replayed, Replays, Run, Scenario};
use serde::Serialize;

use crate::check::Kind;
use crate::failure::{Failure, Outcome, print, print_json};
use crate::outputs::Named;
use crate::{files, progress};

/// Arguments of `kort simulate`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Example: kort simulate --rig whitcomb-yoerger-1999 --scenario identification-prbs -o prbs.csv
         kort simulate --rig my-rig.toml --scenario report.json -o next.mcap

A scenario is a TOML or JSON file, the JSON report of kort diagnose (its next experiment is run), or
the name of a shipped one: chirp, identification-prbs, identification-random-levels, joystick-replay,
multisine, slow-reversal-ramp, staircase, torque-step-9.2, torque-steps-18, tow.")]
pub struct Args {
    /// Rig description: a file, or the name of a shipped one
    #[arg(long, value_name = "RIG")]
    rig: PathBuf,
    /// What is run: a file, or the name of a shipped scenario
    #[arg(long, value_name = "FILE")]
    scenario: PathBuf,
    /// The recording to write: .csv, .csv.gz, .mcap or .parquet
    #[arg(short, long, value_name = "REC")]
    output: PathBuf,
    /// Seed of noise and random signals, before the scenario's
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Factor on the usual sensor noise, before the scenario's; 0 is off
    #[arg(long, value_name = "FACTOR")]
    noise: Option<f64>,
    /// Print what was written as one JSON document
    #[arg(long)]
    json: bool,
}

impl Args {
    /// The files that it reads, and those that it writes.
    pub fn named(&self) -> Named {
        let named = Named::default().reads_rig(Some(&self.rig)).reads("scenario", &self.scenario);
        named.writes("-o", Some(&self.output))
    }
}

#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    kort_version: &'static str,
    recording: String,
    rig: &'a str,
    scenario: &'a str,
    model: &'static str,
    seed: u64,
    rows: u64,
    duration_s: f64,
    columns: Vec<&'static str>,
}

/// Runs it.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    let format = Format::of(&args.output).map_err(Failure::input)?;
    let rig = files::read_rig(&args.rig)?;
    let mut scenario = read_scenario(&args.scenario)?;
    scenario.seed = args.seed.unwrap_or(scenario.seed);
    if let Some(noise) = args.noise.filter(|noise| !(noise.is_finite() && *noise >= 0.0)) {
        return Err(Failure::input(format!(
            "--noise {noise}: allowed is 0 (off) or a factor above 0\nhint: 1 is the usual noise of the rig's sensors"
        )));
    }
    scenario.noise = args.noise.unwrap_or(scenario.noise);
    let mut files = Files::beside(&args.scenario);
    let mut run =
        Run::new(&scenario, &rig, &mut files).map_err(|wrong| Failure::in_file_all(&args.scenario, wrong))?;
    let columns = run.columns().to_vec();
    let replayed =
        files.read.iter().fold(Named::default(), |named, file| named.reads("replayed recording", file));
    replayed.writes("-o", Some(&args.output)).check()?;
    let duration_s = write(&mut run, format, &args.output)?;
    let report = Report {
        schema: "kort.simulate/1",
        kort_version: env!("CARGO_PKG_VERSION"),
        recording: args.output.display().to_string(),
        rig: &rig.name,
        scenario: &scenario.name,
        model: scenario.model.name(),
        seed: scenario.seed,
        rows: run.rows(),
        duration_s,
        columns,
    };
    if args.json {
        print_json(&report)?;
    } else {
        let Report { recording, rows, model, .. } = &report;
        print(&format!(
            "{recording}: {rows} rows, {duration_s} s of {model}: {}\n",
            report.columns.join(", ")
        ))?;
    }
    Ok(Outcome::with_loss(files.lost))
}

/// The same in memory: a recording as `kort simulate` writes it, of a scenario's text in TOML or JSON.
///
/// # Errors
/// [`Failure`] names the file, the key and what is allowed.
pub fn recording(
    rig: &Path,
    scenario: &Path,
    text: &str,
    seed: Option<u64>,
    noise: Option<f64>,
) -> Result<Recording, Failure> {
    let rig = files::read_rig(rig)?;
    let mut wanted =
        Scenario::from_text_with_all(text).map_err(|wrong| Failure::in_file_all(scenario, wrong))?;
    wanted.seed = seed.unwrap_or(wanted.seed);
    wanted.noise = noise.unwrap_or(wanted.noise);
    let mut files = Files::beside(scenario);
    let mut run =
        Run::new(&wanted, &rig, &mut files).map_err(|wrong| Failure::in_file_all(scenario, wrong))?;
    let names = run.columns().to_vec();
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); names.len()];
    let (mut time_s, mut values) = (Vec::new(), Vec::new());
    while let Some(now_s) = run.next_row(&mut values) {
        time_s.push(now_s);
        for (column, value) in columns.iter_mut().zip(&values) {
            column.push(*value);
        }
    }
    drop(run);
    let columns = names.into_iter().zip(columns).map(|(name, values)| Column::new(name, values)).collect();
    let losses = files.lost.then(|| "the replayed recording had losses".to_string()).into_iter().collect();
    Ok(Recording { name: wanted.name, time_s, columns, losses, ..Recording::default() })
}

/// Writes the rows; nothing half-written stays behind when that fails.
fn write(run: &mut Run, format: Format, path: &Path) -> Result<f64, Failure> {
    let bar = progress::bar(run.rows(), "simulating");
    let mut go = || -> std::io::Result<f64> {
        let output = BufWriter::new(File::create(path)?);
        let mut writer = Writer::create(format, TOPIC, run.columns(), output)?;
        let (mut values, mut last_s) = (Vec::new(), 0.0);
        while let Some(time_s) = run.next_row(&mut values) {
            writer.row(time_s, &values)?;
            bar.inc(1);
            last_s = time_s;
        }
        writer.finish()?;
        Ok(last_s)
    };
    let done = go().map_err(|e| {
        let _ = std::fs::remove_file(path);
        Failure::unwritten(path, e)
    });
    drop(bar);
    done
}

/// A scenario in TOML or JSON, or the next experiment of a diagnosis report.
fn read_scenario(wanted: &Path) -> Result<Scenario, Failure> {
    let text = files::scenario_text(wanted)?;
    if text.parse().is_ok_and(|table| Kind::of(&table) == Kind::Soak) {
        let file = wanted.display();
        return Err(Failure::input(format!(
            "{file}: this is a scenario of kort soak, which runs controllers; kort simulate takes a test signal, [[segments]]\nhint: kort soak {file}"
        )));
    }
    Scenario::from_text_with_all(&text).map_err(|wrong| Failure::in_file_all(wanted, wrong))
}

/// Replays from files and built-in recordings.
pub(crate) struct Files {
    beside: Option<PathBuf>,
    lost: bool,
    /// Recordings that were read.
    read: Vec<PathBuf>,
}

impl Files {
    /// Those that a scenario's file names.
    pub(crate) fn beside(scenario: &Path) -> Self {
        Self { beside: scenario.parent().map(Path::to_path_buf), lost: false, read: Vec::new() }
    }
}

impl Replays for Files {
    fn column(&mut self, name: &str, column: &str, columns: Option<&str>) -> Result<Replayed, String> {
        let map = files::read_columns(columns).map_err(|e| e.to_string())?;
        let recording = files::replayed_recording(name, self.beside.as_deref(), map.as_ref())
            .map_err(|e| e.to_string())?;
        self.lost |= !recording.losses.is_empty();
        self.read.push(PathBuf::from(&recording.name));
        let Some(values) = recording.column(column) else {
            let names: Vec<&str> = recording.columns.iter().map(|c| c.name.as_str()).collect();
            return Err(format!("{name} has no column `{column}`\nhint: it has {}", names.join(", ")));
        };
        let start = recording.time_s[0];
        let (time_s, values) = recording
            .time_s
            .iter()
            .zip(values)
            .filter(|(_, v)| !v.is_nan())
            .map(|(t, v)| (t - start, *v))
            .unzip();
        Ok(Replayed { time_s, values })
    }
}
