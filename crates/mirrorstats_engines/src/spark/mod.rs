//! Spark: the SQL lowering submitted to a cluster through the user's own installation.
//!
//! ```text
//! locate ──► submit ──► driver.py on the user's Spark ──► answer
//! (whose      (a request,                                   (the table, a folder of Parquet,
//!  Spark)      a child process)                              or what was refused)
//! ```
//!
//! Rules: the statement reads only the view `steps`, which the driver makes from the named traces. One more aggregation
//! (`check`) refuses whatever the scan of traces refuses. The exception is what only files and their order can show:
//! that an episode's rows are together, in order, in one file. Nothing is skipped silently: files that Spark would
//! ignore and columns that it would read as null are refused.

mod answer;
mod cause;
mod check;
mod locate;
mod request;
pub mod setting;
pub mod source;
mod submit;

use std::fs;
use std::io;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use mirrorstats_exact::replace::TemporaryFolder;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_metric::sql::LoweringError;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_trace::diagnostic::Finding;

use self::answer::Answer;
use self::request::{Request, TABLE};
use self::setting::Setting;
use self::source::Sources;

#[derive(Clone, Debug, Default)]
pub struct Cluster {
    /// `spark://host:port`, `yarn`, `local[2]`, ...; the master in Spark's own configuration if absent.
    pub master: Option<String>,
    pub settings: Vec<Setting>,
    /// Give up after this many seconds; never if absent.
    pub timeout_s: Option<NonZeroU32>,
    /// The file for Spark's own log; no log if absent.
    pub log: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    pub definitions: &'a Definitions,
    pub labels: &'a [String],
    pub sources: &'a Sources,
}

#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub struct Written {
    pub episodes: u64,
}

#[derive(Debug, thiserror::Error)]
pub enum SparkError {
    #[error(
        "no Spark found: SPARK_HOME is not set, there is no `spark-submit` on PATH, and `{python}` has no package \
         `pyspark`; install one of them, such as with `pip install pyspark`"
    )]
    NoSpark { python: String },
    #[error("SPARK_HOME is `{home}`, where there is no bin/spark-submit; set it to the folder of a Spark, or unset it")]
    Home { home: String },
    #[error("Spark found no Java that it can run on; install Java 17 or newer, or set JAVA_HOME ({words})")]
    Java { words: String },
    #[error("cannot connect to the master `{master}`: {words}; is it running, and is this the URL on its web page?")]
    Master { master: String, words: String },
    #[error("cannot {what}")]
    System { what: String, source: io::Error },
    #[error(transparent)]
    Lowering(#[from] LoweringError),
    #[error(
        "`{column}`: expected a column of the traces, found a label beside them, which Spark does not read\n  \
         help: leave --engine spark out"
    )]
    Label { column: String },
    #[error("`{folder}` already exists; Spark writes a new folder: remove it or choose another name")]
    Exists { folder: String },
    #[error(
        "`{uri}`: expected Parquet files, or folders with *.parquet in them, found none; files that begin with `_` or `.` are skipped"
    )]
    Empty { uri: String },
    #[error(
        "column `{column}` of {file}: expected {expected}, found {found}; write it with this type in all traces, or choose other metrics with --metrics"
    )]
    Column { file: String, column: String, expected: String, found: String },
    #[error(
        "expected {expected} rows by the footers of the traces, Spark read {found}; every worker must see the same files \
         under the same path, and none may begin with `_` or `.`"
    )]
    Rows { expected: u64, found: u64 },
    #[error("{finding}{}", more_episodes(*.more))]
    Rule { finding: Box<Finding>, more: u64 },
    #[error("Spark has not answered in {seconds} s (--spark-timeout), and was stopped")]
    Late { seconds: u32 },
    #[error("Spark: {cause}\n  help: --spark-log FILE keeps Spark's own log")]
    Failed { cause: String },
    #[error("cannot read what the driver on Spark answered: {words}; report this as a fault of mirrorstats")]
    Answer { words: String },
}

impl SparkError {
    fn system(what: impl Into<String>) -> impl FnOnce(io::Error) -> Self {
        let what = what.into();
        move |source| Self::System { what, source }
    }
}

fn more_episodes(more: u64) -> String {
    match more {
        0 => String::new(),
        1 => "\n  and 1 more episode breaks a rule".to_owned(),
        more => format!("\n  and {more} more episodes break a rule"),
    }
}

pub fn score(job: Job<'_>, cluster: &Cluster) -> Result<EpisodeTable, SparkError> {
    let place = temporary_folder()?;
    run(job, cluster, place.path(), None)?;
    answer::table(&place.path().join(TABLE), job)
}

/// Scores on Spark, which writes the table as a folder of Parquet with the definitions in every file.
pub fn write(job: Job<'_>, cluster: &Cluster, folder: &str) -> Result<Written, SparkError> {
    let target = if source::is_uri(folder) {
        folder.to_owned()
    } else {
        if fs::symlink_metadata(folder).is_ok() {
            return Err(SparkError::Exists { folder: folder.to_owned() });
        }
        source::local_uri(Path::new(folder)).map_err(SparkError::system(format!("resolve `{folder}`")))?
    };
    run(job, cluster, temporary_folder()?.path(), Some(target))
}

/// The private folder of one submission: its request, which may hold secrets, and the driver's answer.
fn temporary_folder() -> Result<TemporaryFolder, SparkError> {
    TemporaryFolder::private("spark").map_err(SparkError::system("make a temporary folder"))
}

fn run(job: Job<'_>, cluster: &Cluster, place: &Path, folder: Option<String>) -> Result<Written, SparkError> {
    let request = Request::new(job, cluster, place, folder)?;
    match submit::submit(&request, cluster, place)? {
        Answer::Done(written) => Ok(written),
        Answer::Refused(refused) => Err(refused.error(job)),
        Answer::Failed(failed) => Err(cause::of_failure(&failed, cluster)),
        Answer::Late {} => Err(SparkError::Late { seconds: cluster.timeout_s.map_or(0, NonZeroU32::get) }),
    }
}
