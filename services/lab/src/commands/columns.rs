//! `kort columns`: what is in a log, with units where it says them, and the column map that would bring it in.

use std::fmt::Write;
use std::path::PathBuf;

use kort_recording::Recording;
use kort_recording::log::{FieldSurvey, Survey, TopicSurvey, survey};

use crate::failure::{Failure, Outcome, print, print_json, write_text};
use crate::outputs::Named;
use crate::progress;

const EXAMPLE: &str = "\
Example: kort columns flight.ulg
         kort columns bench.csv -o my-bench.toml
         kort diagnose bench.csv --rig t200 --columns my-bench.toml";

/// Say what is in a log, and propose a column map for it
///
/// Of every kind of message: how many, at which rate, from when to when, with what gaps; of every field: its unit, where
/// the log or its name says one, and its range. A shipped map that fits is named; where none does, a map is proposed
/// from names and units, for a person to check; for a table without names, the frame of one.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLE)]
pub struct Args {
    /// The log, plain or gzip: PX4 ULog, ArduPilot DataFlash, ROS 2 bag (MCAP or sqlite), Betaflight blackbox, candump, MCAP with JSON, or CSV with commas,
    /// semicolons or tabs
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// List the fields of every kind of message, not only of those that look like a thruster's
    #[arg(long)]
    fields: bool,
    /// Write the proposed map, for --columns
    #[arg(short = 'o', long = "output", value_name = "MAP")]
    output: Option<PathBuf>,
    /// Print one JSON document (kort.columns/1)
    #[arg(long)]
    json: bool,
}

impl Args {
    /// The files that it reads, and those that it writes.
    pub fn named(&self) -> Named {
        Named::default().reads("log", &self.log).writes_toml("-o", self.output.as_deref())
    }
}

/// Does it.
///
/// # Errors
/// The log cannot be read, or nothing in it can be proposed where a map was asked for.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    let file = Recording::open(&args.log).map_err(Failure::input)?;
    let size = file.metadata().map_or(0, |m| m.len());
    let name = args.log.display().to_string();
    let bar = progress::bytes(size, name.clone());
    let found = survey(&name, bar.wrap_read(file));
    drop(bar);
    let found = found.map_err(Failure::input)?;
    for loss in &found.losses {
        eprintln!("{name}: lost: {loss}");
    }
    if args.json {
        print_json(&found)?;
    } else {
        print(&text(&found, args.fields))?;
    }
    if let Some(path) = &args.output {
        let map = found.proposal.map.as_deref().ok_or_else(|| {
            Failure::input(format!(
                "{name}: there is no map to propose{}\nhint: docs/recordings.md shows how one is written",
                if found.proposal.native { ": the log is a recording of kort already" } else { "" }
            ))
        })?;
        write_text(path, map)?;
    }
    Ok(Outcome::with_loss(!found.losses.is_empty()))
}

fn text(found: &Survey, all: bool) -> String {
    let mut out = format!("{}: {}", found.file, found.format);
    if let Some(duration_s) = found.duration_s {
        let _ = write!(out, ", {duration_s:.1} s");
    }
    let _ = writeln!(out, "\nstamps: {}", found.clock);
    if found.resets > 0 {
        let what = if found.proposal.native {
            "kort reads no recording of its own like this: part it there"
        } else {
            "the longest stretch is read"
        };
        let _ = writeln!(out, "the clock begins anew {} time(s): {what}", found.resets);
    }
    for note in &found.notes {
        let _ = writeln!(out, "note: {note}");
    }
    for topic in &found.topics {
        out += &topic_text(topic, all || topic.name.is_empty());
    }
    out + &proposal(found)
}

fn topic_text(topic: &TopicSurvey, all: bool) -> String {
    let name = if topic.name.is_empty() { "rows" } else { &topic.name };
    let mut out = format!("\n{name}: {}", topic.messages);
    if topic.messages_read != topic.messages {
        let _ = write!(out, ", of which {} are read,", topic.messages_read);
    }
    if let Some(rate_hz) = topic.rate_hz {
        let _ = write!(out, " at {rate_hz:.1} Hz");
    }
    if let (Some(from_s), Some(to_s)) = (topic.from_s, topic.to_s) {
        let _ = write!(out, ", {from_s:.3} to {to_s:.3} s");
    }
    if let Some(gap) = &topic.longest_gap {
        let _ = write!(out, ", {} gap(s), the longest {:.3} to {:.3} s", topic.gaps, gap.from_s, gap.to_s);
    }
    if !all && topic.fields.iter().all(|field| field.column.is_none()) {
        return out + &format!("; {} field(s)", topic.fields.len());
    }
    let width = topic.fields.iter().map(|field| field.source.chars().count()).max().unwrap_or(0);
    for field in &topic.fields {
        let _ = write!(out, "\n  {:width$}  {:8}{}", field.source, unit(field), range(field));
    }
    out + "\n"
}

/// A unit that only the name claims has a question mark.
fn unit(field: &FieldSurvey) -> String {
    match (&field.unit, field.unit_from) {
        (Some(unit), Some("name")) => format!("{unit}?"),
        (Some(unit), _) => unit.clone(),
        (None, _) => "-".into(),
    }
}

fn range(field: &FieldSurvey) -> String {
    let mut out = match (field.min, field.max) {
        (Some(min), Some(max)) => format!(" {} to {}", short(min), short(max)),
        _ if field.texts > 0 => " text".into(),
        _ => " no number".into(),
    };
    if let Some(column) = &field.column {
        let _ = write!(out, "  -> {column}");
    }
    out
}

/// Six digits, as short as they go.
fn short(value: f64) -> String {
    if value != 0.0 && !(1e-4..1e9).contains(&value.abs()) {
        return format!("{value:.5e}");
    }
    let text = format!("{value:.*}", (5 - value.abs().max(1.0).log10() as i32).max(0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

fn proposal(found: &Survey) -> String {
    let mut out = String::from("\n");
    if found.proposal.native {
        let refused = found.resets > 0 || found.losses.iter().any(|lost| lost.contains("is refused for it"));
        let _ = if refused {
            writeln!(
                out,
                "a recording of kort by its names, which is refused as it is for what is said above{}",
                if found.proposal.map.is_some() {
                    ": mend that, or bring it in by the map below"
                } else {
                    ""
                }
            )
        } else {
            writeln!(out, "a recording of kort: no map is needed\n  kort diagnose {} --rig RIG", found.file)
        };
    }
    for name in &found.proposal.shipped {
        let file = &found.file;
        for example in found.proposal.examples.iter().filter(|example| example.map == *name) {
            let (key, value, meaning) = (&example.key, &example.value, &example.meaning);
            let _ = writeln!(out, "{key}={value} below is an example: write yours in its place ({meaning})");
        }
        for still in found.proposal.still.iter().filter(|still| still.map == *name) {
            let (column, source, value) = (&still.column, &still.source, short(still.value));
            let _ = writeln!(
                out,
                "{name} fits by its names, but {column} never changes in this log: {source} is {value} throughout"
            );
        }
        let _ = if found.proposal.without_response.contains(name) {
            writeln!(
                out,
                "a shipped map fits, without a measured response: nothing to diagnose, but to convert or replay\n  kort convert {file} --columns {name} -o REC.csv"
            )
        } else {
            writeln!(out, "a shipped map fits\n  kort diagnose {file} --rig RIG --columns {name}")
        };
    }
    for part in &found.proposal.incomplete {
        let _ = writeln!(out, "a shipped map fits in part: {}\n  has    {}", part.map, part.has.join(", "));
        for lack in &part.lacks {
            let _ = writeln!(out, "  lacks  {}: there is no {} in it", lack.column, lack.source);
        }
    }
    match &found.proposal.map {
        Some(map) => {
            out += "a map from what it says of its columns, to be checked and filled in where a line has a # (-o MAP writes it):\n\n";
            for line in map.lines() {
                let _ = writeln!(out, "  {line}");
            }
        }
        None if !found.proposal.native
            && found.proposal.shipped.is_empty()
            && found.proposal.incomplete.is_empty() =>
        {
            out += &nothing(found);
        }
        None => {}
    }
    out
}

/// Why there is nothing to propose.
fn nothing(found: &Survey) -> String {
    let rows = found.topics.iter().map(|topic| topic.messages).max().unwrap_or(0);
    let unchanging = &found.proposal.unchanging;
    if rows < 2 {
        return format!(
            "there are {rows} row(s) in it, and at least 2 are needed: was the logger stopped too early?\n"
        );
    }
    if !unchanging.is_empty() {
        return format!(
            "{} never change in it, and nothing else has the name of a signal of a thruster; docs/recordings.md shows how a map is written\n",
            unchanging.join(", ")
        );
    }
    "nothing in it has the name of a signal of a thruster; docs/recordings.md shows how a map is written\n"
        .into()
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn numbers_are_short_and_true() {
        for (value, text) in [
            (0.0, "0"),
            (1500.0, "1500"),
            (-12.345678, "-12.3457"),
            (1e-7, "1.00000e-7"),
            (0.25, "0.25"),
            (123456.7, "123457"),
        ] {
            assert_eq!(short(value), text);
        }
    }
}
