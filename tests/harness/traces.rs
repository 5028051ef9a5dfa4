//! Writes and reads small traces.

use std::fs::File;
use std::path::Path;

use arrow::array::{ArrayRef, AsArray as _, RecordBatch};
use arrow::compute::{cast, concat_batches};
use arrow::datatypes::DataType;
use mirrorstats_trace::episodes::episode::{Episode, Step};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::schema::RECORDING_KEY;
use mirrorstats_trace::write::{OptionalColumns, TraceMetadata, TraceWriter};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::file::properties::WriterProperties;
use serde_json::Value;

/// An episode of model `m` in E1.
pub fn episode(id: &str, steps: Vec<Step>) -> Episode {
    Episode {
        episode_id: id.into(),
        model: "m".into(),
        experiment: "E1".into(),
        seed: 1,
        run: 1,
        body_color: "red".into(),
        steps,
        ..Episode::default()
    }
}

/// Writes a trace with these optional columns, even if they have no values.
pub fn write_trace(path: &Path, episodes: &[Episode], columns: OptionalColumns) {
    let mut writer = TraceWriter::create(path, &TraceMetadata { recording: None, columns }).unwrap();
    for episode in episodes {
        writer.write(episode).unwrap();
    }
    writer.commit().unwrap();
}

/// Scores in CSV, row by row, without the columns `unusable_replies` and `mirrorstats.declared`.
pub fn score_values(scores: &str) -> Vec<Vec<String>> {
    let mut reader = csv::Reader::from_reader(scores.as_bytes());
    let header = reader.headers().unwrap().clone();
    let is_value = |at: usize| !["unusable_replies", "mirrorstats.declared"].contains(&&header[at]);
    let values = |row: &csv::StringRecord| {
        row.iter().enumerate().filter(|(at, _)| is_value(*at)).map(|(_, text)| text.to_owned()).collect()
    };
    let names = values(&header);
    std::iter::once(names).chain(reader.records().map(|row| values(&row.unwrap()))).collect()
}

/// Writes rows as another writer does: each batch becomes at least one row group.
pub fn write_rows(path: &Path, batches: &[RecordBatch], properties: Option<WriterProperties>) {
    let mut writer = ArrowWriter::try_new(File::create(path).unwrap(), batches[0].schema(), properties).unwrap();
    for batch in batches {
        writer.write(batch).unwrap();
        writer.flush().unwrap();
    }
    writer.close().unwrap();
}

/// The traces of some files.
pub fn open(paths: &[&Path]) -> TraceSet {
    TraceSet::open(&paths.iter().map(Input::new).collect::<Vec<_>>()).unwrap()
}

/// A Parquet file about to be read.
pub fn reader(path: &Path) -> ParquetRecordBatchReaderBuilder<File> {
    ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap()
}

/// All rows of a Parquet file.
pub fn rows(path: &Path) -> RecordBatch {
    let batches: Vec<_> = reader(path).build().unwrap().map(Result::unwrap).collect();
    concat_batches(&batches[0].schema(), &batches).unwrap()
}

/// A column by its name.
pub fn column(rows: &RecordBatch, name: &str) -> ArrayRef {
    rows.column_by_name(name).unwrap_or_else(|| panic!("no column {name}")).clone()
}

/// A column of text of a Parquet file, null as `None`.
pub fn texts(path: &Path, name: &str) -> Vec<Option<String>> {
    let texts = cast(&column(&rows(path), name), &DataType::Utf8).unwrap();
    texts.as_string::<i32>().iter().map(|text| text.map(str::to_owned)).collect()
}

/// A trace's metadata about its recording.
pub fn recording(path: &Path) -> Value {
    serde_json::from_str(open(&[path]).files()[0].metadata_value(RECORDING_KEY).unwrap()).unwrap()
}

/// The episodes of a trace.
pub fn episodes(path: &Path) -> Vec<Episode> {
    episode_rows::read(path).unwrap().iter().map(|rows| rows.episode().unwrap()).collect()
}
