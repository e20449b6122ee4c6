//! One cell of a row, and the number in it.

use crate::decimal::with_comma;
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
        let number = if decimal_comma { with_comma(text) } else { text.parse().ok() };
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

/// As much of a text as an error shows.
pub(crate) fn shown(text: &str) -> String {
    text.chars().take(40).collect()
}
