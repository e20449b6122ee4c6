//! Where a table has less, or more, than rows of cells below names: no names at all, names without cells, names once more
//! among the rows, and a separator at the end of each row.

use csv::ByteRecord;

use super::opening::{self, DELIMITERS};
use crate::error::Problem;
use crate::map::ColumnMap;

/// How a column is called that has no name.
pub(super) fn by_place(place: usize) -> String {
    format!("column_{place}")
}

/// Whether a row is one of numbers only, where the names should stand.
fn is_nameless(row: &ByteRecord) -> bool {
    let filled = opening::filled(row);
    filled > 0 && opening::numbers(row) == filled
}

/// That it was.
pub(super) fn said(line: u64) -> String {
    format!(
        "line {line} holds numbers where the names of the columns should stand: it is taken for a row, and the columns are called column_1, column_2 and so on, from the left"
    )
}

/// Takes out of a header the names that the map says no row has a cell for; what a user should know of it.
pub(super) fn without_cells(
    header: &mut Vec<String>,
    map: Option<&ColumnMap>,
) -> Result<Option<String>, Problem> {
    let Some(map) = map.filter(|map| !map.without_cells.is_empty()) else { return Ok(None) };
    for name in &map.without_cells {
        let Some(place) = header.iter().position(|known| known == name) else {
            return Err(Problem::MappedColumnMissing {
                map: map.name.clone(),
                column: name.clone(),
                found: header.join(", "),
                hint: "`without_cells` lists names of the header that no row has a cell for; an empty one is called as `kort columns LOG` shows it".into(),
            });
        };
        header.remove(place);
    }
    Ok(Some(format!("no row has a cell for {}, as the column map says", map.without_cells.join(", "))))
}

/// Which names of a header may be those without cells, where all rows have so many: names that are empty, if they are as many
/// as are too many, else the last ones. It is for a person to say.
pub(super) fn perhaps_without(names: &[String], cells: usize) -> Vec<String> {
    let empty = || (1..=names.len()).filter(|place| names[place - 1].is_empty());
    if empty().count() + cells == names.len() {
        return empty().map(|place| format!("(column {place})")).collect();
    }
    names[cells..].to_vec()
}

/// That a header is longer than all rows.
pub(super) fn said_longer(names: &[String], beyond: &[String]) -> String {
    format!(
        "the header names {} columns, every row has {} cells, and nothing shows which of the names has none: below, those at the end; mend the header, or say it in a column map: without_cells = {beyond:?}",
        names.len(),
        names.len() - beyond.len(),
    )
}

/// The names of a table, and the units below them if there are, once more among its rows: a logger that was started anew.
pub(super) struct Repeats {
    rows: Vec<ByteRecord>,
    found: u64,
    first: u64,
}

impl Repeats {
    /// Of these rows, as the file has them.
    pub fn of(rows: Vec<ByteRecord>) -> Self {
        Self { rows, found: 0, first: 0 }
    }

    /// Whether a row is one of them.
    pub fn is(&mut self, row: &ByteRecord, line: u64) -> bool {
        let same =
            |known: &ByteRecord| known.iter().map(<[u8]>::trim_ascii).eq(row.iter().map(<[u8]>::trim_ascii));
        let is = self.rows.iter().any(same);
        if is {
            self.found += 1;
            self.first = if self.found == 1 { line } else { self.first };
        }
        is
    }

    /// What a user should know.
    pub fn note(&self) -> Option<String> {
        let (rows, line) = (self.found, self.first);
        (rows > 0).then(|| {
            format!("{rows} row(s), the first in line {line}, hold the header once more, as where a logger was started anew, and are passed over")
        })
    }
}

/// A separator at the end of the rows where none stands behind the names: the table's own, or another of those in use.
pub(super) struct Ends {
    width: usize,
    delimiter: u8,
    cut: u64,
}

impl Ends {
    /// For the rows below these names, and whether they are none but the first of the rows.
    pub fn of(first: &mut ByteRecord, delimiter: u8) -> (Self, bool) {
        let names = Self { width: first.len(), delimiter, cut: 0 };
        let mut row = first.clone();
        let mut ends = Self { width: first.len(), delimiter, cut: 0 };
        if row.len() > 1 && row.get(row.len() - 1).is_some_and(|cell| cell.trim_ascii().is_empty()) {
            ends.width -= 1;
        }
        ends.cut(&mut row);
        if !is_nameless(&row) {
            return (names, false);
        }
        *first = row;
        (ends, true)
    }

    /// Where some of the names have no cells.
    pub fn narrow(&mut self, width: usize) {
        self.width = width;
    }

    /// Takes it away.
    pub fn cut(&mut self, row: &mut ByteRecord) {
        if row.len() == self.width + 1 && row.get(self.width).is_some_and(|cell| cell.trim_ascii().is_empty())
        {
            row.truncate(self.width);
            self.cut += 1;
        } else if let Some(bare) = self.bare(row) {
            let mut cells: ByteRecord = row.iter().take(self.width - 1).collect();
            cells.push_field(&bare);
            cells.set_position(row.position().cloned());
            *row = cells;
            self.cut += 1;
        }
    }

    /// The last cell without a sign that ends it, where that leaves a number or nothing.
    fn bare(&self, row: &ByteRecord) -> Option<Vec<u8>> {
        let cell = row.get(self.width.checked_sub(1)?).filter(|_| row.len() == self.width)?.trim_ascii();
        let (sign, bare) = cell.split_last()?;
        let other = *sign != self.delimiter && DELIMITERS.contains(sign);
        (other && (bare.is_empty() || opening::is_number(std::str::from_utf8(bare).ok()?.trim())))
            .then(|| bare.to_vec())
    }

    /// What a user should know.
    pub fn note(&self) -> Option<String> {
        let rows = self.cut;
        (rows > 0).then(|| format!("{rows} row(s) end with a separator, which begins no column"))
    }
}
