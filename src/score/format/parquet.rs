//! The episode table as Parquet, the definitions in its footer.

use std::io::Write;
use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray as _, Int32Array, Int64Array, RecordBatch, StringArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Field, Float64Type, Int64Type, Schema};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::{ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::{KeyValue, ParquetMetaDataReader};
use parquet::file::properties::WriterProperties;
use parquet::file::reader::ChunkReader;

use super::FormatError;
use super::csv::{KEYS, check_unique};
use super::footer;
use super::surroundings::Surroundings;
use crate::score::table::{EpisodeKey, EpisodeTable, LabelColumn, MetricColumn};
use crate::trace::contain::contained;

/// The footer key that tells scores from traces.
pub const KIND_KEY: &str = "mirrorstats.kind";
/// The value of [`KIND_KEY`] for scores.
pub const SCORES_KIND: &str = "scores";
/// The footer key of the definitions, as JSON (a `Catalog`).
pub const DEFINITIONS_KEY: &str = "mirrorstats.definitions";
/// The footer key of the definitions' hash.
pub const HASH_KEY: &str = "mirrorstats.definitions_hash";

/// Whether a file is Parquet with scores: its footer says so, or it has their key columns and no timestep.
///
/// `folders` are columns that stand in the names of the file's folders.
pub fn holds_scores(file: &impl ChunkReader, folders: &[(String, Option<String>)]) -> bool {
    let footer = contained(|| ParquetMetaDataReader::new().parse_and_finish(file));
    let Ok(Ok(metadata)) = footer else { return false };
    if footer::value(metadata.file_metadata(), KIND_KEY).is_some() {
        return footer::value(metadata.file_metadata(), KIND_KEY).as_deref() == Some(SCORES_KIND);
    }
    let columns = metadata.file_metadata().schema_descr().root_schema().get_fields().iter();
    let outside = folders.iter().map(|(name, _)| name.as_str());
    let names: Vec<&str> = columns.map(|column| column.name()).chain(outside).collect();
    !names.contains(&"t") && KEYS.iter().all(|key| names.contains(key))
}

/// Whether a file of scores carries the definitions that gave them.
pub fn holds_definitions(file: &impl ChunkReader) -> bool {
    let footer = contained(|| ParquetMetaDataReader::new().parse_and_finish(file));
    matches!(footer, Ok(Ok(metadata)) if footer::value(metadata.file_metadata(), DEFINITIONS_KEY).is_some())
}

pub(super) fn write(table: &EpisodeTable, out: impl Write + Send) -> Result<(), FormatError> {
    let batch = batch(table)?;
    let definitions =
        serde_json::to_string(&table.catalog).map_err(|error| FormatError::Definitions(error.to_string()))?;
    let pair = |key: &str, value: &str| KeyValue::new(key.to_owned(), value.to_owned());
    let metadata = vec![
        pair(KIND_KEY, SCORES_KIND),
        pair("mirrorstats.writer", concat!("mirrorstats ", env!("CARGO_PKG_VERSION"))),
        pair(HASH_KEY, &table.catalog.hash),
        pair(DEFINITIONS_KEY, &definitions),
    ];
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(metadata))
        .build();
    let mut writer = ArrowWriter::try_new(out, batch.schema(), Some(properties))?;
    writer.write(&batch)?;
    writer.close()?;
    Ok(())
}

fn batch(table: &EpisodeTable) -> Result<RecordBatch, FormatError> {
    let text = |name: &str, of: fn(&EpisodeKey) -> &str| {
        let array: StringArray = table.keys.iter().map(|key| Some(of(key))).collect();
        (Field::new(name, DataType::Utf8, false), Arc::new(array) as ArrayRef)
    };
    let int = |name: &str, of: fn(&EpisodeKey) -> i32| {
        let array: Int32Array = table.keys.iter().map(of).collect::<Vec<_>>().into();
        (Field::new(name, DataType::Int32, false), Arc::new(array) as ArrayRef)
    };
    let mut columns = vec![
        text(KEYS[0], |key| &key.episode_id),
        text(KEYS[1], |key| &key.model),
        text(KEYS[2], |key| &key.experiment),
        int(KEYS[3], |key| key.seed),
        int(KEYS[4], |key| key.run),
    ];
    for label in &table.labels {
        let array: StringArray = label.values.iter().map(Option::as_deref).collect();
        columns.push((Field::new(&label.name, DataType::Utf8, true), Arc::new(array)));
    }
    for metric in &table.metrics {
        let array: Int64Array = metric.values.iter().copied().collect();
        columns.push((Field::new(&metric.name, DataType::Int64, true), Arc::new(array)));
    }
    let (fields, arrays): (Vec<Field>, Vec<ArrayRef>) = columns.into_iter().unzip();
    RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays)
        .map_err(|error| FormatError::Parquet(ParquetError::ArrowError(error.to_string())))
}

pub(super) fn read(
    input: impl ChunkReader + 'static,
    surroundings: &Surroundings<'_>,
) -> Result<EpisodeTable, FormatError> {
    contained(|| decode(input, surroundings))
        .unwrap_or_else(|panic| Err(FormatError::Parquet(ParquetError::General(panic))))
}

fn decode(input: impl ChunkReader + 'static, surroundings: &Surroundings<'_>) -> Result<EpisodeTable, FormatError> {
    let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
    let builder = ParquetRecordBatchReaderBuilder::try_new_with_options(input, options)?;
    let catalog = match (footer::value(builder.metadata().file_metadata(), DEFINITIONS_KEY), surroundings.definitions) {
        (Some(text), _) => serde_json::from_str(&text).map_err(|error| FormatError::Definitions(error.to_string()))?,
        (None, Some(named)) => named.clone(),
        (None, None) => return Err(FormatError::Definitions(format!("there is no `{DEFINITIONS_KEY}`"))),
    };
    let names: Vec<&str> = builder.schema().fields().iter().map(|field| field.name().as_str()).collect();
    check_unique(&names)?;
    let mut table = EpisodeTable { catalog, keys: Vec::new(), labels: Vec::new(), metrics: Vec::new() };
    // A part without rows has its columns all the same.
    let none = surroundings.complete(&RecordBatch::new_empty(builder.schema().clone()), &table.catalog)?;
    append(&mut table, &none)?;
    for batch in builder.build()? {
        let batch = batch.map_err(|error| FormatError::Parquet(error.into()))?;
        let batch = surroundings.complete(&batch, &table.catalog)?;
        append(&mut table, &batch)?;
    }
    Ok(table.sorted())
}

fn append(table: &mut EpisodeTable, batch: &RecordBatch) -> Result<(), FormatError> {
    let [ids, models, experiments] = [texts(batch, KEYS[0])?, texts(batch, KEYS[1])?, texts(batch, KEYS[2])?];
    let [seeds, runs] = [ints(batch, KEYS[3])?, ints(batch, KEYS[4])?];
    for row in 0..batch.num_rows() {
        let text = |values: &[Option<String>], column| values[row].clone().ok_or_else(|| null(column));
        let number = |values: &[Option<i64>], column| {
            values[row].and_then(|value| i32::try_from(value).ok()).ok_or_else(|| null(column))
        };
        table.keys.push(EpisodeKey {
            experiment: text(&experiments, KEYS[2])?,
            model: text(&models, KEYS[1])?,
            seed: number(&seeds, KEYS[3])?,
            run: number(&runs, KEYS[4])?,
            episode_id: text(&ids, KEYS[0])?,
        });
    }
    let schema = batch.schema();
    let others = schema.fields().iter().map(|field| field.name()).filter(|name| !KEYS.contains(&name.as_str()));
    for name in others {
        if table.catalog.metric.contains_key(name) {
            let values = ints(batch, name)?;
            match table.metrics.iter_mut().find(|metric| metric.name == *name) {
                Some(metric) => metric.values.extend(values),
                None => table.metrics.push(MetricColumn { name: name.clone(), values }),
            }
        } else {
            let values = texts(batch, name)?;
            match table.labels.iter_mut().find(|label| label.name == *name) {
                Some(label) => label.values.extend(values),
                None => table.labels.push(LabelColumn { name: name.clone(), values }),
            }
        }
    }
    Ok(())
}

fn null(column: &str) -> FormatError {
    FormatError::Column { column: column.to_owned(), expected: "a value in every row", found: "null".to_owned() }
}

fn column(batch: &RecordBatch, name: &str, ty: &DataType, expected: &'static str) -> Result<ArrayRef, FormatError> {
    let fault = |found: String| FormatError::Column { column: name.to_owned(), expected, found };
    let column = batch.column_by_name(name).ok_or_else(|| fault("no such column".to_owned()))?;
    let fits = match ty {
        // Some engines widen a sum of integers until Parquet has no integer for it.
        DataType::Int64 => column.data_type().is_integer() || is_whole(column),
        _ => column.data_type().is_string(),
    };
    if !fits {
        return Err(fault(column.data_type().to_string()));
    }
    cast(column, ty).map_err(|error| fault(error.to_string()))
}

/// Whether all values are doubles that stand for one integer each.
fn is_whole(column: &ArrayRef) -> bool {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    let whole = |value: f64| value.fract().abs() <= 0.0 && value.abs() < EXACT;
    column.as_primitive_opt::<Float64Type>().is_some_and(|floats| floats.iter().flatten().all(whole))
}

fn texts(batch: &RecordBatch, name: &str) -> Result<Vec<Option<String>>, FormatError> {
    let column = column(batch, name, &DataType::Utf8, "text")?;
    Ok(column.as_string::<i32>().iter().map(|text| text.map(str::to_owned)).collect())
}

fn ints(batch: &RecordBatch, name: &str) -> Result<Vec<Option<i64>>, FormatError> {
    let column = column(batch, name, &DataType::Int64, "integers")?;
    Ok(column.as_primitive::<Int64Type>().iter().collect())
}
