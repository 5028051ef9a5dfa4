//! `mirrorstats trace renormalize` at the process boundary: changes, unchanged parts, refusals.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{Array, Int32Array, RecordBatch, StringArray, TimestampMicrosecondArray};
use arrow::datatypes::{DataType, Field, Schema};
use parquet::basic::Compression;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use serde_json::{Value, json};
use trace::episode::{Action, Extra, Step};
use trace::write::write_episodes;

use crate::assert_shown;
use crate::harness::files::fixture;
use crate::harness::program::{self, Answer};
use crate::harness::traces::{episode, reader, rows, texts, write_rows};

fn run(folder: &Path, arguments: &[&str]) -> Answer {
    program::run(folder, &[&["trace", "renormalize"], arguments].concat())
}

fn step(text: Option<&str>, color: Option<&str>) -> Step {
    let identification = text.map(str::to_owned);
    let extra = Extra { identification, reply: Some("raw".into()), pose_x: Some(0.1), ..Extra::default() };
    Step {
        action: Some(Action::TurnLeft),
        self_color: color.map(str::to_owned),
        selected_cube: Some("none".into()),
        mirror_visible: true,
        extra,
    }
}

/// A trace with three flips, recorded under an older rule.
fn old(folder: &Path, name: &str) -> PathBuf {
    let steps = vec![
        step(Some("I am red"), Some("red")),
        step(Some("crimson"), None),
        step(Some("not red"), Some("red")),
        step(None, Some("blue")),
        step(Some("a robot"), Some("unknown")),
        step(None, None),
    ];
    let path = folder.join(name);
    let recording =
        json!({ "version": 1, "view": { "fov_y": 110.0 }, "agent": { "identification_version": "0", "id": "x" } });
    write_episodes(
        &path,
        Some(recording),
        &[episode("a", steps), episode("b", vec![step(Some("I am blue"), Some("blue"))])],
    )
    .unwrap();
    path
}

fn pairs(path: &Path) -> Vec<KeyValue> {
    reader(path).metadata().file_metadata().key_value_metadata().cloned().unwrap_or_default()
}

fn colors(path: &Path) -> Vec<Option<String>> {
    texts(path, "self_color")
}

/// Checks that all columns except the attribution are the same.
fn assert_rest_is_same(old: &Path, new: &Path) {
    let (old, new) = (rows(old), rows(new));
    let names =
        |rows: &RecordBatch| rows.schema().fields().iter().map(|field| field.name().clone()).collect::<Vec<_>>();
    assert_eq!(names(&old), names(&new));
    for name in names(&old).iter().filter(|name| *name != "self_color") {
        let (old, new) = (old.column_by_name(name).unwrap(), new.column_by_name(name).unwrap());
        assert_eq!(old, new, "{name}");
        assert_eq!(old.data_type(), new.data_type(), "{name}");
    }
}

const AFTER: [Option<&str>; 7] = [Some("red"), Some("red"), Some("unknown"), Some("blue"), None, None, Some("blue")];

#[test]
fn attributions_follow_the_texts_and_all_else_stays() {
    let folder = tempfile::tempdir().unwrap();
    let old = old(folder.path(), "old.parquet");
    let before = fs::read(&old).unwrap();
    let answer = run(folder.path(), &["old.parquet", "-o", "new"]);
    assert_eq!((answer.code, answer.stderr.as_str()), (0, ""));
    let steps: Vec<_> = texts(&old, "identification").into_iter().zip(colors(&old)).collect();
    assert_shown!(format!("mirrorstats trace renormalize old.parquet -o new, of the steps {steps:?}"), answer.stdout);
    let new = folder.path().join("new/old.parquet");
    assert_eq!(fs::read(&old).unwrap(), before);
    assert_eq!(colors(&new), AFTER.map(|color| color.map(str::to_owned)));
    assert_rest_is_same(&old, &new);
    let (was, is) = (pairs(&old), pairs(&new));
    let recording = |pairs: &[KeyValue]| {
        let pair = pairs.iter().find(|pair| pair.key == "mirrorstats.recording").unwrap();
        serde_json::from_str::<Value>(pair.value.as_ref().unwrap()).unwrap()
    };
    let mut expected = recording(&was);
    expected["agent"]["identification_version"] = json!("1");
    assert_eq!(recording(&is), expected);
    let rest = |pairs: Vec<KeyValue>| -> Vec<_> {
        let is_made_anew = |key: &str| ["mirrorstats.recording", "mirrorstats.checksums"].contains(&key);
        pairs.into_iter().filter(|pair| !is_made_anew(&pair.key)).collect()
    };
    assert_eq!(rest(is), rest(was));
    program::run(folder.path(), &["trace", "validate", "new/old.parquet"]).done();
}

#[test]
fn renormalizing_twice_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    old(folder.path(), "x.parquet");
    assert_eq!(run(folder.path(), &["x.parquet", "-o", "one", "--fail-on-change"]).code, 1);
    assert!(
        folder.path().join("one/x.parquet").is_file(),
        "a check that does not hold keeps nothing from being written"
    );
    let again = run(folder.path(), &["one/x.parquet", "-o", "two", "--fail-on-change"]);
    assert_eq!(again.code, 0, "{}", again.stderr);
    assert_eq!(
        again.stdout,
        "0 attributions change of 5 with a text, in 7 steps of 1 trace; identification version 1\n"
    );
    let bytes = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert_eq!(bytes("one/x.parquet"), bytes("two/x.parquet"));
}

#[test]
fn flips_are_in_json_and_a_dry_run_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    old(folder.path(), "x.parquet");
    let answer = run(folder.path(), &["x.parquet", "--dry-run", "--json"]);
    assert_eq!(answer.code, 0, "{}", answer.stderr);
    let flip = |t: i32, before: Value, after: Value, text: &str| json!({ "file": "x.parquet", "episode_id": "a", "t": t, "before": before, "after": after, "identification": text });
    let expected = json!({
        "identification_version": "1",
        "written": false,
        "files": [{ "name": "x.parquet", "out": null, "version_before": "0", "steps": 7, "texts": 5, "flips": 3 }],
        "flips": [
            flip(2, Value::Null, json!("red"), "crimson"),
            flip(3, json!("red"), json!("unknown"), "not red"),
            flip(5, json!("unknown"), Value::Null, "a robot"),
        ],
    });
    assert_eq!(serde_json::from_str::<Value>(&answer.stdout).unwrap(), expected);
    assert_eq!(run(folder.path(), &["x.parquet", "--dry-run", "-o", "new", "--fail-on-change"]).code, 1);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// A trace of another writer: several row groups, another codec, dictionaries, its own key and types, and a
/// non-nullable attribution.
fn foreign(path: &Path, identification: &[Option<&str>]) {
    let n = identification.len();
    let texts = |text: &str| Arc::new(StringArray::from(vec![text; n])) as Arc<dyn Array>;
    let ints = |value: i32| Arc::new(Int32Array::from(vec![value; n])) as Arc<dyn Array>;
    let ids: Vec<String> = (0..n).map(|at| format!("e{at}")).collect();
    let dictionary = DataType::Dictionary(Box::new(DataType::Int8), Box::new(DataType::LargeUtf8));
    let times = TimestampMicrosecondArray::from(vec![1_700_000_000_000_001; n]).with_timezone("UTC");
    let columns: Vec<(&str, Arc<dyn Array>)> = vec![
        ("episode_id", Arc::new(StringArray::from(ids))),
        ("model", arrow::compute::cast(&texts("m"), &dictionary).unwrap()),
        ("experiment", texts("E1")),
        ("seed", ints(1)),
        ("run", ints(1)),
        ("body_color", texts("red")),
        ("t", ints(1)),
        ("action", texts("done")),
        ("self_color", texts("green")),
        ("when", Arc::new(times)),
        ("selected_cube", texts("none")),
        ("mirror_visible", Arc::new(arrow::array::BooleanArray::from(vec![true; n]))),
        ("identification", Arc::new(StringArray::from(identification.to_vec()))),
    ];
    let fields =
        columns.iter().map(|(name, array)| Field::new(*name, array.data_type().clone(), *name == "identification"));
    let schema = Arc::new(Schema::new(fields.collect::<Vec<_>>()));
    let batch = RecordBatch::try_new(schema, columns.into_iter().map(|(_, array)| array).collect()).unwrap();
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_max_row_group_row_count(Some(2))
        .set_bloom_filter_enabled(true)
        .set_key_value_metadata(Some(vec![KeyValue::new("theirs".to_owned(), "kept".to_owned())]))
        .build();
    write_rows(path, &[batch], Some(properties));
}

#[test]
fn traces_of_other_writers_keep_their_columns_and_keys() {
    let folder = tempfile::tempdir().unwrap();
    let old = folder.path().join("theirs.parquet");
    foreign(&old, &[Some("green"), Some("a robot"), None, Some("red or blue"), Some("I am pink")]);
    let answer = run(folder.path(), &["theirs.parquet", "-o", "."]);
    assert_eq!(answer.code, 2, "{}", answer.stdout);
    let answer = run(folder.path(), &["theirs.parquet", "-o", "deep/new"]);
    assert_eq!(answer.code, 0, "{}", answer.stderr);
    let new = folder.path().join("deep/new/theirs.parquet");
    let expected = [Some("green"), None, Some("green"), Some("unknown"), Some("pink")];
    assert_eq!(colors(&new), expected.map(|color| color.map(str::to_owned)));
    assert_rest_is_same(&old, &new);
    let kept = pairs(&new);
    assert!(kept.iter().any(|pair| pair.key == "theirs" && pair.value.as_deref() == Some("kept")));
    let recording = kept.iter().find(|pair| pair.key == "mirrorstats.recording").unwrap();
    assert_eq!(recording.value.as_deref(), Some(r#"{"identification_version":"1"}"#));
    program::run(folder.path(), &["trace", "validate", "deep/new/theirs.parquet"]).ends(0);
}

#[test]
fn recorded_traces_of_scripted_agents_stay() {
    let answer = run(&fixture(""), &["recorded", "--dry-run"]);
    assert_eq!(answer.code, 0, "{}", answer.stderr);
    assert!(answer.stdout.starts_with("0 attributions change of "), "{}", answer.stdout);
}

#[test]
fn impossible_requests_are_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::create_dir(here.join("sub")).unwrap();
    old(here, "x.parquet");
    old(&here.join("sub"), "x.parquet");
    let mut bare = step(None, Some("red"));
    bare.extra = Extra::default();
    write_episodes(&here.join("bare.parquet"), None, &[episode("c", vec![bare])]).unwrap();
    let mut gap = fs::read(here.join("x.parquet")).unwrap();
    gap.truncate(gap.len() / 2);
    fs::write(here.join("cut.parquet"), gap).unwrap();
    for (arguments, words) in [
        (vec!["x.parquet"], "--out"),
        (vec!["x.parquet", "-o", "."], "expected another folder for the new trace, found the trace itself"),
        (vec!["x.parquet", "-o", "sub/.."], "expected another folder for the new trace"),
        (vec!["x.parquet", "sub/x.parquet", "-o", "new"], "expected a name of its own in new, found"),
        (vec!["sub/x.parquet", "bare.parquet", "-o", "new"], "missing-column: bare.parquet, column `identification`"),
        (vec!["cut.parquet", "sub/x.parquet", "-o", "new"], "truncated: cut.parquet"),
        (vec!["x.parquet", "-o", "bare.parquet"], "bare.parquet"),
        (vec!["none.parquet", "-o", "new"], "no such file"),
    ] {
        let answer = run(here, &arguments);
        assert_eq!(answer.code, 2, "{arguments:?}: {}", answer.stdout);
        assert!(answer.stderr.contains(words), "{arguments:?}: {}", answer.stderr);
        let written = fs::read_dir(here.join("new")).map_or(0, Iterator::count);
        assert_eq!(written, 0, "{arguments:?}");
    }
}
