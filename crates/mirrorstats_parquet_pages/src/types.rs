//! The few types of columns in memory: truth values, 64-bit integers and floats, texts under a dictionary.

use std::sync::Arc;

use arrow::array::{Array as _, ArrayRef, AsArray as _, new_null_array};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Int32Type, Schema, UInt64Type};
use parquet::arrow::arrow_reader::{ArrowReaderMetadata, ArrowReaderOptions};
use parquet::arrow::parquet_to_arrow_schema;
use parquet::errors::Result as ParquetResult;
use parquet::file::metadata::ParquetMetaData;

use crate::column::all_within;

/// The type of text in memory: keys into the distinct values.
pub fn text_type() -> DataType {
    DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8))
}

/// A footer whose text columns are read as dictionaries, whatever the writer's own hint; `is_text` marks the text
/// columns of the schema.
pub fn with_texts_as_keys(metadata: ParquetMetaData, is_text: &[bool]) -> ParquetResult<ArrowReaderMetadata> {
    let plain_schema = parquet_to_arrow_schema(metadata.file_metadata().schema_descr(), None)?;
    let fields = plain_schema.fields().iter().zip(is_text).map(|(field, is_text)| match is_text {
        true => Arc::new(field.as_ref().clone().with_data_type(text_type())),
        false => Arc::clone(field),
    });
    let wanted = Arc::new(Schema::new(fields.collect::<Vec<_>>()));
    ArrowReaderMetadata::try_new(Arc::new(metadata), ArrowReaderOptions::new().with_schema(wanted))
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refused {
    Unreadable(String),
    TooLarge { row: usize, value: u64 },
}

/// A column from the Parquet library, converted to `held`: truth values, 64 bits, or [`text_type`]. Checks that keys
/// have values and texts are UTF-8.
pub fn normal_column(column: &ArrayRef, held: &DataType) -> Result<ArrayRef, Refused> {
    if column.data_type() == held {
        if *held == text_type() {
            check_keys(column)?;
            check_texts(column)?;
        }
        return Ok(Arc::clone(column));
    }
    if *column.data_type() == DataType::Null {
        return Ok(new_null_array(held, column.len()));
    }
    if let Some(values) = column.as_primitive_opt::<UInt64Type>()
        && let Some(row) =
            (0..values.len()).find(|row| values.is_valid(*row) && values.value(*row) > i64::MAX.cast_unsigned())
    {
        return Err(Refused::TooLarge { row, value: values.value(row) });
    }
    cast(column, held).map_err(|error| Refused::Unreadable(error.to_string()))
}

/// Checks that every key that is not null has a value that is not null.
fn check_keys(column: &ArrayRef) -> Result<(), Refused> {
    let column = column.as_dictionary::<Int32Type>();
    let count = column.values().len();
    let within = |key: i32| usize::try_from(key).is_ok_and(|key| key < count);
    // The keys of nulls are nearly always in range too; then the nulls need no check.
    let good = column.values().null_count() == 0
        && (all_within(column.keys().values(), count) || column.keys().iter().flatten().all(within));
    if good { Ok(()) } else { Err(Refused::Unreadable("a dictionary key without a value".into())) }
}

/// Checks that every text is UTF-8. The Parquet library checks all texts of a delta-encoded page at once and accepts
/// characters split between two texts.
fn check_texts(column: &ArrayRef) -> Result<(), Refused> {
    let texts = column.as_any_dictionary().values().as_string::<i32>();
    let (bytes, offsets) = (texts.value_data(), texts.value_offsets());
    let begins = |offset: &i32| {
        let next = usize::try_from(*offset).ok().and_then(|at| bytes.get(at..))?.first();
        // A continuation byte does not begin a character.
        Some(next.is_none_or(|byte| byte & 0xc0 != 0x80))
    };
    let (first, last) = (offsets.first().copied().unwrap_or(0), offsets.last().copied().unwrap_or(0));
    let range = usize::try_from(first).ok().zip(usize::try_from(last).ok());
    let is_text = range.and_then(|(first, last)| std::str::from_utf8(bytes.get(first..last)?).ok()).is_some();
    if is_text && offsets.iter().all(|offset| begins(offset) == Some(true)) {
        return Ok(());
    }
    Err(Refused::Unreadable("texts that are not UTF-8".into()))
}
