//! The command line itself, and the commands that are no question to a study.

use std::ffi::OsString;
use std::io::Cursor;

use arrow::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use arrow::json::WriterBuilder;
use arrow::json::writer::LineDelimited;
use mirrorstats::cli;
use mirrorstats::cli::commands::import::ImportArgs;
use mirrorstats::cli::commands::validate::{ValidateCommand, print};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use trace::import::Text;

use crate::answer::{self, Answer};
use crate::error;

/// Runs the command line with these arguments, the program's name first, and gives its exit code.
#[pyfunction]
pub fn run(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| cli::run_to_code(arguments))
}

/// All findings of `mirrorstats trace validate` with these options.
#[pyfunction]
pub fn validate(py: Python<'_>, options: Vec<OsString>) -> PyResult<Answer> {
    let found = py.detach(|| {
        let command = cli::options_of("validate", options).map_err(|failure| error::of_failure(&failure))?;
        ValidateCommand::findings(&command).map_err(|failure| error::of_failure(&failure))
    })?;
    let mut words = Vec::new();
    print(&mut words, &found)?;
    answer::of(&found, String::from_utf8_lossy(&words).into_owned())
}

/// Makes a trace of lines of steps, as `mirrorstats import` with these options.
#[pyfunction]
pub fn import_text(py: Python<'_>, name: &str, lines: Vec<u8>, options: Vec<OsString>) -> PyResult<Answer> {
    let imported = py.detach(|| {
        let args: ImportArgs = cli::options_of("import", options).map_err(|failure| error::of_failure(&failure))?;
        let text = Text::spool(name, Cursor::new(lines)).map_err(error::of_input)?;
        args.import(vec![text]).map_err(|failure| error::of_failure(&failure))
    })?;
    let words = imported.to_string();
    answer::of(&imported, words)
}

/// The rows of an Arrow stream as lines of JSON; what is null says so.
#[pyfunction]
pub fn lines_of(py: Python<'_>, stream: &Bound<'_, PyCapsule>) -> PyResult<Vec<u8>> {
    let pointer = stream.pointer_checked(Some(c"arrow_array_stream"))?.cast::<FFI_ArrowArrayStream>();
    // SAFETY: a capsule of this name holds a stream of Arrow's C interface, and it lives until this function returns. The
    // stream is moved out of it and marked as released there, as the interface has it.
    #[expect(unsafe_code, reason = "Arrow's C interface passes a pointer")]
    let reader = unsafe { RecordBatchStreamReader::from_raw(pointer.as_ptr()) };
    let reader = reader.map_err(|fault| PyValueError::new_err(fault.to_string()))?;
    let written = py.detach(|| {
        let mut lines = Vec::new();
        let mut writer = WriterBuilder::new().with_explicit_nulls(true).build::<_, LineDelimited>(&mut lines);
        for batch in reader {
            writer.write(&batch?)?;
        }
        writer.finish()?;
        drop(writer);
        Ok::<_, arrow::error::ArrowError>(lines)
    });
    written.map_err(|fault| PyValueError::new_err(fault.to_string()))
}
