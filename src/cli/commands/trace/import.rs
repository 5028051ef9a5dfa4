//! `mirrorstats import`: JSON lines of steps, of whatever harness, as a trace.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use crate::cli::text_table::counted;
use exact::budget::Limit;
use exact::escape::visible;
use exact::input;
use exact::replace;
use study::known_experiments;
use trace::colors::palette::Palette;
use trace::declared::Cluster;
use trace::import::{self, Limits, Text};
use trace::inputs::Input;
use trace::schema::Kind;

/// Make a trace of JSON lines of steps: episodes of any harness can be scored
///
/// One line is one step: an object with the columns of the schema as keys, as `mirrorstats trace schema step` prints them.
/// Other keys become columns of their own. Lines of an episode may be in any order and in several files. The trace holds
/// every line and keeps every rule of `mirrorstats trace validate`, or nothing is written.
#[derive(Clone, Debug, clap::Args)]
pub struct ImportArgs {
    /// Files of JSON lines, `-` for standard input
    #[arg(value_name = "STEPS.jsonl", required = true)]
    steps: Vec<PathBuf>,
    /// The trace to write
    #[arg(short, long, value_name = "TRACE.parquet")]
    out: PathBuf,
    /// The definitions whose experiments are known: `paper`, `extended`, or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "paper")]
    definitions: PathBuf,
    /// The colours that there are, which the trace then declares: names with commas between them, a file of names, or
    /// `default`, the ten colours of the study
    #[arg(long, value_name = "NAMES|FILE|default")]
    palette: Option<PathBuf>,
    /// What episodes share that are more alike than chance: statistics of the trace then take it as a cluster. Episodes with
    /// an equal `scene` are pairs without a word
    #[arg(long, value_enum, value_name = "COLUMN")]
    cluster: Option<ClusterArg>,
    /// The steps are rebuilt from published numbers, which leave the rest of them open: statistics take no pairs and no
    /// clusters from them
    #[arg(long, conflicts_with = "cluster")]
    reconstruction: bool,
    /// Answer as JSON
    #[arg(long)]
    json: bool,
}

/// What a cluster is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ClusterArg {
    /// The episodes of one seed
    Seed,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ImportAnswer {
    /// The trace, as typed.
    pub out: String,
    /// How many episodes it has.
    pub episodes: usize,
    /// How many rows it has, one per line.
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
    /// What it holds; null where every line says null.
    #[serde(rename = "type")]
    pub kind: Option<Kind>,
}

impl ImportArgs {
    pub fn run(&self) -> Result<Outcome, Failure> {
        self.check_places()?;
        let texts = self.steps.iter().map(|path| text(path)).collect::<Result<Vec<_>, _>>()?;
        output::print(&self.import(texts)?, self.json)
    }

    /// Makes a trace of the steps in these texts, wherever they are from.
    pub fn import(&self, mut texts: Vec<Text>) -> Result<ImportAnswer, Failure> {
        let experiments = known_experiments(&self.definitions)?;
        let palette = self.palette.as_deref().map(palette).transpose()?;
        let limits = Limits {
            experiments: experiments.as_deref(),
            palette: palette.as_ref(),
            cluster: self.cluster.map(|ClusterArg::Seed| Cluster::Seed),
            is_reconstruction: self.reconstruction,
        };
        let imported = import::import(&mut texts, &self.out, limits).map_err(Failure::input)?;
        let own = imported.own.into_iter().map(|own| OwnColumn { name: own.name, kind: own.kind });
        Ok(ImportAnswer {
            out: Input::new(&self.out).name,
            episodes: imported.episodes,
            steps: imported.steps,
            columns: imported.columns.into_iter().map(str::to_owned).collect(),
            own_columns: own.collect(),
        })
    }

    /// Standard input is there once, and no file is written over its own lines.
    fn check_places(&self) -> Result<(), Failure> {
        if self.steps.iter().filter(|path| is_standard_input(path)).count() > 1 {
            let words = "error: `-`: expected standard input once, found it twice\n  help: name it once";
            return Err(Failure::Rendered(words.to_owned()));
        }
        replace::check_target(&self.out, &self.steps, "the steps themselves").map_err(Failure::input)?;
        output::check_target(&self.out, [&self.definitions].into_iter().chain(&self.palette))
    }
}

/// A colour takes some bytes.
const LARGEST: Limit = Limit::new("bytes of a palette", 1 << 20);

/// The palette that is typed, or in the file that is named. A text with a comma is no name of a file.
fn palette(path: &Path) -> Result<Palette, Failure> {
    let typed = path.to_string_lossy();
    if typed == "default" {
        return Ok(Palette::of_study());
    }
    let is_file = !typed.contains(',') && (typed.contains(['/', '\\', '.']) || path.is_file());
    let names = if is_file {
        input::text(path, LARGEST)
            .map_err(|error| Failure::input(format!("--palette {typed}: cannot read it: {error}")))?
    } else {
        typed.clone().into_owned()
    };
    let names = names.split([',', '\n']).map(str::trim).filter(|name| !name.is_empty());
    let help = "name the colours with commas between them, or in a file one per line; or `default`";
    Palette::of_names(names).map_err(|fault| Failure::input(format!("--palette {typed}: {fault}\n  help: {help}")))
}

fn text(path: &Path) -> Result<Text, Failure> {
    let text = if is_standard_input(path) { Text::spool("standard input", io::stdin()) } else { Text::open(path) };
    text.map_err(Failure::input)
}

fn is_standard_input(path: &Path) -> bool {
    path.as_os_str() == "-"
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
