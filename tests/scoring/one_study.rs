//! A study reads one state of its inputs: a file that changes after opening gives an error, never mixed data.

use std::fs;
use std::path::{Path, PathBuf};

use mirrorstats::{ReportOptions, Study, StudyError};
use mirrorstats_study::inputs::InputError;
use mirrorstats_trace::write::OptionalColumns;

use crate::harness::traces::{episode, write_trace};

fn trace(folder: &Path, name: &str, episodes: usize) -> PathBuf {
    let path = folder.join(name);
    let named = |at| episode(&format!("{name}-{at}"), vec![mirrorstats_trace::episodes::episode::Step::default(); 3]);
    write_trace(&path, &(0..episodes).map(named).collect::<Vec<_>>(), OptionalColumns::NONE);
    path
}

/// The answers of a study of two traces, the second one altered by `change` after opening.
fn after(change: impl Fn(&Path)) -> [Result<(), StudyError>; 3] {
    let folder = tempfile::tempdir().unwrap();
    let paths = [trace(folder.path(), "a.parquet", 2), trace(folder.path(), "b.parquet", 2)];
    let study = Study::open(paths.iter().map(|path| path.to_str().unwrap())).unwrap();
    assert_eq!(study.score().unwrap().episodes.len(), 4);
    change(&paths[1]);
    let options = ReportOptions { figures: false, ..Default::default() };
    [study.score().map(drop), study.cells().map(drop), mirrorstats::report(&study, &options).map(drop)]
}

#[track_caller]
fn assert_changed(answers: [Result<(), StudyError>; 3]) {
    for answer in answers {
        let error = answer.unwrap_err();
        match error.cause() {
            Some(InputError::Changed { name }) => assert!(name.ends_with("b.parquet"), "{name}"),
            _ => panic!("{error}"),
        }
    }
}

#[test]
fn a_file_that_was_replaced_is_an_error() {
    assert_changed(after(|path| {
        let other = trace(path.parent().unwrap(), "c.parquet", 3);
        fs::rename(other, path).unwrap();
    }));
}

#[test]
fn a_file_that_was_written_to_is_an_error() {
    assert_changed(after(|path| {
        let mut bytes = fs::read(path).unwrap();
        bytes.extend(b"more");
        fs::write(path, bytes).unwrap();
    }));
}

#[test]
fn a_file_that_is_gone_is_an_error() {
    assert_changed(after(|path| fs::remove_file(path).unwrap()));
}
