//! The same rows give the same bytes, whatever the files, order, row groups, encodings, types and threads.

use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, Int64Array, RecordBatch, StringArray};
use arrow::compute::cast;
use arrow::datatypes::DataType;
use mirrorstats_score::format::{self, Format};
use mirrorstats_score::score_traces::{self, Request};
use mirrorstats_trace::episodes::episode::Episode;
use parquet::file::properties::WriterProperties;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use tempfile::TempDir;

use crate::harness::files::{Contents, contents};
use crate::harness::program::run;
use crate::harness::traces::{open, rows, write_rows};
use crate::random::episodes;
use crate::traces::write;

/// A foreign writer's storage of the columns.
#[derive(Clone, Copy, Debug)]
struct Layout {
    strings: fn() -> DataType,
    integers: fn() -> DataType,
    row_group: usize,
    /// True to add columns that the paper's definitions do not know; one has the name of a `let`.
    extra_columns: bool,
    reversed_columns: bool,
    dictionary_pages: bool,
}

const PLAIN: Layout = Layout {
    strings: || DataType::Utf8,
    integers: || DataType::Int32,
    row_group: usize::MAX,
    extra_columns: false,
    reversed_columns: false,
    dictionary_pages: true,
};

fn dictionary(key: DataType, value: DataType) -> DataType {
    DataType::Dictionary(Box::new(key), Box::new(value))
}

fn layouts() -> Vec<Layout> {
    vec![
        PLAIN,
        Layout { dictionary_pages: false, ..PLAIN },
        Layout { strings: || DataType::LargeUtf8, integers: || DataType::Int64, row_group: 1, ..PLAIN },
        Layout { strings: || DataType::Utf8View, integers: || DataType::UInt8, row_group: 7, ..PLAIN },
        Layout { strings: || dictionary(DataType::Int32, DataType::Utf8), row_group: 7, extra_columns: true, ..PLAIN },
        Layout { strings: || dictionary(DataType::UInt8, DataType::LargeUtf8), reversed_columns: true, ..PLAIN },
        Layout { integers: || DataType::Int16, row_group: 1000, extra_columns: true, reversed_columns: true, ..PLAIN },
        Layout { integers: || DataType::UInt64, row_group: 2, dictionary_pages: false, ..PLAIN },
        Layout { integers: || DataType::Int8, row_group: 3, ..PLAIN },
    ]
}

/// Random episodes, the same in every run.
fn sample() -> Vec<Episode> {
    let mut runner = TestRunner::deterministic();
    let mut sample = episodes(80..81).new_tree(&mut runner).unwrap().current();
    // Files and tables have different orders.
    sample.sort_by_key(|episode| (episode.run, episode.episode_id.clone()));
    sample
}

/// Writes the rows again in another layout.
fn write_as(layout: Layout, rows: &RecordBatch, path: &Path) {
    let schema = rows.schema();
    let mut columns: Vec<(String, ArrayRef, bool)> = Vec::new();
    for (field, column) in schema.fields().iter().zip(rows.columns()) {
        let wanted = match field.data_type() {
            DataType::Utf8 => (layout.strings)(),
            DataType::Int32 | DataType::Int8 => (layout.integers)(),
            other => other.clone(),
        };
        columns.push((field.name().clone(), cast(column, &wanted).unwrap(), true));
    }
    if layout.extra_columns {
        let count = i64::try_from(rows.num_rows()).unwrap();
        columns.push(("finish".into(), Arc::new(Int64Array::from_iter_values(0..count)), true));
        columns.push(("notes".into(), Arc::new(StringArray::from(vec![None::<&str>; rows.num_rows()])), true));
    }
    if layout.reversed_columns {
        columns.reverse();
    }
    let rows = RecordBatch::try_from_iter_with_nullable(columns).unwrap();
    let properties = WriterProperties::builder()
        .set_max_row_group_row_count(Some(layout.row_group.min(1 << 20)))
        .set_dictionary_enabled(layout.dictionary_pages)
        .build();
    write_rows(path, &[rows], Some(properties));
}

/// The episode table of these files in all three formats.
fn scores(paths: &[PathBuf], threads: usize) -> Vec<Vec<u8>> {
    let traces = open(&paths.iter().map(PathBuf::as_path).collect::<Vec<_>>());
    let request = Request { condition: Some("seed <> 2 or TSA = 0".into()), ..Request::of("paper") };
    let definitions = score_traces::definitions(&traces, &request).unwrap();
    let labels = ["body_color".to_owned(), "distractors".to_owned()];
    let table = score_traces::score(&traces, &definitions, &labels, NonZeroUsize::new(threads).unwrap()).unwrap();
    let bytes = |format| {
        let mut bytes = Vec::new();
        format::write(&table, format, &mut bytes).unwrap();
        bytes
    };
    [Format::Csv, Format::JsonLines, Format::Parquet].map(bytes).to_vec()
}

/// The sample in one file and in forty.
fn one_and_many(folder: &TempDir) -> (PathBuf, Vec<PathBuf>) {
    let sample = sample();
    let one = folder.path().join("one.parquet");
    write(&one, &sample);
    let many = folder.path().join("many");
    fs::create_dir(&many).unwrap();
    let files = sample.chunks(2).enumerate().map(|(at, episodes)| {
        // The order of names differs from the order of episodes.
        let path = many.join(format!("{:03}.parquet", (at * 17) % 40));
        write(&path, episodes);
        path
    });
    let files = files.collect();
    (one, files)
}

#[test]
fn scores_do_not_depend_on_the_layout() {
    let folder = tempfile::tempdir().unwrap();
    let (one, many) = one_and_many(&folder);
    let expected = scores(std::slice::from_ref(&one), 1);
    assert!(expected[0].split(|byte| *byte == b'\n').count() > 30, "the condition leaves enough to compare");
    let rows = rows(&one);
    let other = folder.path().join("other.parquet");
    for layout in layouts() {
        write_as(layout, &rows, &other);
        for threads in [1, 2, 8] {
            assert!(scores(std::slice::from_ref(&other), threads) == expected, "{layout:?}, {threads} threads");
        }
    }
    let backwards: Vec<PathBuf> = many.iter().rev().cloned().collect();
    for threads in [1, 2, 8] {
        assert!(scores(&many, threads) == expected && scores(&backwards, threads) == expected, "{threads} threads");
    }
}

/// Every file of a report, without the list of inputs in the manifest.
fn report(folder: &TempDir, out: &str, arguments: &[&str]) -> Contents {
    run(folder.path(), &[&["report"], arguments, &["--out", out]].concat()).done();
    let mut found = contents(&folder.path().join(out));
    let mut manifest: serde_json::Value = serde_json::from_slice(&found["manifest.json"]).unwrap();
    assert!(manifest.as_object_mut().unwrap().remove("inputs").is_some());
    // The page also lists the inputs.
    for output in manifest["outputs"].as_array_mut().unwrap() {
        if output["path"] == "report.html" {
            assert!(output.as_object_mut().unwrap().remove("sha256").is_some());
            assert!(output.as_object_mut().unwrap().remove("bytes").is_some());
        }
    }
    found.insert("manifest.json".to_owned(), manifest.to_string().into_bytes());
    found
}

#[test]
fn reports_do_not_depend_on_the_layout() {
    let folder = tempfile::tempdir().unwrap();
    let (one, _) = one_and_many(&folder);
    let expected = report(&folder, "a", &["one.parquet", "--threads", "1"]);
    assert!(expected.len() >= 9 && expected.contains_key("cells.csv"), "{:?}", expected.keys());
    let other = Layout { strings: || DataType::Utf8View, row_group: 5, extra_columns: true, ..PLAIN };
    write_as(other, &rows(&one), &folder.path().join("other.parquet"));
    let cases: [&[&str]; 4] =
        [&["one.parquet", "--threads", "8"], &["other.parquet", "--threads", "2"], &["many"], &["many/*.parquet"]];
    for (at, case) in cases.iter().enumerate() {
        let found = report(&folder, &format!("b{at}"), case);
        // The page lists inputs with hashes, so it is the same only for the same files.
        let lists_inputs = |path: &str| path == "report.html" && case[0] != "one.parquet";
        let differ: Vec<_> = found
            .iter()
            .filter(|(path, bytes)| !lists_inputs(path) && expected.get(*path) != Some(bytes))
            .map(|(path, _)| path)
            .collect();
        assert!(differ.is_empty() && found.len() == expected.len(), "{case:?}: {differ:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_split_into_files_and_row_groups_scores_the_same(
        episodes in episodes(1..20), row_group in 1_usize..20, files in 1_usize..5, threads in 1_usize..4,
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: String| folder.path().join(name);
        let whole = path("whole.parquet".into());
        write(&whole, &episodes);
        let mut parts = Vec::new();
        for (at, some) in episodes.chunks(episodes.len().div_ceil(files)).enumerate() {
            let (plain, part) = (path(format!("plain{at}.parquet")), path(format!("{at}.parquet")));
            write(&plain, some);
            write_as(Layout { row_group, ..PLAIN }, &rows(&plain), &part);
            parts.push(part);
        }
        prop_assert!(scores(&[whole], 1) == scores(&parts, threads));
    }
}
