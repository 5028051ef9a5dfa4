//! A trace again with one column of text made anew; everything else is as it was.
//!
//! Rule: other columns are copied as the bytes they are, so whatever type, encoding or codec a writer chose stays; so do
//! the row groups and the footer's own keys, but for the recording. What only speeds up reading (page indexes, bloom
//! filters) is left behind.

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

/// The sources of a new text: the episode's id, the timestep, the text to look at, and the present text.
pub(crate) type Before<'a> = (&'a str, i64, Option<&'a str>, Option<&'a str>);

/// Writes the trace of a set's only file to `out`, with the column `target`, which it has, as `change` makes it from the
/// column `source`, and with this recording.
pub(crate) fn rewrite<W: Write + Send>(
    set: &TraceSet,
    [source, target]: [&str; 2],
    mut change: impl FnMut(Before<'_>) -> Option<String>,
    recording: &serde_json::Value,
    out: W,
) -> Result<W, TraceError> {
    let layout = Layout::new(set, [source, target], [])?;
    let [file] = set.files() else { return Err(unwritable("the trace", "there is not exactly one".into())) };
    // What is copied gets new checksums, which must not represent damaged bytes.
    verify_pages(set)?;
    let failed = |error: ParquetError| unwritable(file.name(), error.into());
    let metadata = file.footer_again(Extent::Whole).map_err(|finding| TraceError::from(*finding))?.metadata;
    let schema = with_text(metadata.file_metadata().schema_descr(), target).map_err(failed)?;
    let mut writer = SerializedFileWriter::new(Held::new(out), schema, properties(file, recording)).map_err(failed)?;
    let input = file.reader().map_err(|source| TraceError::Read { what: file.name().to_owned(), source })?;
    for row_group in 0..file.row_groups() {
        let texts = texts(file, &layout, [source, target], row_group, &mut change)?;
        let chunks = metadata.row_group(row_group).columns();
        let mut group = writer.next_row_group().map_err(failed)?;
        copy(&mut group, chunks, &input, target, &texts).map_err(failed)?;
        group.close().map_err(failed)?;
        checksums::pass_on(&mut writer).map_err(failed)?;
    }
    checksums::finish(writer).map_err(failed)
}

fn texts(
    file: &TraceFile,
    layout: &Layout,
    columns: [&str; 2],
    row_group: usize,
    change: &mut impl FnMut(Before<'_>) -> Option<String>,
) -> Result<Vec<Option<String>>, TraceError> {
    let [source, target] = columns.map(|name| layout.position(name).expect("the layout was made with it"));
    let mut texts = Vec::with_capacity(file.row_group_rows(row_group));
    for rows in RowGroup::open(file, layout, row_group, None).map_err(|finding| TraceError::from(*finding))? {
        let rows = rows.map_err(|finding| TraceError::from(*finding))?;
        for row in 0..rows.len() {
            let (id, t) = (rows.episode(row).unwrap_or_default(), rows.columns[T].int(row).unwrap_or_default());
            texts.push(change((id, t, rows.columns[source].text(row), rows.columns[target].text(row))));
        }
    }
    Ok(texts)
}

fn copy<W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    chunks: &[ColumnChunkMetaData],
    input: &File,
    target: &str,
    texts: &[Option<String>],
) -> parquet::errors::Result<()> {
    for chunk in chunks {
        if chunk.column_path().parts() == [target] {
            write_texts(group, texts)?;
        } else {
            let close = ColumnCloseResult {
                bytes_written: u64::try_from(chunk.compressed_size()).unwrap_or_default(),
                rows_written: texts.len() as u64,
                metadata: chunk.clone(),
                bloom_filter: None,
                column_index: None,
                offset_index: None,
            };
            contained(|| group.append_column(input, close)).map_err(ParquetError::General)??;
        }
    }
    Ok(())
}

fn write_texts<W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    texts: &[Option<String>],
) -> parquet::errors::Result<()> {
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("the row group has no column left".into()));
    };
    let values: Vec<ByteArray> = texts.iter().flatten().map(|text| ByteArray::from(text.as_str())).collect();
    let levels: Vec<i16> = texts.iter().map(|text| i16::from(text.is_some())).collect();
    column.typed::<ByteArrayType>().write_batch(&values, Some(&levels), None)?;
    column.close()
}

/// The file's schema with the target as text that may be null.
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

fn properties(file: &TraceFile, recording: &serde_json::Value) -> WriterPropertiesPtr {
    let mut pairs = file.pairs().to_vec();
    let value = Some(recording.to_string());
    match pairs.iter_mut().find(|pair| pair.key == RECORDING_KEY) {
        Some(pair) => pair.value = value,
        None => pairs.push(KeyValue { key: RECORDING_KEY.to_owned(), value }),
    }
    let properties = WriterProperties::builder()
        .set_key_value_metadata(Some(pairs))
        .set_created_by(CREATED_BY.to_owned())
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        // Chunks that are copied have no page index here, and a file has one for all columns or for none.
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_offset_index_disabled(true);
    Arc::new(properties.build())
}

fn unwritable(file: &str, source: Box<dyn std::error::Error + Send + Sync>) -> TraceError {
    TraceError::Write { file: file.to_owned(), source }
}
