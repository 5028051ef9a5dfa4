//! The native library of the Python package: the command line, and the study library as Python sees it.
//!
//! Rule: no logic of its own. Whatever has an answer has it from the library `mirrorstats`.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the command line with these arguments, the program's name first, and gives its exit code.
#[pyfunction]
fn run(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| mirrorstats::cli::run_to_code(arguments))
}

/// The module.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(run, module)?)
}
