//! The column of stamps of a table: how it is known, and what a proposed column map says of it.

use std::fmt::Write;

use super::Log;
use super::propose::{unit_in, unit_of, words};
use crate::dates;

/// Whether a table's column looks like its stamps.
pub(crate) fn is_time(name: &str) -> bool {
    let names = words(name);
    const TIME: &[&str] = &[
        "time",
        "timestamp",
        "stamp",
        "t",
        "ms",
        "us",
        "millis",
        "micros",
        "zeit",
        "zeitstempel",
        "messzeit",
    ];
    names.first().is_some_and(|first| TIME.contains(&first.as_str()))
        || unit_in(name).is_some_and(|u| u.si == "s") && names.iter().any(|n| TIME.contains(&n.as_str()))
}

/// Factor to seconds of a table's stamps, if their name says it.
pub(crate) fn time_factor(name: &str) -> Option<f64> {
    let first = words(name).into_iter().next().unwrap_or_default();
    match first.as_str() {
        "ms" | "millis" => Some(1e-3),
        "us" | "micros" => Some(1e-6),
        _ => unit_in(name).filter(|u| u.si == "s").map(|u| u.factor),
    }
}

/// What stands below `[time]` in a map for this table.
pub(super) fn proposed(log: &Log) -> String {
    let topic = &log.topics[0];
    let dated = |unit: &Option<String>| unit.as_deref() == Some(dates::UNIT);
    let stamps = topic.fields.iter().find(|field| dated(&field.unit));
    let Some(stamps) = stamps.or_else(|| topic.fields.iter().find(|field| is_time(&field.name))) else {
        return "# source = \"…\"   no column looks like a time stamp; settle_s = 2.0 instead for settled points\n".into();
    };
    let mut out = format!("source = {:?}\n", stamps.name);
    match (&log.dates, unit_of(stamps).filter(|unit| unit.si == "s")) {
        (Some(dates), _) => {
            let _ = write!(out, "unit = {:?}\n{}", dates::UNIT, dates.proposed());
        }
        (None, Some(unit)) => {
            let _ = writeln!(out, "unit = {:?}", unit.symbol);
        }
        (None, None) => out += "# unit = \"…\"   the log does not say it: s, ms, us or ns\n",
    }
    if topic.stale > topic.stamps_s.len() as u64 {
        out += "# stale_rows = \"drop\"   would leave the lesser part of the rows, since they come faster than their stamps can tell\n";
    } else if log.resets > 0 || topic.stale > 0 {
        out += "stale_rows = \"drop\"   # there are such rows; where the clock begins anew the longest stretch is read\n";
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_of_stamps_is_known_by_its_name() {
        assert!(is_time("ms_today") && is_time("t_s") && is_time("Time") && !is_time("temp"));
        assert!(
            is_time("Zeit") && is_time("Zeit [s]") && is_time("Time (ms)") && is_time("Elapsed Time (s)")
        );
        assert_eq!(time_factor("ms_today"), Some(1e-3));
        assert_eq!(time_factor("Time"), None);
    }
}
