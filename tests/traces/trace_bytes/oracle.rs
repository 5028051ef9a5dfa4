//! The Parquet library's own reader as the reference: bytes that it refuses are refused, and values are those that it
//! reads.

use std::collections::BTreeMap;
use std::fs;
use std::num::NonZeroUsize;
use std::panic::{self, AssertUnwindSafe};
use std::path::Path;

use arrow::array::{Array as _, ArrayRef, RecordBatch};
use arrow::compute::cast;
use arrow::datatypes::DataType;
use arrow::util::display::array_value_to_string;
use bytes::Bytes;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::scan::{EpisodeBatch, Projection};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::Compression;
use parquet::file::properties::{WriterProperties, WriterVersion};

use crate::trace_bytes::pages::pages;
use crate::trace_bytes::stored;

/// The values of each column as text.
type Values = BTreeMap<String, Vec<Option<String>>>;

/// Adds a column's values; text encodings and integer widths make no difference.
fn add(values: &mut Values, name: &str, column: &ArrayRef) {
    let wide = match column.data_type() {
        DataType::Dictionary(_, _) => cast(column, &DataType::Utf8).unwrap(),
        integer if integer.is_integer() => cast(column, &DataType::Int64).unwrap(),
        _ => column.clone(),
    };
    let text = |row| (!wide.is_null(row)).then(|| array_value_to_string(&wide, row).unwrap());
    values.entry(name.to_owned()).or_default().extend((0..wide.len()).map(text));
}

/// The library's values; `None` if it refuses.
fn library(bytes: &[u8]) -> Option<Values> {
    let bytes = Bytes::copy_from_slice(bytes);
    let read = panic::catch_unwind(AssertUnwindSafe(|| {
        let reader = ParquetRecordBatchReaderBuilder::try_new(bytes).ok()?.build().ok()?;
        reader.collect::<Result<Vec<RecordBatch>, _>>().ok()
    }));
    let mut values = Values::new();
    for batch in read.ok()?? {
        for (field, column) in batch.schema().fields().iter().zip(batch.columns()) {
            add(&mut values, field.name(), column);
        }
    }
    Some(values)
}

/// The values of a scan over all columns; `None` if it refuses.
fn scan(path: &Path) -> Option<Values> {
    let set = TraceSet::open(&[Input::new(path)]).ok()?;
    let steps: Vec<String> = set.column_names().into_iter().map(str::to_owned).collect();
    let mut values = Values::new();
    let sink = |batch: EpisodeBatch| {
        for (field, column) in batch.steps.schema().fields().iter().zip(batch.steps.columns()) {
            add(&mut values, field.name(), column);
        }
        for texts in &batch.texts {
            let keys = texts.keys.iter().map(|key| key.map(|key| texts.texts.value(key.into()).to_owned()));
            values.entry(texts.name.clone()).or_default().extend(keys);
        }
        Ok(())
    };
    let projection = Projection { steps, ..Projection::default() };
    set.scan(&projection, NonZeroUsize::MIN, Ok::<_, TraceError>, sink).ok()?;
    Some(values)
}

/// Flips bits of column data and of the footer, in files without checksums.
fn compare(version: WriterVersion, dictionaries: bool, codec: Compression, stride: usize) {
    let folder = tempfile::tempdir().unwrap();
    let properties = WriterProperties::builder().set_writer_version(version).set_dictionary_enabled(dictionaries);
    let whole = stored(folder.path(), properties.set_compression(codec));
    let path = folder.path().join("flipped.parquet");
    fs::write(&path, &whole).unwrap();
    let sound = scan(&path).unwrap();
    assert_eq!(Some(&sound), library(&whole).as_ref());
    let data = pages(&whole).iter().map(|page| page.end).max().unwrap();
    let (mut refused, mut both) = (0, 0);
    for bit in (32..data * 8).step_by(stride) {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        fs::write(&path, &bytes).unwrap();
        match (scan(&path), library(&bytes)) {
            (Some(ours), Some(theirs)) => {
                assert_eq!(ours, theirs, "bit {bit}");
                both += 1;
            }
            (Some(_), None) => panic!("bit {bit}: the library refuses what a scan takes"),
            (None, _) => refused += 1,
        }
    }
    assert!(refused > both / 4, "{refused} refused, {both} read");
}

#[test]
fn flipped_bits_are_read_as_the_library_reads_them_or_refused() {
    for (version, dictionaries) in [
        (WriterVersion::PARQUET_1_0, true),
        (WriterVersion::PARQUET_1_0, false),
        (WriterVersion::PARQUET_2_0, true),
        (WriterVersion::PARQUET_2_0, false),
    ] {
        compare(version, dictionaries, Compression::UNCOMPRESSED, 23);
        compare(version, dictionaries, Compression::SNAPPY, 67);
    }
}
