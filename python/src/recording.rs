//! Recordings between files, numpy and the laboratory.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;

use kort_lab::Failure;
use kort_recording::{Column, ColumnMap, Format, Recording, RecordingError};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::error;

/// A recording as Python hands it over: arrays of 64-bit floats, whose values are copied, as a fit keeps its own.
#[derive(FromPyObject)]
pub struct Given<'py> {
    name: String,
    time_s: PyReadonlyArray1<'py, f64>,
    columns: Vec<(String, PyReadonlyArray1<'py, f64>)>,
    about: BTreeMap<String, String>,
    notes: Vec<String>,
    losses: Vec<String>,
    unused: Vec<String>,
}

impl Given<'_> {
    /// The recording, by the same rules as one from a file.
    pub fn take(self) -> PyResult<Recording> {
        let wrong = |words: String| PyValueError::new_err(format!("{}: {words}", self.name));
        let time_s: Vec<f64> = self.time_s.as_array().to_vec();
        if time_s.len() < 2 {
            return Err(wrong(format!("has {} rows\nhint: a recording has at least two", time_s.len())));
        }
        if let Some(row) = time_s.iter().position(|t| !t.is_finite()) {
            return Err(wrong(format!("time_s in row {row} is {}\nhint: finite seconds", time_s[row])));
        }
        if let Some(row) = time_s.windows(2).position(|w| w[0] >= w[1]) {
            let (before, after) = (time_s[row], time_s[row + 1]);
            return Err(wrong(format!(
                "time_s does not increase from row {row} ({before} s) to the next ({after} s)\nhint: sort by time_s and keep one row an instant"
            )));
        }
        let mut columns = Vec::with_capacity(self.columns.len());
        for (name, values) in self.columns {
            let values = values.as_array().to_vec();
            if values.len() != time_s.len() {
                return Err(wrong(format!(
                    "column {name} has {} values, time_s has {}\nhint: one value a row, NaN for \"not sampled then\"",
                    values.len(),
                    time_s.len()
                )));
            }
            if let Some(row) = values.iter().position(|v| v.is_infinite()) {
                return Err(wrong(format!(
                    "column {name} in row {row} is {}\nhint: a finite number, or NaN for \"not sampled then\"",
                    values[row]
                )));
            }
            if let Some(known) = kort_recording::columns::unit_missing(&name) {
                let near =
                    known.map_or(String::new(), |k| format!("; the known column is {} [{}]", k.name, k.unit));
                return Err(wrong(format!(
                    "column {name} is a quantity without one of our units{near}\nhint: convert to SI and rename it"
                )));
            }
            columns.push(Column::new(name, values));
        }
        Ok(Recording {
            name: self.name,
            time_s,
            columns,
            unused: self.unused,
            notes: self.notes,
            about: self.about,
            losses: self.losses,
        })
    }
}

/// A recording for Python; numpy takes its columns without a copy.
pub fn give<'py>(py: Python<'py>, recording: Recording) -> PyResult<Bound<'py, PyDict>> {
    let gaps: Vec<(f64, f64)> = recording.gaps().iter().map(|gap| (gap.from_s, gap.to_s)).collect();
    let columns = PyDict::new(py);
    for column in recording.columns {
        columns.set_item(column.name, PyArray1::from_vec(py, column.values))?;
    }
    let out = PyDict::new(py);
    out.set_item("name", recording.name)?;
    out.set_item("time_s", PyArray1::from_vec(py, recording.time_s))?;
    out.set_item("columns", columns)?;
    out.set_item("about", recording.about)?;
    out.set_item("notes", recording.notes)?;
    out.set_item("losses", recording.losses)?;
    out.set_item("unused", recording.unused)?;
    out.set_item("gaps", gaps)?;
    Ok(out)
}

fn map_of(columns: Option<&str>) -> PyResult<Option<ColumnMap>> {
    kort_lab::files::read_columns(columns).map_err(error)
}

fn unreadable(problem: RecordingError) -> PyErr {
    PyValueError::new_err(problem.to_string())
}

/// Reads a file.
#[pyfunction]
pub fn read<'py>(py: Python<'py>, path: PathBuf, columns: Option<&str>) -> PyResult<Bound<'py, PyDict>> {
    let map = map_of(columns)?;
    let recording = py.detach(|| Recording::read(&path, map.as_ref())).map_err(unreadable)?;
    give(py, recording)
}

/// Decodes a file's bytes.
#[pyfunction]
pub fn decode<'py>(
    py: Python<'py>,
    name: &str,
    bytes: &Bound<'py, PyBytes>,
    columns: Option<&str>,
) -> PyResult<Bound<'py, PyDict>> {
    let map = map_of(columns)?;
    let recording = Recording::decode(name, bytes.as_bytes(), map.as_ref()).map_err(unreadable)?;
    give(py, recording)
}

/// Writes a file: .csv, .csv.gz, .mcap or .parquet.
#[pyfunction]
pub fn write(py: Python<'_>, path: PathBuf, recording: Given<'_>) -> PyResult<()> {
    let format = Format::of(&path).map_err(unreadable)?;
    let recording = recording.take()?;
    let go = || recording.write(format, BufWriter::new(File::create(&path)?));
    py.detach(go).map_err(|e| error(Failure::unwritten(&path, e)))
}

/// The columns kort knows: name, unit, meaning and sign.
#[pyfunction]
pub fn known_columns() -> Vec<(&'static str, &'static str, &'static str)> {
    kort_recording::columns::known().map(|k| (k.name, k.unit, k.meaning)).collect()
}
