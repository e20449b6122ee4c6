//! One cell of a row, and the number in it.

use crate::decimal::{with_comma, with_point};
use crate::error::{Place, Problem};

/// One cell as a format has it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Cell<'a> {
    /// Not sampled then.
    Empty,
    /// Text yet to be read.
    Text(&'a str),
    /// A number.
    Number(f64),
}

impl Cell<'_> {
    /// As text, empty if it is empty.
    pub fn text(self) -> String {
        match self {
            Cell::Empty => String::new(),
            Cell::Text(text) => text.to_owned(),
            Cell::Number(x) => x.to_string(),
        }
    }

    /// Whether nothing stands in it.
    pub fn is_empty(self) -> bool {
        matches!(self, Cell::Empty) || matches!(self, Cell::Text(text) if text.trim().is_empty())
    }

    /// Whether it says that there is no value.
    pub fn is_no_value(self) -> bool {
        matches!(self, Cell::Text(text) if is_no_value(text))
    }

    /// Empty, if it says that there is no value.
    pub fn or_empty(self) -> Self {
        if self.is_no_value() { Cell::Empty } else { self }
    }

    /// The number in it, NaN if it is empty; place and column stand in errors.
    pub fn number(self, place: Place, column: &str, decimal_comma: bool) -> Result<f64, Problem> {
        let column = || column.to_owned();
        let text = match self {
            Cell::Empty => return Ok(f64::NAN),
            Cell::Number(x) if x.is_finite() => return Ok(x),
            Cell::Number(x) => {
                return Err(Problem::NotFinite { place, column: column(), text: x.to_string() });
            }
            Cell::Text(text) => text.trim(),
        };
        if text.is_empty() {
            return Ok(f64::NAN);
        }
        let number = if decimal_comma { with_comma(text) } else { with_point(text) };
        match number {
            Some(x) if x.is_finite() => Ok(x),
            Some(_) => Err(Problem::NotFinite { place, column: column(), text: text.into() }),
            None if decimal_comma && text.contains('.') => {
                Err(Problem::PointBesideComma { place, column: column(), text: text.into() })
            }
            None => Err(Problem::NotANumber { place, column: column(), text: shown(text) }),
        }
    }
}

/// What stands in the logs of others where nothing was measured: dashes, words, a meter's overload, what is no finite number.
pub(crate) fn is_no_value(text: &str) -> bool {
    const WORDS: [&str; 6] = ["n/a", "#n/a", "na", "null", "none", "ol"];
    let text = text.trim();
    let dashes = !text.is_empty() && text.chars().all(|c| matches!(c, '-' | '–' | '—'));
    dashes
        || WORDS.iter().any(|word| text.eq_ignore_ascii_case(word))
        || with_point(text).is_some_and(|number| !number.is_finite())
}

/// Cells of a kind among the others, of which the first is shown.
#[derive(Clone, Debug, Default)]
pub(crate) struct Odd {
    count: u64,
    first: Option<(Place, String)>,
}

impl Odd {
    /// One more.
    pub fn add(&mut self, place: Place, text: &str) {
        self.count += 1;
        self.first.get_or_insert_with(|| (place, shown(text)));
    }

    /// How many, and where the first is: `3 cell(s) …, the first in line 4: "N/A"`.
    pub fn said(&self, what: &str) -> Option<String> {
        let (place, text) = self.first.as_ref()?;
        let first = if self.count > 1 { "the first in" } else { "in" };
        Some(format!("{} {what}, {first} {place}: {text:?}", self.count))
    }

    /// That cells of a column held no value.
    pub fn no_value(&self, column: &str) -> Option<String> {
        self.said(&format!("cell(s) of `{column}` hold no value: not sampled then"))
    }
}

/// As much of a text as an error shows.
pub(crate) fn shown(text: &str) -> String {
    text.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_for_no_value_is_told_from_numbers_and_words() {
        for text in
            ["NaN", "-nan", "inf", "-Infinity", "N/A", "#N/A", " na ", "NULL", "none", "OL", "-", "--", "—"]
        {
            assert!(is_no_value(text), "{text}");
        }
        for text in ["", "0", "-1.5", "start", "on", "1,5", "12:00:00", "−3"] {
            assert!(!is_no_value(text), "{text}");
        }
    }
}
