//! Where a table has less, or more, than rows of cells below names: no names at all, and a separator at the end of each row.

use csv::ByteRecord;

use super::opening::{self, DELIMITERS};

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
