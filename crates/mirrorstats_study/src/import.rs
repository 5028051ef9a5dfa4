//! Makes traces of other programs' files, given the experiments that definitions know.

use std::borrow::Cow;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::{fmt, slice};

use schemars::JsonSchema;
use serde::Serialize;

use crate::error::kinds;
use crate::findings::ExpectedTraces;
use crate::inputs::{InputError, ScoreFile};
use crate::own_definitions::DEFAULT_DEFINITIONS;
use crate::{ErrorKind, StudyError};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::counted;
use mirrorstats_exact::input;
use mirrorstats_exact::replace::TemporaryFolder;
use mirrorstats_import::{ImportError, Limits, Mapping, MappingError, Notes, Text};
use mirrorstats_metric::file;
use mirrorstats_score::tables::columns::KEYS;
use mirrorstats_trace::footers::declared::Cluster;
use mirrorstats_trace::inputs::{Input, is_data_set, is_report};
use mirrorstats_trace::read::open::TraceFile;
use mirrorstats_trace::schema::colors::palette::Palette;
use mirrorstats_trace::schema::{Kind, RECORDING_KEY};

/// A colour takes only a few bytes.
const LARGEST: Limit = Limit::new("bytes of a palette or of definitions", 1 << 20);

/// The bytes of a file that tell whether it is a log.
const HEAD: u64 = 64 << 10;

kinds! { Definitions: MappingError; }

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ImportRequest {
    pub out: PathBuf,
    /// The definitions that give the known experiments, by name or path; those of the files' format if `None`, or else the
    /// paper's.
    pub definitions: Option<PathBuf>,
    /// Names of colours separated by commas, a file of names, or `default`.
    pub palette: Option<PathBuf>,
    /// True if the episodes of one seed are more alike than chance.
    pub clusters_by_seed: bool,
    /// True if the steps are rebuilt from published numbers.
    pub reconstruction: bool,
}

/// The written trace.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ImportAnswer {
    /// The trace, as typed.
    pub out: String,
    /// The number of its episodes.
    pub episodes: usize,
    /// The number of its rows, one per line.
    pub steps: usize,
    /// Columns of the schema that it has.
    pub columns: Vec<String>,
    /// Columns that the schema does not know.
    pub own_columns: Vec<OwnColumn>,
}

/// A column that the schema does not know.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct OwnColumn {
    /// Its name, the key of the lines.
    pub name: String,
    /// The type of its values; null if every value is null.
    #[serde(rename = "type")]
    pub kind: Option<Kind>,
}

/// Makes a trace from the steps in these texts; writes nothing if that fails.
pub fn import(mut texts: Vec<Text>, request: &ImportRequest) -> Result<ImportAnswer, StudyError> {
    let of_format = texts.first().and_then(Text::definitions);
    let of_format = of_format.filter(|_| texts.iter().all(|text| text.definitions() == of_format));
    let default = || Path::new(of_format.unwrap_or(DEFAULT_DEFINITIONS));
    let expected = ExpectedTraces::of(request.definitions.as_deref().unwrap_or_else(default))?;
    let palette = request.palette.as_deref().map(palette).transpose()?;
    let limits = Limits {
        expected: expected.as_expected(),
        domain: expected.domain.as_deref(),
        palette: palette.as_ref(),
        definitions: expected.carried.as_ref().map(|carried| (&*carried.name, &*carried.text)),
        cluster: request.clusters_by_seed.then_some(Cluster::Seed),
        is_reconstruction: request.reconstruction,
    };
    let imported = mirrorstats_import::import(&mut texts, &request.out, limits)?;
    let own = imported.own.into_iter().map(|own| OwnColumn { name: own.name, kind: own.kind });
    Ok(ImportAnswer {
        out: Input::new(&request.out).name,
        episodes: imported.episodes,
        steps: imported.steps,
        columns: imported.columns.into_iter().map(str::to_owned).collect(),
        own_columns: own.collect(),
    })
}

/// The mapping in these definitions, if they have one.
pub fn mapping_in(definitions: &Path) -> Result<Option<Mapping>, StudyError> {
    let built_in = definitions.to_str().and_then(file::built_in).map(Cow::Borrowed);
    // A file that cannot be read is reported by the reader of definitions.
    let text = built_in.or_else(|| input::text(definitions, LARGEST).ok().map(Cow::Owned));
    Ok(Mapping::of_definitions(definitions, &text.unwrap_or_default())?)
}

/// Traces of the logs among inputs. Their files exist as long as this value.
#[derive(Debug)]
pub struct Logs {
    _folder: TemporaryFolder,
    /// What was left out of the logs, and how often.
    pub notes: Vec<String>,
}

impl Logs {
    /// Makes one trace of all logs among the inputs, in whose place it comes: files of other formats than Parquet that
    /// hold no scores, and, if the definitions have `[import]`, Parquet files without a footer of ours. `None` if there
    /// is no log. Errors: as [`import`].
    pub fn of(inputs: &mut Vec<Input>, definitions: Option<&Path>) -> Result<Option<Self>, StudyError> {
        let mapping = definitions.map(mapping_in).transpose()?.flatten();
        let (logs, mut others): (Vec<Input>, Vec<Input>) =
            inputs.drain(..).partition(|input| is_log(input, mapping.is_some()));
        let Some(first) = logs.first() else {
            *inputs = others;
            return Ok(None);
        };
        let name = match logs.len() {
            1 => format!("{} (imported)", first.name),
            count => format!("{} and {} more (imported)", first.name, count - 1),
        };
        let unreadable = |error: io::Error| InputError::unreadable(first, error);
        let folder = TemporaryFolder::private("logs").map_err(unreadable)?;
        let mut notes = Notes::default();
        let mapping = mapping.unwrap_or_default();
        let text = |input: &Input| {
            if let Some(text) = Text::of_data_set(&input.path, &mapping, &mut notes)? {
                return Ok(text);
            }
            let mut text = Text::open(&input.path)?;
            text.read(&mapping, None, &mut notes).map(|()| text)
        };
        let texts = logs.iter().map(text).collect::<Result<Vec<_>, ImportError>>()?;
        let out = folder.path().join("logs.parquet");
        let definitions = definitions.map(Path::to_owned);
        import(texts, &ImportRequest { out: out.clone(), definitions, ..ImportRequest::default() })?;
        others.push(Input { name, path: out });
        others.sort();
        *inputs = others;
        Ok(Some(Self { _folder: folder, notes: notes.texts() }))
    }
}

/// Returns true if another program wrote the file. What cannot be told from its first bytes is left to the reader of
/// traces and scores.
fn is_log(input: &Input, has_mapping: bool) -> bool {
    if is_data_set(&input.path) {
        return true;
    }
    let Ok(file) = input::open(&input.path) else { return false };
    let mut head = Vec::new();
    if file.take(HEAD).read_to_end(&mut head).is_err() {
        return false;
    }
    let name = input.name.to_ascii_lowercase();
    if head.starts_with(b"PAR1") {
        let is_ours = |file: TraceFile| file.metadata_value(RECORDING_KEY).is_some();
        return has_mapping
            && ScoreFile::all(slice::from_ref(input)).is_ok_and(|scores| scores.is_none())
            && !TraceFile::open(input).is_ok_and(is_ours);
    }
    let is_compressed =
        [&b"PK\x03\x04"[..], b"\x1f\x8b", b"\x28\xb5\x2f\xfd"].iter().any(|mark| head.starts_with(mark));
    let text = head.trim_ascii_start();
    let first = text.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let is_json = text.starts_with(b"{") || text.starts_with(b"[");
    let is_table = [".csv", ".tsv"].iter().any(|ending| name.ends_with(ending));
    // The same columns tell scores in Parquet from steps.
    let has = |column: &str| {
        let named = if is_json { format!("\"{column}\"") } else { column.to_owned() };
        let cells = first.split(|byte| if is_json { b" ,{:".contains(byte) } else { b",;\t\r\"".contains(byte) });
        cells.into_iter().any(|cell| cell == named.as_bytes())
    };
    let keys = KEYS.iter().filter(|key| has(key)).count();
    // Faulty scores are refused as scores.
    let holds_scores = !has("t") && keys >= if has_mapping { KEYS.len() } else { 3 };
    let is_in_report = || input.path.parent().is_some_and(is_report);
    is_compressed || ((is_json || (is_table && !text.is_empty())) && !holds_scores && !is_in_report())
}

/// The palette in an argument or in the file that it names. A text with a comma is never a file name.
fn palette(path: &Path) -> Result<Palette, StudyError> {
    let typed = path.to_string_lossy();
    if typed == "default" {
        return Ok(Palette::of_study());
    }
    let failed = |words: String| StudyError::new(ErrorKind::Argument, format!("--palette {typed}: {words}"));
    let is_file = !typed.contains(',') && (typed.contains(['/', '\\', '.']) || path.is_file());
    let names = if is_file {
        Cow::Owned(input::text(path, LARGEST).map_err(|error| failed(format!("cannot read it: {error}")))?)
    } else {
        typed.clone()
    };
    let names = names.split([',', '\n']).map(str::trim).filter(|name| !name.is_empty());
    let help = "name the colours with commas between them, or in a file one per line; or `default`";
    Palette::of_names(names).map_err(|fault| failed(format!("{fault}\n  help: {help}")))
}

impl fmt::Display for ImportAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (episodes, steps) = (counted(self.episodes as u64, "episode"), counted(self.steps as u64, "step"));
        writeln!(f, "imported {episodes}, {steps} into {}", self.out)?;
        if self.own_columns.is_empty() {
            return Ok(());
        }
        let kind = |column: &OwnColumn| column.kind.map_or("null in every line", Kind::name);
        let own = self.own_columns.iter().map(|column| format!("{} ({})", visible(&column.name), kind(column)));
        writeln!(f, "columns that the schema does not know: {}", own.collect::<Vec<_>>().join(", "))
    }
}
