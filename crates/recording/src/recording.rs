//! A recording in memory.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use crate::columns;
use crate::error::{Problem, RecordingError};
use crate::formats;
use crate::map::ColumnMap;

/// One column.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name, unit last.
    pub name: String,
    /// One value a row; NaN means "not sampled then".
    pub values: Vec<f64>,
    /// The contract knows this column; an unknown one is kept and may explain a residual.
    pub known: bool,
}

impl Column {
    /// A column, marked known if the contract knows its name.
    pub fn new(name: impl Into<String>, values: Vec<f64>) -> Self {
        let name = name.into();
        Self { known: columns::find(&name).is_some(), name, values }
    }

    /// Number of cells with a value.
    pub fn samples(&self) -> usize {
        self.values.iter().filter(|v| !v.is_nan()).count()
    }
}

/// A stretch without rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Last instant before it, s.
    pub from_s: f64,
    /// First instant after it, s.
    pub to_s: f64,
}

/// A recording: rows at strictly increasing instants, SI columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// The file it came from, or a name.
    pub name: String,
    /// Log instants, s, strictly increasing, at least two.
    pub time_s: Vec<f64>,
    /// The other columns, in the file's order.
    pub columns: Vec<Column>,
    /// Source columns that a column map does not take over.
    pub unused: Vec<String>,
    /// What a user should know: gaps, columns without a sample.
    pub notes: Vec<String>,
    /// What a live recording says of itself: `rig` is the rig's description, with versions and origin of time.
    pub about: BTreeMap<String, String>,
    /// What was lost or skipped while reading; not empty means exit code 3.
    pub losses: Vec<String>,
}

impl Recording {
    /// Reads a recording from a file, CSV (plain or gzip) or MCAP by its content.
    ///
    /// # Errors
    /// [`RecordingError`] names the file, the place, the value found and what is allowed.
    pub fn read(path: &Path, map: Option<&ColumnMap>) -> Result<Self, RecordingError> {
        let name = path.display().to_string();
        Self::decode(&name, Self::open(path)?, map)
    }

    /// Opens a file for [`Recording::decode`], so that a caller may watch the bytes go by.
    ///
    /// # Errors
    /// The file cannot be opened, or is a folder.
    pub fn open(path: &Path) -> Result<File, RecordingError> {
        let fail = |problem| RecordingError::new(&path.display().to_string(), problem);
        let file = File::open(path).map_err(|e| fail(Problem::Unreadable { message: e.to_string() }))?;
        match file.metadata() {
            Ok(about) if about.is_dir() => Err(fail(Problem::Folder {
                inside: logs_in(path).first().map(|log| log.display().to_string()),
            })),
            _ => Ok(file),
        }
    }

    /// Decodes a recording from any reader; `name` stands in errors.
    ///
    /// # Errors
    /// As [`Recording::read`].
    pub fn decode(name: &str, reader: impl Read, map: Option<&ColumnMap>) -> Result<Self, RecordingError> {
        formats::decode(name, BufReader::with_capacity(1 << 16, reader), map)
            .map_err(|problem| RecordingError::new(name, problem))
    }

    /// The states that a live recording holds beside its signals, JSON objects, each with its time on the axis of `time_s`, s.
    ///
    /// # Errors
    /// The file cannot be opened or is no MCAP; `path` stands in it.
    pub fn states(path: &Path, take: impl FnMut(f64, &[u8])) -> Result<(), RecordingError> {
        let name = path.display().to_string();
        let input = BufReader::with_capacity(1 << 16, Self::open(path)?);
        formats::states(input, take).map_err(|problem| RecordingError::new(&name, problem))
    }

    /// Values of a column, if it is there.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|c| c.name == name).map(|c| c.values.as_slice())
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.time_s.len()
    }

    /// From the first to the last instant, s.
    pub fn duration_s(&self) -> f64 {
        match (self.time_s.first(), self.time_s.last()) {
            (Some(a), Some(b)) => b - a,
            _ => 0.0,
        }
    }

    /// Median time between rows, s; zero with fewer than two rows.
    pub fn period_s(&self) -> f64 {
        self.step_quantile(0.5)
    }

    /// Stretches more than five times as long as nine in ten steps of the log.
    pub fn gaps(&self) -> Vec<Gap> {
        let limit = 5.0 * self.step_quantile(0.9);
        self.time_s
            .windows(2)
            .filter(|w| w[1] - w[0] > limit)
            .map(|w| Gap { from_s: w[0], to_s: w[1] })
            .collect()
    }

    fn step_quantile(&self, part: f64) -> f64 {
        let mut steps: Vec<f64> = self.time_s.windows(2).map(|w| w[1] - w[0]).collect();
        if steps.is_empty() {
            return 0.0;
        }
        let at = ((steps.len() - 1) as f64 * part) as usize;
        *steps.select_nth_unstable_by(at, f64::total_cmp).1
    }
}

/// Endings of files that are read, plain or with `.gz` behind.
const ENDINGS: [&str; 9] = ["csv", "mcap", "ulg", "bin", "db3", "bfl", "bbl", "log", "candump"];

/// The files of a folder whose names end as those of recordings and logs do, in order of their names; none of a folder that
/// cannot be read.
pub fn logs_in(folder: &Path) -> Vec<PathBuf> {
    let ends = |path: &Path| path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    let is_log = |path: &PathBuf| {
        let plain = if ends(path).as_deref() == Some("gz") { path.with_extension("") } else { path.clone() };
        path.is_file() && ends(&plain).is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
    };
    let files = std::fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let mut logs: Vec<PathBuf> = files.filter(is_log).collect();
    logs.sort();
    logs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_is_found_and_jitter_is_not() {
        let mut time_s: Vec<f64> = (0..100).map(|i| f64::from(i) * 0.01 + 0.002 * f64::from(i % 3)).collect();
        let mut recording = Recording { time_s: time_s.clone(), ..Recording::default() };
        assert!(recording.gaps().is_empty());
        time_s.iter_mut().skip(50).for_each(|t| *t += 2.0);
        recording.time_s = time_s;
        assert_eq!(recording.gaps().len(), 1);
        assert!(recording.gaps()[0].to_s > 2.4);
    }
}
