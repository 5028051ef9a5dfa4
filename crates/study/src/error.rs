//! Errors of a study.

use std::error::Error;
use std::io;

use super::provenance::ProvenanceError;
use super::scored_alike::ScoredAlike;
use engines::spark::SparkError;
use exact::budget::Exceeded;
use exact::moments::MomentOverflow;
use exact::replace::TargetIsInput;
use metric::definitions::{ReplaceError, UnknownMetric};
use metric::file::FileError;
use report::audit::AuditError;
use report::bundle::BundleError;
use report::cells::group::GroupError;
use report::comparison::ComparisonError;
use report::figures::{EncodeError, FigureError};
use report::html::HtmlError;
use report::published::PublishedError;
use report::style::StyleError;
use score::declared_experiments::DeclarationError;
use score::evidence::EvidenceError;
use score::format::FormatError;
use score::score_traces::ScoreError;
use score::select::SelectError;
use toml_spec::Faults;
use trace::error::TraceError;
use trace::import::ImportError;
use trace::lost::LostListError;

/// An error of a study. Each message says what, where, expected, found, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// More than the budget allows.
    #[error(transparent)]
    Exceeded(#[from] Exceeded),
    /// A URI among files.
    #[error(
        "`{uri}`: expected files of this machine, found a URI, which Spark alone can read\n  \
         help: `mirrorstats score --engine spark {uri} -o scores.parquet`, then give the scores"
    )]
    Uri {
        /// As given.
        uri: String,
    },
    /// Files of this machine and URIs at once.
    #[error(
        "expected files of this machine or URIs for Spark, found both\n  \
         help: name the files as file:// URIs, or score the two apart"
    )]
    FilesAndUris,
    /// Traces and scores at once.
    #[error(
        "expected traces or files of scores, found both: `{scores}` holds scores\n  \
         help: score the traces first, or leave one kind out"
    )]
    Mixed {
        /// The first file of scores.
        scores: String,
    },
    /// Scores where steps are needed.
    #[error(
        "{scores}: expected traces, found scores, which have no steps\n  help: give the traces that they were computed from"
    )]
    NoSteps {
        /// The file.
        scores: String,
    },
    /// Traces without a mirror, where its thresholds are asked for.
    #[error(
        "expected traces of the domain `mirror`, whose thresholds of evidence vary here; found another domain\n  \
         help: write the other threshold into a definition file, and compare it with `mirrorstats diff`"
    )]
    NoMirror,
    /// Traces that do not record what a threshold is of.
    #[error(
        "expected traces with the column `{column}`, to which a threshold applies: {problem}\n  \
         help: give traces that record it, as those of `mirrorstats record` do; `mirrorstats trace info` lists the columns"
    )]
    NoPixels { column: &'static str, problem: String },
    /// Steps that do not record what a threshold is of.
    #[error(
        "{column}: expected a value at every step, found {steps} without one, for example in `{episode}`: a threshold does \
         not say what they show\n  \
         help: --where \"all({column} is not null)\" keeps the episodes that have them"
    )]
    PixelsMissing {
        column: &'static str,
        /// The number of steps, and of their episodes.
        steps: String,
        /// The first such episode.
        episode: String,
    },
    /// Metrics none of which a threshold moves.
    #[error(
        "expected a metric that depends on the `let` `{name}`, found none among {metrics}\n  \
         help: ask for other metrics with --metrics, or let the definitions use `{name}`"
    )]
    NothingMoves {
        /// The `let`.
        name: &'static str,
        metrics: String,
    },
    /// Evidence that cannot be replaced.
    #[error("{definitions}: {source}")]
    EvidenceLet {
        /// The definition file.
        definitions: String,
        /// The reason.
        source: ReplaceError,
    },
    /// A file is not the one that was opened.
    #[error(
        "{name}: the file changed while it was read: the results would mix two versions of it\n  \
         help: wait until nothing writes to it, then run the command again"
    )]
    Changed {
        /// The file.
        name: String,
    },
    /// Something is wrong with one file.
    #[error("{name}: {source}")]
    File {
        /// The file.
        name: String,
        source: Box<dyn Error + Send + Sync>,
    },
    /// No file at all.
    #[error("expected at least one file of scores, found none\n  help: name traces or scores")]
    NoScores,
    /// A list of lost episodes that cannot be read.
    #[error(transparent)]
    LostList(#[from] LostListError),
    /// A cell that mixes episodes which were recorded differently.
    #[error(
        "{cell}: expected episodes that were recorded alike, found {counts}: {differences}; for example {episodes}\n  help: {help}"
    )]
    Pooled {
        /// The experiment and model.
        cell: String,
        /// Two episodes that differ.
        episodes: String,
        /// The number of episodes with each fingerprint.
        counts: String,
        /// In which parts the fingerprints differ.
        differences: String,
        /// The remedy.
        help: String,
    },
    /// Scores under other definitions than those asked for.
    #[error(
        "{file}: expected scores under `{wanted}` ({wanted_hash}), found scores under `{found}` ({found_hash})\n  \
         help: score the traces again with --definitions {wanted}"
    )]
    OtherDefinitions {
        file: String,
        /// The definitions asked for.
        wanted: String,
        /// The first digits of their hash.
        wanted_hash: String,
        /// The definitions of the scores.
        found: String,
        /// The first digits of their hash.
        found_hash: String,
    },
    /// Experiments that need different definitions.
    #[error("expected experiments that the same definitions score, found {}", differing(.groups))]
    DefinitionsDiffer {
        /// The experiments, by what scores them.
        groups: Vec<ScoredAlike>,
    },
    /// An experiment whose definitions are a file that traces do not carry.
    #[error(
        "{}: expected the definition file `{}`{}, which scores these episodes, found its name alone\n  \
         help: a trace carries no definition file: give it with --definitions FILE",
        .group.experiments.iter().map(String::as_str).collect::<Vec<_>>().join(", "),
        .group.definitions,
        .group.hash.as_deref().map(|hash| format!(" (sha256 {hash})")).unwrap_or_default()
    )]
    DefinitionsElsewhere {
        /// The experiments and the file.
        group: ScoredAlike,
    },
    /// Definitions that do not say what decides an experiment.
    #[error(
        "{experiment}: expected definitions that score it, as `{own}` do, found `{definitions}`, whose zeros would mean nothing\n  \
         help: leave --definitions out, or give --definitions {own}; a file of your own scores it with `include = [\"{own}\"]`, \
         or with a table `[experiment.{experiment}]`; `--where` leaves its episodes out"
    )]
    NotScored {
        experiment: String,
        /// The definitions that were asked for.
        definitions: String,
        /// Those that the experiment names.
        own: String,
    },
    /// The definitions are about a mirror, and the traces about something else.
    #[error(
        "`{file}` has no column of the domain `mirror`: expected definitions of its own domain, found `{definitions}`\n  \
         help: give --definitions a file that says `domain = \"NAME\"` and declares the columns that it reads, `[column.NAME]`"
    )]
    OtherDomain {
        /// The first trace.
        file: String,
        /// The definitions that were asked for, or the default ones.
        definitions: String,
    },
    /// Definitions to compare, and nothing to score with them.
    #[error(
        "`{name}` are definitions: expected traces to score with them, found none\n  \
         help: name the traces after OLD and NEW"
    )]
    NoTraces {
        /// The definitions.
        name: String,
    },
    /// A side of a comparison that holds no scores.
    #[error(
        "{argument}: expected definitions, scores or a report's folder, found no scores in it\n  \
         help: OLD and NEW come first, the traces after them"
    )]
    NoSide {
        /// As given.
        argument: String,
    },
    /// A table that a style does not lay out.
    #[error("no table of the style `{style}` is named `{name}`; it has {known}{hint}")]
    NoTable {
        /// The name asked for.
        name: String,
        style: String,
        /// The tables that there are.
        known: String,
        /// The nearest of them, in words; may be empty.
        hint: String,
    },
    /// A metric of which neither direction is better.
    #[error(
        "{metric}: expected a metric with `better = \"higher\"` or \"lower\", found none\n  help: name another metric with --metric"
    )]
    NoDirection { metric: String },
    /// A filter that keeps no episode.
    #[error("{words}\n  help: give a filter that holds for some of them, or none")]
    EmptyFilter {
        /// The number of episodes, and the values of the columns that the filter names.
        words: String,
    },
    /// A report would be written over the one that it is made from.
    #[error(
        "{out}: expected a folder beside the report, found the report itself\n  \
         help: the old report stays as it is; give another --out"
    )]
    OntoItself {
        /// The folder.
        out: String,
    },
    /// The style of a report is not what it was.
    #[error(
        "the style `{name}` changed since the report was made: expected sha256 {expected}, found {found}\n  \
         help: name the style with --style"
    )]
    StyleChanged {
        /// The style.
        name: String,
        /// Its hash in the manifest.
        expected: String,
        /// Its hash now.
        found: String,
    },
    /// The style of a report was a file.
    #[error(
        "the report's style `{name}` (sha256 {expected}) was a file, and a manifest keeps no paths\n  \
         help: name the style with --style"
    )]
    StyleGone {
        /// The style.
        name: String,
        /// Its hash in the manifest.
        expected: String,
    },
    /// This build lacks a feature.
    #[error(
        "`{what}` needs Polars, which this build lacks\n  \
         help: build with it: cargo build --release --features polars"
    )]
    WithoutPolars {
        /// The option or the command.
        what: &'static str,
    },
    /// The colours of an import cannot be taken.
    #[error("--palette {typed}: {words}")]
    Palette {
        typed: String,
        /// The problem, and a remedy.
        words: String,
    },
    /// Lines of steps are not as they must be.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// The traces are not as they must be.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// The traces cannot be scored.
    #[error(transparent)]
    Score(#[from] ScoreError),
    /// A definition file is not as it must be.
    #[error(transparent)]
    Definitions(#[from] FileError),
    /// A filter is not as it must be.
    #[error(transparent)]
    Filter(#[from] Faults),
    /// A metric that the definitions do not have.
    #[error(transparent)]
    Metric(#[from] UnknownMetric),
    /// An episode cannot be explained.
    #[error(transparent)]
    Evidence(#[from] EvidenceError),
    /// Scores cannot be written.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// Scores cannot be filtered.
    #[error(transparent)]
    Select(#[from] SelectError),
    /// Episodes cannot be grouped.
    #[error(transparent)]
    Group(#[from] GroupError),
    /// Scores whose traces declare one experiment differently; a level that none can have.
    #[error(transparent)]
    Declaration(#[from] DeclarationError),
    /// Sums of squares leave 128 bits.
    #[error(transparent)]
    Overflow(#[from] MomentOverflow),
    /// A style is not as it must be.
    #[error(transparent)]
    Style(#[from] StyleError),
    /// A published table is not as it must be.
    #[error(transparent)]
    Published(#[from] PublishedError),
    /// A published table is not the one that the traces give.
    #[error(transparent)]
    Comparison(#[from] ComparisonError),
    /// Published tables cannot be audited.
    #[error(transparent)]
    Audit(#[from] AuditError),
    /// A figure cannot be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// A figure cannot be encoded.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// The page of a report cannot be made.
    #[error(transparent)]
    Page(#[from] HtmlError),
    /// A report cannot be written.
    #[error(transparent)]
    Bundle(#[from] BundleError),
    /// A report cannot be made again.
    #[error(transparent)]
    Provenance(#[from] ProvenanceError),
    /// Spark gave no scores.
    #[error(transparent)]
    Spark(#[from] SparkError),
    /// Polars gave no scores.
    #[cfg(feature = "polars")]
    #[error(transparent)]
    Polars(#[from] engines::polars::run::PolarsError),
    /// An output is one of the files that are read.
    #[error(transparent)]
    Target(#[from] TargetIsInput),
    /// The operating system refuses.
    #[error(transparent)]
    System(#[from] io::Error),
}

impl StudyError {
    pub(super) fn file(name: &str, source: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::File { name: name.to_owned(), source: source.into() }
    }

    /// The faults of definitions or of a filter, which have their own layout, with the source underlined.
    pub fn faults(&self) -> Option<&Faults> {
        match self {
            Self::Filter(faults) | Self::Select(SelectError::Condition(faults)) => Some(faults),
            Self::Definitions(error) => faults_of_file(error),
            Self::Style(StyleError::Faults(faults)) => Some(faults),
            Self::Score(error) | Self::Evidence(EvidenceError::Score(error)) => faults_of_scoring(error),
            #[cfg(feature = "polars")]
            Self::Polars(engines::polars::run::PolarsError::Score(error)) => faults_of_scoring(error),
            _ => None,
        }
    }

    /// The system's own error where writing the answer failed, such as a pipe whose reader is gone.
    ///
    /// # Errors
    /// This error, if it is another one.
    pub fn into_io(self) -> Result<io::Error, Self> {
        match self {
            Self::System(error) => Ok(error),
            Self::Format(error) => error.into_io().map_err(Self::Format),
            #[cfg(feature = "polars")]
            Self::Polars(engines::polars::run::PolarsError::ReaderGone) => Ok(io::ErrorKind::BrokenPipe.into()),
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

fn faults_of_scoring(error: &ScoreError) -> Option<&Faults> {
    match error {
        ScoreError::Condition(faults) => Some(faults),
        ScoreError::Definitions(error) => faults_of_file(error),
        _ => None,
    }
}

fn faults_of_file(error: &FileError) -> Option<&Faults> {
    match error {
        FileError::Faults(faults) => Some(faults),
        FileError::Unreadable { .. } => None,
    }
}
