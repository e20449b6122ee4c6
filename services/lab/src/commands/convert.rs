//! `kort convert`: a recording, or a log of others through a column map, in another format.

use std::path::PathBuf;

use kort_recording::columns::{find, known};
use kort_recording::{Format, Recording};
use serde::Serialize;

use crate::failure::{Failure, Outcome, print, print_json};
use crate::files;
use crate::outputs::Named;

const EXAMPLE: &str = "\
Example: kort convert flight.ulg --columns px4:motor=2 -o flight.parquet
         kort convert run.mcap -o run.csv";

/// Write a recording, or a log of others through a column map, in another format
///
/// Columns are SI whatever the log had. Parquet and MCAP carry units and meanings; Parquet is written, not read.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLE)]
pub struct Args {
    /// The recording or log
    #[arg(value_name = "REC")]
    recording: PathBuf,
    /// Column map of a log of others: a shipped one or a TOML file (`kort columns` proposes one)
    #[arg(long, value_name = "MAP")]
    columns: Option<String>,
    /// The file to write: .csv, .csv.gz, .mcap or .parquet
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Print one JSON document (kort.convert/1)
    #[arg(long)]
    json: bool,
}

impl Args {
    /// The files that it reads, and those that it writes.
    pub fn named(&self) -> Named {
        let named = Named::default().reads("recording", &self.recording).reads_map(self.columns.as_deref());
        named.writes("-o", Some(&self.output))
    }
}

/// What was written.
#[derive(Debug, Serialize)]
struct Written<'r> {
    schema: &'static str,
    /// What was read.
    file: String,
    /// What was written.
    output: String,
    rows: usize,
    from_s: Option<f64>,
    to_s: Option<f64>,
    columns: Vec<WrittenColumn<'r>>,
    /// Columns of the log that the map does not take, and those that stay and nothing knows.
    unused: Vec<&'r str>,
    notes: &'r [String],
    losses: &'r [String],
}

#[derive(Debug, Serialize)]
struct WrittenColumn<'r> {
    name: &'r str,
    /// Of a column that kort knows.
    unit: Option<&'static str>,
    /// Rows with a value in it.
    samples: usize,
}

impl<'r> Written<'r> {
    fn of(args: &Args, recording: &'r Recording) -> Self {
        let columns = recording.columns.iter().map(|column| WrittenColumn {
            name: &column.name,
            unit: known().find(|known| known.name == column.name).map(|known| known.unit),
            samples: column.samples(),
        });
        Self {
            schema: "kort.convert/1",
            file: args.recording.display().to_string(),
            output: args.output.display().to_string(),
            rows: recording.rows(),
            from_s: recording.time_s.first().copied(),
            to_s: recording.time_s.last().copied(),
            columns: columns.collect(),
            unused: unused(recording).collect(),
            notes: &recording.notes,
            losses: &recording.losses,
        }
    }
}

/// Columns that nothing uses: left out by the map, or kept under a name of their own.
fn unused(recording: &Recording) -> impl Iterator<Item = &str> {
    let columns = recording.columns.iter().map(|column| column.name.as_str());
    let left_out = recording.unused.iter().map(String::as_str);
    // What a log states that was measured beside the drive has names that the contract leaves out.
    let beside = |name: &str| matches!(name, "supply_current_a" | "power_w" | "torque_enable");
    left_out.chain(columns.filter(move |name| find(name).is_none() && !beside(name)))
}

/// Does it.
///
/// # Errors
/// The log cannot be read, or the file cannot be written.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    Format::of(&args.output).map_err(Failure::input)?;
    let map = files::read_columns(args.columns.as_deref())?;
    let recording = files::read_recording(&args.recording, map.as_ref())?;
    let unknown: Vec<&str> = unused(&recording).collect();
    if !unknown.is_empty() {
        eprintln!("columns not used: {}", unknown.join(", "));
    }
    recording.save(&args.output).map_err(Failure::failed)?;
    if args.json {
        print_json(&Written::of(args, &recording))?;
        return Ok(Outcome::with_loss(!recording.losses.is_empty()));
    }
    let names: Vec<&str> = recording.columns.iter().map(|column| column.name.as_str()).collect();
    print(&format!("{}: {} rows of {}\n", args.output.display(), recording.rows(), names.join(", ")))?;
    Ok(Outcome::with_loss(!recording.losses.is_empty()))
}
