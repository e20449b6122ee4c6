//! The commands' work, with the interpreter free for other threads meanwhile.

use std::path::{Path, PathBuf};

use kort_lab::commands::{diagnose as diagnosing, fit as fitting, simulate as simulating, soak as soaking};
use kort_lab::fitted_rig::with_fit;
use kort_lab::input::{Input, Loaded};
use kort_lab::{Failure, files, render};
use kort_thruster::models::ModelName;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;

use crate::error;
use crate::recording::{Given, give};

/// What `fit` and `diagnose` share beside the recordings.
#[derive(FromPyObject)]
pub struct Asked {
    rig: Option<PathBuf>,
    model: String,
    with_effects: Vec<String>,
    seed: u64,
    jobs: Option<u16>,
}

impl Asked {
    fn input(self) -> PyResult<Input> {
        let model: ModelName =
            self.model.parse().map_err(|e| PyValueError::new_err(format!("model: {e}")))?;
        if self.jobs.is_some_and(|jobs| !(1..=1024).contains(&jobs)) {
            return Err(PyValueError::new_err("jobs: allowed are 1 to 1024\nhint: None takes one a core"));
        }
        Ok(Input {
            recordings: Vec::new(),
            rig: self.rig,
            model,
            columns: None,
            with: self.with_effects,
            seed: self.seed,
            jobs: self.jobs,
        })
    }
}

/// Reads, works with the interpreter free, and hands each step's words to `progress`.
fn work<T: Send>(
    py: Python<'_>,
    recordings: Vec<Given<'_>>,
    asked: Asked,
    progress: Option<Py<PyAny>>,
    go: impl FnOnce(&Input, &Loaded, &(dyn Fn(&str) + Sync)) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    let recordings = recordings.into_iter().map(Given::take).collect::<PyResult<Vec<_>>>()?;
    let input = asked.input()?;
    let told = |words: &str| {
        if let Some(progress) = &progress {
            Python::attach(|py| {
                // What the caller's function raises must not end a fit; it is shown as Python shows such things.
                if let Err(raised) = progress.call1(py, (words,)) {
                    raised.write_unraisable(py, Some(progress.bind(py)));
                }
            });
        }
    };
    py.detach(|| {
        let loaded = input.take(recordings)?;
        go(&input, &loaded, &told)
    })
    .map_err(error)
}

fn json(value: &impl Serialize) -> Result<String, Failure> {
    serde_json::to_string(value).map_err(Failure::failed)
}

/// `kort fit`: the report's JSON.
#[pyfunction]
pub fn fit(
    py: Python<'_>,
    recordings: Vec<Given<'_>>,
    asked: Asked,
    starts: u16,
    free_friction: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, String)> {
    if !(1..=100).contains(&starts) {
        return Err(PyValueError::new_err(format!("starts = {starts}: allowed are 1 to 100")));
    }
    work(py, recordings, asked, progress, |input, loaded, told| {
        let report = fitting::fit(input, loaded, usize::from(starts), free_friction, told)?;
        let (rig, _) = with_fit(&loaded.rig_text, &report).map_err(Failure::failed)?;
        Ok((json(&report)?, rig))
    })
}

/// `kort diagnose`: the report's JSON, the rig with what is believed, the page, the curves.
#[pyfunction]
pub fn diagnose(
    py: Python<'_>,
    recordings: Vec<Given<'_>>,
    asked: Asked,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, String, String)> {
    work(py, recordings, asked, progress, |input, loaded, told| {
        let diagnosis = diagnosing::diagnosis(input, loaded, told)?;
        let (rig, ..) = diagnosing::adopted(loaded, &diagnosis.report)?;
        Ok((json(&diagnosis.report)?, rig, render::diagnosis::page(&diagnosis, &loaded.rig)))
    })
}

/// `kort simulate`: a recording. `text` holds the scenario where it is not a file's or a shipped one's.
#[pyfunction]
pub fn simulate<'py>(
    py: Python<'py>,
    rig: PathBuf,
    scenario: PathBuf,
    text: Option<String>,
    seed: Option<u64>,
    noise: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let go = || {
        let text = text.map_or_else(|| files::scenario_text(&scenario), Ok)?;
        simulating::recording(&rig, Path::new(&scenario), &text, seed, noise)
    };
    let recording = py.detach(go).map_err(error)?;
    give(py, recording)
}

/// `kort soak`: the report's JSON and the page.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are the command's options, by name in Python")]
pub fn soak(
    py: Python<'_>,
    scenarios: Vec<PathBuf>,
    rigs: Vec<PathBuf>,
    controllers: Option<Vec<String>>,
    seeds: Option<u32>,
    seed: u64,
    jobs: usize,
    adopt: bool,
) -> PyResult<(String, String)> {
    let wanted =
        soaking::Wanted { scenarios: &scenarios, rigs: &rigs, controllers: controllers.as_deref(), seeds };
    py.detach(|| {
        let loaded = soaking::load(&wanted).map_err(Failure::input)?;
        let watch = kort_lab::soak::Watch { metrics: None };
        let run = if adopt { kort_lab::soak::adopt } else { kort_lab::soak::soak };
        let report = run(&loaded, seed, jobs, &watch).map_err(Failure::failed)?;
        Ok((report.json().to_string(), kort_lab::soak::page(&report)))
    })
    .map_err(error)
}
