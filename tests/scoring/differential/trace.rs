//! Random traces: files of whole episodes where every column may be null or absent, and narrow or wide. Row groups may
//! begin anywhere.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{
    ArrayRef, BooleanArray, Float32Array, Float64Array, Int32Array, Int64Array, RecordBatch, StringArray,
};
use arrow::compute::cast;
use arrow::datatypes::DataType;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceSet;
use parquet::arrow::ArrowWriter;
use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;
use proptest::sample::select;

/// One file.
#[derive(Clone, Debug)]
pub struct Sheet {
    pub episodes: Vec<Episode>,
    /// True for each of the [`OPTIONAL`] columns that the file has.
    pub present: Vec<bool>,
    /// Rows per row group.
    pub rows_of_group: usize,
    /// 64-bit integers and text dictionaries, instead of 32-bit integers and plain text.
    pub wide: bool,
}

#[derive(Clone, Debug)]
pub struct Episode {
    model: &'static str,
    experiment: &'static str,
    numbers: (i32, i32, Option<i32>),
    body_color: &'static str,
    stated_color: Option<&'static str>,
    pub steps: Vec<Step>,
}

#[derive(Clone, Debug)]
pub struct Step {
    texts: [Option<&'static str>; 5],
    visible: bool,
    bumped: Option<bool>,
    grip_open: Option<bool>,
    ints: [Option<i32>; 3],
    points: Option<i64>,
    pose_x: Option<f32>,
    weight: Option<f64>,
}

/// The columns that a file may lack.
pub const OPTIONAL: [&str; 11] = [
    "mirror_px",
    "mirror_self_px",
    "distractors",
    "stated_color",
    "reasoning",
    "bumped",
    "pose_x",
    "points",
    "weight",
    "note",
    "n4",
];

const CLAIMS: [&str; 3] = ["red", "blue", "unknown"];
const CUBES: [&str; 3] = ["red", "blue", "none"];
const ACTIONS: [&str; 5] = ["move_forward", "move_backward", "turn_left", "turn_right", "done"];
const TEXTS: [&str; 10] = ["I think", "maybe me", "", "done", "Z", "é", "😀 non", "it's", "a\\b", "é"];

fn text(from: &'static [&'static str]) -> impl Strategy<Value = Option<&'static str>> {
    option::of(select(from))
}

fn int(from: &'static [i32]) -> impl Strategy<Value = Option<i32>> {
    option::weighted(0.8, select(from))
}

fn step() -> impl Strategy<Value = Step> {
    let points = select(vec![0, 1, 2, -1, -7, 40, (1 << 53) + 1, 1 << 55, -(1 << 55)]);
    let floats = select(vec![0.0, -0.0, 1.5, -2.25, f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.1, 1e30]);
    let weights = select(vec![0.0, -0.0, 1.5, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.1, -3e200]);
    let texts = (text(&ACTIONS), text(&CLAIMS), text(&CUBES), text(&TEXTS), text(&TEXTS));
    let bools = (any::<bool>(), any::<Option<bool>>(), any::<Option<bool>>());
    let ints = (int(&[0, 1, 2, 3, i32::MAX]), int(&[0, 1, 2, 3, 900]), int(&[0, -1, 5, i32::MIN, i32::MAX]));
    (texts, bools, ints, option::of(points), option::of(floats), option::of(weights)).prop_map(
        |((a, b, c, d, e), (visible, bumped, grip_open), (f, g, h), points, pose_x, weight)| Step {
            texts: [a, b, c, d, e],
            visible,
            bumped,
            grip_open,
            ints: [f, g, h],
            points,
            pose_x,
            weight,
        },
    )
}

fn episode() -> impl Strategy<Value = Episode> {
    let names = (select(vec!["m", "é model", "third"]), select(vec!["E1", "E2", "E5"]), select(vec!["red", "blue"]));
    let numbers = (select(vec![0, 1, 2, i32::MAX]), select(vec![0, 3, i32::MAX]), int(&[0, 1, 5]));
    (names, numbers, text(&CLAIMS[..2]), vec(step(), 1..9)).prop_map(
        |((model, experiment, body_color), numbers, stated_color, steps)| Episode {
            model,
            experiment,
            numbers,
            body_color,
            stated_color,
            steps,
        },
    )
}

/// One or more random files.
pub fn sheets() -> impl Strategy<Value = Vec<Sheet>> {
    let present = vec(prop::bool::weighted(0.85), OPTIONAL.len());
    let sheet = (vec(episode(), 1..5), present, 1..20_usize, any::<bool>());
    let sheet =
        sheet.prop_map(|(episodes, present, rows_of_group, wide)| Sheet { episodes, present, rows_of_group, wide });
    vec(sheet, 1..4)
}

/// Writes the files into a folder and opens them.
pub fn open(folder: &Path, sheets: &[Sheet]) -> TraceSet {
    let write = |(at, sheet): (usize, &Sheet)| {
        let path = folder.join(format!("trace {at}.parquet"));
        write(&path, at, sheet);
        Input::new(path)
    };
    let inputs: Vec<Input> = sheets.iter().enumerate().map(write).collect();
    TraceSet::open(&inputs).unwrap()
}

fn write(path: &Path, at: usize, sheet: &Sheet) {
    let batch = batch(at, sheet);
    let mut writer = ArrowWriter::try_new(File::create(path).unwrap(), batch.schema(), None).unwrap();
    for start in (0..batch.num_rows()).step_by(sheet.rows_of_group) {
        writer.write(&batch.slice(start, sheet.rows_of_group.min(batch.num_rows() - start))).unwrap();
        writer.flush().unwrap();
    }
    writer.close().unwrap();
}

/// A row: the episode's number, the episode, t and the step.
type Row<'a> = (usize, &'a Episode, usize, &'a Step);

fn batch(at: usize, sheet: &Sheet) -> RecordBatch {
    let steps = |(e, episode): (usize, &'_ Episode)| {
        let number = e;
        (0..episode.steps.len()).map(move |s| (number, s)).collect::<Vec<_>>()
    };
    let places: Vec<(usize, usize)> = sheet.episodes.iter().enumerate().flat_map(steps).collect();
    let rows: Vec<Row> =
        places.iter().map(|&(e, s)| (e, &sheet.episodes[e], s + 1, &sheet.episodes[e].steps[s])).collect();
    let columns = columns(at, &rows).into_iter().filter(|(name, _)| {
        OPTIONAL.iter().position(|optional| optional == name).is_none_or(|place| sheet.present[place])
    });
    let widened = |(name, array): (&'static str, ArrayRef)| match array.data_type() {
        DataType::Int32 if sheet.wide => (name, cast(&array, &DataType::Int64).unwrap()),
        DataType::Utf8 if sheet.wide => {
            let dictionary = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
            (name, cast(&array, &dictionary).unwrap())
        }
        _ => (name, array),
    };
    RecordBatch::try_from_iter(columns.map(widened)).unwrap()
}

fn columns(at: usize, rows: &[Row]) -> Vec<(&'static str, ArrayRef)> {
    let text = |of: &dyn Fn(&Row) -> Option<&'static str>| -> ArrayRef {
        Arc::new(rows.iter().map(of).collect::<StringArray>())
    };
    let int = |of: &dyn Fn(&Row) -> Option<i32>| -> ArrayRef { Arc::new(rows.iter().map(of).collect::<Int32Array>()) };
    let truth =
        |of: &dyn Fn(&Row) -> Option<bool>| -> ArrayRef { Arc::new(rows.iter().map(of).collect::<BooleanArray>()) };
    let ids: StringArray = rows.iter().map(|(e, ..)| Some(format!("f{at}-e{e}"))).collect();
    vec![
        ("episode_id", Arc::new(ids)),
        ("model", text(&|row| Some(row.1.model))),
        ("experiment", text(&|row| Some(row.1.experiment))),
        ("seed", int(&|row| Some(row.1.numbers.0))),
        ("run", int(&|row| Some(row.1.numbers.1))),
        ("body_color", text(&|row| Some(row.1.body_color))),
        ("t", int(&|row| i32::try_from(row.2).ok())),
        ("action", text(&|row| row.3.texts[0])),
        ("self_color", text(&|row| row.3.texts[1])),
        ("selected_cube", text(&|row| row.3.texts[2])),
        ("mirror_visible", truth(&|row| Some(row.3.visible))),
        ("mirror_px", int(&|row| row.3.ints[0])),
        ("mirror_self_px", int(&|row| row.3.ints[1])),
        ("distractors", int(&|row| row.1.numbers.2)),
        ("stated_color", text(&|row| row.1.stated_color)),
        ("reasoning", text(&|row| row.3.texts[3])),
        ("bumped", truth(&|row| row.3.bumped)),
        ("pose_x", Arc::new(rows.iter().map(|row| row.3.pose_x).collect::<Float32Array>())),
        ("points", Arc::new(rows.iter().map(|row| row.3.points).collect::<Int64Array>())),
        ("weight", Arc::new(rows.iter().map(|row| row.3.weight).collect::<Float64Array>())),
        ("note", text(&|row| row.3.texts[4])),
        ("n4", int(&|row| row.3.ints[2])),
        ("grip open", truth(&|row| row.3.grip_open)),
    ]
}
