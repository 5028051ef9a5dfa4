//! Folders of scores as other engines write them: many parts, notes between them, columns in folder names.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Array, Int32Array, Int64Array, RecordBatch, StringArray};
use mirrorstats_trace::write::OptionalColumns;

use super::{episode, write};
use crate::harness::program::run;
use crate::harness::traces::write_rows;

fn parquet(path: &Path, columns: Vec<(&str, ArrayRef)>) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let batch = RecordBatch::try_from_iter_with_nullable(columns.into_iter().map(|(n, c)| (n, c, true))).unwrap();
    write_rows(path, &[batch], None);
}

fn texts(values: &[&str]) -> ArrayRef {
    Arc::new(StringArray::from(values.to_vec()))
}

fn ints(values: &[Option<i64>]) -> ArrayRef {
    Arc::new(Int64Array::from(values.to_vec()))
}

#[test]
fn parts_without_definitions_use_the_named_ones() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // `tsa_c` comes from an engine that folds case (portable `TSA_C` for `TSA-C`); folder names hold the other keys.
    for (place, id, value) in [("experiment=E2/model=a%2Fb", "x", Some(1)), ("experiment=E1/model=a%2Fb", "y", None)] {
        let run: ArrayRef = Arc::new(Int32Array::from(vec![7]));
        let columns =
            vec![("episode_id", texts(&[id])), ("seed", ints(&[Some(1)])), ("run", run), ("tsa_c", ints(&[value]))];
        parquet(&at.join(format!("out/{place}/part-0.parquet")), columns);
    }
    fs::write(at.join("out/_SUCCESS"), "").unwrap();
    fs::write(at.join("out/.part-0.parquet.crc"), "crc").unwrap();
    let scores = run(at, &["score", "out"]).done();
    assert_eq!(scores, "episode_id,model,experiment,seed,run,TSA-C\ny,a/b,E1,1,7,\nx,a/b,E2,1,7,1\n");
}

#[test]
fn a_column_of_the_file_wins_over_the_name_of_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(&at.join("a.parquet"), &[episode("a", "E1", 1)], OptionalColumns::all());
    fs::create_dir_all(at.join("model=other/run=x")).unwrap();
    run(at, &["score", "a.parquet", "-o", "model=other/run=x/scores.parquet"]).done();
    let scores = run(at, &["score", "a.parquet"]).done();
    assert_eq!(run(at, &["score", "model=other"]).done(), scores);
}

#[test]
fn doubles_that_are_whole_numbers_are_integers_and_others_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, value) in [("whole", 3.0), ("half", 0.5), ("huge", 9_007_199_254_740_993.0), ("nan", f64::NAN)] {
        let columns = vec![
            ("episode_id", texts(&["x"])),
            ("model", texts(&["m"])),
            ("experiment", texts(&["E1"])),
            ("seed", ints(&[Some(1)])),
            ("run", ints(&[Some(1)])),
            ("MGD", Arc::new(Float64Array::from(vec![value])) as ArrayRef),
        ];
        parquet(&at.join(name).with_extension("parquet"), columns);
    }
    assert!(run(at, &["score", "whole.parquet"]).done().ends_with("x,m,E1,1,1,3\n"));
    for name in ["half.parquet", "huge.parquet", "nan.parquet"] {
        assert!(run(at, &["score", name]).refused().contains("column `MGD`: expected integers, found Float64"));
    }
}

#[test]
fn a_folder_that_names_no_number_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let columns = vec![
        ("episode_id", texts(&["x"])),
        ("model", texts(&["m"])),
        ("experiment", texts(&["E1"])),
        ("run", ints(&[Some(1)])),
        ("TSA", ints(&[Some(1)])),
    ];
    parquet(&at.join("out/seed=one/part-0.parquet"), columns);
    let message = run(at, &["score", "out"]).refused();
    assert!(message.contains("column `seed`: expected an integer in the name of the folder, found `one`"), "{message}");
}
