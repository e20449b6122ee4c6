//! The default law of every rig beside the plain one, as a table in a page between two marks.

use std::fmt::Write;
use std::path::Path;

use kort_soak::{LawResult, NEVER_WORSE, ScenarioResult, limits};

use super::adoption;
use super::load::DEFAULT;
use super::report::Report;
use crate::failure::{Failure, read_text, write_text};

/// Marks of the comparison's table, and of the adoption's.
const MARKS: [[&str; 2]; 2] = [
    ["<!-- kort soak: begin -->", "<!-- kort soak: end -->"],
    ["<!-- kort soak --adopt: begin -->", "<!-- kort soak --adopt: end -->"],
];

/// Replaces what stands between the marks of a page.
///
/// # Errors
/// The page cannot be read or written, or lacks the marks.
pub fn put_into(path: &Path, report: &Report, seed: u64) -> Result<(), Failure> {
    let page = read_text(path)?;
    let ([begin_mark, end_mark], table) = match &report.adoption {
        None => (MARKS[0], table(report, seed)),
        Some(all) => (MARKS[1], adoption::markdown(all, seed)),
    };
    let (Some(begin), Some(end)) = (page.find(begin_mark), page.find(end_mark)) else {
        return Err(Failure::input(format!(
            "{}: lacks the marks between which the table goes\nhint: write {begin_mark} and {end_mark} on lines of their own",
            path.display()
        )));
    };
    write_text(path, &format!("{}{begin_mark}\n{table}{}", &page[..begin], &page[end..]))
}

/// Rigs down, scenarios across; in each cell the default law and what the drive's limits leave, both over the
/// plain law, means over seeds.
fn table(report: &Report, seed: u64) -> String {
    let mut scenarios: Vec<&ScenarioResult> = Vec::new();
    let mut rigs: Vec<&str> = Vec::new();
    for s in &report.scenarios {
        if !scenarios.iter().any(|x| x.name == s.name) {
            scenarios.push(s);
        }
        if !rigs.contains(&s.rig.as_str()) {
            rigs.push(&s.rig);
        }
    }
    let seeds = report.scenarios.iter().flat_map(|s| &s.laws).map(|l| l.by_seed.len()).max().unwrap_or(0);
    let mut out = format!(
        "\nkort {}; {seeds} seeds from {seed}; {:.0} virtual seconds. `law` (`limits`), both over `velocity_servo`.\n\n| rig |",
        env!("CARGO_PKG_VERSION"),
        report.virtual_seconds
    );
    for s in &scenarios {
        let _ = write!(out, " {} (aim {}) |", s.name, s.aim_of_plain);
    }
    out += "\n| --- |";
    out += &" --- |".repeat(scenarios.len());
    for rig in rigs {
        let _ = write!(out, "\n| `{rig}` |");
        for wanted in &scenarios {
            let found = report.scenarios.iter().find(|s| s.rig == rig && s.name == wanted.name);
            let _ = write!(out, " {} |", found.map_or_else(|| "-".into(), cell));
        }
    }
    out + "\n\n"
}

fn cell(s: &ScenarioResult) -> String {
    let of = |law: Option<&LawResult>| Some(law?.ratio(s.plain()?, "thrust_rms_n")?.mean);
    let Some(law) = of(s.law(DEFAULT)) else { return "-".into() };
    // The law that is told everything is a good one, no proven optimum: where another does better, that is what is left.
    let limits = of(s.law(limits::NAME)).map(|x| x.min(law));
    let left = limits.map_or_else(String::new, |x| format!(" ({x:.2})"));
    // Held to the aim where a law that is told everything reaches it; never worse than the plain law anywhere.
    let held = if limits.is_some_and(|x| x <= s.aim_of_plain) { s.aim_of_plain } else { NEVER_WORSE };
    if law <= held { format!("{law:.2}{left}") } else { format!("**{law:.2}**{left}") }
}
