//! Makes a trace from JSON lines of steps, for harnesses that mirrorstats did not run.
//!
//! ```text
//! lines ──► first pass: every line checked, where each step lies ──► second pass: rows, episode by episode ──► trace
//! ```
//!
//! One line is one step, a flat object with the columns of the schema as keys (`schemas/step.schema.json`). Other keys
//! become own columns. Lines of an episode may be scattered over places and files: `episode_id` and `t` identify the
//! step. Episodes are ordered by their first lines.
//!
//! Rule: all or nothing. A line that cannot be taken unchanged fails the import; values are never filled in or dropped.
//! Memory holds the position of each step, not the steps.

mod columns;
mod error;
mod fault;
mod format;
mod index;
mod limits;
mod line;
mod mapping;
mod rows;
pub mod schema;
mod text;

use std::num::NonZeroUsize;
use std::path::Path;

pub use columns::Own;
pub use error::ImportError;
pub use fault::Fault;
pub use format::Format;
pub use limits::Limits;
pub use mapping::{Mapping, MappingError};
use parquet::errors::ParquetError;
pub use text::Text;

use super::diagnostic::Severity;
use super::error::TraceError;
use super::inputs::Input;
use super::validate::{Expected, validate_as};
use super::write::unwritable;
use columns::Columns;
use error::Faults;
use exact::replace::NewFile;
use index::Index;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Imported {
    pub episodes: usize,
    pub steps: usize,
    /// The columns of the schema in the trace, in schema order.
    pub columns: Vec<&'static str>,
    /// The columns outside the schema, in the order of their first lines.
    pub own: Vec<Own>,
}

/// Writes the steps of these texts, checked against `limits`, to the trace at `out`.
pub fn import(texts: &mut [Text], out: &Path, limits: Limits<'_>) -> Result<Imported, ImportError> {
    let mut columns = Columns::default();
    let mut index = Index::default();
    let mut faults = Faults::default();
    for (at, text) in texts.iter_mut().enumerate() {
        survey(at, text, limits, &mut columns, &mut index, &mut faults)?;
    }
    faults.extend(columns.faults());
    faults.none()?;
    let steps = index.into_steps(texts, &mut faults);
    faults.none()?;
    let file = write(texts, &columns, &steps, out, limits)?;
    check(&file, out, limits.expected)?;
    file.commit().map_err(|error| unwritable(out, error))?;
    Ok(Imported {
        episodes: steps.chunk_by(|a, b| a.episode == b.episode).count(),
        steps: steps.len(),
        columns: columns.known().map(|column| column.name).collect(),
        own: columns.own(),
    })
}

fn survey(
    at: usize,
    text: &mut Text,
    limits: Limits<'_>,
    columns: &mut Columns,
    index: &mut Index,
    faults: &mut Faults,
) -> Result<(), ImportError> {
    let mut is_empty = true;
    text.rewind()?;
    while let Some(line) = text.next_line()? {
        is_empty = false;
        let members = match text.members(&line.bytes, line.ended) {
            Ok(members) => members,
            Err(fault) => {
                faults.add(fault.at(&line.place));
                continue;
            }
        };
        let found = columns.check(&members, &line.place, limits);
        if found.is_empty() {
            faults.extend(index.add(at, &line, &members));
        }
        faults.extend(found);
    }
    if is_empty {
        faults.add(Fault {
            expected: "at least one step".into(),
            found: "none".into(),
            help: "leave the file out, or write its steps anew".into(),
            ..Fault::of_file(text.name())
        });
    }
    Ok(())
}

/// The second pass: writes the rows of every episode to a temporary file beside `out`.
fn write(
    texts: &mut [Text],
    columns: &Columns,
    steps: &[index::Step],
    out: &Path,
    limits: Limits<'_>,
) -> Result<NewFile, ImportError> {
    let recording = limits.recording(texts)?;
    let file = NewFile::create(out).map_err(|error| unwritable(out, error))?;
    let failed = |error: ParquetError| TraceError::Write { file: out.display().to_string(), source: Box::new(error) };
    let mut rows = rows::Rows::new(file, columns, &recording).map_err(failed)?;
    for episode in steps.chunk_by(|a, b| a.episode == b.episode) {
        for step in episode {
            let text = &mut texts[step.text];
            let bytes = text.line_at(step.offset)?;
            let members = text.members(&bytes, true).map_err(|_| ImportError::changed(text.name()))?;
            rows.add(&members).map_err(|()| ImportError::changed(text.name()))?;
        }
        rows.end_episode().map_err(failed)?;
    }
    Ok(rows.finish().map_err(failed)?)
}

fn check(file: &NewFile, out: &Path, expected: Expected<'_>) -> Result<(), ImportError> {
    let input = Input { name: Input::new(out).name, path: file.temporary_path().to_owned() };
    let report = validate_as(&[input], Expected { errors_alone: true, ..expected }, NonZeroUsize::MIN)?;
    let errors = report.findings.into_iter().filter(|finding| finding.severity == Severity::Error).collect();
    TraceError::of(errors).map_or(Ok(()), |error| Err(error.into()))
}
