//! Answers on standard output, and files that appear whole or not at all.
//!
//! A command's files are on the disk when it ends, and no loss of power leaves half of one.

use std::fmt::{self, Display, Write as _};
use std::fs::File;
use std::io::{self, Write as _};
use std::path::Path;

use serde::Serialize;

use crate::cli::{Failure, Outcome};
use mirrorstats_exact::escape::visible_lines;
use mirrorstats_exact::replace::{self, Content, FolderFiles, NewFile};
use mirrorstats_trace::footers::checksums::stale_note;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceFile;

/// Prints an answer: text for people or JSON for programs.
pub fn print<T: Display + Serialize>(answer: &T, json: bool) -> Result<Outcome, Failure> {
    print_with(answer, json, |text, answer| write!(text, "{answer}"))
}

/// Prints an answer whose text `write` makes.
pub fn print_with<T: Serialize>(
    answer: &T,
    json: bool,
    write: impl FnOnce(&mut String, &T) -> fmt::Result,
) -> Result<Outcome, Failure> {
    if json {
        return print_json(answer);
    }
    let mut text = String::new();
    write(&mut text, answer)?;
    plain(visible_lines(text.trim_end()) + "\n")
}

/// Prints an answer: a text that may have emphasis, or JSON.
pub fn print_rendered<T: Serialize>(
    answer: &T,
    json: bool,
    render: impl FnOnce(&T) -> String,
) -> Result<Outcome, Failure> {
    if json { print_json(answer) } else { plain(render(answer)) }
}

/// Prints bytes as they are.
pub fn plain(text: impl AsRef<[u8]>) -> Result<Outcome, Failure> {
    io::stdout().lock().write_all(text.as_ref())?;
    Ok(Outcome::Done)
}

pub fn print_json<T: Serialize>(answer: &T) -> Result<Outcome, Failure> {
    let mut out = io::stdout().lock();
    serde_json::to_writer_pretty(&mut out, answer).map_err(io::Error::from)?;
    writeln!(out)?;
    Ok(Outcome::Done)
}

pub fn note(words: &str) {
    say(&format!("note: {words}"));
}

pub fn notes(notes: &[String]) {
    for words in notes {
        note(words);
    }
}

/// Prints which of these traces have checksums of another file.
pub fn note_stale_checksums(inputs: &[Input]) {
    let files: Vec<TraceFile> = inputs.iter().filter_map(|input| TraceFile::open(input).ok()).collect();
    notes(stale_note(&files).as_slice());
}

/// Prints progress on standard error. If it is closed, the message is dropped and the work continues.
pub fn say(words: &str) {
    let _ = writeln!(io::stderr(), "{}", visible_lines(words));
}

pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    write_file_with(path, |file| Ok(file.write_all(bytes)?))
}

/// Replaces a file by the output of `write`; the new one is on the disk when this returns.
pub fn write_file_with(path: &Path, write: impl FnOnce(&mut File) -> Result<(), Failure>) -> Result<(), Failure> {
    let mut file = create(path)?;
    write(file.as_file_mut()).map_err(|failure| match failure {
        Failure::Output(error) => unwritable(path, error),
        other => other,
    })?;
    file.commit().map_err(|error| unwritable(path, error))
}

/// Replaces files of a folder together, by their paths inside it; other files stay.
pub fn write_folder(folder: &Path, files: &[(&Path, Content<'_>)]) -> Result<(), Failure> {
    let files = FolderFiles { new: files, index: None, old: &|_| Vec::new() };
    replace::replace_folder(folder, &files).map_err(|error| unwritable(&error.path, error.source))
}

pub fn create(path: &Path) -> Result<NewFile, Failure> {
    NewFile::create(path).map_err(|error| unwritable(path, error))
}

pub fn make_folder(folder: &Path) -> Result<(), Failure> {
    replace::make_folder(folder).map_err(|error| {
        let words = "help: is there a file of that name, and is the folder above it writable?";
        Failure::input(format!("cannot make the folder `{}`: {error}\n  {words}", folder.display()))
    })
}

/// Refuses an output that is one of the files that the command reads.
pub fn check_target<P: AsRef<Path>>(target: &Path, read: impl IntoIterator<Item = P>) -> Result<(), Failure> {
    Ok(replace::check_target(target, read, "one that is read")?)
}

pub fn unwritable(path: &Path, error: io::Error) -> Failure {
    // The reader of a pipe may stop early, even if the pipe has a name.
    if error.kind() == io::ErrorKind::BrokenPipe {
        return Failure::Output(error);
    }
    Failure::input(format!(
        "cannot write `{}`: {error}\n  help: is the folder there and writable, and the disk not full?",
        path.display(),
    ))
}
