//! The inputs of a study: traces, or files of scores. Each input is recognised and opened once.

use std::ffi::OsString;
use std::fs::Metadata;
use std::io::{self, Read};
use std::path::PathBuf;
use std::time::{Duration, UNIX_EPOCH};

use crate::StudyError;
use mirrorstats_engines::spark::source::is_uri;
use mirrorstats_exact::hash;
use mirrorstats_report::bundle;
use mirrorstats_score::format::{self, Format};
use mirrorstats_trace::beside::labels::Labels;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::inputs::{self, Input};
use mirrorstats_trace::read::open::TraceSet;

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
        Some(uri) => Err(StudyError::Uri { uri: uri.to_owned() }),
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

    pub fn traces(&self) -> Result<&TraceSet, StudyError> {
        match self {
            Self::Traces(traces) => Ok(traces),
            Self::Scores(files) => {
                let scores = files.first().map_or_else(String::new, |file| file.input.name.clone());
                Err(StudyError::NoSteps { scores })
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
    pub fn all(inputs: &[Input]) -> Result<Option<Vec<Self>>, StudyError> {
        let scores: Vec<Self> = inputs.iter().filter_map(Self::recognise).collect();
        match scores.first() {
            None => Ok(None),
            Some(_) if scores.len() == inputs.len() => Ok(Some(scores)),
            Some(first) => Err(StudyError::Mixed { scores: first.input.name.clone() }),
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

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Stamp {
    name: String,
    path: PathBuf,
    state: FileState,
}

/// The state of a file on systems that report it: device, inode, size, modification and inode change times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct FileState {
    identity: (u64, u64),
    bytes: u64,
    written: Option<Duration>,
    changed: (i64, i64),
}

impl FileState {
    fn of(metadata: &Metadata) -> Self {
        #[cfg(unix)]
        let (identity, changed) = {
            use std::os::unix::fs::MetadataExt as _;
            ((metadata.dev(), metadata.ino()), (metadata.ctime(), metadata.ctime_nsec()))
        };
        #[cfg(not(unix))]
        let (identity, changed) = ((0, 0), (0, 0));
        let written = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        Self { identity, bytes: metadata.len(), written, changed }
    }
}

impl Stamp {
    pub fn of(input: &Input) -> Result<Self, StudyError> {
        let state = state_of(&input.path).map_err(|source| StudyError::file(&input.name, source))?;
        Ok(Self { name: input.name.clone(), path: input.path.clone(), state })
    }

    /// Returns an error if the file was replaced or written to.
    pub fn check(&self) -> Result<(), StudyError> {
        match state_of(&self.path) {
            Ok(state) if state == self.state => Ok(()),
            _ => Err(StudyError::Changed { name: self.name.clone() }),
        }
    }
}

fn state_of(path: &std::path::Path) -> io::Result<FileState> {
    std::fs::metadata(path).map(|metadata| FileState::of(&metadata))
}

pub(crate) fn hashes(inputs: &[Input]) -> Result<Vec<bundle::InputFile>, StudyError> {
    inputs.iter().map(hash_of).collect()
}

fn hash_of(input: &Input) -> Result<bundle::InputFile, StudyError> {
    let read = || {
        let file = mirrorstats_exact::input::open(&input.path)?;
        let bytes = file.metadata()?.len();
        Ok::<_, io::Error>((hash::of_reader(file)?, bytes))
    };
    let (sha256, bytes) = read().map_err(|error| StudyError::file(&input.name, error))?;
    Ok(bundle::InputFile::new(input.name.as_ref(), sha256, bytes))
}
