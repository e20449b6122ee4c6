//! How a recording may be called.

use crate::problem::{Kind, Problem};

/// May this be chosen as a name: 1 to 64 letters, digits, `.`, `_` or `-`, the first a letter or digit?
pub fn is_name(name: &str) -> bool {
    name.len() <= 64 && is_word(name)
}

/// The same of any length: a recording that goes on in further files has its number behind its name.
pub(super) fn is_word(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphanumeric())
        && name.bytes().all(|b| b.is_ascii_alphanumeric() || b"._-".contains(&b))
}

/// May a new recording be called so? With the ending of a file it would stand for a file of another recording.
pub fn check_new_name(field: &str, name: &str) -> Result<(), Problem> {
    let refused =
        |hint| Err(Problem::new(Kind::OutOfRange, format!("{field} = {name:?} is not allowed")).hint(hint));
    if !is_name(name) {
        return refused("1 to 64 letters, digits, dots, underscores or hyphens; the first a letter or digit");
    }
    if [".csv", ".mcap", ".parquet"].iter().any(|ending| name.ends_with(ending)) {
        return refused(
            "without the ending: a recording NAME is fetched as NAME.mcap, NAME.csv and NAME.parquet",
        );
    }
    Ok(())
}
