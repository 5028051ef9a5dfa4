//! The native library of the Python package: the command line, and the study library for Python.
//!
//! Rule: no logic of its own. All answers come from the library `mirrorstats`, and all errors have the messages of the
//! command line. Long work runs with the interpreter's lock released.

mod answer;
mod columns;
mod commands;
mod environment;
mod error;
mod recording;
mod shown;
mod study;

use pyo3::prelude::*;

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<columns::Table>()?;
    module.add_class::<columns::Steps>()?;
    module.add_class::<shown::ReportTable>()?;
    module.add_class::<shown::Figure>()?;
    module.add_class::<study::Study>()?;
    module.add_class::<environment::Environment>()?;
    module.add_function(wrap_pyfunction!(environment::experiments, module)?)?;
    module.add_function(wrap_pyfunction!(commands::run, module)?)?;
    module.add_function(wrap_pyfunction!(commands::validate, module)?)?;
    module.add_function(wrap_pyfunction!(commands::import_text, module)?)?;
    module.add_function(wrap_pyfunction!(commands::pixels, module)?)?;
    module.add_function(wrap_pyfunction!(columns::lines_of, module)?)?;
    module.add_function(wrap_pyfunction!(columns::table_of, module)?)?;
    module.add_function(wrap_pyfunction!(study::compare, module)?)?;
    module.add_function(wrap_pyfunction!(recording::record_options, module)?)?;
    module.add_function(wrap_pyfunction!(recording::record, module)?)
}
