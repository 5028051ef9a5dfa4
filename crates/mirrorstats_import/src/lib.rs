//! Makes a trace from steps and logs of harnesses that mirrorstats did not run.
//!
//! ```text
//! file ──► columns of its rows ──► mapping: steps ──► first pass: every value checked ──► second pass: cast, by episode ──► trace
//! ```
//!
//! One row is one step with the columns of the schema (`schemas/step.schema.json`); others become own columns. Rows of
//! an episode may be scattered over places and files: `episode_id` and `t` identify the step. Episodes are ordered by
//! their first rows.
//!
//! Rule: all or nothing. Values stay in Arrow columns of the source's own types and are cast once; a value that cannot be
//! taken unchanged fails the import, and values are never filled in or dropped. The one exception: steps with an
//! `identification` and no key `self_color` get it from the text.

mod arrays;
mod beside;
mod columns;
mod error;
mod format;
mod guess;
mod index;
mod json;
mod mapping;
mod notes;
mod rows;
pub mod schema;
mod source;
mod spelling;
mod spool;
mod text;
mod value;
mod write;

use std::collections::HashSet;
use std::num::NonZeroUsize;
use std::path::Path;

use serde_json::json;

pub use columns::Own;
pub use error::{Fault, ImportError};
pub use format::Format;
pub use guess::{Draft, guess};
pub use mapping::{Mapping, MappingError};
pub use notes::Notes;
pub use text::Text;

use columns::Columns;
use error::Faults;
use index::Index;
use mirrorstats_exact::replace::NewFile;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::footers::declared::{Cluster, Origin};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::schema::colors::palette::Palette;
use mirrorstats_trace::schema::{DeclaredColumn, Kind};
use mirrorstats_trace::validate::{Expected, validate_as};
use text::Steps;
use write::write;

/// Limits on the values of steps beyond the schema, and the trace's declarations about them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Limits<'a> {
    pub expected: Expected<'a>,
    /// The name of the domain; the mirror if `None`.
    pub domain: Option<&'a str>,
    /// The known colours, which the trace then declares; any if `None`.
    pub palette: Option<&'a Palette>,
    pub cluster: Option<Cluster>,
    /// The name and text of the definitions, if they are not built in; the trace then carries them.
    pub definitions: Option<(&'a str, &'a str)>,
    /// True if the steps were rebuilt from published numbers, so that other values in them are arbitrary.
    pub is_reconstruction: bool,
}

impl Limits<'_> {
    fn declared(&self, name: &str) -> Option<&DeclaredColumn> {
        self.expected.declared.iter().find(|declared| declared.name == name)
    }

    /// The type of a column that the schema or the definitions know.
    fn kind(&self, name: &str) -> Option<Kind> {
        let known = self.expected.domain.column(name).map(|column| column.stored.kind());
        known.or_else(|| Some(self.declared(name)?.kind))
    }

    fn recording(&self, texts: &[Text]) -> serde_json::Value {
        let steps = || texts.iter().filter_map(|text| text.read.as_ref());
        let sources: Vec<&str> = steps().flat_map(Steps::hashes).collect();
        let origin = if self.is_reconstruction { Origin::Reconstruction } else { Origin::Import };
        let mut recording = json!({ "kind": origin.name(), "sources": sources });
        if let Some(domain) = self.domain {
            recording["domain"] = json!(domain);
        }
        if let Some(palette) = self.palette {
            recording["palette"] = json!(palette.names());
        }
        if let Some((name, text)) = self.definitions {
            recording["definitions"] = json!({ "name": name, "text": text });
        }
        if let Some(cluster) = self.cluster {
            recording["design"] = json!({ "cluster": cluster });
        }
        if let Some(mapping) = steps().find_map(|steps| steps.mapping.as_ref()) {
            recording["mapping"] = mapping.clone();
            recording["formats"] = steps().map(|steps| steps.format.name()).collect();
        }
        recording
    }
}

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
    let mut index = Index::new(limits.expected.declared);
    let mut faults = Faults::default();
    for (at, text) in texts.iter_mut().enumerate() {
        survey(at, text, limits, &mut columns, &mut index, &mut faults)?;
    }
    faults.extend(columns.faults());
    faults.check()?;
    let steps = index.into_steps(texts, &mut faults);
    faults.check()?;
    let file = write(texts, &mut columns, &steps, out, limits)?;
    check(&file, out, limits.expected)?;
    file.commit().map_err(|error| TraceError::write(out, error))?;
    Ok(Imported {
        episodes: steps.chunk_by(|a, b| a.episode == b.episode).count(),
        steps: write::count(&steps),
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
    let steps = text.steps()?;
    let (order, absent, batches) = (steps.order, steps.absent.clone(), steps.spool.batches.len());
    let unread = std::mem::take(&mut steps.faults);
    if batches == 0 && unread.is_empty() {
        faults.add(Fault {
            expected: "at least one step".into(),
            found: "none".into(),
            help: "leave the file out, or write its steps anew".into(),
            ..Fault::of_file(&text.name)
        });
    }
    faults.join(unread);
    for batch in 0..batches {
        let place = |row| text.place(batch, row);
        let (rows, mut found) = columns.completed(&text.batch(batch)?, &text.folders, limits);
        found.extend(columns.check(&rows, &place, (order, &absent), limits));
        let refused: HashSet<usize> = found.iter().map(|(row, _)| *row).collect();
        found.extend(index.add((at, batch, order), &rows, place, |row| refused.contains(&row)));
        found.sort_by_key(|(row, _)| *row);
        faults.extend(found.into_iter().map(|(row, fault)| text.of_folder(fault).at(&place(row))));
    }
    Ok(())
}

fn check(file: &NewFile, out: &Path, expected: Expected<'_>) -> Result<(), ImportError> {
    let input = Input { name: Input::new(out).name, path: file.temporary_path().to_owned() };
    let threads = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    Ok(validate_as(&[input], Expected { errors_alone: true, ..expected }, threads)?.errors()?)
}
