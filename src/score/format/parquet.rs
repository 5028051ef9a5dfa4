//! The episode table as Parquet, the definitions in its footer.

use std::io::Write;
use std::iter;
use std::ops::Range;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, SyncSender};

use arrow::array::{
    Array, ArrayBuilder as _, ArrayRef, AsArray as _, Int32Builder, Int64Array, RecordBatch, StringBuilder,
};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Field, Float64Type, Int64Type, Schema};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::{ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use parquet::arrow::arrow_writer::{ArrowColumnChunk, ArrowColumnWriter, ArrowRowGroupWriterFactory, compute_leaves};
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::{KeyValue, ParquetMetaData, ParquetMetaDataReader};
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::ChunkReader;
use parquet::file::writer::SerializedFileWriter;

use super::FormatError;
use super::csv::{KEYS, check_unique};
use super::footer;
use super::surroundings::Surroundings;
use crate::base::beside::beside;
use crate::score::table::{EpisodeKey, EpisodeRow, EpisodeTable, Header, LabelColumn, MetricColumn};
use crate::score::values::nulls_of;
use crate::trace::contain::contained;
use crate::trace::footer_shape;

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
    let Some(metadata) = metadata(file) else { return false };
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
    metadata(file).is_some_and(|metadata| footer::value(metadata.file_metadata(), DEFINITIONS_KEY).is_some())
}

/// The footer of a file, if it has one that can be read.
fn metadata(file: &impl ChunkReader) -> Option<ParquetMetaData> {
    footer_shape::check_file(file).ok()?;
    contained(|| ParquetMetaDataReader::new().parse_and_finish(file)).ok()?.ok()
}

/// Rows after which a row group is closed: what is encoded and not yet written stays small.
const ROW_GROUP_ROWS: usize = 64 * 1024;
/// Rows that are gathered before they are encoded.
const GATHERED_ROWS: usize = 4 * 1024;
/// Bytes of texts that are gathered at most, one row more or less: a column holds 2 GiB.
const GATHERED_TEXT: usize = 256 << 20;

/// Batches that wait for an encoder.
const WAITING: usize = 2;

/// The columns that one encoder takes; another one takes those behind them. Each has about half of the work.
const TEXTS: Range<usize> = 0..3;

/// Writes a table as Parquet: rows are gathered here and encoded on threads of their own.
///
/// `rows` gives each row to the function that it is called with.
pub(super) fn write<E: From<FormatError>>(
    header: &Header,
    out: impl Write + Send,
    rows: impl FnOnce(&mut dyn FnMut(&EpisodeRow) -> Result<(), FormatError>) -> Result<(), E>,
) -> Result<(), E> {
    let schema = Arc::new(schema(header));
    let properties = properties(header)?;
    let parquet = ArrowWriter::try_new(out, Arc::clone(&schema), Some(properties)).map_err(FormatError::from)?;
    let feed = |give: SyncSender<RecordBatch>| {
        let mut gathered = Gathered::new(header);
        // What ended the encoder is learnt when it is done.
        let send = |gathered: &mut Gathered| {
            let batch = RecordBatch::try_new(Arc::clone(&schema), gathered.take());
            let batch = batch.map_err(|error| FormatError::Parquet(ParquetError::ArrowError(error.to_string())))?;
            Ok::<_, FormatError>(give.send(batch).is_ok())
        };
        let mut over = false;
        rows(&mut |row| {
            if !over {
                gathered.add(row);
                over = gathered.is_full() && !send(&mut gathered)?;
            }
            Ok(())
        })?;
        send(&mut gathered).map(drop).map_err(E::from)
    };
    let (given, written) =
        beside("parquet", WAITING, |batches| encode(parquet, &batches), feed).map_err(FormatError::Thread)?;
    given?;
    written?.close().map_err(FormatError::from)?;
    Ok(())
}

/// Encodes batches until there are no more; what comes back is to be closed, unless a row was lost.
fn encode<W: Write + Send>(
    parquet: ArrowWriter<W>,
    batches: &Receiver<RecordBatch>,
) -> Result<SerializedFileWriter<W>, FormatError> {
    let (mut file, factory) = parquet.into_serialized_writer()?;
    let others = TEXTS.end..file.schema_descr().num_columns();
    let (give, numbers) = mpsc::channel();
    let factory = &factory;
    let encode_numbers = move |batches: Receiver<RecordBatch>| {
        let gone = |_| ParquetError::General("nobody takes the encoded columns".into());
        encode_columns(factory, &others, batches, |chunks| give.send(chunks).map_err(gone))
    };
    let encode_texts = |pass_on: SyncSender<RecordBatch>| {
        let mut pass_on = Some(pass_on);
        // The other encoder is told at once when there are no more: its last columns are waited for here.
        let batches = iter::from_fn(|| {
            let batch = batches.recv().ok();
            pass_on = pass_on.take().filter(|next| batch.clone().is_some_and(|batch| next.send(batch).is_ok()));
            batch
        });
        encode_columns(factory, &TEXTS, batches, |texts| {
            // Why there are none, the other encoder knows.
            let Ok(numbers) = numbers.recv() else { return Ok(()) };
            let mut group = file.next_row_group()?;
            texts.into_iter().chain(numbers).try_for_each(|chunk| chunk.append_to_row_group(&mut group))?;
            group.close().map(drop)
        })
    };
    let (texts, numbers) = beside("parquet", WAITING, encode_numbers, encode_texts).map_err(FormatError::Thread)?;
    texts?;
    numbers?;
    Ok(file)
}

/// Encodes some columns of batches and gives `done` their chunks, row group by row group.
fn encode_columns(
    factory: &ArrowRowGroupWriterFactory,
    columns: &Range<usize>,
    batches: impl IntoIterator<Item = RecordBatch>,
    mut done: impl FnMut(Vec<ArrowColumnChunk>) -> Result<(), ParquetError>,
) -> Result<(), ParquetError> {
    let mut batches = batches.into_iter().filter(|batch| batch.num_rows() > 0).peekable();
    for group in 0.. {
        if batches.peek().is_none() {
            break;
        }
        let mut writers: Vec<_> = factory.create_column_writers(group)?.drain(columns.clone()).collect();
        let mut rows = 0;
        while rows < ROW_GROUP_ROWS
            && let Some(batch) = batches.next()
        {
            for (writer, at) in writers.iter_mut().zip(columns.clone()) {
                for leaf in compute_leaves(batch.schema_ref().field(at), batch.column(at))? {
                    writer.write(&leaf)?;
                }
            }
            rows += batch.num_rows();
        }
        done(writers.into_iter().map(ArrowColumnWriter::close).collect::<Result<_, _>>()?)?;
    }
    Ok(())
}

fn properties(header: &Header) -> Result<WriterProperties, FormatError> {
    let definitions =
        serde_json::to_string(&header.catalog).map_err(|error| FormatError::Definitions(error.to_string()))?;
    let pair = |key: &str, value: &str| KeyValue::new(key.to_owned(), value.to_owned());
    let metadata = vec![
        pair(KIND_KEY, SCORES_KIND),
        pair("mirrorstats.writer", concat!("mirrorstats ", env!("CARGO_PKG_VERSION"))),
        pair(HASH_KEY, &header.catalog.hash),
        pair(DEFINITIONS_KEY, &definitions),
    ];
    let mut properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        // Who reads scores reads all of them.
        .set_statistics_enabled(EnabledStatistics::None)
        // No two episodes have the same id, names stand in order, and small numbers take few bits anyway.
        .set_dictionary_enabled(false)
        .set_write_batch_size(GATHERED_ROWS)
        .set_max_row_group_row_count(Some(ROW_GROUP_ROWS))
        .set_key_value_metadata(Some(metadata));
    for name in header.metrics.iter().map(String::as_str).chain([KEYS[3], KEYS[4]]) {
        properties = properties.set_column_encoding(name.into(), Encoding::DELTA_BINARY_PACKED);
    }
    Ok(properties.build())
}

fn schema(header: &Header) -> Schema {
    let keys = KEYS.iter().zip([DataType::Utf8, DataType::Utf8, DataType::Utf8, DataType::Int32, DataType::Int32]);
    let keys = keys.map(|(name, ty)| Field::new(*name, ty, false));
    let labels = header.labels.iter().map(|name| Field::new(name, DataType::Utf8, true));
    let metrics = header.metrics.iter().map(|name| Field::new(name, DataType::Int64, true));
    Schema::new(keys.chain(labels).chain(metrics).collect::<Vec<_>>())
}

/// Rows as columns that grow.
struct Gathered {
    texts: [StringBuilder; 3],
    seed: Int32Builder,
    run: Int32Builder,
    labels: Vec<StringBuilder>,
    metrics: Vec<Numbers>,
    text_bytes: usize,
}

/// Integers of which some are not there.
#[derive(Default)]
struct Numbers {
    values: Vec<i64>,
    valid: Vec<bool>,
}

impl Numbers {
    fn add(&mut self, number: Option<i64>) {
        self.values.push(number.unwrap_or_default());
        self.valid.push(number.is_some());
    }

    /// All of them; room is made for as many.
    fn take(&mut self) -> Int64Array {
        let count = self.values.len();
        let values = std::mem::replace(&mut self.values, Vec::with_capacity(count));
        let numbers = Int64Array::new(values.into(), nulls_of(&self.valid));
        self.valid.clear();
        numbers
    }
}

impl Gathered {
    fn new(header: &Header) -> Self {
        Self {
            texts: Default::default(),
            seed: Int32Builder::new(),
            run: Int32Builder::new(),
            labels: header.labels.iter().map(|_| StringBuilder::new()).collect(),
            metrics: header.metrics.iter().map(|_| Numbers::default()).collect(),
            text_bytes: 0,
        }
    }

    fn is_full(&self) -> bool {
        self.seed.len() == GATHERED_ROWS || self.text_bytes >= GATHERED_TEXT
    }

    fn add(&mut self, row: &EpisodeRow) {
        let EpisodeKey { experiment, model, seed, run, episode_id } = &row.key;
        for (column, text) in self.texts.iter_mut().zip([episode_id, model, experiment]) {
            column.append_value(text);
            self.text_bytes += text.len();
        }
        self.seed.append_value(*seed);
        self.run.append_value(*run);
        for (column, label) in self.labels.iter_mut().zip(&row.labels) {
            column.append_option(label.as_deref());
            self.text_bytes += label.as_ref().map_or(0, String::len);
        }
        for (column, metric) in self.metrics.iter_mut().zip(&row.metrics) {
            column.add(*metric);
        }
    }

    /// The columns in the order of the schema; none is left behind.
    fn take(&mut self) -> Vec<ArrayRef> {
        self.text_bytes = 0;
        let mut columns: Vec<ArrayRef> = Vec::new();
        columns.extend(self.texts.iter_mut().map(taken));
        columns.extend([&mut self.seed, &mut self.run].map(|column| Arc::new(column.finish()) as ArrayRef));
        columns.extend(self.labels.iter_mut().map(taken));
        columns.extend(self.metrics.iter_mut().map(|column| Arc::new(column.take()) as ArrayRef));
        columns
    }
}

/// All texts of a column; room is made for as many.
fn taken(column: &mut StringBuilder) -> ArrayRef {
    let texts = column.finish();
    *column = StringBuilder::with_capacity(texts.len(), texts.value_data().len());
    Arc::new(texts)
}

pub(super) fn read(
    input: impl ChunkReader + 'static,
    surroundings: &Surroundings<'_>,
) -> Result<EpisodeTable, FormatError> {
    contained(|| decode(input, surroundings))
        .unwrap_or_else(|panic| Err(FormatError::Parquet(ParquetError::General(panic))))
}

fn decode(input: impl ChunkReader + 'static, surroundings: &Surroundings<'_>) -> Result<EpisodeTable, FormatError> {
    footer_shape::check_file(&input).map_err(ParquetError::General)?;
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

#[cfg(test)]
mod tests {
    use std::io;

    use bytes::Bytes;
    use parquet::file::metadata::RowGroupMetaData;

    use super::*;
    use crate::metric::definitions::Definitions;
    use crate::score::format::{self, Format};
    use crate::score::run::schema_columns;

    /// More rows than a row group has.
    fn table() -> EpisodeTable {
        let rows = 0..ROW_GROUP_ROWS + GATHERED_ROWS + 5;
        let metric = |name: &str, of: &dyn Fn(usize) -> Option<i64>| MetricColumn {
            name: name.to_owned(),
            values: rows.clone().map(of).collect(),
        };
        let small = |row: usize| i64::try_from(row % 7).unwrap();
        EpisodeTable {
            catalog: Definitions::load("paper", &schema_columns()).unwrap().catalog,
            keys: rows
                .clone()
                .map(|row| EpisodeKey {
                    experiment: format!("E{}", 1 + row / 20_000),
                    model: "é, \"quoted\"".to_owned(),
                    seed: i32::try_from(row).unwrap(),
                    run: -1,
                    episode_id: format!("episode {row:06}"),
                })
                .collect(),
            labels: Vec::new(),
            metrics: vec![
                metric("TSA", &|row| Some(small(row) % 2)),
                metric("TTD", &|row| (row % 3 > 0).then(|| small(row) << 40)),
            ],
        }
    }

    #[test]
    fn row_groups_come_back_whole() {
        let mut bytes = Vec::new();
        format::write(&table(), Format::Parquet, &mut bytes).unwrap();
        let bytes = Bytes::from(bytes);
        let groups = ParquetMetaDataReader::new().parse_and_finish(&bytes).unwrap();
        let rows: Vec<i64> = groups.row_groups().iter().map(RowGroupMetaData::num_rows).collect();
        assert_eq!(rows, [ROW_GROUP_ROWS, GATHERED_ROWS + 5].map(|rows| i64::try_from(rows).unwrap()));
        let surroundings = Surroundings { folders: &[], definitions: None };
        assert_eq!(read(bytes, &surroundings).unwrap(), table());
    }

    /// Takes so many bytes.
    struct Full(usize);

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0 = self.0.checked_sub(bytes.len()).ok_or(io::ErrorKind::StorageFull)?;
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_full_disk_is_told_wherever_it_is_full() {
        let table = table();
        let mut bytes = Vec::new();
        format::write(&table, Format::Parquet, &mut bytes).unwrap();
        for room in [0, 4, bytes.len() / 3, bytes.len() - 1] {
            let error = format::write(&table, Format::Parquet, Full(room)).unwrap_err();
            assert_eq!(error.into_io().unwrap().kind(), io::ErrorKind::StorageFull, "room for {room} bytes");
        }
    }
}
