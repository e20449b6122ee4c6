//! The column of stamps of a table: how it is known, and what a proposed column map says of it.

use std::fmt::Write;

use super::names::{unit_in, unit_of, words};
use super::rules::{PULSES, has};
use super::{Field, Log};
use crate::dates;

/// Whether a table's column looks like its stamps.
pub(crate) fn is_time(name: &str) -> bool {
    let names = words(name);
    const TIME: &[&str] = &["time", "timestamp", "stamp", "t", "ms", "us", "millis", "micros"];
    names.first().is_some_and(|first| TIME.contains(&first.as_str()))
        || unit_in(name).is_some_and(|u| u.si == "s") && names.iter().any(|n| TIME.contains(&n.as_str()))
}

/// Whether nothing but the unit in its name speaks for a column of stamps; a pulse for a speed controller has one too.
pub(crate) fn is_time_by_unit(name: &str) -> bool {
    unit_in(name).is_some_and(|unit| unit.si == "s") && !has(&words(name), PULSES)
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
    let of_unit = |unit: &str| topic.fields.iter().find(|field| field.unit.as_deref() == Some(unit));
    let (date, of_day) = (of_unit(dates::UNIT), of_unit(dates::OF_DAY));
    let named = || topic.fields.iter().find(|field| is_time(&field.name) && field.samples > 0);
    let by_unit = || topic.fields.iter().find(|field| is_stamp(field));
    let Some(stamps) = date.or(of_day).or_else(named).or_else(by_unit) else {
        return "# source = \"…\"   no column looks like a time stamp; settle_s = 2.0 instead for settled points\n".into();
    };
    let mut out = format!("source = {:?}\n", stamps.name);
    match (&log.dates, unit_of(stamps).filter(|unit| unit.si == "s")) {
        (Some(_), _) if date.is_none() => {
            let _ = writeln!(out, "unit = {:?}", dates::OF_DAY);
        }
        (Some(dates), _) => {
            let _ = writeln!(out, "unit = {:?}", dates::UNIT);
            if let Some(of_day) = of_day {
                let _ = writeln!(out, "time_of_day = {:?}", of_day.name);
            }
            out += &dates.proposed();
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

fn is_stamp(field: &Field) -> bool {
    let pulse = has(&words(&field.name), PULSES);
    !pulse && field.samples > 0 && unit_of(field).is_some_and(|unit| unit.si == "s")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_of_stamps_is_known_by_its_name() {
        assert!(is_time("ms_today") && is_time("t_s") && is_time("Time") && !is_time("temp"));
        assert!(
            is_time("Zeit")
                && is_time("Tiempo (s)")
                && is_time("Zeit [s]")
                && is_time("Time (ms)")
                && is_time("Elapsed Time (s)")
        );
        assert!(is_time_by_unit("elapsed (s)") && !is_time_by_unit("ESC signal (µs)"));
        assert_eq!(time_factor("ms_today"), Some(1e-3));
        assert_eq!(time_factor("Time"), None);
    }
}
