//! Base columns: every type, encoding, codec and page version in which a trace may be stored.

use std::sync::Arc;

use arrow::array::{
    ArrayRef, BooleanArray, Float32Array, Float64Array, Int8Array, Int32Array, Int64Array, RecordBatch, StringArray,
    UInt64Array,
};
use arrow::datatypes::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, Encoding, GzipLevel, ZstdLevel};
use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader};
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterVersion};

use super::codec::decompress;
use super::thrift::Header;

/// A page taken apart.
#[derive(Clone, Debug)]
pub struct Page {
    /// Its header; sizes and checksum are computed again when it is written.
    pub header: Header,
    /// Levels before the compressed part: those of a page of version 2.
    pub levels: Vec<u8>,
    /// The rest, decompressed.
    pub body: Vec<u8>,
}

/// A column of one row group.
#[derive(Clone, Debug)]
pub struct Base {
    /// The footer of its file.
    pub metadata: Arc<ParquetMetaData>,
    /// Its codec.
    pub codec: Compression,
    /// True if there may be nulls.
    pub optional: bool,
    /// Its pages.
    pub pages: Vec<Page>,
}

/// The types, each with its encodings besides plain values and dictionaries.
const TYPES: [(DataType, &[Encoding]); 8] = [
    (DataType::Boolean, &[Encoding::RLE]),
    (DataType::Int32, &[Encoding::DELTA_BINARY_PACKED, Encoding::BYTE_STREAM_SPLIT]),
    (DataType::Int64, &[Encoding::DELTA_BINARY_PACKED, Encoding::BYTE_STREAM_SPLIT]),
    (DataType::Utf8, &[Encoding::DELTA_LENGTH_BYTE_ARRAY, Encoding::DELTA_BYTE_ARRAY]),
    (DataType::Float32, &[Encoding::BYTE_STREAM_SPLIT]),
    (DataType::Float64, &[Encoding::BYTE_STREAM_SPLIT]),
    (DataType::Int8, &[]),
    (DataType::UInt64, &[]),
];

/// Rows per column and per page.
const ROWS: [(usize, usize); 4] = [(1, 64), (19, 7), (64, 64), (300, 96)];

/// All columns: each type in each encoding, codec, page version, number of rows, with nulls or without.
pub fn all() -> Vec<Base> {
    let codecs = [
        Compression::UNCOMPRESSED,
        Compression::SNAPPY,
        Compression::ZSTD(ZstdLevel::default()),
        Compression::GZIP(GzipLevel::default()),
    ];
    let mut found = Vec::new();
    for (ty, encodings) in &TYPES {
        let of_type = [None, Some(Encoding::PLAIN)].into_iter().chain(encodings.iter().copied().map(Some));
        for encoding in of_type.filter(|encoding| *ty != DataType::Boolean || encoding.is_some()) {
            for codec in codecs {
                for version in [WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0] {
                    for (at, rows) in ROWS.into_iter().enumerate() {
                        // Nulls; no nulls in a nullable column; a non-nullable column.
                        for nulls in [Some(3), Some(usize::MAX), None] {
                            found.push(base(ty, encoding, codec, version, rows, nulls, at));
                        }
                    }
                }
            }
        }
    }
    found
}

/// Values with or without runs, every `nulls`-th of them null.
fn values(ty: &DataType, rows: usize, nulls: Option<usize>, salt: usize) -> ArrayRef {
    let at = |row: usize| {
        (nulls.is_none_or(|every| row % every != every - 1))
            .then(|| if salt.is_multiple_of(2) { row / 5 } else { row * 7 % 11 })
    };
    let rows = (0..rows).map(at);
    let small = |value: usize| i8::try_from(value % 100).unwrap_or(0);
    match ty {
        DataType::Boolean => Arc::new(rows.map(|row| row.map(|row| row % 2 == 0)).collect::<BooleanArray>()),
        DataType::Int32 => {
            Arc::new(rows.map(|row| row.map(|row| i32::from(small(row)) * 70_000)).collect::<Int32Array>())
        }
        DataType::Int64 => Arc::new(rows.map(|row| row.map(|row| i64::from(small(row)) << 40)).collect::<Int64Array>()),
        DataType::Float32 => {
            Arc::new(rows.map(|row| row.map(|row| f32::from(small(row)) / 3.0)).collect::<Float32Array>())
        }
        DataType::Float64 => {
            Arc::new(rows.map(|row| row.map(|row| f64::from(small(row)) / 3.0)).collect::<Float64Array>())
        }
        DataType::Int8 => Arc::new(rows.map(|row| row.map(small)).collect::<Int8Array>()),
        DataType::UInt64 => Arc::new(rows.map(|row| row.map(|row| row as u64)).collect::<UInt64Array>()),
        _ => Arc::new(rows.map(|row| row.map(|row| format!("text é {row}"))).collect::<StringArray>()),
    }
}

fn base(
    ty: &DataType,
    encoding: Option<Encoding>,
    codec: Compression,
    version: WriterVersion,
    (rows, of_page): (usize, usize),
    nulls: Option<usize>,
    salt: usize,
) -> Base {
    let mut properties = WriterProperties::builder()
        .set_writer_version(version)
        .set_compression(codec)
        .set_statistics_enabled(EnabledStatistics::None)
        .set_write_batch_size(of_page)
        .set_data_page_row_count_limit(of_page)
        .set_dictionary_enabled(encoding.is_none());
    if let Some(encoding) = encoding {
        properties = properties.set_encoding(encoding);
    }
    let schema = Arc::new(Schema::new(vec![Field::new("column", ty.clone(), nulls.is_some())]));
    let rows = RecordBatch::try_new(schema.clone(), vec![values(ty, rows, nulls, salt)]).expect("values of the type");
    let mut writer = ArrowWriter::try_new(Vec::new(), schema, Some(properties.build())).expect("a sound schema");
    writer.write(&rows).expect("memory takes any bytes");
    let file = bytes::Bytes::from(writer.into_inner().expect("memory takes any bytes"));
    let metadata = ParquetMetaDataReader::new().parse_and_finish(&file).expect("a sound file");
    let (start, length) = metadata.row_group(0).column(0).byte_range();
    let (start, length) = (usize::try_from(start).expect("small"), usize::try_from(length).expect("small"));
    let pages = pages(codec, &file[start..start + length]);
    Base { metadata: Arc::new(metadata), codec, optional: nulls.is_some(), pages }
}

fn pages(codec: Compression, mut chunk: &[u8]) -> Vec<Page> {
    let mut pages = Vec::new();
    while !chunk.is_empty() {
        let (mut header, length) = Header::read(chunk).expect("a sound header");
        let (stored, rest) = chunk[length..].split_at(usize::try_from(header.stored).expect("small"));
        chunk = rest;
        header.own.retain(|(field, _)| header.kind != 3 || *field <= 6);
        let levels = if header.kind == 3 { header.get(5) + header.get(6) } else { 0 };
        let (levels, body) = stored.split_at(usize::try_from(levels).expect("small"));
        let is_plain = header.kind == 3 && header.is_compressed == Some(false);
        let body = if is_plain || body.is_empty() { body.to_vec() } else { decompress(codec, body) };
        pages.push(Page { header, levels: levels.to_vec(), body });
    }
    pages
}
