//! The episode table as Parquet, with the definitions in its footer.

use std::io::Write;
use std::sync::{Arc, Mutex, PoisonError};

use arrow::array::{ArrayAccessor, ArrayRef, AsArray as _, Int64Array, RecordBatch, StringArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Decimal128Type, Float64Type, Int64Type, Schema};
use arrow::error::ArrowError;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::{ArrowReaderMetadata, ArrowReaderOptions};
use parquet::arrow::arrow_writer::{ArrowColumnChunk, ArrowColumnWriter, ArrowRowGroupWriterFactory, compute_leaves};
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::{KeyValue, ParquetMetaData, ParquetMetaDataReader};
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::ChunkReader;
use parquet::file::writer::SerializedFileWriter;

use super::csv::{KEYS, check_unique};
use super::partition::Partition;
use super::{DeclaredText, FormatError, footer};
use crate::tables::builder::TableBuilder;
use crate::tables::columns;
use crate::tables::table::{Declared, EpisodeTable, Header, KeyRef, TextColumn};
use mirrorstats_metric::catalogs::catalog::Catalog;
use mirrorstats_parquet_pages::check_footer;
use mirrorstats_parquet_pages::checksums::{self, CREATED_BY, Held};
use mirrorstats_trace::catch_panic::contained;
use mirrorstats_trace::read::flat::{TableFile, flat_rows};
use mirrorstats_trace::schema::COLUMNS;

pub const KIND_KEY: &str = "mirrorstats.kind";
pub const SCORES_KIND: &str = "scores";
pub const DEFINITIONS_KEY: &str = "mirrorstats.definitions";
pub const HASH_KEY: &str = "mirrorstats.definitions_hash";

/// The footer key of the traces' declarations about their recording, as JSON (a `Declared`).
pub(crate) const DECLARED_KEY: &str = "mirrorstats.declared";

/// Returns true if a file is Parquet with scores: its footer says so, or it has their key columns and no timestep.
/// `folders` are the columns in the names of the file's folders.
pub fn holds_scores(file: &impl ChunkReader, folders: &[(String, Option<String>)]) -> bool {
    let Some(metadata) = metadata(file) else { return false };
    if footer::value(metadata.file_metadata(), KIND_KEY).is_some() {
        return footer::value(metadata.file_metadata(), KIND_KEY).as_deref() == Some(SCORES_KIND);
    }
    let columns = metadata.file_metadata().schema_descr().root_schema().get_fields().iter();
    let outside = folders.iter().map(|(name, _)| name.as_str());
    let names: Vec<&str> = columns.map(|column| column.name()).chain(outside).collect();
    let is_of_steps =
        |name: &str| COLUMNS.iter().any(|column| column.required && !column.constant && column.name == name);
    // A trace without `t` has the keys too, but also columns of steps.
    !names.iter().any(|name| is_of_steps(name)) && KEYS.iter().all(|key| names.contains(key))
}

pub fn holds_definitions(file: &impl ChunkReader) -> bool {
    metadata(file).is_some_and(|metadata| footer::value(metadata.file_metadata(), DEFINITIONS_KEY).is_some())
}

fn metadata(file: &impl ChunkReader) -> Option<ParquetMetaData> {
    check_footer(file).ok()?;
    contained(|| ParquetMetaDataReader::new().parse_and_finish(file)).ok()?.ok()
}

/// Rows per row group: few enough that encoded but unwritten data stays small.
const ROW_GROUP_ROWS: usize = 64 * 1024;
/// Rows encoded at a time.
const GATHERED_ROWS: usize = 4 * 1024;
/// Bytes of a column's texts encoded at a time, or one text: a page holds 2 GiB.
const GATHERED_TEXT: usize = 256 << 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job {
    group: usize,
    column: usize,
}

pub struct Encoder<'a> {
    table: &'a EpisodeTable,
    schema: Arc<Schema>,
    factory: ArrowRowGroupWriterFactory,
    /// The column writers of each row group that are not in use yet; empty before the first job of the group.
    groups: Vec<Mutex<Vec<Option<ArrowColumnWriter>>>>,
}

pub struct Writer<W: Write + Send> {
    file: SerializedFileWriter<Held<W>>,
    columns: usize,
    group: Vec<ArrowColumnChunk>,
}

pub fn encoder<W: Write + Send>(table: &EpisodeTable, out: W) -> Result<(Encoder<'_>, Writer<W>), FormatError> {
    let header = table.header();
    let schema = Arc::new(columns::schema(&header));
    let properties = properties(&header, &table.declared)?;
    let parquet = ArrowWriter::try_new(Held::new(out), Arc::clone(&schema), Some(properties))?;
    let (file, factory) = parquet.into_serialized_writer()?;
    let writer = Writer { file, columns: schema.fields().len(), group: Vec::new() };
    let groups = (0..table.len().div_ceil(ROW_GROUP_ROWS)).map(|_| Mutex::default()).collect();
    Ok((Encoder { table, schema, factory, groups }, writer))
}

impl Encoder<'_> {
    pub fn jobs(&self) -> impl Iterator<Item = Job> + use<> {
        let columns = self.schema.fields().len();
        (0..self.groups.len()).flat_map(move |group| (0..columns).map(move |column| Job { group, column }))
    }

    pub fn encode(&self, job: Job) -> Result<ArrowColumnChunk, FormatError> {
        let mut writer = self.writer(job)?;
        let field = self.schema.field(job.column);
        let start = job.group * ROW_GROUP_ROWS;
        let end = self.table.len().min(start + ROW_GROUP_ROWS);
        let longest = columns::texts(self.table, job.column).map_or(0, TextColumn::longest);
        let at_a_time = (GATHERED_TEXT / longest.max(1)).clamp(1, GATHERED_ROWS);
        for first in (start..end).step_by(at_a_time) {
            let rows = first..end.min(first + at_a_time);
            let values = columns::coded_values(self.table, job.column, rows).map_err(|error| failed(&error))?;
            compute_leaves(field, &values)?.iter().try_for_each(|leaf| writer.write(leaf))?;
        }
        Ok(writer.close()?)
    }

    /// Writers are created for a whole row group at once, and each is costly.
    fn writer(&self, job: Job) -> Result<ArrowColumnWriter, ParquetError> {
        let mut writers = self.groups[job.group].lock().unwrap_or_else(PoisonError::into_inner);
        if writers.is_empty() {
            *writers = self.factory.create_column_writers(job.group)?.into_iter().map(Some).collect();
        }
        writers[job.column].take().ok_or_else(|| ParquetError::General("the column is encoded already".into()))
    }
}

impl<W: Write + Send> Writer<W> {
    pub fn append(&mut self, column: ArrowColumnChunk) -> Result<(), FormatError> {
        self.group.push(column);
        if self.group.len() == self.columns {
            let mut group = self.file.next_row_group()?;
            self.group.drain(..).try_for_each(|column| column.append_to_row_group(&mut group))?;
            group.close()?;
            checksums::pass_on(&mut self.file)?;
        }
        Ok(())
    }

    pub fn finish(self) -> Result<(), FormatError> {
        checksums::finish(self.file)?;
        Ok(())
    }
}

fn properties(header: &Header, declared: &Declared) -> Result<WriterProperties, FormatError> {
    let definitions =
        serde_json::to_string(&header.catalog).map_err(|error| FormatError::Definitions(error.to_string()))?;
    let pair = |key: &str, value: &str| KeyValue::new(key.to_owned(), value.to_owned());
    let mut metadata = vec![
        pair(KIND_KEY, SCORES_KIND),
        pair("mirrorstats.writer", concat!("mirrorstats ", env!("CARGO_PKG_VERSION"))),
        pair(HASH_KEY, &header.catalog.hash),
        pair(DEFINITIONS_KEY, &definitions),
    ];
    let declared = DeclaredText { declared: declared.clone(), ..DeclaredText::default() };
    metadata.extend(declared.text()?.map(|text| pair(DECLARED_KEY, &text)));
    let mut properties = WriterProperties::builder()
        .set_created_by(CREATED_BY.to_owned())
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        // Readers of scores read all rows.
        .set_statistics_enabled(EnabledStatistics::None)
        // Episode ids are unique, names are sorted, and small numbers take few bits anyway.
        .set_dictionary_enabled(false)
        .set_write_batch_size(GATHERED_ROWS)
        .set_max_row_group_row_count(Some(ROW_GROUP_ROWS))
        .set_key_value_metadata(Some(metadata));
    let is_integer = |name: &&String| columns::metric_type(&header.catalog, name) == DataType::Int64;
    for name in header.metrics.iter().filter(is_integer).map(String::as_str).chain([KEYS[3], KEYS[4]]) {
        properties = properties.set_column_encoding(name.into(), Encoding::DELTA_BINARY_PACKED);
    }
    Ok(properties.build())
}

fn failed(error: &ArrowError) -> ParquetError {
    ParquetError::ArrowError(error.to_string())
}

pub(super) fn read(input: TableFile, partition: &Partition<'_>) -> Result<EpisodeTable, FormatError> {
    contained(|| decode(input, partition))
        .unwrap_or_else(|panic| Err(FormatError::Parquet(ParquetError::General(panic))))
}

fn decode(input: TableFile, partition: &Partition<'_>) -> Result<EpisodeTable, FormatError> {
    check_footer(&input).map_err(ParquetError::General)?;
    if let Some(metadata) = metadata(&input) {
        checksums::verify_file(&input, &metadata).map_err(FormatError::Damaged)?;
    }
    let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
    let about = ArrowReaderMetadata::load(&input, options)?;
    let rows = flat_rows(input, Arc::clone(about.metadata())).map_err(ParquetError::General)?;
    let catalog = match (footer::value(about.metadata().file_metadata(), DEFINITIONS_KEY), partition.definitions) {
        (Some(text), _) => serde_json::from_str(&text).map_err(|error| FormatError::Definitions(error.to_string()))?,
        (None, Some(named)) => named.clone(),
        (None, None) => return Err(FormatError::Definitions(format!("there is no `{DEFINITIONS_KEY}`"))),
    };
    // Scores of other programs have no declarations.
    let declared = footer::value(about.metadata().file_metadata(), DECLARED_KEY);
    let declared = declared.map(|text| DeclaredText::parse(&text)).transpose()?.unwrap_or_default().declared;
    let names: Vec<&str> = about.schema().fields().iter().map(|field| field.name().as_str()).collect();
    check_unique(&names)?;
    // A part without rows has all columns nevertheless.
    let none = partition.complete(&RecordBatch::new_empty(about.schema().clone()), &catalog)?;
    let mut table = TableBuilder::new(header_of(&none, catalog));
    append(&mut table, &none)?;
    for batch in rows {
        let batch = batch.map_err(|error| FormatError::Parquet(ParquetError::General(error)))?;
        let batch = partition.complete(&batch, &table.header().catalog)?;
        append(&mut table, &batch)?;
    }
    Ok(EpisodeTable { declared, ..table.finish() })
}

fn header_of(batch: &RecordBatch, catalog: Catalog) -> Header {
    let schema = batch.schema();
    let others = schema.fields().iter().map(|field| field.name()).filter(|name| !KEYS.contains(&name.as_str()));
    let (metrics, labels) = others.cloned().partition(|name| catalog.metric.contains_key(name));
    Header { catalog, labels, metrics }
}

fn append(table: &mut TableBuilder, batch: &RecordBatch) -> Result<(), FormatError> {
    let [ids, models, experiments] = [texts(batch, KEYS[0])?, texts(batch, KEYS[1])?, texts(batch, KEYS[2])?];
    let [seeds, runs] = [ints(batch, KEYS[3])?, ints(batch, KEYS[4])?];
    let Header { labels, metrics, .. } = table.header();
    let catalog = &table.header().catalog;
    let metrics: Vec<_> = metrics.iter().map(|name| stored(batch, name, catalog)).collect::<Result<_, _>>()?;
    let labels: Vec<_> = labels.iter().map(|name| texts(batch, name)).collect::<Result<_, _>>()?;
    for row in 0..batch.num_rows() {
        let number = |values: &Int64Array, column| {
            at(values, row).and_then(|value| i32::try_from(value).ok()).ok_or_else(|| null(column))
        };
        let key = KeyRef {
            experiment: at(&experiments, row).ok_or_else(|| null(KEYS[2]))?,
            model: at(&models, row).ok_or_else(|| null(KEYS[1]))?,
            seed: number(&seeds, KEYS[3])?,
            run: number(&runs, KEYS[4])?,
            episode_id: at(&ids, row).ok_or_else(|| null(KEYS[0]))?,
        };
        let labels = labels.iter().map(|label| at(label, row));
        table.push(key, labels, metrics.iter().map(|metric| at(metric, row)));
    }
    Ok(())
}

fn at<A: ArrayAccessor + Copy>(values: A, row: usize) -> Option<A::Item> {
    values.is_valid(row).then(|| values.value(row))
}

fn null(column: &str) -> FormatError {
    FormatError::column(column, "a value in every row", "null")
}

fn column(batch: &RecordBatch, name: &str, ty: &DataType, expected: &'static str) -> Result<ArrayRef, FormatError> {
    let fault = |found: String| FormatError::column(name, expected, found);
    let column = batch.column_by_name(name).ok_or_else(|| fault("no such column".to_owned()))?;
    let fits = match ty {
        // Some engines widen an integer sum to a type that Parquet cannot store as an integer.
        DataType::Int64 => column.data_type().is_integer() || is_whole(column),
        _ => column.data_type().is_string(),
    };
    if !fits {
        return Err(fault(column.data_type().to_string()));
    }
    cast(column, ty).map_err(|error| fault(error.to_string()))
}

fn is_whole(column: &ArrayRef) -> bool {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    let whole = |value: f64| value.fract().abs() <= 0.0 && value.abs() < EXACT;
    column.as_primitive_opt::<Float64Type>().is_some_and(|floats| floats.iter().flatten().all(whole))
}

fn texts(batch: &RecordBatch, name: &str) -> Result<StringArray, FormatError> {
    let column = column(batch, name, &DataType::Utf8, "text")?;
    Ok(column.as_string::<i32>().clone())
}

/// The stored values of a metric. Other engines write decimals as doubles: the nearest decimal gives the double back.
fn stored(batch: &RecordBatch, name: &str, catalog: &Catalog) -> Result<Int64Array, FormatError> {
    let DataType::Decimal128(digits, decimals) = columns::metric_type(catalog, name) else { return ints(batch, name) };
    let fault = |found: String| FormatError::column(name, "numbers with the digits of the metric", found);
    let column = batch.column_by_name(name).ok_or_else(|| fault("no such column".to_owned()))?;
    let exact = cast(column, &DataType::Decimal128(digits, decimals)).map_err(|error| fault(error.to_string()))?;
    let back = cast(&exact, column.data_type()).map_err(|error| fault(error.to_string()))?;
    let is_number = column.data_type().is_numeric();
    if !is_number || back.as_ref() != column.as_ref() {
        return Err(fault(column.data_type().to_string()));
    }
    let units = exact.as_primitive::<Decimal128Type>();
    units.try_unary(|units| i64::try_from(units).map_err(|_| fault(units.to_string())))
}

fn ints(batch: &RecordBatch, name: &str) -> Result<Int64Array, FormatError> {
    let column = column(batch, name, &DataType::Int64, "integers")?;
    Ok(column.as_primitive::<Int64Type>().clone())
}

#[cfg(test)]
mod tests {
    use std::io;

    use bytes::Bytes;
    use parquet::file::metadata::RowGroupMetaData;

    use super::*;
    use crate::format::{self, Format};
    use crate::tables::table::{EpisodeKey, MetricColumn};
    use crate::vocabulary::schema_columns;
    use mirrorstats_metric::definitions::Definitions;

    fn table() -> EpisodeTable {
        let rows = 0..ROW_GROUP_ROWS + GATHERED_ROWS + 5;
        let metric = |name: &str, of: &dyn Fn(usize) -> Option<i64>| MetricColumn::new(name, rows.clone().map(of));
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
            declared: Declared::default(),
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
        let partition = Partition { folders: &[], definitions: None };
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&bytes).unwrap();
        assert_eq!(read(file, &partition).unwrap(), table());
    }

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
    fn a_full_disk_is_reported_at_any_write() {
        let table = table();
        let mut bytes = Vec::new();
        format::write(&table, Format::Parquet, &mut bytes).unwrap();
        for room in [0, 4, bytes.len() / 3, bytes.len() - 1] {
            let error = format::write(&table, Format::Parquet, Full(room)).unwrap_err();
            assert_eq!(error.into_io().unwrap().kind(), io::ErrorKind::StorageFull, "room for {room} bytes");
        }
    }
}
