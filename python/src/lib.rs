//! The Python module `kort._kort`: what the program's commands do, called in place. Reports cross over as the JSON of
//! the commands, columns as numpy arrays on the memory they were read into; `python/kort` gives both their types.

mod recording;
mod work;

use kort_lab::Failure;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

/// Input that cannot be used is a `ValueError`, work that failed a `RuntimeError`; the words are the program's.
fn error(failure: Failure) -> PyErr {
    match failure {
        Failure::Input(words) => PyValueError::new_err(words),
        Failure::Failed(words) => PyRuntimeError::new_err(words),
    }
}

/// What the program can do, for `python/kort`.
#[pymodule]
fn _kort(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(recording::read, module)?)?;
    module.add_function(wrap_pyfunction!(recording::decode, module)?)?;
    module.add_function(wrap_pyfunction!(recording::write, module)?)?;
    module.add_function(wrap_pyfunction!(recording::known_columns, module)?)?;
    module.add_function(wrap_pyfunction!(work::fit, module)?)?;
    module.add_function(wrap_pyfunction!(work::diagnose, module)?)?;
    module.add_function(wrap_pyfunction!(work::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(work::soak, module)?)?;
    Ok(())
}
