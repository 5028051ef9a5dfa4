//! Resolves TRACES arguments to a sorted list of distinct files, with names that are the same on any machine.
//!
//! An argument is a file, a folder (with every `*.parquet` below it, or else the logs in it), a glob that the shell did not expand, or `-` for
//! a list of files and folders on standard input, one per line. An existing name is taken literally, whatever its
//! characters. Inside a folder, links to folders are not followed. Reports and names that begin with `_` or `.` are
//! skipped: other programs leave such files beside their Parquet.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::{OsStr, OsString};
use std::fs;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use super::error::TraceError;
use super::glob_paths::{GlobError, is_glob, matches};

use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;
use mirrorstats_exact::replace::{folder_of, is_unfinished};

/// A file to read, and its name in messages and outputs.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Input {
    /// The typed path if it was relative; relative to the current folder if below it; else only the file's name. Never
    /// absolute, with `/` between its parts.
    pub name: String,
    pub path: PathBuf,
}

impl Input {
    pub fn new(path: impl Into<PathBuf>) -> Self {
        let path = path.into();
        Self { name: display_name(&path), path }
    }
}

/// The files of the arguments, ordered by name; each file appears once, whatever its spellings.
///
/// `-` reads `list`, which is standard input in the program.
pub fn resolve(arguments: &[OsString], list: impl Read) -> Result<Vec<Input>, TraceError> {
    let mut list = Some(list);
    let mut paths = Vec::new();
    for argument in arguments {
        if argument != "-" {
            paths.extend(expand(argument)?);
        } else if let Some(list) = list.take() {
            paths.extend(listed(list)?);
        }
    }
    let folders: BTreeSet<&Path> = paths.iter().map(|path| folder_of(path)).collect();
    if let Some(folder) = folders.into_iter().find(|folder| is_unfinished(folder)) {
        return Err(TraceError::NoInput {
            argument: folder.display().to_string(),
            expected: "the files of one command",
            found: "old and new ones, since their replacement was broken off".into(),
            help: "run the command again that writes there: it puts them in order",
        });
    }
    let mut files = BTreeMap::new();
    for path in paths {
        let input = Input::new(&path);
        // A path that cannot be resolved is reported on opening, under its own name.
        let place = fs::canonicalize(&path).unwrap_or(path);
        let kept = files.entry(place).or_insert_with(|| input.clone());
        // Keep the shortest name, so that the order of the arguments does not matter.
        if (input.name.len(), &input.name) < (kept.name.len(), &kept.name) {
            *kept = input;
        }
    }
    let mut inputs: Vec<_> = files.into_values().collect();
    inputs.sort();
    Ok(inputs)
}

fn expand(argument: &OsStr) -> Result<Vec<PathBuf>, TraceError> {
    let no_input = |found: &str, help| TraceError::NoInput {
        argument: argument.to_string_lossy().into_owned(),
        expected: "a trace file, a folder of them, a glob, or `-`",
        found: found.to_owned(),
        help,
    };
    let some =
        |traces: Vec<PathBuf>, found, help| if traces.is_empty() { Err(no_input(found, help)) } else { Ok(traces) };
    let path = Path::new(argument);
    if path.exists() {
        let help = "name the folder that the recorder wrote to";
        if is_data_set(path) {
            return Ok(vec![path.to_owned()]);
        }
        let traces = traces_at(path)?;
        let files = if traces.is_empty() { logs_in(path)? } else { traces };
        return some(files, "a folder without any *.parquet in it", help);
    }
    // A pattern is text; other bytes can only be a name.
    let Some(pattern) = argument.to_str().filter(|text| is_glob(text)) else {
        return Err(no_input(
            "no such file or folder",
            "a path is relative to the current folder; a file may be elsewhere, or not recorded yet",
        ));
    };
    let matches = matches(pattern).map_err(|error| match error {
        GlobError::Pattern(error) => no_input(error.msg, "correct the glob, or name the files"),
        GlobError::Folder(folder, source) => TraceError::Read { what: folder.display().to_string(), source },
    })?;
    let traces = matches.iter().map(|path| traces_at(path)).collect::<Result<Vec<_>, _>>()?.concat();
    some(traces, "a glob that matches no trace", "check the pattern and the current folder")
}

/// A hundred thousand names take some 20 MB.
const LONGEST_LIST: Limit = Limit::new("bytes of a list of traces", 64 << 20);

fn listed(list: impl Read) -> Result<Vec<PathBuf>, TraceError> {
    let bytes = input::bytes_of(list, LONGEST_LIST)
        .map_err(|source| TraceError::Read { what: "the list on standard input".into(), source })?;
    let mut paths = Vec::new();
    for line in bytes.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii).filter(|line| !line.is_empty()) {
        paths.extend(expand(&name_of(line)?)?);
    }
    if paths.is_empty() {
        return Err(TraceError::NoInput {
            argument: "-".into(),
            expected: "a list of trace files on standard input, one a line",
            found: "no line".into(),
            help: "pipe one in, as in `ls runs/*.parquet | mirrorstats report -`",
        });
    }
    Ok(paths)
}

/// A name from the system's bytes: any on Unix, UTF-8 elsewhere.
#[cfg(unix)]
#[expect(clippy::unnecessary_wraps, reason = "elsewhere not every name is one")]
fn name_of(bytes: &[u8]) -> Result<OsString, TraceError> {
    use std::os::unix::ffi::OsStrExt as _;
    Ok(OsStr::from_bytes(bytes).to_owned())
}

#[cfg(not(unix))]
fn name_of(bytes: &[u8]) -> Result<OsString, TraceError> {
    let text = input::utf8(bytes.to_owned());
    text.map(Into::into).map_err(|source| TraceError::Read { what: "the list on standard input".into(), source })
}

pub fn traces_at(path: &Path) -> Result<Vec<PathBuf>, TraceError> {
    if !path.is_dir() || is_data_set(path) {
        return Ok(vec![path.to_owned()]);
    }
    if is_bundle(path) {
        return traces_at(&path.join("traces"));
    }
    let mut files = files_below(path)?;
    files.retain(|file| file.extension() == Some(OsStr::new("parquet")));
    Ok(files)
}

/// The files in a folder and in those below it, except hidden ones and what a report holds.
fn files_below(folder: &Path) -> Result<Vec<PathBuf>, TraceError> {
    let failed = |source| TraceError::Read { what: folder.display().to_string(), source };
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let below = entry.path();
        if entry.file_name().to_string_lossy().starts_with(['_', '.']) {
            continue;
        }
        if entry.file_type().map_err(failed)?.is_dir() {
            let below = if is_bundle(&below) { below.join("traces") } else { below };
            if !is_report(&below) {
                files.extend(files_below(&below)?);
            }
        } else if !below.is_dir() {
            files.push(below);
        }
    }
    Ok(files)
}

/// Returns true if the folder is a data set of `LeRobot`, whose rows lie in several files.
pub fn is_data_set(folder: &Path) -> bool {
    folder.join("meta/info.json").is_file()
}

/// Endings of logs of other programs, and one that other files have too.
const LOGS: [&str; 4] = ["csv", "eval", "jsonl", "tsv"];
const MAYBE_LOG: &str = "json";

/// Folders of files that inspect-robots writes beside its logs: the steps of each trial, and its calls.
const BESIDE_LOGS: [&str; 2] = ["actions", "wire"];

/// The logs in a folder without traces and below it; not the lists that mirrorstats writes beside traces, nor the files
/// that belong to a log beside them.
fn logs_in(folder: &Path) -> Result<Vec<PathBuf>, TraceError> {
    let ends_in = |path: &Path, ending: &str| path.extension().is_some_and(|found| found == ending);
    let is_list = |path: &Path| ["lost.jsonl", "labels.jsonl"].iter().any(|name| path.ends_with(name));
    let files = files_below(folder)?;
    let with_logs: BTreeSet<&Path> =
        files.iter().filter(|path| ends_in(path, MAYBE_LOG)).map(|path| folder_of(path)).collect();
    let is_beside = |path: &Path| {
        let folders = path.ancestors().filter(|above| BESIDE_LOGS.iter().any(|name| above.ends_with(name)));
        folders.map(folder_of).any(|above| with_logs.contains(above))
    };
    let is_log = |path: &&PathBuf| LOGS.iter().any(|log| ends_in(path, log)) && !is_list(path) && !is_beside(path);
    let logs: Vec<PathBuf> = files.iter().filter(is_log).cloned().collect();
    Ok(if logs.is_empty() { files.into_iter().filter(|path| ends_in(path, MAYBE_LOG)).collect() } else { logs })
}

/// Returns true if `mirrorstats report` wrote the folder: its Parquet file holds scores, not steps.
pub fn is_report(folder: &Path) -> bool {
    ["manifest.json", "cells.csv", "episodes.parquet"].iter().all(|name| folder.join(name).is_file())
}

/// Returns true if `mirrorstats publish` wrote the folder: its steps are in `traces`.
fn is_bundle(folder: &Path) -> bool {
    folder.join("croissant.json").is_file() && folder.join("manifest.json").is_file() && folder.join("traces").is_dir()
}

/// The value that marks null in the name of a folder.
pub const NULL_FOLDER: &str = "__HIVE_DEFAULT_PARTITION__";

/// The columns in the folder names of a path, as in partitioned tables of Spark and others: `experiment=E1`.
///
/// `None` is the null of such a table. `%41` spells a character that a file system might refuse.
pub fn folder_values(path: &Path) -> Vec<(String, Option<String>)> {
    let folders = path.parent().into_iter().flat_map(Path::components);
    let pair = |folder: Component| {
        let (name, value) = folder.as_os_str().to_str()?.split_once('=')?;
        Some((unescaped(name), (value != NULL_FOLDER).then(|| unescaped(value))))
    };
    folders.filter_map(pair).collect()
}

/// `%41` as `A`; other text is unchanged, and so is text that would not be UTF-8, such as `%FF`.
fn unescaped(text: &str) -> String {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, others)) = rest.split_first() {
        let digits = others.get(..2).filter(|digits| first == b'%' && digits.iter().all(u8::is_ascii_hexdigit));
        let spelled = digits.and_then(|digits| u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok());
        bytes.push(spelled.unwrap_or(first));
        rest = if spelled.is_some() { &others[2..] } else { others };
    }
    String::from_utf8(bytes).unwrap_or_else(|_| text.to_owned())
}

fn display_name(path: &Path) -> String {
    let relative = if path.is_absolute() {
        let here = std::env::current_dir().unwrap_or_default();
        match path.strip_prefix(&here) {
            Ok(below) => below,
            Err(_) => path.file_name().map_or(path, Path::new),
        }
    } else {
        path
    };
    let parts: Vec<_> = relative
        .components()
        .filter(|part| !matches!(part, Component::CurDir | Component::RootDir | Component::Prefix(_)))
        .map(|part| part.as_os_str().to_string_lossy())
        .collect();
    parts.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(arguments: &[&str], list: &str) -> Result<Vec<String>, String> {
        let arguments: Vec<OsString> = arguments.iter().map(Into::into).collect();
        match resolve(&arguments, list.as_bytes()) {
            Ok(inputs) => Ok(inputs.into_iter().map(|input| input.name).collect()),
            Err(error) => Err(error.to_string()),
        }
    }

    fn folder() -> (tempfile::TempDir, String) {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir_all(folder.path().join("deep/er")).unwrap();
        for name in ["b.parquet", "a.parquet", "notes.txt", "deep/er/c.parquet", "x[1].parquet"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let path = folder.path().to_str().unwrap().to_owned();
        (folder, path)
    }

    #[test]
    fn a_folder_gives_its_traces_and_those_below() {
        let (_keep, at) = folder();
        let expected = ["a.parquet", "b.parquet", "c.parquet", "x[1].parquet"].map(String::from).to_vec();
        assert_eq!(names(&[&at], ""), Ok(expected.clone()));
        assert_eq!(names(&["-"], &format!("{at}\n\n")), Ok(expected));
    }

    #[test]
    fn other_programs_files_in_a_folder_are_passed_over() {
        let (_keep, at) = folder();
        fs::create_dir_all(format!("{at}/_temporary/0")).unwrap();
        for name in ["_temporary/0/part.parquet", "_notes.parquet", ".a.parquet", "_SUCCESS"] {
            fs::write(format!("{at}/{name}"), "").unwrap();
        }
        assert_eq!(names(&[&at], "").unwrap().len(), 4);
        assert_eq!(names(&[&format!("{at}/_notes.parquet")], ""), Ok(vec!["_notes.parquet".into()]));
    }

    #[test]
    fn folders_may_name_columns() {
        let path =
            Path::new("out/experiment=E1/model=a%2Fb%25 50%/task=%FF%41/run=__HIVE_DEFAULT_PARTITION__/x=1.parquet");
        let pair = |name: &str, value: Option<&str>| (name.to_owned(), value.map(str::to_owned));
        let expected = [
            pair("experiment", Some("E1")),
            pair("model", Some("a/b% 50%")),
            pair("task", Some("%FF%41")),
            pair("run", None),
        ];
        assert_eq!(folder_values(path), expected);
    }

    #[test]
    fn a_file_counts_once_whatever_it_is_called() {
        let (_keep, at) = folder();
        let (plain, detour, glob) =
            (format!("{at}/a.parquet"), format!("{at}/deep/../a.parquet"), format!("{at}/[a]*.parquet"));
        assert_eq!(names(&[&plain, &detour, &glob, "-"], &plain), Ok(vec!["a.parquet".into()]));
    }

    #[test]
    fn the_name_of_a_file_is_not_taken_for_a_glob() {
        let (_keep, at) = folder();
        assert_eq!(names(&[&format!("{at}/x[1].parquet")], ""), Ok(vec!["x[1].parquet".into()]));
    }

    #[test]
    fn an_argument_without_files_is_reported() {
        let (_keep, at) = folder();
        fs::create_dir(format!("{at}/none")).unwrap();
        for (argument, list, why) in [
            (format!("{at}/no.parquet"), "", "no such file or folder"),
            (format!("{at}/none"), "", "a folder without any *.parquet"),
            (format!("{at}/z*.parquet"), "", "a glob that matches no trace"),
            (format!("{at}/***"), "", "glob"),
            ("-".into(), "\n", "no line"),
            ("-".into(), "no/such.parquet", "no such file or folder"),
        ] {
            let error = names(&[&argument], list).unwrap_err();
            assert!(error.contains(why), "{argument}: {error}");
        }
    }

    #[test]
    fn names_are_relative() {
        let here = std::env::current_dir().unwrap();
        assert_eq!(Input::new("./runs//a.parquet").name, "runs/a.parquet");
        assert_eq!(Input::new("../a.parquet").name, "../a.parquet");
        assert_eq!(Input::new(here.join("runs/a.parquet")).name, "runs/a.parquet");
        assert_eq!(Input::new("/somewhere/else/a.parquet").name, "a.parquet");
    }
}
