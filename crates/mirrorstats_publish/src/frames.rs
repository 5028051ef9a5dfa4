//! Frames as a table with an image column, which the Hub shows: one file per trace.
//!
//! Rule: a picture is encoded from its pixels, so equal frames give equal bytes. Its pixels must have the digest that
//! the trace states.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{
    Array as _, ArrayRef, AsArray, BinaryBuilder, Int32Array, RecordBatch, StringArray, StringBuilder, StructArray,
};
use arrow::datatypes::{DataType, Field, Fields, Int32Type, Schema};
use mirrorstats_exact::format::counted;
use mirrorstats_exact::hash;
use mirrorstats_exact::replace::make_folder;
use mirrorstats_log::LogError;
use mirrorstats_log::frames::LogIndex;
use mirrorstats_study::Study;
use mirrorstats_study::explain::explain_each_in;
use mirrorstats_trace::catch_panic::contained;
use mirrorstats_trace::episodes::episode::{Action, Episode};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows;
use mirrorstats_view::picture;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::arrow::arrow_writer::ArrowWriterOptions;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use serde_json::json;

use crate::PublishError;
use crate::card::dtype;
use crate::derive::inputs;
use crate::manifest::Frames;

pub(crate) const FRAMES: &str = "frames";
/// The Hub reads a whole row group to show one row.
const ROW_GROUP_ROWS: usize = 100;
/// The Hub shows images up to this size.
const LARGEST_IMAGE: usize = 1_000_000;

/// Pictures by episode and step.
type Pictures = BTreeMap<(String, i32), Vec<u8>>;

/// The frames of a trace.
enum Source {
    Log(LogIndex),
    Table(Pictures),
}

/// Writes the frames of each trace whose log is beside it, or whose frames are in the bundle already.
pub(crate) fn write_frames(
    study: &Study,
    base: &Path,
    out: &Path,
    frames: Frames,
    notes: &mut Vec<String>,
) -> Result<(), PublishError> {
    let folder = out.join(FRAMES);
    let mut without: u64 = 0;
    for input in inputs(base)? {
        let name = input.path.file_name().unwrap_or_default().to_owned();
        let log = input.path.with_extension("mcap");
        let table = base.join(FRAMES).join(&name);
        let (source, source_name) = if log.is_file() {
            (Source::of_log(&log)?, input.name.replace(".parquet", ".mcap"))
        } else if table.is_file() && base != out {
            (Some(Source::Table(of_table(&table, &input.name)?)), format!("{FRAMES}/{}", name.to_string_lossy()))
        } else {
            (None, String::new())
        };
        let is_written = match source {
            None => false,
            Some(source) => {
                let episodes = read_episodes(&input)?;
                let wanted = match frames {
                    Frames::Decisive => Some(decisive(study, &input, &episodes)?),
                    Frames::All | Frames::None => None,
                };
                make_folder(&folder).map_err(PublishError::file(&folder))?;
                write_table(&folder.join(&name), (source, &source_name), &episodes, wanted.as_ref())?
            }
        };
        without += u64::from(!is_written);
    }
    if without > 0 {
        notes.push(format!("no frames of {}: no log with them is beside", counted(without, "trace")));
    }
    Ok(())
}

fn read_episodes(input: &Input) -> Result<Vec<Episode>, PublishError> {
    let rows = episode_rows::read(&input.path)?;
    let refused = |error: episode_rows::NotAnEpisode| PublishError::Refused(format!("{}: {error}", input.name));
    rows.iter().map(|rows| rows.episode().map_err(refused)).collect()
}

/// The steps that decided a metric.
fn decisive(study: &Study, input: &Input, episodes: &[Episode]) -> Result<BTreeSet<(String, i32)>, PublishError> {
    let ids = episodes.iter().map(|episode| episode.episode_id.clone()).collect();
    let mut steps = BTreeSet::new();
    for (id, evidence) in explain_each_in(study, input, &ids)? {
        let timesteps = evidence.metrics.iter().flat_map(|metric| &metric.timesteps);
        steps.extend(timesteps.filter_map(|t| Some((id.clone(), i32::try_from(*t).ok()?))));
    }
    Ok(steps)
}

impl Source {
    /// `None` for a log without an index, or of another program.
    fn of_log(log: &Path) -> Result<Option<Self>, PublishError> {
        match LogIndex::open(log) {
            Ok(index) => Ok(index.map(Self::Log)),
            Err(LogError::Foreign { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// The pictures of an episode by step. One episode of a log is in memory at a time.
    fn pictures(
        &mut self,
        episode: &Episode,
        wanted: Option<&BTreeSet<(String, i32)>>,
    ) -> Result<BTreeMap<i32, Vec<u8>>, PublishError> {
        let key = |t: i32| (episode.episode_id.clone(), t);
        let mut found = BTreeMap::new();
        match self {
            Self::Table(pictures) => {
                let steps = (1..).zip(&episode.steps).map(|(t, _)| t);
                found.extend(steps.filter_map(|t| Some((t, pictures.remove(&key(t))?))));
            }
            Self::Log(index) => {
                let times: BTreeMap<u64, i32> = (1..)
                    .zip(&episode.steps)
                    .filter_map(|(t, step)| Some((u64::try_from(step.extra.frame_time?).ok()?, t)))
                    .filter(|(_, t)| wanted.is_none_or(|wanted| wanted.contains(&key(*t))))
                    .collect();
                let moments = times.keys().copied().collect();
                index.each_moment(&episode.episode_id, &moments, &mut |time, moment| {
                    found.extend(moment.frame.map(|frame| (times[&time], frame)));
                })?;
            }
        }
        Ok(found)
    }
}

/// Reads the pictures of a published table, which may be damaged.
fn of_table(path: &Path, trace: &str) -> Result<Pictures, PublishError> {
    let mut pictures = Pictures::new();
    let damaged = |words: String| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        PublishError::Refused(format!("{FRAMES}/{name}: expected the frames of {trace}, found {words}"))
    };
    let file = File::open(path).map_err(PublishError::file(path))?;
    let read = contained(|| -> Result<Vec<RecordBatch>, String> {
        let reader = ParquetRecordBatchReaderBuilder::try_new(file).map_err(|error| error.to_string())?;
        let reader = reader.with_batch_size(ROW_GROUP_ROWS).build().map_err(|error| error.to_string())?;
        reader.map(|batch| batch.map_err(|error| error.to_string())).collect()
    });
    for batch in read.and_then(|batches| batches).map_err(damaged)? {
        let columns = || {
            let ids = batch.column_by_name("episode_id")?.as_string_opt::<i32>()?;
            let steps = batch.column_by_name("t")?.as_primitive_opt::<Int32Type>()?;
            let image = batch.column_by_name("image")?.as_struct_opt()?.column_by_name("bytes")?;
            Some((ids, steps, image.as_binary_opt::<i32>()?))
        };
        let (ids, steps, images) = columns().ok_or_else(|| damaged("other columns".to_owned()))?;
        for row in 0..batch.num_rows() {
            if images.is_valid(row) {
                pictures.insert((ids.value(row).to_owned(), steps.value(row)), images.value(row).to_vec());
            }
        }
    }
    Ok(pictures)
}

/// The hash of each picture of a table by its episode and step; empty for a damaged table.
pub(crate) fn hashes(path: &Path) -> BTreeMap<String, String> {
    let pictures = of_table(path, "the trace").unwrap_or_default();
    let named = pictures.into_iter().map(|((id, t), bytes)| (format!("{id}, t = {t}"), hash::of_bytes(&bytes)));
    named.collect()
}

/// The picture as it is published, after comparing its pixels with the digest of the trace.
fn checked(bytes: &[u8], step: &str, digest: Option<&str>) -> Result<Vec<u8>, PublishError> {
    let refused = |words: &str| PublishError::Refused(format!("{step}: expected {words}"));
    let frame = picture::decode(bytes).ok_or_else(|| refused("a frame as PNG with 8 bits per channel, found none"))?;
    if let Some(digest) = digest.filter(|digest| **digest != *frame.digest()) {
        let (digest, found) = (short(digest), frame.digest());
        return Err(refused(&format!("the frame {digest}, as the trace states, found {}", short(&found))));
    }
    let bytes = picture::encode(&frame).ok_or_else(|| refused("a frame that can be encoded"))?;
    if bytes.len() > LARGEST_IMAGE {
        let found = bytes.len();
        return Err(refused(&format!(
            "a picture of at most {LARGEST_IMAGE} bytes, found {found}\n  help: `--frames none` leaves frames out"
        )));
    }
    Ok(bytes)
}

fn short(digest: &str) -> &str {
    digest.split('-').next().unwrap_or(digest)
}

/// Returns false if there is no frame, and so no file.
fn write_table(
    path: &Path,
    (mut source, name): (Source, &str),
    episodes: &[Episode],
    wanted: Option<&BTreeSet<(String, i32)>>,
) -> Result<bool, PublishError> {
    let schema = schema();
    let failed = |error: ParquetError| PublishError::Refused(format!("{}: {error}", path.display()));
    let mut writer = None;
    for episode in episodes {
        let mut rows = Vec::new();
        for (t, bytes) in source.pictures(episode, wanted)? {
            let step = &episode.steps[usize::try_from(t - 1).unwrap_or_default()];
            let place = format!("{name}, {}, t = {t}", episode.episode_id);
            let bytes = checked(&bytes, &place, step.extra.frame_digest.as_deref())?;
            rows.push((t, step.action.map(Action::name), bytes));
        }
        if rows.is_empty() {
            continue;
        }
        let writer = if let Some(writer) = &mut writer {
            writer
        } else {
            let file = File::create(path).map_err(PublishError::file(path))?;
            writer.insert(ArrowWriter::try_new_with_options(file, Arc::clone(&schema), options()).map_err(failed)?)
        };
        writer.write(&batch(&schema, episode, &rows).map_err(|error| failed(error.into()))?).map_err(failed)?;
    }
    if let Source::Table(rest) = source
        && let Some((id, t)) = rest.keys().next()
    {
        let words = "expected frames of the steps of its trace, found one of";
        return Err(PublishError::Refused(format!("{name}: {words} {id}, t = {t}")));
    }
    let is_written = writer.is_some();
    if let Some(writer) = writer {
        writer.close().map_err(failed)?;
    }
    Ok(is_written)
}

fn options() -> ArrowWriterOptions {
    let properties = WriterProperties::builder()
        .set_created_by(concat!("mirrorstats version ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_key_value_metadata(Some(vec![KeyValue::new("huggingface".to_owned(), features().to_string())]))
        .set_max_row_group_row_count(Some(ROW_GROUP_ROWS))
        .set_dictionary_enabled(false)
        .build();
    ArrowWriterOptions::new().with_properties(properties).with_skip_arrow_metadata(true)
}

type Row = (i32, Option<&'static str>, Vec<u8>);

fn batch(schema: &Arc<Schema>, episode: &Episode, rows: &[Row]) -> Result<RecordBatch, arrow::error::ArrowError> {
    let text = |value: &str| Arc::new(StringArray::from_iter_values(rows.iter().map(|_| value))) as ArrayRef;
    let number = |value: i32| Arc::new(Int32Array::from_iter_values(rows.iter().map(|_| value))) as ArrayRef;
    let (mut bytes, mut paths) = (BinaryBuilder::new(), StringBuilder::new());
    for (t, _, image) in rows {
        bytes.append_value(image);
        paths.append_value(format!("{}-t{t}.png", episode.episode_id.replace('/', "-")));
    }
    let image: Vec<ArrayRef> = vec![Arc::new(bytes.finish()), Arc::new(paths.finish())];
    let columns: Vec<ArrayRef> = vec![
        text(&episode.episode_id),
        text(&episode.model),
        text(&episode.experiment),
        number(episode.seed),
        number(episode.run),
        Arc::new(Int32Array::from_iter_values(rows.iter().map(|(t, ..)| *t))),
        Arc::new(rows.iter().map(|(_, action, _)| *action).collect::<StringArray>()),
        Arc::new(StructArray::try_new(image_fields(), image, None)?),
    ];
    RecordBatch::try_new(Arc::clone(schema), columns)
}

fn image_fields() -> Fields {
    vec![Field::new("bytes", DataType::Binary, true), Field::new("path", DataType::Utf8, true)].into()
}

fn schema() -> Arc<Schema> {
    let texts = ["episode_id", "model", "experiment"].map(|name| Field::new(name, DataType::Utf8, false));
    let numbers = ["seed", "run", "t"].map(|name| Field::new(name, DataType::Int32, false));
    let action = Field::new("action", DataType::Utf8, true);
    let image = Field::new("image", DataType::Struct(image_fields()), true);
    Arc::new(Schema::new(texts.into_iter().chain(numbers).chain([action, image]).collect::<Vec<_>>()))
}

/// The features of the table, as `datasets` and the Hub read them from a footer.
fn features() -> serde_json::Value {
    let feature = |field: &Arc<Field>| match field.data_type() {
        DataType::Struct(_) => json!({"_type": "Image"}),
        kind => json!({"dtype": dtype(kind), "_type": "Value"}),
    };
    let schema = schema();
    let features = schema.fields().iter().map(|field| (field.name().clone(), feature(field)));
    json!({"info": {"features": features.collect::<serde_json::Map<_, _>>()}})
}
