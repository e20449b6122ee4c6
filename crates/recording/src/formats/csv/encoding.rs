//! Cells as text: UTF-8, and what is none as Windows-1252, the Latin-1 of Western Europe's spreadsheets and instruments.

use csv::ByteRecord;
use encoding_rs::WINDOWS_1252;

use crate::error::{Place, Problem};

/// Takes rows as text, and remembers where one was no UTF-8.
#[derive(Default)]
pub(super) struct Texts {
    other: Option<u64>,
}

impl Texts {
    /// Makes UTF-8 of the cells of a row.
    pub fn take(&mut self, row: &mut ByteRecord, line: u64) -> Result<(), Problem> {
        let is_text = |cell: &[u8]| std::str::from_utf8(cell).is_ok_and(|text| !text.contains('\0'));
        if row.iter().all(is_text) {
            return Ok(());
        }
        let mut cells = ByteRecord::new();
        cells.set_position(row.position().cloned());
        for cell in &*row {
            if is_text(cell) {
                cells.push_field(cell);
                continue;
            }
            let words = WINDOWS_1252.decode_without_bom_handling(cell).0;
            // Signs that it does not have are read as control signs, which no table holds: these bytes are something else.
            if words.chars().any(|c| c.is_control() && !matches!(c, '\t' | '\r' | '\n')) {
                return Err(Problem::NotText { place: Place::Line(line) });
            }
            cells.push_field(words.as_bytes());
        }
        *row = cells;
        self.other.get_or_insert(line);
        Ok(())
    }

    /// What a user should know.
    pub fn note(&self) -> Option<String> {
        self.other.map(|line| {
            format!(
                "text that is no UTF-8 (the first in line {line}) is read as Windows-1252 (Latin-1): if its letters are wrong, save the file as UTF-8"
            )
        })
    }
}
