//! Validation reports every fault, in the order of files and rows, and counts what it checked.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, Int64Array, RecordBatch, StringArray};
use arrow::compute::cast;
use arrow::datatypes::DataType;
use mirrorstats_trace::diagnostic::{Code, Severity};
use mirrorstats_trace::episodes::episode::{Action, Episode, Step};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::validate::{Validation, validate};
use mirrorstats_trace::write::OptionalColumns;

use crate::harness::traces;

/// Two episodes of four steps, as rows.
fn sound(folder: &Path) -> RecordBatch {
    let steps = vec![Step { action: Some(Action::Done), ..Step::default() }; 4];
    let episode = |(id, run)| Episode { run, ..traces::episode(id, steps.clone()) };
    let path = folder.join("sound.parquet");
    traces::write_trace(&path, &[("a", 1), ("b", 2)].map(episode), OptionalColumns::NONE);
    traces::rows(&path)
}

fn with(rows: &RecordBatch, name: &str, values: impl Into<ArrayRef>) -> RecordBatch {
    let (schema, values) = (rows.schema(), values.into());
    let columns = schema.fields().iter().zip(rows.columns()).map(|(field, column)| {
        let column = if field.name() == name { &values } else { column };
        (field.name().clone(), Arc::clone(column), true)
    });
    RecordBatch::try_from_iter_with_nullable(columns).unwrap()
}

fn texts<const N: usize>(values: [Option<&str>; N]) -> ArrayRef {
    Arc::new(StringArray::from(values.to_vec()))
}

fn ints<const N: usize>(values: [i64; N]) -> ArrayRef {
    Arc::new(Int64Array::from(values.to_vec()))
}

/// Validates one file with these row groups; the result must not depend on the number of threads.
fn check(folder: &Path, row_groups: &[RecordBatch], experiments: Option<&[String]>) -> Validation {
    let input = Input::new(folder.join("checked.parquet"));
    traces::write_rows(&input.path, row_groups, None);
    let [one, many] = [1, 8].map(|threads| {
        validate(std::slice::from_ref(&input), experiments, NonZeroUsize::new(threads).unwrap()).unwrap()
    });
    assert_eq!(one, many);
    one
}

/// Code, episode, t and column.
type Place<'a> = (Code, Option<&'a str>, Option<i64>, Option<&'a str>);

fn places(report: &Validation) -> Vec<Place<'_>> {
    report
        .findings
        .iter()
        .map(|finding| (finding.code, finding.episode.as_deref(), finding.t, finding.column.as_deref()))
        .collect()
}

#[test]
fn everything_wrong_is_reported_by_row() {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = sound(folder.path());
    let (e1, e9) = (Some("E1"), Some("E9"));
    rows = with(&rows, "experiment", texts([e1, e1, e1, e1, e9, e9, e9, e9]));
    rows = with(&rows, "body_color", texts([Some("red"), None, None, Some("red"), e1, e1, e1, e1]));
    rows = with(&rows, "action", texts([None, Some("jump"), None, Some("hop"), None, None, None, None]));
    rows = with(&rows, "t", ints([1, 2, 4, 6, 0, 1, 1, 3]));
    rows = with(&rows, "run", ints([1, 1, 1, 2, 1, 1, 1, 1]));
    let known = ["E1".to_owned(), "E2".to_owned()];
    let report = check(folder.path(), &[rows], Some(&known));
    let (a, b) = (Some("a"), Some("b"));
    let expected = [
        (Code::NullInRequired, a, Some(2), Some("body_color")),
        (Code::UnknownAction, a, Some(2), Some("action")),
        (Code::TGap, a, Some(4), Some("t")),
        (Code::InconsistentConstant, a, Some(6), Some("run")),
        (Code::UnknownExperiment, b, Some(0), Some("experiment")),
        (Code::InvalidColor, b, Some(0), Some("body_color")),
        (Code::TStart, b, Some(0), Some("t")),
        (Code::TDuplicate, b, Some(1), Some("t")),
        (Code::TGap, b, Some(3), Some("t")),
    ];
    assert_eq!(places(&report), expected);
    assert_eq!(report.findings[0].found, "null (and 1 more rows of the episode break this rule)");
    assert_eq!((report.files[0].episodes, report.files[0].steps), (2, 8));
}

#[test]
fn an_episode_with_scattered_rows_is_one_finding() {
    let folder = tempfile::tempdir().unwrap();
    let rows = sound(folder.path());
    let parts = [rows.slice(0, 2), rows.slice(4, 4), rows.slice(2, 2)];
    let report = check(folder.path(), &parts, None);
    assert_eq!(places(&report), [(Code::EpisodeTwice, Some("a"), None, Some("episode_id"))]);
    assert_eq!(report.findings[0].row_group, Some(2));
}

#[test]
fn a_split_episode_is_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let rows = sound(folder.path());
    let report = check(folder.path(), &[rows.slice(0, 5), rows.slice(5, 3)], None);
    assert_eq!(places(&report), [(Code::SplitEpisode, Some("b"), None, None)]);
    assert_eq!((report.count(Severity::Error), report.count(Severity::Note)), (0, 1));
}

#[test]
fn all_faults_of_a_footer_are_reported_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let rows = sound(folder.path());
    let keep: Vec<_> = (0..rows.num_columns())
        .filter(|i| !["model", "self_color"].contains(&rows.schema().field(*i).name().as_str()))
        .collect();
    let t = cast(rows.column_by_name("t").unwrap(), &DataType::Float64).unwrap();
    let report = check(folder.path(), &[with(&rows.project(&keep).unwrap(), "t", t)], None);
    let expected = [
        (Code::MissingColumn, None, None, Some("model")),
        (Code::WrongType, None, None, Some("t")),
        (Code::MissingColumn, None, None, Some("self_color")),
    ];
    assert_eq!(places(&report), expected);
    assert!(!report.files[0].complete);
}

#[test]
fn a_misspelled_column_is_suggested() {
    let folder = tempfile::tempdir().unwrap();
    let rows = sound(folder.path());
    let names =
        rows.schema().fields().iter().map(|f| f.name().replace("body_color", "body_colour")).collect::<Vec<_>>();
    let renamed = names.into_iter().zip(rows.columns().iter().cloned()).map(|(name, column)| (name, column, true));
    let report = check(folder.path(), &[RecordBatch::try_from_iter_with_nullable(renamed).unwrap()], None);
    assert_eq!(report.findings[0].found, "none, though there is `body_colour`");
}
