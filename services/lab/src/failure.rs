//! How a command ends: outcomes, failures and their exit codes.

use std::fmt;
use std::path::Path;

pub use crate::files::read_rig;

/// A command that did its work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All of it.
    Done,
    /// All of it, but data were lost or skipped on the way (exit code 3).
    DoneWithLoss,
}

impl Outcome {
    /// Done, with or without loss.
    pub fn with_loss(lost: bool) -> Self {
        if lost { Outcome::DoneWithLoss } else { Outcome::Done }
    }
}

/// A command that did not do its work. The message names file, field, value found and what is
/// allowed, and ends in a `hint:` line where there is something to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Failure {
    /// Wrong usage or unreadable input (exit code 2).
    Input(String),
    /// The work itself failed (exit code 1).
    Failed(String),
}

impl Failure {
    /// Wrong usage or unreadable input.
    pub fn input(message: impl fmt::Display) -> Self {
        Failure::Input(message.to_string())
    }

    /// Input of a named file whose error does not name the file itself.
    pub fn in_file(path: &Path, message: impl fmt::Display) -> Self {
        Failure::Input(format!("{}: {message}", path.display()))
    }

    /// Input of a named file with all that is wrong with it.
    pub fn in_file_all(path: &Path, wrong: impl IntoIterator<Item: fmt::Display>) -> Self {
        Self::in_file(path, all_of(&path.display().to_string(), wrong))
    }

    /// The work itself failed.
    pub fn failed(message: impl fmt::Display) -> Self {
        Failure::Failed(message.to_string())
    }

    /// A result that could not be written.
    pub fn unwritten(path: &Path, error: impl fmt::Display) -> Self {
        Failure::Failed(format!(
            "{}: cannot be written: {error}\nhint: check that the folder exists and may be written",
            path.display()
        ))
    }

    /// Exit code.
    pub fn code(&self) -> u8 {
        match self {
            Failure::Input(_) => 2,
            Failure::Failed(_) => 1,
        }
    }
}

/// All that is wrong with a file, each but the first behind its name: that stands before the whole.
pub fn all_of(file: &str, wrong: impl IntoIterator<Item: fmt::Display>) -> String {
    let said: Vec<String> = wrong.into_iter().map(|words| words.to_string()).collect();
    said.join(&format!("\n{file}: "))
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::Input(message) | Failure::Failed(message) => f.write_str(message),
        }
    }
}

impl std::error::Error for Failure {}

/// Reads a text file.
///
/// # Errors
/// Names the file; not readable, or not UTF-8.
pub fn read_text(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path)
        .map_err(|e| Failure::input(format!("{}: cannot be read: {e}\nhint: check the path", path.display())))
}

/// Writes a result file.
///
/// # Errors
/// Names the file.
pub fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    std::fs::write(path, text).map_err(|e| Failure::unwritten(path, e))
}

/// Prints to stdout; a closed pipe (`kort … | head`) ends the output quietly.
///
/// # Errors
/// Not all of it could be printed.
pub fn print(text: &str) -> Result<(), Failure> {
    use std::io::{ErrorKind, Write};
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure::failed(format!(
            "the result cannot be printed: {error}\nhint: check where standard output goes: is that disk full?"
        ))),
        _ => Ok(()),
    }
}

/// Prints exactly one JSON document to stdout.
///
/// # Errors
/// Not all of it could be printed.
pub fn print_json(value: &impl serde::Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value).map_err(Failure::failed)?;
    print(&(text + "\n"))
}
