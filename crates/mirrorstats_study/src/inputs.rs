//! The inputs of a study: traces, or files of scores. Each input is recognised and opened once.

use std::error::Error;
use std::ffi::OsString;
use std::io::{self, Read};
use std::path::Path;
use std::time::SystemTime;

use crate::StudyError;
use crate::error::kinds;
use mirrorstats_engines::spark::source::is_uri;
use mirrorstats_exact::hash;
use mirrorstats_report::bundle;
use mirrorstats_score::format::{self, Format};
use mirrorstats_trace::beside::labels::Labels;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::inputs::{self, Input};
use mirrorstats_trace::read::open::TraceSet;

#[derive(Debug, thiserror::Error)]
pub enum InputError {
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
    #[error("expected at least one file of scores, found none\n  help: name traces or scores")]
    NoScores,
    #[error(
        "{file}: expected scores under `{wanted}` ({wanted_hash}), found scores under `{found}` ({found_hash})\n  \
         help: score the traces again with --definitions {wanted}"
    )]
    OtherDefinitions { file: String, wanted: String, wanted_hash: String, found: String, found_hash: String },
    #[error(
        "{name}: the file changed while it was read: the results would mix two versions of it\n  \
         help: wait until nothing writes to it, then run the command again"
    )]
    Changed { name: String },
    #[error("{name}: {source}")]
    Unreadable { name: String, source: Box<dyn Error + Send + Sync> },
}

kinds! { Input: InputError; }

impl InputError {
    pub(crate) fn unreadable(input: &Input, source: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Unreadable { name: input.name.clone(), source: source.into() }
    }
}

#[derive(Debug)]
pub enum Source {
    Traces(Box<TraceSet>),
    Scores(Vec<ScoreFile>),
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScoreFile {
    pub input: Input,
    pub format: Format,
    /// True if it carries its definitions; text formats and files of other engines do not.
    pub carries_definitions: bool,
}

/// The files that some arguments name: paths, folders, globs, or `-` for a list, which is read from `list`.
pub fn resolve(arguments: &[OsString], list: impl Read) -> Result<Vec<Input>, StudyError> {
    match arguments.iter().filter_map(|argument| argument.to_str()).find(|argument| is_uri(argument)) {
        Some(uri) => Err(InputError::Uri { uri: uri.to_owned() }.into()),
        None => Ok(inputs::resolve(arguments, list)?),
    }
}

impl Source {
    /// Recognises and opens files, which must all be traces or all be scores.
    pub fn open(inputs: &[Input]) -> Result<Self, StudyError> {
        match ScoreFile::all(inputs)? {
            Some(scores) => Ok(Self::Scores(scores)),
            None => Ok(Self::Traces(Box::new(labelled(inputs)?))),
        }
    }

    pub fn traces(&self) -> Result<&TraceSet, InputError> {
        match self {
            Self::Traces(traces) => Ok(traces),
            Self::Scores(files) => {
                let scores = files.first().map_or_else(String::new, |file| file.input.name.clone());
                Err(InputError::NoSteps { scores })
            }
        }
    }
}

pub(crate) fn labelled(inputs: &[Input]) -> Result<TraceSet, StudyError> {
    let labels = Labels::beside(inputs).map_err(TraceError::from)?;
    Ok(TraceSet::open(inputs)?.with_labels(labels)?)
}

impl ScoreFile {
    /// The files as files of scores; `None` if they are all something else.
    pub fn all(inputs: &[Input]) -> Result<Option<Vec<Self>>, InputError> {
        let scores: Vec<Self> = inputs.iter().filter_map(Self::recognise).collect();
        match scores.first() {
            None => Ok(None),
            Some(_) if scores.len() == inputs.len() => Ok(Some(scores)),
            Some(first) => Err(InputError::Mixed { scores: first.input.name.clone() }),
        }
    }

    /// The file as a file of scores; `None` for any other file, which is opened as a trace.
    fn recognise(input: &Input) -> Option<Self> {
        let scores = |format, carries_definitions| Some(Self { input: input.clone(), format, carries_definitions });
        match Format::of_name(&input.name) {
            Ok(text @ (Format::Csv | Format::JsonLines)) => scores(text, false),
            Ok(Format::Parquet) | Err(_) => {
                // A file that cannot be opened is reported later, as a trace.
                let file = mirrorstats_exact::input::open(&input.path).ok()?;
                if !format::holds_scores(&file, &inputs::folder_values(&input.path)) {
                    return None;
                }
                scores(Format::Parquet, format::holds_definitions(&file))
            }
        }
    }
}

/// An input, and the state of its file when it was opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Stamp {
    input: Input,
    state: FileState,
}

/// The state of a file on systems that report it: device and inode, size, modification and inode change times.
type FileState = ((u64, u64), u64, Option<SystemTime>, (i64, i64));

fn state_of(path: &Path) -> io::Result<FileState> {
    let metadata = std::fs::metadata(path)?;
    #[cfg(unix)]
    let (identity, changed) = {
        use std::os::unix::fs::MetadataExt as _;
        ((metadata.dev(), metadata.ino()), (metadata.ctime(), metadata.ctime_nsec()))
    };
    #[cfg(not(unix))]
    let (identity, changed) = ((0, 0), (0, 0));
    Ok((identity, metadata.len(), metadata.modified().ok(), changed))
}

impl Stamp {
    pub fn of(input: &Input) -> Result<Self, InputError> {
        let state = state_of(&input.path).map_err(|error| InputError::unreadable(input, error))?;
        Ok(Self { input: input.clone(), state })
    }

    /// Returns an error if the file was replaced or written to.
    pub fn check(&self) -> Result<(), InputError> {
        match state_of(&self.input.path) {
            Ok(state) if state == self.state => Ok(()),
            _ => Err(InputError::Changed { name: self.input.name.clone() }),
        }
    }
}

pub(crate) fn hashes(inputs: &[Input]) -> Result<Vec<bundle::InputFile>, InputError> {
    let hash_of = |input: &Input| {
        let file = mirrorstats_exact::input::open(&input.path)?;
        let bytes = file.metadata()?.len();
        Ok(bundle::InputFile::new(input.name.as_ref(), hash::of_reader(file)?, bytes))
    };
    inputs.iter().map(|input| hash_of(input).map_err(|error: io::Error| InputError::unreadable(input, error))).collect()
}
