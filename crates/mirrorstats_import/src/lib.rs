//! Makes a trace from steps and logs of harnesses that mirrorstats did not run.
//!
//! ```text
//! lines, or rows of a format with their types ──► first pass: every line checked, where each step lies ──► second pass: rows, episode by episode ──► trace
//! ```
//!
//! One line is one step, a flat object with the columns of the schema as keys (`schemas/step.schema.json`). Other keys
//! become own columns. Lines of an episode may be scattered over places and files: `episode_id` and `t` identify the
//! step. Episodes are ordered by their first lines.
//!
//! Rule: all or nothing. A line that cannot be taken unchanged fails the import; values are never filled in or dropped.
//! The one exception: steps with an `identification` and no key `self_color` get it from the text.
//! Memory holds the position of each step, not the steps.

mod cell;
mod columns;
mod error;
mod format;
mod index;
mod line;
mod mapping;
pub mod schema;
mod table;
mod text;
mod value;

use std::collections::HashMap;
use std::num::NonZeroUsize;
use std::path::Path;

use arrow::datatypes::{DataType, Field};
use parquet::errors::ParquetError;
use serde_json::json;

pub use columns::Own;
pub use error::{Fault, ImportError};
pub use format::Format;
pub use mapping::{Mapping, MappingError};
pub use text::Text;

use columns::Columns;
use error::Faults;
use index::Index;
use mirrorstats_exact::replace::NewFile;
use mirrorstats_trace::episodes::identification::put_version;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::footers::declared::{Cluster, Origin};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::schema::colors::palette::Palette;
use mirrorstats_trace::schema::{Kind, Value};
use mirrorstats_trace::validate::{Expected, validate_as};
use mirrorstats_trace::write::row_groups::{Gathered, RowGroups, field};
use value::{LineValue, Members};

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
    fn recording(&self, texts: &mut [Text]) -> Result<serde_json::Value, ImportError> {
        let sources = texts.iter_mut().map(Text::hash).collect::<Result<Vec<_>, _>>()?;
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
        if let Some(source) = texts.iter().find_map(|text| text.source.as_ref()) {
            recording["mapping"] = source.mapping.clone();
            let format = |text: &Text| text.source.as_ref().map_or(Format::JsonLines, |source| source.format).name();
            recording["formats"] = texts.iter().map(format).collect();
        }
        Ok(recording)
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
    let file = write(texts, &columns, &steps, out, limits)?;
    check(&file, out, limits.expected)?;
    file.commit().map_err(|error| TraceError::write(out, error))?;
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
        columns.is_derived |= Columns::lacks_attribution(&members, limits);
        let (members, other) = Columns::typed(members, &text.folders, limits);
        faults.extend(other.map(|fault| fault.at(&line.place)));
        let found = columns.check(&members, &line.place, limits);
        if found.is_empty() {
            faults.extend(index.add(at, &line, &members));
        }
        faults.extend(found.into_iter().map(|fault| text.of_folder(fault)));
    }
    if is_empty {
        faults.add(Fault {
            expected: "at least one step".into(),
            found: "none".into(),
            help: "leave the file out, or write its steps anew".into(),
            ..Fault::of_file(&text.name)
        });
    }
    Ok(())
}

/// The second pass: writes the rows of every episode to a temporary file beside `out`.
fn write(
    texts: &mut [Text],
    columns: &Columns,
    steps: &[index::IndexedStep],
    out: &Path,
    limits: Limits<'_>,
) -> Result<NewFile, ImportError> {
    let mut recording = limits.recording(texts)?;
    if columns.is_derived {
        put_version(&mut recording);
    }
    let file = NewFile::create(out).map_err(|error| TraceError::write(out, error))?;
    let failed = |error: ParquetError| TraceError::write(out, error);
    let known = columns.known().map(|column| (field(column), Some(column.stored.kind())));
    let own = columns.own().into_iter().map(|own| {
        // The declared type holds whole numbers of a float column, and columns of nulls. A column of nulls without it is
        // compatible with any type in other files.
        let declared = limits.expected.declared.iter().find(|declared| declared.name == own.name);
        let kind = declared.map(|declared| declared.kind).or(own.kind);
        (Field::new(&own.name, kind.map_or(DataType::Null, Kind::data_type), true), kind)
    });
    let mut rows = Gathered::new(known.chain(own));
    let mut file = RowGroups::new(file, &rows.layout, Some(&recording)).map_err(failed)?;
    for episode in steps.chunk_by(|a, b| a.episode == b.episode) {
        for step in episode {
            let text = &mut texts[step.text];
            let bytes = text.line_at(step.offset)?;
            let members = text.members(&bytes, true).map_err(|_| ImportError::changed(&text.name))?;
            let members = columns.with_cells(Columns::typed(members, &text.folders, limits).0);
            add(&mut rows, &members).map_err(|()| ImportError::changed(&text.name))?;
        }
        file.end_episode(&mut rows).map_err(failed)?;
    }
    Ok(file.finish(Some(rows)).map_err(failed)?)
}

fn add(rows: &mut Gathered, members: &Members) -> Result<(), ()> {
    // A row may have a thousand columns.
    let members: HashMap<&str, &LineValue> = members.iter().map(|(key, value)| (key.as_str(), value)).collect();
    for (field, values) in rows.layout.fields().iter().zip(&mut rows.columns) {
        let value = members.get(field.name().as_str()).copied();
        values.push(plain(value, field.data_type())?).ok_or(())?;
    }
    rows.rows += 1;
    Ok(())
}

#[expect(clippy::cast_precision_loss, reason = "the first pass refused what would lose anything in an own column")]
fn plain<'a>(value: Option<&'a LineValue>, stored: &DataType) -> Result<Option<Value<'a>>, ()> {
    Ok(Some(match value {
        None | Some(LineValue::Null) => return Ok(None),
        Some(LineValue::Bool(value)) => Value::Bool(*value),
        Some(LineValue::Int(value)) if stored.is_floating() => Value::Float(*value as f64),
        Some(LineValue::Int(value)) => Value::Int(*value),
        Some(LineValue::Float(value)) => Value::Float(*value),
        Some(LineValue::Text(text)) => Value::Text(text),
        Some(_) => return Err(()),
    }))
}

fn check(file: &NewFile, out: &Path, expected: Expected<'_>) -> Result<(), ImportError> {
    let input = Input { name: Input::new(out).name, path: file.temporary_path().to_owned() };
    Ok(validate_as(&[input], Expected { errors_alone: true, ..expected }, NonZeroUsize::MIN)?.errors()?)
}
