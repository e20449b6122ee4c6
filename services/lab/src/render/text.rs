//! Plain text for a terminal: headings, wrapped items, aligned tables.

use std::collections::BTreeMap;

use kort_diagnose::report::{ChannelReport, ParameterReport};
use kort_thruster::rig::Rig;

use super::number;

const WIDTH: usize = 100;

/// A growing text report.
pub struct Sheet {
    text: String,
}

impl Sheet {
    /// Starts with a title line.
    pub fn new(title: &str) -> Self {
        Self { text: format!("{title}\n") }
    }

    /// A heading after an empty line.
    pub fn heading(&mut self, text: &str) {
        self.text.push_str(&format!("\n{text}\n"));
    }

    /// A paragraph.
    pub fn paragraph(&mut self, text: &str) {
        self.wrapped(text, "", "");
    }

    /// An item of a list; a hint in it begins a line.
    pub fn item(&mut self, text: &str) {
        let (said, hint) = text.split_once("\nhint:").unwrap_or((text, ""));
        self.wrapped(said, "  - ", "    ");
        if !hint.is_empty() {
            self.more(&format!("hint:{hint}"));
        }
    }

    /// Goes on under an item.
    pub fn more(&mut self, text: &str) {
        self.wrapped(text, "    ", "    ");
    }

    /// A table; the first column stands left, numbers right.
    pub fn table(&mut self, head: &[&str], rows: &[Vec<String>]) {
        let cell = |row: &[String], i: usize| row.get(i).cloned().unwrap_or_default();
        let widths: Vec<usize> = (0..head.len())
            .map(|i| {
                rows.iter()
                    .map(|r| cell(r, i).chars().count())
                    .max()
                    .unwrap_or(0)
                    .max(head[i].chars().count())
            })
            .collect();
        let head: Vec<String> = head.iter().map(|h| (*h).to_string()).collect();
        for row in std::iter::once(head.as_slice()).chain(rows.iter().map(Vec::as_slice)) {
            let mut line = String::from("  ");
            for (i, width) in widths.iter().enumerate() {
                let text = cell(row, i);
                let fill = " ".repeat(width - text.chars().count());
                if i == 0 { line += &(text + &fill) } else { line += &format!("  {fill}{text}") }
            }
            self.text.push_str(line.trim_end());
            self.text.push('\n');
        }
    }

    fn wrapped(&mut self, text: &str, first: &str, rest: &str) {
        let mut line = first.to_string();
        let mut empty = true;
        for word in text.split_whitespace() {
            if !empty && line.chars().count() + 1 + word.chars().count() > WIDTH {
                self.text.push_str(&line);
                self.text.push('\n');
                line = rest.to_string();
                empty = true;
            }
            if !empty {
                line.push(' ');
            }
            line.push_str(word);
            empty = false;
        }
        self.text.push_str(&line);
        self.text.push('\n');
    }

    /// The report.
    pub fn into_text(self) -> String {
        self.text
    }
}

/// Errors of each channel as percent of full scale: fitted rows, held-out rows, noise alone, white.
pub fn error_rows(channels: &BTreeMap<String, ChannelReport>) -> Vec<Vec<String>> {
    let percent = |x: f64| format!("{:.3}", 100.0 * x);
    channels
        .iter()
        .map(|(name, c)| {
            vec![
                name.clone(),
                percent(c.nrmse_train),
                percent(c.nrmse_heldout),
                percent(c.noise_floor),
                if c.white { "yes" } else { "no" }.into(),
            ]
        })
        .collect()
}

/// Rows of a table of parameters: name, stated, fitted, standard error, unit, moved, remark.
pub fn parameter_rows(parameters: &[ParameterReport], rig: &Rig) -> Vec<Vec<String>> {
    parameters
        .iter()
        .map(|p| {
            vec![
                p.name.clone(),
                p.stated.map_or_else(|| "-".into(), number),
                number(p.value),
                number(p.std_error),
                p.unit.clone(),
                super::verdict::moved(p, rig),
                if p.at_bound == Some(true) { "at its bound" } else { "" }.into(),
            ]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_words_and_tables_stay_aligned() {
        let mut sheet = Sheet::new("t");
        sheet.item(&"word ".repeat(40));
        sheet.table(&["", "a"], &[vec!["x".into(), "1.5".into()], vec!["longer".into(), "10".into()]]);
        let text = sheet.into_text();
        assert!(text.lines().all(|l| l.chars().count() <= WIDTH));
        let ends: Vec<usize> = text.lines().rev().take(3).map(|l| l.chars().count()).collect();
        assert!(ends.iter().all(|e| *e == ends[0]), "{text}");
    }

    #[test]
    fn a_hint_begins_a_line() {
        let mut sheet = Sheet::new("t");
        sheet.item("the motor is reversed, as thrust goes astern\nhint: swap two wires");
        assert_eq!(
            sheet.into_text(),
            "t\n  - the motor is reversed, as thrust goes astern\n    hint: swap two wires\n"
        );
    }
}
