//! Scans: their rows for every layout of files, and their refusals.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, AsArray, BooleanArray, DictionaryArray, Float32Array, Int8Array, Int16Array, Int32Array,
    Int64Array, LargeStringArray, NullArray, RecordBatch, StringArray, StringViewArray, UInt8Array, UInt16Array,
    UInt32Array, UInt64Array,
};
use arrow::datatypes::{Float64Type, Int8Type, Int32Type, Int64Type};
use mirrorstats_trace::diagnostic::Code;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::scan::{EpisodeBatch, Projection};
use parquet::file::properties::WriterProperties;
use proptest::prelude::*;

use crate::harness::traces::write_rows;

/// One row as plain values.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    id: Option<String>,
    model: String,
    seed: i64,
    t: i64,
    action: Option<String>,
    px: Option<i64>,
    visible: bool,
}

fn rows(episodes: &[(&str, usize)]) -> Vec<Row> {
    let row = |id: &str, t: usize| Row {
        id: Some(id.into()),
        model: format!("model of {}", &id[..1]),
        seed: 3,
        t: i64::try_from(t).unwrap(),
        action: (!t.is_multiple_of(3)).then(|| ["turn_left", "done"][t % 2].into()),
        px: t.is_multiple_of(2).then_some(i64::try_from(t * 10).unwrap()),
        visible: t % 4 == 1,
    };
    episodes.iter().flat_map(|(id, steps)| (1..=*steps).map(move |t| row(id, t))).collect()
}

/// A foreign writer's storage of text and integers.
#[derive(Clone, Copy, Debug)]
enum Style {
    Plain,
    Dictionary,
    Large,
    View,
}

fn text(values: Vec<Option<&str>>, style: Style) -> ArrayRef {
    match style {
        Style::Plain => Arc::new(StringArray::from(values)),
        Style::Dictionary => Arc::new(values.into_iter().collect::<DictionaryArray<Int8Type>>()),
        Style::Large => Arc::new(LargeStringArray::from(values)),
        Style::View => Arc::new(StringViewArray::from(values)),
    }
}

fn ints(values: Vec<Option<i64>>, style: Style) -> ArrayRef {
    let wide = Int64Array::from(values);
    let wanted = match style {
        Style::Plain => arrow::datatypes::DataType::Int32,
        Style::Dictionary => arrow::datatypes::DataType::UInt16,
        Style::Large => return Arc::new(wide),
        Style::View => arrow::datatypes::DataType::UInt64,
    };
    arrow::compute::cast(&wide, &wanted).unwrap()
}

fn batch(rows: &[Row], style: Style) -> RecordBatch {
    let one = |value: &'static str| text(vec![Some(value); rows.len()], style);
    RecordBatch::try_from_iter_with_nullable([
        ("mirror_visible", Arc::new(rows.iter().map(|r| Some(r.visible)).collect::<BooleanArray>()) as ArrayRef, true),
        ("episode_id", text(rows.iter().map(|r| r.id.as_deref()).collect(), style), true),
        ("model", text(rows.iter().map(|r| Some(r.model.as_str())).collect(), style), true),
        ("experiment", one("E1"), true),
        ("seed", ints(rows.iter().map(|r| Some(r.seed)).collect(), style), true),
        ("run", ints(vec![Some(1); rows.len()], style), true),
        ("body_color", one("red"), true),
        ("t", ints(rows.iter().map(|r| Some(r.t)).collect(), style), true),
        ("action", text(rows.iter().map(|r| r.action.as_deref()).collect(), style), true),
        ("self_color", one("unknown"), true),
        ("selected_cube", one("none"), true),
        ("mirror_px", ints(rows.iter().map(|r| r.px).collect(), style), true),
    ])
    .unwrap()
}

/// Writes a file with these row groups.
fn write(path: &Path, groups: &[RecordBatch]) -> Input {
    write_keyed(path, groups, 64)
}

/// Writes a file with these row groups; a column has keys while its distinct values fit into `bytes`.
fn write_keyed(path: &Path, groups: &[RecordBatch], bytes: usize) -> Input {
    let properties = WriterProperties::builder().set_dictionary_page_size_limit(bytes).build();
    write_rows(path, groups, Some(properties));
    Input::new(path)
}

fn projection() -> Projection {
    let names = |names: &[&str]| names.iter().map(ToString::to_string).collect();
    Projection {
        steps: names(&["action", "mirror_px", "mirror_visible", "t"]),
        constants: names(&["body_color"]),
        experiments: None,
        ..Projection::default()
    }
}

fn threads(n: usize) -> NonZeroUsize {
    NonZeroUsize::new(n).unwrap()
}

/// The rows of a batch as plain values.
fn rows_of(batch: &EpisodeBatch) -> Vec<Row> {
    let text = |batch: &RecordBatch, name: &str, row: usize| {
        let column = batch.column_by_name(name).unwrap().as_dictionary::<Int32Type>().clone();
        column.key(row).map(|key| column.values().as_string::<i32>().value(key).to_owned())
    };
    let int = |batch: &RecordBatch, name: &str, row: usize| {
        let column = batch.column_by_name(name).unwrap().as_primitive::<Int64Type>();
        column.is_valid(row).then(|| column.value(row))
    };
    let action = |row: usize| match batch.texts.as_slice() {
        [] => text(&batch.steps, "action", row),
        [action] => action.keys.is_valid(row).then(|| action.texts.value(action.keys.value(row).into()).to_owned()),
        more => panic!("there is one text among the columns of steps, not {}", more.len()),
    };
    let mut rows = Vec::new();
    for (episode, ends) in batch.offsets.windows(2).enumerate() {
        assert_eq!(text(&batch.episodes, "body_color", episode).as_deref(), Some("red"));
        assert_eq!(int(&batch.episodes, "run", episode), Some(1));
        rows.extend((ends[0]..ends[1]).map(|row| Row {
            id: text(&batch.episodes, "episode_id", episode),
            model: text(&batch.episodes, "model", episode).unwrap(),
            seed: int(&batch.episodes, "seed", episode).unwrap(),
            t: int(&batch.steps, "t", row).unwrap(),
            action: action(row),
            px: int(&batch.steps, "mirror_px", row),
            visible: batch.steps.column_by_name("mirror_visible").unwrap().as_boolean().value(row),
        }));
    }
    rows
}

fn scan(inputs: &[Input], projection: &Projection, n: usize) -> Result<Vec<Row>, TraceError> {
    let set = TraceSet::open(inputs)?;
    let mut all = Vec::new();
    let summary = set.scan(
        projection,
        threads(n),
        |batch| Ok::<_, TraceError>(rows_of(&batch)),
        |rows| {
            all.extend(rows);
            Ok(())
        },
    )?;
    assert_eq!(summary.steps, all.len() as u64);
    Ok(all)
}

fn fault(inputs: &[Input], projection: &Projection) -> (Code, String) {
    let faults: Vec<_> = [1, 2, 8]
        .iter()
        .map(|n| match scan(inputs, projection, *n).unwrap_err() {
            TraceError::Finding { first, .. } => (first.code, first.to_string()),
            other => panic!("{other}"),
        })
        .collect();
    assert!(faults.iter().all(|fault| *fault == faults[0]), "the fault depends on threads: {faults:?}");
    faults.into_iter().next().unwrap()
}

fn file(folder: &tempfile::TempDir, name: &str) -> PathBuf {
    folder.path().join(name)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_layout_of_the_rows_gives_the_same_episodes(
        lengths in prop::collection::vec(1_usize..12, 1..12),
        cuts in prop::collection::vec(1_usize..9, 1..40),
        style in prop::sample::select(vec![Style::Plain, Style::Dictionary, Style::Large, Style::View]),
        split in 0_usize..12,
        n in prop::sample::select(vec![1_usize, 2, 8]),
    ) {
        let ids: Vec<_> = (0..lengths.len()).map(|i| format!("{}-{i}", ["a", "b"][i % 2])).collect();
        let episodes: Vec<_> = ids.iter().map(String::as_str).zip(lengths.iter().copied()).collect();
        let folder = tempfile::tempdir().unwrap();
        let split = split.min(episodes.len());
        let mut inputs = Vec::new();
        for (name, part) in [("1.parquet", &episodes[..split]), ("2.parquet", &episodes[split..])] {
            let part = rows(part);
            let (mut groups, mut from) = (Vec::new(), 0);
            for cut in cuts.iter().cycle().take_while(|_| !part.is_empty()) {
                let to = part.len().min(from + cut);
                groups.push(batch(&part[from..to], style));
                from = to;
                if from == part.len() {
                    break;
                }
            }
            if !groups.is_empty() {
                inputs.push(write(&file(&folder, name), &groups));
            }
        }
        prop_assert_eq!(scan(&inputs, &projection(), n).unwrap(), rows(&episodes));
    }
}

#[test]
fn an_episode_longer_than_a_batch_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let long = rows(&[("a", 3), ("b", 200_001), ("c", 70_000), ("d", 1)]);
    let groups = [batch(&long[..150_000], Style::Plain), batch(&long[150_000..], Style::Plain)];
    let input = write(&file(&folder, "long.parquet"), &groups);
    assert!(scan(&[input], &projection(), 2).unwrap() == long);
}

/// Episodes of 1 to 90 steps, more rows than one batch; only one row group boundary is also an episode boundary.
fn many() -> (Vec<Row>, Vec<std::ops::Range<usize>>) {
    let ids: Vec<String> = (0..2500).map(|i| format!("{}-{i:05}", ["a", "b"][i % 2])).collect();
    let episodes: Vec<_> = ids.iter().enumerate().map(|(i, id)| (id.as_str(), 1 + i * 7 % 90)).collect();
    let rows = rows(&episodes);
    let starts: Vec<usize> = (1..rows.len()).filter(|row| rows[*row].t == 1).collect();
    let inside = |row: usize| (row..rows.len()).find(|row| rows[*row].t > 1).unwrap();
    let whole = starts[starts.partition_point(|start| *start < 80_000)];
    let cuts = [0, inside(40_000), inside(41_000), whole, rows.len()];
    let groups = cuts.windows(2).map(|ends| ends[0]..ends[1]).collect();
    (rows, groups)
}

#[test]
fn many_short_episodes_are_whole_however_their_ids_are_stored() {
    let (rows, groups) = many();
    assert!(rows.len() > 100_000 && rows[groups[3].start].t == 1);
    let groups: Vec<_> = groups.into_iter().map(|group| batch(&rows[group], Style::Plain)).collect();
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in [("keys.parquet", 1 << 20), ("some-keys.parquet", 12_000), ("texts.parquet", 64)] {
        let input = write_keyed(&file(&folder, name), &groups, bytes);
        for n in [1, 2, 8] {
            assert!(scan(std::slice::from_ref(&input), &projection(), n).unwrap() == rows, "{name} on {n} threads");
        }
    }
}

#[test]
fn a_fault_in_a_late_batch_is_refused_where_it_is() {
    let (rows, groups) = many();
    let groups: Vec<_> = groups.into_iter().map(|group| (batch(&rows[group.clone()], Style::Plain), group)).collect();
    let bad = (113_000..rows.len()).find(|row| rows[*row].t > 1).unwrap();
    let place = format!("row group 3, episode `{}`, t = {}, column", rows[bad].id.as_ref().unwrap(), rows[bad].t);
    let folder = tempfile::tempdir().unwrap();
    for bytes in [1 << 20, 64] {
        let large = |row: usize| if row == bad { u64::MAX } else { row as u64 };
        let own = |group: &std::ops::Range<usize>| Arc::new(group.clone().map(large).collect::<UInt64Array>());
        let with: Vec<_> = groups.iter().map(|(batch, group)| with_column(batch, "own", own(group))).collect();
        let input = write_keyed(&file(&folder, "large.parquet"), &with, bytes);
        let mut with_own = projection();
        with_own.steps.push("own".into());
        let (code, text) = fault(&[input], &with_own);
        assert_eq!(code, Code::OutOfRange);
        assert!(text.contains(&format!("{place} `own`")), "{text}");

        let mut gap = rows.clone();
        gap[bad].t += 1;
        let gap: Vec<_> = groups.iter().map(|(_, group)| batch(&gap[group.clone()], Style::Plain)).collect();
        let input = write_keyed(&file(&folder, "gap.parquet"), &gap, bytes);
        let (code, text) = fault(&[input], &projection());
        assert_eq!(code, Code::TGap);
        assert!(text.contains("row group 3") && text.contains(rows[bad].id.as_ref().unwrap()), "{text}");
    }
}

#[test]
fn a_column_that_a_file_lacks_is_null_there() {
    let folder = tempfile::tempdir().unwrap();
    let with = batch(&rows(&[("a", 4)]), Style::Plain);
    let mut columns: Vec<usize> = (0..with.num_columns()).collect();
    columns.retain(|i| with.schema().field(*i).name() != "mirror_px");
    let without = batch(&rows(&[("b", 4)]), Style::Plain).project(&columns).unwrap();
    let inputs = [write(&file(&folder, "1.parquet"), &[with]), write(&file(&folder, "2.parquet"), &[without])];
    let set = TraceSet::open(&inputs).unwrap();
    assert_eq!(set.column("mirror_px").unwrap().missing_from.as_deref(), Some("2.parquet"));
    let px: Vec<_> = scan(&inputs, &projection(), 1).unwrap().into_iter().map(|row| row.px).collect();
    assert_eq!(px, [None, Some(20), None, Some(40), None, None, None, None]);
}

fn with_column(batch: &RecordBatch, name: &str, column: ArrayRef) -> RecordBatch {
    let mut columns: Vec<_> = batch
        .schema()
        .fields()
        .iter()
        .zip(batch.columns())
        .map(|(field, column)| (field.name().clone(), Arc::clone(column)))
        .filter(|(known, _)| known != name)
        .collect();
    columns.push((name.to_owned(), column));
    RecordBatch::try_from_iter_with_nullable(columns.into_iter().map(|(name, column)| (name, column, true))).unwrap()
}

#[test]
fn every_width_of_integer_and_float_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let plain = batch(&rows(&[("a", 2)]), Style::Plain);
    let values: Vec<(&str, ArrayRef, Option<i64>)> = vec![
        ("i8", Arc::new(Int8Array::from(vec![-128, 127])), Some(127)),
        ("i16", Arc::new(Int16Array::from(vec![-32768, 32767])), Some(32767)),
        ("i32", Arc::new(Int32Array::from(vec![i32::MIN, i32::MAX])), Some(i64::from(i32::MAX))),
        ("u8", Arc::new(UInt8Array::from(vec![0, 255])), Some(255)),
        ("u16", Arc::new(UInt16Array::from(vec![0, 65535])), Some(65535)),
        ("u32", Arc::new(UInt32Array::from(vec![0, u32::MAX])), Some(i64::from(u32::MAX))),
        ("u64", Arc::new(UInt64Array::from(vec![0, i64::MAX as u64])), Some(i64::MAX)),
        ("nothing", Arc::new(NullArray::new(2)), None),
    ];
    for (name, column, expected) in values {
        let input = write(&file(&folder, &format!("{name}.parquet")), &[with_column(&plain, "own", column)]);
        let own = Projection { steps: vec!["own".into()], ..Projection::default() };
        let set = TraceSet::open(&[input]).unwrap();
        let check = |batch: EpisodeBatch| {
            match (batch.steps.column(0).as_primitive_opt::<Int64Type>(), expected) {
                (Some(own), expected) => assert_eq!(Some(own.value(1)), expected, "{name}"),
                (None, expected) => assert_eq!((batch.steps.column(0).null_count(), expected), (2, None), "{name}"),
            }
            Ok::<_, TraceError>(())
        };
        set.scan(&own, threads(1), check, |()| Ok(())).unwrap();
    }
    let float = with_column(&plain, "pose_x", Arc::new(Float32Array::from(vec![0.5, 1.5])));
    let set = TraceSet::open(&[write(&file(&folder, "float.parquet"), &[float])]).unwrap();
    let pose = Projection { steps: vec!["pose_x".into()], ..Projection::default() };
    let check = |batch: EpisodeBatch| {
        assert_eq!(batch.steps.column(0).as_primitive::<Float64Type>().values(), &[0.5, 1.5]);
        Ok::<_, TraceError>(())
    };
    set.scan(&pose, threads(1), check, |()| Ok(())).unwrap();
}

#[test]
fn an_integer_beyond_64_bits_signed_is_refused_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let plain = batch(&rows(&[("a", 2), ("b", 1)]), Style::Plain);
    let column = Arc::new(UInt64Array::from(vec![0, u64::MAX, 1]));
    let input = write(&file(&folder, "large.parquet"), &[with_column(&plain, "own", column)]);
    let own = Projection { steps: vec!["own".into()], ..Projection::default() };
    let (code, text) = fault(&[input], &own);
    assert_eq!(code, Code::OutOfRange);
    assert!(text.contains("row group 0, episode `a`, t = 2, column `own`"), "{text}");
}

#[test]
fn a_column_that_cannot_be_delivered_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let plain = batch(&rows(&[("a", 2)]), Style::Plain);
    let number = with_column(&plain, "own", Arc::new(Int8Array::from(vec![1, 2])));
    let words = with_column(&plain, "own", Arc::new(StringArray::from(vec!["x", "y"])));
    let inputs = [write(&file(&folder, "1.parquet"), &[number]), write(&file(&folder, "2.parquet"), &[words])];
    for (name, why) in [
        ("own", "expected the same type in all files, found integer in 1.parquet and string in 2.parquet"),
        ("nobody", "expected a column of the traces, found none; they have episode_id, model"),
    ] {
        let own = Projection { steps: vec![name.into()], ..Projection::default() };
        let error = scan(&inputs, &own, 1).unwrap_err().to_string();
        assert!(error.contains(why), "{error}");
    }
}

/// Scans these rows after `damage`; each slice is a row group.
fn damaged(groups: &[usize], damage: impl Fn(&mut Vec<Row>)) -> (Code, String) {
    let folder = tempfile::tempdir().unwrap();
    let mut all = rows(&[("a", 4), ("b", 4), ("c", 4)]);
    damage(&mut all);
    let (mut batches, mut from) = (Vec::new(), 0);
    for to in groups.iter().copied().chain([all.len()]) {
        batches.push(batch(&all[from..to], Style::Plain));
        from = to;
    }
    fault(&[write(&file(&folder, "d.parquet"), &batches)], &projection())
}

#[test]
fn the_earliest_fault_is_found_whatever_the_row_groups() {
    type Damage = fn(&mut Vec<Row>);
    let cases: [(Damage, Code, &str); 10] = [
        (|rows| rows[5].t = 9, Code::TGap, "episode `b`, t = 9"),
        (|rows| rows[5].t = 1, Code::TDuplicate, "episode `b`, t = 1"),
        (|rows| rows[6].t = 1, Code::EpisodeTwice, "episode `b`, t = 1"),
        (|rows| rows[7].t = 2, Code::TOrder, "episode `b`, t = 2"),
        (|rows| rows[4].t = 0, Code::TStart, "episode `b`, t = 0"),
        (|rows| rows[6].id = None, Code::NullInRequired, "t = 3, column `episode_id`"),
        (|rows| rows[6].model = "other".into(), Code::InconsistentConstant, "episode `b`, t = 3, column `model`"),
        (|rows| rows[6].action = Some("jump".into()), Code::UnknownAction, "episode `b`, t = 3, column `action`"),
        (|rows| rows[6].px = Some(-1), Code::NegativeCount, "episode `b`, t = 3, column `mirror_px`"),
        (|rows| rows.extend_from_within(..4), Code::EpisodeTwice, "episode `a`, column `episode_id`"),
    ];
    for groups in [&[][..], &[4, 8], &[6], &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]] {
        for (damage, code, place) in cases {
            let (found, text) = damaged(groups, damage);
            assert_eq!(found, code, "{text}");
            assert!(text.contains(place), "{text}");
        }
    }
}

#[test]
fn an_id_is_unique_over_all_files() {
    let folder = tempfile::tempdir().unwrap();
    let one = write(&file(&folder, "1.parquet"), &[batch(&rows(&[("a", 2), ("b", 2)]), Style::Plain)]);
    let two = write(&file(&folder, "2.parquet"), &[batch(&rows(&[("b", 2), ("c", 2)]), Style::Plain)]);
    let (code, text) = fault(&[one, two], &projection());
    assert_eq!(code, Code::EpisodeInTwoFiles);
    assert!(text.contains("2.parquet") && text.contains("its id in 1.parquet too"), "{text}");
}

#[test]
fn an_unknown_experiment_names_the_known_ones() {
    let folder = tempfile::tempdir().unwrap();
    let input = write(&file(&folder, "1.parquet"), &[batch(&rows(&[("a", 2)]), Style::Plain)]);
    let known = Projection { experiments: Some(vec!["E7".into(), "F".into()]), ..projection() };
    let (code, text) = fault(&[input], &known);
    assert_eq!(code, Code::UnknownExperiment);
    assert!(text.contains("expected one of E7, F") && text.contains("found `E1`"), "{text}");
}

#[test]
#[should_panic(expected = "scoped thread panicked")]
fn a_panic_in_the_work_is_not_swallowed() {
    let folder = tempfile::tempdir().unwrap();
    let one = batch(&rows(&[("a", 4), ("b", 4)]), Style::Plain);
    let inputs: Vec<_> =
        (0..9).map(|i| write(&file(&folder, &format!("{i}.parquet")), std::slice::from_ref(&one))).collect();
    let set = TraceSet::open(&inputs).unwrap();
    let fail = |_: EpisodeBatch| -> Result<(), TraceError> { panic!("on purpose") };
    drop(set.scan(&projection(), threads(2), fail, |()| Ok(())));
}

#[test]
fn the_first_error_of_the_work_ends_the_scan() {
    let folder = tempfile::tempdir().unwrap();
    let all = rows(&[("a", 4), ("b", 4), ("c", 4)]);
    let groups: Vec<_> = all.chunks(4).map(|rows| batch(rows, Style::Plain)).collect();
    let set = TraceSet::open(&[write(&file(&folder, "1.parquet"), &groups)]).unwrap();
    let stop = |batch: EpisodeBatch| {
        let column = "stop".into();
        Err::<(), _>(TraceError::Column { column, expected: "", found: batch.origin.row_group.to_string() })
    };
    for n in [1, 2, 8] {
        let error = set.scan(&projection(), threads(n), stop, |()| Ok(())).unwrap_err();
        assert!(matches!(&error, TraceError::Column { found, .. } if found == "0"), "{error}");
    }
}
