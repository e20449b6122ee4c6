//! A second header row, as DIAdem, LabVIEW and many loggers write it: the units below the names.

use csv::ByteRecord;

use crate::decimal::{with_comma, with_point};
use crate::log::names::symbol;
use crate::log::stamps::is_time;
use crate::units::{self, Unit};

/// What stands where a column has no unit.
const NONE: [&str; 5] = ["", "-", "--", "1", "#"];

/// The units below these names, one a column, none where there is none; `None` for a row of anything else: a number in it, or
/// words that are no units for the greater part, or below the stamps.
pub(super) fn below(names: &[String], row: &ByteRecord) -> Option<Vec<Option<String>>> {
    if row.len() > names.len() {
        return None;
    }
    let mut units = vec![None; names.len()];
    let (mut known, mut words) = (0, 0);
    for ((place, cell), name) in row.iter().enumerate().zip(names) {
        let cell = bare(std::str::from_utf8(cell).ok()?);
        if NONE.contains(&cell) {
            continue;
        }
        if with_point(cell).is_some() || with_comma(cell).is_some() {
            return None;
        }
        words += 1;
        let unit = symbol(cell);
        known += usize::from(unit.is_some());
        if is_time(name) && unit.is_none_or(|unit| unit.si != "s") {
            return None;
        }
        units[place] = Some(cell.to_owned());
    }
    (known > 0 && 2 * known >= words).then_some(units)
}

/// That such a row was found.
pub(super) fn said(line: u64) -> String {
    format!("line {line} holds units, and is no row")
}

/// Whether each of them is the unit that its column's name ends in.
pub(super) fn as_named(names: &[String], below: &[Option<String>]) -> bool {
    names.iter().zip(below).all(|(name, unit)| {
        let symbol = unit.as_deref().and_then(symbol).map(|unit| unit.symbol);
        unit.is_none() || symbol.is_some() && symbol == units::of_column(name).map(|unit| unit.symbol)
    })
}

/// Words for columns that are read in another unit than stands below their name.
pub(super) fn differ<'a>(
    line: u64,
    names: &[String],
    below: &[Option<String>],
    read: impl Iterator<Item = (&'a str, &'a Unit)>,
) -> Vec<String> {
    let said = |name: &str| {
        let place = names.iter().position(|known| known == name)?;
        below.get(place)?.as_deref().and_then(symbol)
    };
    let other = |(name, unit): (&str, &Unit)| {
        let said = said(name).filter(|said| said.symbol != unit.symbol)?.symbol;
        let read = unit.symbol;
        Some(format!("line {line} of the file has `{name}` in {said}, the column map reads it in {read}"))
    };
    read.filter_map(other).collect()
}

/// Without brackets around it, and without the mark of a comment before the first of the row.
fn bare(cell: &str) -> &str {
    let cell = cell.trim();
    let marked = cell.strip_prefix(['%', '#']).map(str::trim_start);
    let cell = marked.filter(|rest| rest.starts_with(['[', '('])).unwrap_or(cell);
    let within = [('[', ']'), ('(', ')')]
        .into_iter()
        .find_map(|(open, close)| cell.strip_prefix(open)?.strip_suffix(close));
    within.unwrap_or(cell).trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_units_is_told_from_a_row_of_anything_else() {
        let names = ["Time", "n", "F", "label"].map(str::to_owned);
        let of = |cells: &[&str]| below(&names, &ByteRecord::from(cells.to_vec()));
        let wanted = [Some("s"), Some("1/min"), Some("N"), None].map(|unit| unit.map(str::to_owned));
        assert_eq!(of(&["s", "1/min", "N", ""]), Some(wanted.to_vec()));
        assert_eq!(of(&["[s]", " [1/min] ", "(N)", "-"]), Some(wanted.to_vec()));
        assert_eq!(of(&["%[s]", "[1/min]", "[N]", "[#]"]), Some(wanted.to_vec()));
        assert!(of(&["ms", "mV/V", "N"]).is_some(), "one that is not known, and one cell less");
        for other in [
            &["0", "1", "2", "x"][..],
            &["0,5", "rpm", "N", ""],
            &["start", "rpm", "N", ""],
            &["rpm", "rpm", "N", ""],
            &["", "", "", "a1"],
            &["", "", "", ""],
            &["s", "up", "down", "both"],
            &["s", "rpm", "N", "", ""],
        ] {
            assert_eq!(of(other), None, "{other:?}");
        }
    }
}
