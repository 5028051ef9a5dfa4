//! The command line itself, and the commands that do not query a study.

use std::ffi::OsString;
use std::io::Cursor;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::thread::available_parallelism;

use mirrorstats::cli::{self, CommandLine};
use mirrorstats_import::Text;
use mirrorstats_study::findings::{findings, findings_text};
use mirrorstats_study::import::{ImportRequest, import};
use mirrorstats_trace::inputs;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::answer::{self, Answer};
use crate::error;

/// Runs the command line with these arguments, the program's name first, and gives its exit code.
#[pyfunction]
pub fn run(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    let line = CommandLine::new(arguments);
    py.detach(|| line.exit_code(cli::caught(|| line.parse()?.run())))
}

/// All findings of traces.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "Python's values become owned ones")]
pub fn validate(
    py: Python<'_>,
    paths: Vec<OsString>,
    definitions: Option<PathBuf>,
    threads: Option<NonZeroUsize>,
) -> PyResult<Answer> {
    let found = py.detach(|| {
        let inputs = inputs::resolve(&paths, std::io::empty()).map_err(error::of_input)?;
        let threads = threads.or_else(|| available_parallelism().ok()).unwrap_or(NonZeroUsize::MIN);
        findings(definitions.as_deref(), &inputs, threads).map_err(error::of_study)
    })?;
    answer::of(&found, findings_text(&found))
}

/// The import arguments from Python.
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
pub fn import_text(py: Python<'_>, name: &str, lines: &[u8], asked: ImportAsked) -> PyResult<Answer> {
    let ImportAsked { out, definitions, palette, clusters_by_seed, reconstruction } = asked;
    let request = ImportRequest { out, definitions: Some(definitions), palette, clusters_by_seed, reconstruction };
    let imported = py.detach(|| {
        let text = Text::spool(name, lines).map_err(error::of_input)?;
        import(vec![text], &request).map_err(error::of_study)
    })?;
    answer::of(&imported, imported.to_string())
}

/// The pixels of a PNG file of a frame: height, width, and red, green and blue of each pixel, row by row.
#[pyfunction]
pub fn pixels<'py>(py: Python<'py>, png: &[u8]) -> PyResult<(u32, u32, Bound<'py, PyBytes>)> {
    let mut reader = png::Decoder::new(Cursor::new(png)).read_info().map_err(error::of_input)?;
    let mut bytes = vec![0; reader.output_buffer_size().unwrap_or_default()];
    let frame = reader.next_frame(&mut bytes).map_err(error::of_input)?;
    Ok((frame.height, frame.width, PyBytes::new(py, &bytes[..frame.buffer_size()])))
}
