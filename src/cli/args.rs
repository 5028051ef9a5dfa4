//! Arguments that several commands share, and the study that they open.

use std::ffi::OsString;
use std::io;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

#[cfg(feature = "sim")]
use clap::builder::OsStringValueParser;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use crate::cli::{Failure, output};
#[cfg(feature = "sim")]
use mirrorstats_record::plan::Experiments;
use mirrorstats_study::Study;
use mirrorstats_study::inputs::resolve;
use mirrorstats_study::losses::LostAs;
use mirrorstats_study::question::Question;

/// The traces to read.
#[derive(Clone, Debug, clap::Args)]
pub struct TraceArgs {
    /// Traces or logs that `import` reads: files, folders, quoted globs, or `-` for a list of files on standard input
    #[arg(required = true, value_name = "TRACES")]
    pub traces: Vec<OsString>,
    #[command(flatten)]
    pub threads: ThreadArgs,
}

impl TraceArgs {
    pub fn open(&self, definitions: Option<&Path>) -> Result<Study, Failure> {
        let inputs = resolve(&self.traces, io::stdin().lock())?;
        let study = Study::with_logs(inputs, definitions)?.threads(self.threads.count());
        output::notes(study.logs.as_ref().map_or(&[][..], |logs| &logs.notes));
        output::notes(study.stale_checksums().as_slice());
        Ok(study)
    }

    /// Opens the files as a study with these questions.
    pub fn study(&self, scoring: &ScoringArgs, grouping: &GroupingArgs) -> Result<Study, Failure> {
        let study = self.open(scoring.definitions.as_deref())?.asked(scoring.question(grouping))?;
        output::notes(study.carried_note().as_slice());
        Ok(study)
    }
}

/// The number of threads.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct ThreadArgs {
    /// Threads to use; results do not depend on it [default: all cores]
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
}

impl ThreadArgs {
    /// The number asked for, or one per core.
    pub fn count(self) -> NonZeroUsize {
        self.threads.or_else(|| std::thread::available_parallelism().ok()).unwrap_or(NonZeroUsize::MIN)
    }
}

/// The traces to score, and the definitions.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct ScoringArgs {
    /// Definitions: `paper`, `extended`, or a TOML file [default: those that the traces name, else paper]
    #[arg(long, value_name = "NAME|FILE")]
    pub definitions: Option<PathBuf>,
    /// Only these metrics, separated by commas [default: all of the definitions]
    #[arg(long, value_name = "METRICS", value_delimiter = ',')]
    pub metrics: Option<Vec<String>>,
    /// Only episodes where this holds, in the language of definitions, such as "seed = 1 and TSA = 1"
    #[arg(long = "where", value_name = "EXPR")]
    pub condition: Option<String>,
}

impl ScoringArgs {
    pub fn question(&self, grouping: &GroupingArgs) -> Question {
        Question {
            definitions: self.definitions.clone(),
            filter: self.condition.clone(),
            metrics: self.metrics.clone(),
            by: grouping.by.clone(),
            pool: grouping.pool,
            lost: grouping.lost,
            ..Question::default()
        }
    }
}

/// The grouping of episodes into cells.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct GroupingArgs {
    /// Group episodes by these columns, separated by commas [default: experiment,model, and condition where there are some]
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',')]
    pub by: Option<Vec<String>>,
    /// Allow episodes with different settings in one cell: world, prompts or agent
    #[arg(long)]
    pub pool: bool,
    /// How to count episodes that were lost because no answer came
    #[arg(long, value_parser = described(&LOST), default_value = LOST[0].1)]
    pub lost: LostAs,
}

const LOST: [Described<LostAs>; 2] = [
    (LostAs::Nothing, "excluded", "Leave them out"),
    (LostAs::Failure, "as-failure", "Count them as failures in each rate that every episode has"),
];

/// A value, its name on the command line, and its words in the help.
pub type Described<T> = (T, &'static str, &'static str);

/// Parses the name of one of some values; the help has the words of each.
pub fn described<T: Copy + Send + Sync + 'static>(all: &'static [Described<T>]) -> impl TypedValueParser<Value = T> {
    let values = all.iter().map(|(_, name, words)| PossibleValue::new(*name).help(*words));
    PossibleValuesParser::new(values)
        .map(|typed: String| all.iter().find(|(_, name, _)| *name == typed).expect("only these names are possible").0)
}

/// Parses the name of one of some values.
pub fn one_of<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.iter().map(|value| name(*value))).map(move |typed: String| {
        *all.iter().find(|value| name(**value) == typed).expect("only these names are possible")
    })
}

/// Parses a number of an option.
pub fn number(text: &str, expected: &str, holds: impl Fn(f64) -> bool) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| holds(*value));
    value.ok_or_else(|| format!("expected {expected}, found `{text}`"))
}

/// Parses typed experiments; a file name may have any bytes.
#[cfg(feature = "sim")]
pub fn experiments() -> impl TypedValueParser<Value = Experiments> {
    OsStringValueParser::new().try_map(|typed| Experiments::parse(&typed))
}
