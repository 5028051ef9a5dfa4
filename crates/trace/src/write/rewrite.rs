//! Copies a trace with one new text column, or only with checksums; everything else stays unchanged.
//!
//! Rule: other columns are copied as bytes, so their types, encodings and codecs stay. So do the row groups and the
//! footer's own keys, except the recording. Data that only speeds up reading (page indexes, bloom filters) is dropped.

use std::fs::File;
use std::io::Write;
use std::sync::Arc;

use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, Type as Physical, ZstdLevel};
use parquet::column::writer::ColumnCloseResult;
use parquet::data_type::{ByteArray, ByteArrayType};
use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, KeyValue};
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesPtr};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{SchemaDescriptor, Type, TypePtr};

use crate::catch_panic::contained;
use crate::error::TraceError;
use crate::read::decode::RowGroup;
use crate::read::footer::Extent;
use crate::read::open::{TraceFile, TraceSet};
use crate::read::projection::{Layout, T};
use crate::read::verify::verify_pages;
use crate::schema::RECORDING_KEY;
use parquet_pages::checksums::{self, CREATED_BY, Held};

/// The sources of a new text: the episode's id, the timestep, the source text, and the present text.
pub(crate) type Before<'a> = (&'a str, i64, Option<&'a str>, Option<&'a str>);

/// Writes the trace of a set's only file to `out` with this recording; `change` gives the new values of the existing
/// column `target` from the column `source`.
pub(crate) fn rewrite<W: Write + Send>(
    set: &TraceSet,
    [source, target]: [&str; 2],
    mut change: impl FnMut(Before<'_>) -> Result<Option<String>, TraceError>,
    recording: &serde_json::Value,
    out: W,
) -> Result<W, TraceError> {
    let layout = Layout::new(set, [source, target], [])?;
    copied(set, out, Some((target, recording)), |group, file, row_group| {
        write_texts(group, (file, row_group), &layout, [source, target], &mut change)
    })
}

/// Writes the trace of a set's only file to `out` with checksums; all columns are copied unchanged.
pub(crate) fn with_checksums<W: Write + Send>(set: &TraceSet, out: W) -> Result<W, TraceError> {
    copied(set, out, None, |_, _, _| Ok(()))
}

/// Copies the columns of a set's only file; `write` writes the new column, which comes with a new recording.
fn copied<W: Write + Send>(
    set: &TraceSet,
    out: W,
    anew: Option<(&str, &serde_json::Value)>,
    mut write: impl FnMut(&mut SerializedRowGroupWriter<'_, Held<W>>, &TraceFile, usize) -> Result<(), TraceError>,
) -> Result<W, TraceError> {
    let [file] = set.files() else { return Err(TraceError::write("the trace", "there is not exactly one")) };
    // Copied columns get new checksums, which must not hide damaged bytes.
    verify_pages(set)?;
    let failed = |error: ParquetError| TraceError::write(file.name(), error);
    let metadata = file.footer_again(Extent::Whole)?.metadata;
    let old = metadata.file_metadata().schema_descr();
    let (schema, pairs) = match anew {
        Some((column, recording)) => (with_text(old, column).map_err(failed)?, with_recording(file, recording)),
        None => (old.root_schema_ptr(), file.pairs.clone()),
    };
    let mut writer = SerializedFileWriter::new(Held::new(out), schema, properties(pairs)).map_err(failed)?;
    let input = file.reader().map_err(|source| TraceError::Read { what: file.name().to_owned(), source })?;
    for row_group in 0..file.row_groups() {
        let mut group = writer.next_row_group().map_err(failed)?;
        for chunk in metadata.row_group(row_group).columns() {
            if anew.is_some_and(|(column, _)| chunk.column_path().parts() == [column]) {
                write(&mut group, file, row_group)?;
            } else {
                copy(&mut group, chunk, file.row_group_rows(row_group), &input).map_err(failed)?;
            }
        }
        group.close().map_err(failed)?;
        checksums::pass_on(&mut writer).map_err(failed)?;
    }
    checksums::finish(writer).map_err(failed)
}

fn copy<W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    chunk: &ColumnChunkMetaData,
    rows: usize,
    input: &File,
) -> parquet::errors::Result<()> {
    let close = ColumnCloseResult {
        bytes_written: u64::try_from(chunk.compressed_size()).unwrap_or_default(),
        rows_written: rows as u64,
        metadata: chunk.clone(),
        bloom_filter: None,
        column_index: None,
        offset_index: None,
    };
    contained(|| group.append_column(input, close)).map_err(ParquetError::General)?
}

/// The number of rows written together: a multiple of the library's batch, so that the bytes do not depend on how many
/// are decoded together.
const WRITTEN_ROWS: usize = 8 << 10;

/// Writes the new column, some rows at a time: a row group of a small file may have millions.
fn write_texts<W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    (file, row_group): (&TraceFile, usize),
    layout: &Layout,
    columns: [&str; 2],
    change: &mut impl FnMut(Before<'_>) -> Result<Option<String>, TraceError>,
) -> Result<(), TraceError> {
    let failed = |error: ParquetError| TraceError::write(file.name(), error);
    let [source, target] = columns.map(|name| layout.position(name).expect("the layout was made with it"));
    let missing = || failed(ParquetError::General("the row group has no column left".into()));
    let mut column = group.next_column().map_err(failed)?.ok_or_else(missing)?;
    let mut write = |values: &mut Vec<ByteArray>, levels: &mut Vec<i16>| {
        column.typed::<ByteArrayType>().write_batch(values, Some(levels), None).map_err(failed)?;
        values.clear();
        levels.clear();
        Ok::<_, TraceError>(())
    };
    let (mut values, mut levels) = (Vec::new(), Vec::with_capacity(WRITTEN_ROWS));
    for rows in RowGroup::open(file, layout, row_group, None)? {
        let rows = rows?;
        for row in 0..rows.len() {
            let (id, t) = (rows.episode(row).unwrap_or_default(), rows.columns[T].int(row).unwrap_or_default());
            let text = change((id, t, rows.columns[source].text(row), rows.columns[target].text(row)))?;
            levels.push(i16::from(text.is_some()));
            values.extend(text.map(|text| ByteArray::from(text.as_str())));
            if levels.len() == WRITTEN_ROWS {
                write(&mut values, &mut levels)?;
            }
        }
    }
    if !levels.is_empty() {
        write(&mut values, &mut levels)?;
    }
    column.close().map_err(failed)
}

fn with_text(schema: &SchemaDescriptor, target: &str) -> parquet::errors::Result<TypePtr> {
    let root = schema.root_schema();
    let fields = root.get_fields().iter().map(|field| {
        if field.name() != target {
            return Ok(Arc::clone(field));
        }
        let text = Type::primitive_type_builder(target, Physical::BYTE_ARRAY)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(Some(LogicalType::String))
            .with_converted_type(ConvertedType::UTF8);
        text.build().map(Arc::new)
    });
    let fields = fields.collect::<parquet::errors::Result<Vec<_>>>()?;
    Type::group_type_builder(root.name()).with_fields(fields).build().map(Arc::new)
}

fn with_recording(file: &TraceFile, recording: &serde_json::Value) -> Vec<KeyValue> {
    let mut pairs = file.pairs.clone();
    let value = Some(recording.to_string());
    match pairs.iter_mut().find(|pair| pair.key == RECORDING_KEY) {
        Some(pair) => pair.value = value,
        None => pairs.push(KeyValue { key: RECORDING_KEY.to_owned(), value }),
    }
    pairs
}

fn properties(pairs: Vec<KeyValue>) -> WriterPropertiesPtr {
    let properties = WriterProperties::builder()
        .set_key_value_metadata(Some(pairs))
        .set_created_by(CREATED_BY.to_owned())
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        // Copied chunks have no page index here, and a file has one for all columns or for none.
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_offset_index_disabled(true);
    Arc::new(properties.build())
}
