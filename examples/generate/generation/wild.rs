//! Files as other programs write them: without our footer, with keys that repeat and values that do not.

use std::fs::File;
use std::iter;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanArray, Float32Array, Float64Array, Int64Array, RecordBatch, StringArray};
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::properties::{EnabledStatistics, WriterProperties};

use super::Failure;
use super::draw::Draw;
use super::episodes::{COLORS, Study, Wild};

const EXPERIMENTS: [&str; 5] = ["E1", "E2", "E3", "E4", "E5"];
const MOVES: [&str; 4] = ["move_forward", "move_backward", "turn_left", "turn_right"];
/// The first columns of measurements; others are sensors of the robot.
const POSE: [&str; 3] = ["pose_x", "pose_y", "pose_yaw"];
const WORDS: [&str; 16] = [
    "I", "see", "the", "mirror", "wall", "robot", "red", "blue", "turn", "left", "step", "toward", "cube", "shows",
    "body", "now",
];
/// The words of a summary: 16^6 texts, so that few of them come twice.
const SUMMARY: usize = 6;
/// Rows of a row group, which ends at any step of an episode.
const GROUP_ROWS: usize = 100_000;
/// Episodes that are in memory at a time.
const BATCH_EPISODES: usize = 500;

struct Episode {
    id: String,
    model: String,
    experiment: &'static str,
    seed: i64,
    run: i64,
    body_color: &'static str,
    steps: Vec<Step>,
}

struct Step {
    t: i64,
    action: &'static str,
    self_color: &'static str,
    selected_cube: &'static str,
    mirror_visible: bool,
    cost: f64,
    summary: String,
    /// Poses and other measurements.
    others: Vec<f32>,
}

/// Writes a file with the properties that pyarrow has by default.
pub fn write_file(study: &Study, shape: Wild, numbers: &[u32], path: &Path) -> Result<(), Failure> {
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_offset_index_disabled(true)
        .set_max_row_group_row_count(Some(GROUP_ROWS))
        .build();
    let schema = batch(&[], shape.columns)?.schema();
    let mut writer = ArrowWriter::try_new(File::create(path)?, schema, Some(properties))?;
    for some in numbers.chunks(BATCH_EPISODES) {
        let episodes: Vec<Episode> = some.iter().map(|number| episode(study, shape, (*number).into())).collect();
        writer.write(&batch(&episodes, shape.columns)?)?;
    }
    writer.close()?;
    Ok(())
}

/// The keys are drawn, so that many episodes share model, experiment, seed and run.
fn episode(study: &Study, shape: Wild, number: u64) -> Episode {
    let draw = &mut Draw::of(!study.seed, number);
    let model = format!("vendor/model-{}", draw.below(shape.models));
    let (experiment, body_color) = (draw.one(&EXPERIMENTS), draw.one(&COLORS));
    let (seed, run) = (1 + i64::from(draw.small(3)), 1 + i64::from(draw.small(7)));
    let last = i64::try_from(study.length(number)).unwrap_or(i64::MAX);
    let steps = (1..=last).map(|t| step(t, t == last, body_color, shape.columns, draw)).collect();
    Episode { id: format!("ep-{number:07}"), model, experiment, seed, run, body_color, steps }
}

fn step(t: i64, is_last: bool, body_color: &'static str, others: usize, draw: &mut Draw) -> Step {
    let action = if is_last { "done" } else { draw.one(&MOVES) };
    let self_color = match draw.below(100) {
        0..30 => body_color,
        30..65 => "unknown",
        _ => draw.one(&COLORS),
    };
    let selected_cube = if is_last && draw.percent(80) { body_color } else { "none" };
    let words: Vec<&str> = iter::repeat_with(|| draw.one(&WORDS)).take(SUMMARY).collect();
    Step {
        t,
        action,
        self_color,
        selected_cube,
        mirror_visible: draw.percent(30),
        cost: f64::from(draw.small(10_000_000)) / 1e9,
        summary: words.join(" "),
        others: iter::repeat_with(|| coordinate(draw)).take(others).collect(),
    }
}

/// A coordinate in a room of 8 m, with all the digits of its type.
fn coordinate(draw: &mut Draw) -> f32 {
    f32::from(draw.short(800)) / 100.0 - 4.0 + f32::from(draw.short(u16::MAX)) / 1e7
}

/// Every column may be null, and integers have 64 bits: the types that tables of other programs have by default.
fn batch(episodes: &[Episode], others: usize) -> Result<RecordBatch, Failure> {
    let key = |of: fn(&Episode) -> &str| -> ArrayRef {
        let rows = episodes.iter().flat_map(|episode| iter::repeat_n(of(episode), episode.steps.len()));
        Arc::new(StringArray::from_iter_values(rows))
    };
    let number = |of: fn(&Episode) -> i64| -> ArrayRef {
        let rows = episodes.iter().flat_map(|episode| iter::repeat_n(of(episode), episode.steps.len()));
        Arc::new(Int64Array::from_iter_values(rows))
    };
    let steps = || episodes.iter().flat_map(|episode| &episode.steps);
    let text = |of: fn(&Step) -> &str| -> ArrayRef { Arc::new(StringArray::from_iter_values(steps().map(of))) };
    let columns: [(&str, ArrayRef); 13] = [
        ("episode_id", key(|episode| &episode.id)),
        ("model", key(|episode| &episode.model)),
        ("experiment", key(|episode| episode.experiment)),
        ("seed", number(|episode| episode.seed)),
        ("run", number(|episode| episode.run)),
        ("body_color", key(|episode| episode.body_color)),
        ("t", Arc::new(Int64Array::from_iter_values(steps().map(|step| step.t)))),
        ("action", text(|step| step.action)),
        ("self_color", text(|step| step.self_color)),
        ("selected_cube", text(|step| step.selected_cube)),
        ("mirror_visible", Arc::new(steps().map(|step| Some(step.mirror_visible)).collect::<BooleanArray>())),
        ("cost_usd", Arc::new(Float64Array::from_iter_values(steps().map(|step| step.cost)))),
        ("summary", text(|step| &step.summary)),
    ];
    let columns = columns.map(|(name, values)| (name.to_owned(), values));
    let others = (0..others).map(|at| {
        let values: ArrayRef = Arc::new(Float32Array::from_iter_values(steps().map(|step| step.others[at])));
        (POSE.get(at).map_or_else(|| format!("sensor_{at}"), |name| (*name).to_owned()), values)
    });
    let columns = columns.into_iter().chain(others).map(|(name, values)| (name, values, true));
    Ok(RecordBatch::try_from_iter_with_nullable(columns)?)
}
