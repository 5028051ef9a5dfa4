//! The command line itself, and the commands that are no question to a study.

use std::ffi::OsString;
use std::io::Cursor;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::thread::available_parallelism;

use arrow::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use arrow::json::WriterBuilder;
use arrow::json::writer::LineDelimited;
use mirrorstats::cli;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use study::ImportRequest;
use trace::import::Text;
use trace::inputs;

use crate::answer::{self, Answer};
use crate::error;

/// Runs the command line with these arguments, the program's name first, and gives its exit code.
#[pyfunction]
pub fn run(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| cli::run_to_code(arguments))
}

/// All findings of traces.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "Python's values become owned ones")]
pub fn validate(
    py: Python<'_>,
    paths: Vec<OsString>,
    definitions: PathBuf,
    threads: Option<NonZeroUsize>,
) -> PyResult<Answer> {
    let found = py.detach(|| {
        let inputs = inputs::resolve(&paths, std::io::empty()).map_err(error::of_input)?;
        let threads = threads.or_else(|| available_parallelism().ok()).unwrap_or(NonZeroUsize::MIN);
        study::findings(&definitions, &inputs, threads).map_err(error::of_study)
    })?;
    answer::of(&found, study::findings_text(&found))
}

/// An import as Python asks for it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ImportAsked {
    out: PathBuf,
    definitions: PathBuf,
    palette: Option<PathBuf>,
    clusters_by_seed: bool,
    reconstruction: bool,
}

/// Makes a trace of lines of steps.
#[pyfunction]
pub fn import_text(py: Python<'_>, name: &str, lines: Vec<u8>, asked: ImportAsked) -> PyResult<Answer> {
    let ImportAsked { out, definitions, palette, clusters_by_seed, reconstruction } = asked;
    let request = ImportRequest { out, definitions, palette, clusters_by_seed, reconstruction };
    let imported = py.detach(|| {
        let text = Text::spool(name, Cursor::new(lines)).map_err(error::of_input)?;
        study::import(vec![text], &request).map_err(error::of_study)
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
