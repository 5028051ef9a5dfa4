//! Errors of a study.

use std::error::Error;
use std::io;

use crate::own_definitions::ScoredAlike;
use crate::provenance::ProvenanceError;
use mirrorstats_engines::spark::SparkError;
use mirrorstats_exact::budget::Exceeded;
use mirrorstats_exact::moments::MomentOverflow;
use mirrorstats_exact::replace::TargetIsInput;
use mirrorstats_figures::{EncodeError, FigureError};
use mirrorstats_import::ImportError;
use mirrorstats_metric::definitions::{ReplaceError, UnknownMetric};
use mirrorstats_metric::file::FileError;
use mirrorstats_report::bundle::BundleError;
use mirrorstats_report::html::HtmlError;
use mirrorstats_report::published::PublishedError;
use mirrorstats_report::published::audit::AuditError;
use mirrorstats_report::published::comparison::ComparisonError;
use mirrorstats_report::style::StyleError;
use mirrorstats_score::cells::group::GroupError;
use mirrorstats_score::error::ScoreError;
use mirrorstats_score::evidence::EvidenceError;
use mirrorstats_score::format::FormatError;
use mirrorstats_score::tables::declared_experiments::DeclarationError;
use mirrorstats_score::tables::select::SelectError;
use mirrorstats_toml_spec::Faults;
use mirrorstats_trace::beside::lost::LostListError;
use mirrorstats_trace::error::TraceError;

/// An error of a study. Each message gives the problem, the location, the expected and found values, and a remedy.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    #[error(transparent)]
    Exceeded(#[from] Exceeded),
    #[error(
        "`{uri}`: expected files of this machine, found a URI, which Spark alone can read\n  \
         help: `mirrorstats score --engine spark {uri} -o scores.parquet`, then give the scores"
    )]
    Uri { uri: String },
    #[error(
        "expected files of this machine or URIs for Spark, found both\n  \
         help: name the files as file:// URIs, or score the two apart"
    )]
    FilesAndUris,
    #[error(
        "expected traces or files of scores, found both: `{scores}` holds scores\n  \
         help: score the traces first, or leave one kind out"
    )]
    Mixed { scores: String },
    #[error(
        "{scores}: expected traces, found scores, which have no steps\n  help: give the traces that they were computed from"
    )]
    NoSteps { scores: String },
    #[error(
        "expected traces of the domain `mirror`, whose thresholds of evidence vary here; found another domain\n  \
         help: write the other threshold into a definition file, and compare it with `mirrorstats diff`"
    )]
    NoMirror,
    #[error(
        "expected traces with the column `{column}`, to which a threshold applies: {problem}\n  \
         help: give traces that record it, as those of `mirrorstats record` do; `mirrorstats trace info` lists the columns"
    )]
    NoPixels { column: &'static str, problem: String },
    #[error(
        "{column}: expected a value at every step, found {steps} without one, for example in `{episode}`: a threshold does \
         not say what they show\n  \
         help: --where \"all({column} is not null)\" keeps the episodes that have them"
    )]
    PixelsMissing { column: &'static str, steps: String, episode: String },
    #[error(
        "expected a metric that depends on the `let` `{name}`, found none among {metrics}\n  \
         help: ask for other metrics with --metrics, or let the definitions use `{name}`"
    )]
    NothingMoves { name: &'static str, metrics: String },
    #[error("{definitions}: {source}")]
    EvidenceLet { definitions: String, source: ReplaceError },
    #[error(
        "{name}: the file changed while it was read: the results would mix two versions of it\n  \
         help: wait until nothing writes to it, then run the command again"
    )]
    Changed { name: String },
    #[error("{name}: {source}")]
    File { name: String, source: Box<dyn Error + Send + Sync> },
    #[error("expected at least one file of scores, found none\n  help: name traces or scores")]
    NoScores,
    #[error(transparent)]
    LostList(#[from] LostListError),
    #[error(
        "{cell}: expected episodes that were recorded alike, found {counts}: {differences}; for example {episodes}\n  help: {help}"
    )]
    Pooled { cell: String, episodes: String, counts: String, differences: String, help: String },
    #[error(
        "{file}: expected scores under `{wanted}` ({wanted_hash}), found scores under `{found}` ({found_hash})\n  \
         help: score the traces again with --definitions {wanted}"
    )]
    OtherDefinitions { file: String, wanted: String, wanted_hash: String, found: String, found_hash: String },
    #[error("expected experiments that the same definitions score, found {}", differing(.groups))]
    DefinitionsDiffer { groups: Vec<ScoredAlike> },
    #[error(
        "{}: expected the definition file `{}`{}, which scores these episodes, found its name alone\n  \
         help: a trace carries no definition file: give it with --definitions FILE",
        .group.experiments.iter().map(String::as_str).collect::<Vec<_>>().join(", "),
        .group.definitions,
        .group.hash.as_deref().map(|hash| format!(" (sha256 {hash})")).unwrap_or_default()
    )]
    DefinitionsElsewhere { group: ScoredAlike },
    #[error(
        "{experiment}: expected definitions that score it, as `{own}` do, found `{definitions}`, whose zeros would mean nothing\n  \
         help: leave --definitions out, or give --definitions {own}; a file of your own scores it with `include = [\"{own}\"]`, \
         or with a table `[experiment.{experiment}]`; `--where` leaves its episodes out"
    )]
    NotScored { experiment: String, definitions: String, own: String },
    #[error(
        "expected traces that carry the same definitions, found `{}` in {} and `{}` in {}\n  \
         help: name the definitions for all of them with --definitions, or give the files one by one",
        .names[0], .files[0], .names[1], .files[1]
    )]
    CarriedDefinitionsDiffer { files: [String; 2], names: [String; 2] },
    #[error(
        "`{file}` has no column of the domain `mirror`: expected definitions of its own domain, found `{definitions}`\n  \
         help: give --definitions a file with `domain = \"NAME\"` and a `[column.NAME]` for each column that it reads"
    )]
    OtherDomain { file: String, definitions: String },
    #[error(
        "`{name}` are definitions: expected traces to score with them, found none\n  \
         help: name the traces after OLD and NEW"
    )]
    NoTraces { name: String },
    #[error(
        "{argument}: expected definitions, scores or a report's folder, found no scores in it\n  \
         help: OLD and NEW come first, the traces after them"
    )]
    NoSide { argument: String },
    #[error("no table of the style `{style}` is named `{name}`; it has {known}{hint}")]
    NoTable { name: String, style: String, known: String, hint: String },
    #[error(
        "{metric}: expected a metric with `better = \"higher\"` or \"lower\", found none\n  help: name another metric with --metric"
    )]
    NoDirection { metric: String },
    #[error("{words}\n  help: give a filter that holds for some of them, or none")]
    EmptyFilter { words: String },
    #[error(
        "{out}: expected a folder beside the report, found the report itself\n  \
         help: the old report stays as it is; give another --out"
    )]
    OntoItself { out: String },
    #[error(
        "the style `{name}` changed since the report was made: expected sha256 {expected}, found {found}\n  \
         help: name the style with --style"
    )]
    StyleChanged { name: String, expected: String, found: String },
    #[error(
        "the report's style `{name}` (sha256 {expected}) was a file, and a manifest keeps no paths\n  \
         help: name the style with --style"
    )]
    StyleGone { name: String, expected: String },
    #[error(
        "`query` needs Polars, which this build lacks\n  \
         help: build with it: cargo build --release --features polars"
    )]
    WithoutPolars,
    #[error("--palette {typed}: {words}")]
    Palette { typed: String, words: String },
    #[error(transparent)]
    Import(#[from] ImportError),
    #[error(transparent)]
    Trace(#[from] TraceError),
    #[error("{0}")]
    Score(#[from] ScoreError),
    #[error("{0}")]
    Definitions(#[from] FileError),
    #[error("{0}")]
    Filter(#[from] Faults),
    #[error(transparent)]
    Metric(#[from] UnknownMetric),
    #[error("{0}")]
    Evidence(#[from] EvidenceError),
    #[error(transparent)]
    Format(#[from] FormatError),
    #[error("{0}")]
    Select(#[from] SelectError),
    #[error(transparent)]
    Group(#[from] GroupError),
    #[error(transparent)]
    Declaration(#[from] DeclarationError),
    #[error(transparent)]
    Overflow(#[from] MomentOverflow),
    #[error("{0}")]
    Style(#[from] StyleError),
    #[error(transparent)]
    Published(#[from] PublishedError),
    #[error(transparent)]
    Comparison(#[from] ComparisonError),
    #[error(transparent)]
    Audit(#[from] AuditError),
    #[error(transparent)]
    Figure(#[from] FigureError),
    #[error(transparent)]
    Encode(#[from] EncodeError),
    #[error(transparent)]
    Page(#[from] HtmlError),
    #[error(transparent)]
    Bundle(#[from] BundleError),
    #[error(transparent)]
    Provenance(#[from] ProvenanceError),
    #[error(transparent)]
    Spark(#[from] SparkError),
    #[cfg(feature = "polars")]
    #[error(transparent)]
    Polars(#[from] mirrorstats_engines::polars::run::PolarsError),
    #[error(transparent)]
    Target(#[from] TargetIsInput),
    #[error(transparent)]
    System(#[from] io::Error),
}

impl StudyError {
    pub(crate) fn file(name: &str, source: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::File { name: name.to_owned(), source: source.into() }
    }

    /// The system's error if writing the answer failed, for example because the reader closed a pipe. Errors: this
    /// error, if it is any other.
    pub fn into_io(self) -> Result<io::Error, Self> {
        match self {
            Self::System(error) => Ok(error),
            Self::Format(error) => error.into_io().map_err(Self::Format),
            #[cfg(feature = "polars")]
            Self::Polars(mirrorstats_engines::polars::run::PolarsError::ReaderGone) => {
                Ok(io::ErrorKind::BrokenPipe.into())
            }
            other => Err(other),
        }
    }
}

fn differing(groups: &[ScoredAlike]) -> String {
    let one = |group: &ScoredAlike| format!("`{}` for {}", group.definitions, group.condition);
    let ask = |group: &ScoredAlike| format!("--where \"{}\" --definitions {}", group.condition, group.definitions);
    let found = groups.iter().map(one).collect::<Vec<_>>().join(", ");
    format!("{found}\n  help: ask for each by itself: {}", groups.iter().map(ask).collect::<Vec<_>>().join("; or "))
}
