//! The checksums of this program's traces: what they cover, who wrote them, and what is refused.

use std::fs;
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, RecordBatch, StringArray};
use mirrorstats_trace::diagnostic::{Code, Finding, Severity};
use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::footers::checksums::Checksums;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows;
use mirrorstats_trace::read::open::{TraceFile, TraceSet};
use mirrorstats_trace::read::verify::verify_pages;
use mirrorstats_trace::scan::Projection;
use mirrorstats_trace::validate::validate;
use mirrorstats_trace::write::merge;
use mirrorstats_trace::write::{OptionalColumns, write_episodes};
use parquet::arrow::ArrowWriter;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use serde_json::{Value, json};

use super::checksums::scores;
use super::pages::{footer, pages};
use super::{episodes, foreign, trace};
use crate::harness::program::{program, run, succeeds};
use crate::harness::traces::{self, reader, write_trace};

const KEY: &str = "mirrorstats.checksums";

fn findings(path: &Path) -> Vec<Finding> {
    validate(&[Input::new(path)], None, NonZeroUsize::MIN).unwrap().findings
}

fn stated(file: &[u8]) -> Value {
    let metadata = footer(file);
    let pairs = metadata.file_metadata().key_value_metadata().unwrap();
    serde_json::from_str(pairs.iter().find(|pair| pair.key == KEY).unwrap().value.as_ref().unwrap()).unwrap()
}

/// Writes the same rows as another program that keeps the footer's keys, except for `change`.
fn again(path: &Path, to: &Path, created_by: &str, change: impl Fn(&mut KeyValue)) {
    let reader = reader(path);
    let mut pairs = reader.metadata().file_metadata().key_value_metadata().unwrap().clone();
    pairs.iter_mut().filter(|pair| pair.key == KEY).for_each(change);
    let properties =
        WriterProperties::builder().set_created_by(created_by.to_owned()).set_key_value_metadata(Some(pairs)).build();
    let file = fs::File::create(to).unwrap();
    let mut writer = ArrowWriter::try_new(file, reader.schema().clone(), Some(properties)).unwrap();
    for batch in reader.build().unwrap() {
        writer.write(&batch.unwrap()).unwrap();
    }
    writer.close().unwrap();
}

#[test]
fn every_chunk_and_the_footer_are_summed_as_the_schema_says() {
    let whole = trace();
    let (metadata, stated) = (footer(&whole), stated(&whole));
    let mut end = 4;
    for (group, sums) in metadata.row_groups().iter().zip(stated["chunks"].as_array().unwrap()) {
        assert_eq!(group.num_columns(), sums.as_array().unwrap().len());
        for (chunk, sum) in group.columns().iter().zip(sums.as_array().unwrap()) {
            let (start, length) = chunk.byte_range();
            let place = |at: u64| usize::try_from(at).unwrap();
            let bytes = &whole[place(start)..place(start + length)];
            assert_eq!(*sum, json!(format!("{:08x}", crc32fast::hash(bytes))));
            assert_eq!(place(start), end, "one chunk behind the other");
            end = place(start + length);
        }
    }
    let text = serde_json::to_string(&stated["footer"]).unwrap();
    let mut rest = whole[end..whole.len() - 8].to_vec();
    let digits = rest.windows(text.len()).rposition(|window| window == text.as_bytes()).unwrap() + 1;
    rest[digits..digits + 8].fill(b'0');
    assert_eq!(stated["footer"], json!(format!("{:08x}", crc32fast::hash(&rest))));
    assert_eq!(footer(&whole).file_metadata().created_by(), stated["created_by"].as_str());
}

#[test]
fn every_way_to_read_a_column_checks_its_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flipped.parquet");
    let whole = trace();
    for page in pages(&whole) {
        for at in [page.offset, page.end - 1] {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x40;
            fs::write(&path, bytes).unwrap();
            let is_told = |told: &str| told.contains("CRC-32") && told.contains(&format!("`{}`", page.column));
            let verified = verify_pages(&traces::open(&[&path])).unwrap_err().to_string();
            assert!(is_told(&verified), "{verified}");
            let merged = episode_rows::read(&path).unwrap_err().to_string();
            assert!(merged.contains("CRC-32"), "{merged}");
            let found = findings(&path);
            assert!(found.iter().any(|finding| finding.code == Code::CorruptData && is_told(&finding.to_string())));
        }
    }
}

/// `validate` also checks columns that it does not decode.
#[test]
fn a_column_that_the_schema_does_not_know_is_checked() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let line = json!({"episode_id": "e", "model": "m", "experiment": "E1", "seed": 1, "run": 1, "body_color": "red",
        "t": 1, "action": "done", "self_color": null, "selected_cube": "red", "mirror_visible": true, "mood": "calm"});
    fs::write(at.join("steps.jsonl"), format!("{line}\n")).unwrap();
    run(at, &["import", "steps.jsonl", "-o", "own.parquet"]).done();
    let path = at.join("own.parquet");
    let mut bytes = fs::read(&path).unwrap();
    let page = pages(&bytes).into_iter().find(|page| page.column == "mood").unwrap();
    run(at, &["trace", "validate", "own.parquet"]).done();
    bytes[page.end - 1] ^= 1;
    fs::write(&path, bytes).unwrap();
    let told = run(at, &["trace", "validate", "own.parquet"]).ends(1).stdout;
    assert!(told.contains("corrupt-data") && told.contains("`mood`") && told.contains("CRC-32"), "{told}");
}

/// A column too large for memory is checksummed before its first rows are returned.
#[test]
fn nothing_of_a_large_column_is_given_before_it_is_checked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.parquet");
    let mut state = 1_u64;
    let mut noise = || -> String {
        let mut letters = String::with_capacity(200_000);
        for _ in 0..200_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            letters.push(char::from(33 + u8::try_from((state >> 33) % 90).unwrap()));
        }
        letters
    };
    let step = |reply: String| Step { extra: Extra { reply: Some(reply), ..Extra::default() }, ..Step::default() };
    let all: Vec<Episode> =
        (0..6).map(|at| traces::episode(&format!("e{at}"), (0..10).map(|_| step(noise())).collect())).collect();
    write_episodes(&path, None, &all).unwrap();
    let whole = fs::read(&path).unwrap();
    let replies: Vec<_> = pages(&whole).into_iter().filter(|page| page.column == "reply").collect();
    assert!(replies.last().unwrap().end - replies[0].offset > 8 << 20);
    let projection = Projection { unchecked: vec!["reply".to_owned()], ..Projection::default() };
    let given = || {
        let mut given = 0;
        let set = traces::open(&[&path]);
        let result = set.scan(
            &projection,
            NonZeroUsize::MIN,
            |batch| Ok::<_, TraceError>(batch.steps.num_rows()),
            |rows| {
                given += rows;
                Ok(())
            },
        );
        (given, result.map_err(|error| error.to_string()))
    };
    assert_eq!(given().0, 60);
    let mut bytes = whole;
    bytes[replies.last().unwrap().end - 1] ^= 2;
    fs::write(&path, bytes).unwrap();
    let (given, result) = given();
    let told = result.unwrap_err();
    assert!(given == 0 && told.contains("CRC-32") && told.contains("`reply`"), "{given} rows, {told}");
}

#[test]
fn checksums_that_another_program_carried_along_do_not_apply() {
    let folder = tempfile::tempdir().unwrap();
    let [own, other] = ["own.parquet", "other.parquet"].map(|name| folder.path().join(name));
    fs::write(&own, trace()).unwrap();
    again(&own, &other, "parquet-cpp-arrow version 26.0.1", |_| ());
    assert!(
        footer(&fs::read(&other).unwrap())
            .file_metadata()
            .key_value_metadata()
            .unwrap()
            .iter()
            .any(|pair| pair.key == KEY)
    );
    let state = |path: &Path| TraceFile::open(&Input::new(path)).unwrap().checksums();
    assert_eq!((state(&own), state(&other)), (Checksums::Present, Checksums::Stale));
    assert_eq!(scores(&own), scores(&other));
    let found = findings(&other);
    assert_eq!(
        found.iter().map(|finding| (finding.code, finding.severity)).collect::<Vec<_>>(),
        [(Code::StaleChecksums, Severity::Note)]
    );
    assert_eq!(findings(&own), []);
    // After writing it again, the file is this program's own.
    let anew = folder.path().join("anew.parquet");
    merge::write(&anew, None, &episode_rows::read(&other).unwrap()).unwrap();
    assert_eq!((state(&anew), findings(&anew)), (Checksums::Present, Vec::new()));
    let info = run(folder.path(), &["trace", "info", "--json", "own.parquet"]).json();
    assert_eq!(info["files"][0]["checksums"], "present");
    let told = run(folder.path(), &["trace", "info", "other.parquet"]).done();
    assert!(told.contains("checksums") && told.contains("stale"), "{told}");
}

#[test]
fn a_file_without_checksums_is_read_as_before() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("foreign.parquet");
    fs::write(&path, foreign(folder.path())).unwrap();
    assert_eq!(TraceFile::open(&Input::new(&path)).unwrap().checksums(), Checksums::None);
    assert!(findings(&path).iter().all(|finding| finding.code == Code::SplitEpisode));
}

/// Damaged bytes must not be copied and get checksums.
#[test]
fn a_damaged_trace_is_not_sealed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("old.parquet");
    let step = Step {
        action: Some(Action::Done),
        extra: Extra { identification: Some("red".into()), ..Extra::default() },
        ..Step::default()
    };
    write_episodes(&path, None, &[traces::episode("a", vec![step])]).unwrap();
    run(folder.path(), &["trace", "seal", "old.parquet", "new.parquet"]).done();
    assert_eq!(findings(&folder.path().join("new.parquet")), []);
    let mut bytes = fs::read(&path).unwrap();
    let page = pages(&bytes).into_iter().find(|page| page.column == "action").unwrap();
    bytes[page.end - 1] ^= 1;
    fs::write(&path, bytes).unwrap();
    let told = run(folder.path(), &["trace", "seal", "old.parquet", "newer.parquet"]).refused();
    assert!(told.contains("CRC-32") && told.contains("`action`"), "{told}");
    assert!(!folder.path().join("newer.parquet").exists());
}

#[test]
fn invalid_checksums_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [own, other] = ["own.parquet", "other.parquet"].map(|name| folder.path().join(name));
    fs::write(&own, trace()).unwrap();
    let sound = stated(&trace());
    let created_by = sound["created_by"].as_str().unwrap().to_owned();
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut value = sound.clone();
        change(&mut value);
        Some(value.to_string())
    };
    let cases: [(Option<String>, &str); 11] = [
        (None, "no value"),
        (Some(String::new()), "EOF"),
        (Some("{".to_owned()), "EOF"),
        (Some("[]".to_owned()), "invalid"),
        (changed(&|value| value["footer"] = json!("0123456g")), "eight lower-case hexadecimal digits"),
        (changed(&|value| value["footer"] = json!(7)), "invalid type"),
        (changed(&|value| drop(value["chunks"][0].as_array_mut().unwrap().pop())), "another number of columns"),
        (changed(&|value| value["chunks"].as_array_mut().unwrap().push(json!([]))), "another number of columns"),
        (changed(&|value| value["algorithm"] = json!("CRC-64")), "another algorithm"),
        (changed(&|value| value["more"] = json!(1)), "unknown field"),
        (changed(&|value| drop(value.as_object_mut().unwrap().remove("footer"))), "missing field"),
    ];
    for (value, expected) in cases {
        again(&own, &other, &created_by, |pair| pair.value.clone_from(&value));
        let found = TraceFile::open(&Input::new(&other)).unwrap_err();
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].code, Code::InvalidMetadata, "{}", found[0]);
        assert!(found[0].to_string().contains(expected), "{value:?}: {}", found[0]);
        assert!(episode_rows::read(&other).is_err());
    }
    // The bytes are sound, but the checksums belong to other bytes.
    again(&own, &other, &created_by, |_| ());
    let found = TraceFile::open(&Input::new(&other)).unwrap_err();
    assert_eq!(found[0].code, Code::CorruptFooter, "{}", found[0]);
}

/// An unknown field number in the footer hides all keys, including `created_by`.
#[test]
fn keys_hidden_by_damage_are_reported_missing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hidden.parquet");
    let mut bytes = trace();
    let start = bytes.len() - 8 - u32::from_le_bytes(*bytes[bytes.len() - 8..].first_chunk().unwrap()) as usize;
    // The list of keys: next field, a list of three structures; the first one begins with its key.
    let head = [&[0x19, 0x3c, 0x18, 26][..], b"mirrorstats.schema_version"].concat();
    let place = start + bytes[start..].windows(head.len()).position(|window| window == head).unwrap();
    bytes[place] = 0x99;
    assert!(footer(&bytes).file_metadata().key_value_metadata().is_none());
    fs::write(&path, bytes).unwrap();
    let found = TraceFile::open(&Input::new(&path)).unwrap_err();
    assert_eq!(found[0].code, Code::InvalidMetadata, "{}", found[0]);
}

#[test]
fn each_row_group_has_its_own_checksums() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("groups.parquet");
    let steps = |count| vec![Step::default(); count];
    let all = [traces::episode("a", steps(131_072)), traces::episode("b", steps(10))];
    write_trace(&path, &all, OptionalColumns::NONE);
    let mut bytes = fs::read(&path).unwrap();
    assert_eq!(stated(&bytes)["chunks"].as_array().unwrap().len(), 2);
    verify_pages(&traces::open(&[&path])).unwrap();
    let page = pages(&bytes).into_iter().find(|page| page.row_group == 1 && page.column == "action").unwrap();
    bytes[page.end - 1] ^= 1;
    fs::write(&path, bytes).unwrap();
    let told = verify_pages(&traces::open(&[&path])).unwrap_err().to_string();
    assert!(told.contains("row group 1, column `action`"), "{told}");
}

#[test]
fn scores_carry_checksums_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("own.parquet"), trace()).unwrap();
    succeeds(program(at).args(["score", "own.parquet", "-o", "scores.parquet"]));
    let whole = fs::read(at.join("scores.parquet")).unwrap();
    run(at, &["stats", "scores.parquet"]).done();
    for page in pages(&whole).into_iter().filter(|page| page.column == "TTD" || page.column == "model") {
        let mut bytes = whole.clone();
        bytes[page.end - 1] ^= 1;
        fs::write(at.join("scores.parquet"), bytes).unwrap();
        let told = run(at, &["stats", "scores.parquet"]).refused();
        assert!(told.contains("CRC-32") && told.contains(&page.column), "{told}");
    }
}

/// An episode's rows with a changed value, as written by a program that does not know the hash.
#[test]
fn an_episode_whose_rows_contradict_its_hash_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hashed.parquet");
    let columns = OptionalColumns::named(&["episode_hash", "mirror_px", "cost_usd", "distractors"]).unwrap();
    let all: Vec<Episode> =
        episodes().into_iter().map(|episode| Episode { episode_hash: Some("any".into()), ..episode }).collect();
    write_trace(&path, &all, columns);
    assert_eq!(findings(&path), []);
    let kept: Vec<_> = episode_rows::read(&path).unwrap().iter().map(|rows| rows.stated_hash().unwrap()).collect();
    assert!(kept.iter().all(|hash| hash.len() == 64) && kept[0] != kept[1]);
    let rows = traces::rows(&path);
    let replaced = |name: &str, values: ArrayRef| {
        let mut columns = rows.columns().to_vec();
        columns[rows.schema().index_of(name).unwrap()] = values;
        traces::write_rows(&path, &[RecordBatch::try_new(rows.schema(), columns).unwrap()], None);
        findings(&path)
    };
    let actions: Vec<Option<&str>> = (0..rows.num_rows()).map(|row| (row != 7).then_some("turn_left")).collect();
    let found = replaced("action", Arc::new(StringArray::from(actions)));
    assert_eq!(found.iter().map(|finding| finding.code).collect::<Vec<_>>(), [Code::CorruptData; 3]);
    assert_eq!((found[1].episode.as_deref(), found[1].column.as_deref()), (Some("e1"), Some("episode_hash")));
    // Without the hash the change is not detected; with the original rows all is well.
    let none = vec![None::<&str>; rows.num_rows()];
    assert_eq!(replaced("episode_hash", Arc::new(StringArray::from(none))), []);
    traces::write_rows(&path, std::slice::from_ref(&rows), None);
    assert_eq!(findings(&path), []);
    let set = TraceSet::open(&[Input::new(&path)]).unwrap();
    let everything =
        Projection { steps: set.column_names().into_iter().map(str::to_owned).collect(), ..Projection::default() };
    set.scan(&everything, NonZeroUsize::MIN, |_| Ok::<_, TraceError>(()), |()| Ok(())).unwrap();
}

/// Rows are the same with types that other programs choose, and with or without columns that have no values.
#[test]
fn the_hash_of_an_episode_does_not_depend_on_how_it_is_stored() {
    let folder = tempfile::tempdir().unwrap();
    let [all, few] = ["all.parquet", "few.parquet"].map(|name| folder.path().join(name));
    let hashed: Vec<Episode> =
        episodes().into_iter().map(|episode| Episode { episode_hash: Some("any".into()), ..episode }).collect();
    write_trace(&all, &hashed, OptionalColumns::all());
    let columns = OptionalColumns::named(&["episode_hash", "mirror_px", "cost_usd", "distractors"]).unwrap();
    write_trace(&few, &hashed, columns);
    assert_eq!(traces::texts(&all, "episode_hash"), traces::texts(&few, "episode_hash"));
    assert_eq!((findings(&all), findings(&few)), (Vec::new(), Vec::new()));
}
