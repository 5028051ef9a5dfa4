//! Makes traces from JSON lines, given the experiments that definitions know.

use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;

use crate::StudyError;
use crate::error::kinds;
use crate::findings::ExpectedTraces;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::counted;
use mirrorstats_exact::input;
use mirrorstats_import::{Limits, Text};
use mirrorstats_trace::footers::declared::Cluster;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::schema::Kind;
use mirrorstats_trace::schema::colors::palette::Palette;

/// A colour takes only a few bytes.
const LARGEST: Limit = Limit::new("bytes of a palette", 1 << 20);

#[derive(Debug, thiserror::Error)]
#[error("--palette {typed}: {words}")]
pub(crate) struct PaletteError {
    typed: String,
    words: String,
}

kinds! { Argument: PaletteError; }

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ImportRequest {
    pub out: PathBuf,
    /// The definitions that give the known experiments, by name or path.
    pub definitions: PathBuf,
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
    let expected = ExpectedTraces::of(&request.definitions)?;
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

/// The palette in an argument or in the file that it names. A text with a comma is never a file name.
fn palette(path: &Path) -> Result<Palette, PaletteError> {
    let typed = path.to_string_lossy();
    if typed == "default" {
        return Ok(Palette::of_study());
    }
    let failed = |words: String| PaletteError { typed: typed.clone().into_owned(), words };
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
