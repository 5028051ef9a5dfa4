//! Columns of tables as the values of rows, unchanged: numbers keep their value, infinities and NaN included.
//!
//! Values of other types than numbers and truth values become text. A time in any zone becomes `2026-01-01T00:00:00Z`.
//! Bytes are text in UTF-8: some writers leave out the annotation.

use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray as _, StringArray, UInt32Array};
use arrow::compute::{cast, take};
use arrow::datatypes::{DataType, Float64Type, Int32Type, Int64Type, UInt64Type};
use arrow::error::ArrowError;
use arrow::util::display::{ArrayFormatter, FormatOptions};

use super::cell;
use super::value::{LineValue, Node};

/// A column whose values are of the few types that rows have.
#[derive(Clone, Debug)]
pub(super) struct RowValues {
    values: ArrayRef,
    /// True for decimal numbers, whose type follows from all of them.
    are_cells: bool,
}

/// A value that a row cannot have; rows count from 0.
#[derive(Debug)]
pub(super) struct Unreadable {
    pub(super) row: usize,
    pub(super) expected: String,
    pub(super) found: String,
}

impl RowValues {
    /// Errors: the first row whose value has no text.
    pub(super) fn new(column: &ArrayRef) -> Result<Self, Unreadable> {
        let are_cells = column.data_type().is_decimal();
        plain(column).map(|values| Self { values, are_cells })
    }

    pub(super) fn at(&self, row: usize) -> Result<LineValue, Unreadable> {
        let not_text = |valid| Unreadable {
            row,
            expected: "text in UTF-8".into(),
            found: format!("other bytes after the first {valid}"),
        };
        Ok(match value(self.values.as_ref(), row).map_err(not_text)? {
            LineValue::Text(text) if self.are_cells => match cell::number(&text) {
                unheld @ LineValue::Unheld(_) => unheld,
                _ => LineValue::Cell(text),
            },
            value => value,
        })
    }
}

fn plain(column: &ArrayRef) -> Result<ArrayRef, Unreadable> {
    let cast = |column: &ArrayRef, to: &DataType| cast(column, to).map_err(|error| unreadable(column, 0, &error));
    match column.data_type() {
        DataType::UInt64 => Ok(Arc::clone(column)),
        integer if integer.is_integer() => cast(column, &DataType::Int64),
        float if float.is_floating() => cast(column, &DataType::Float64),
        DataType::LargeUtf8 | DataType::Utf8View => cast(column, &DataType::Utf8),
        DataType::LargeBinary | DataType::BinaryView | DataType::FixedSizeBinary(_) => cast(column, &DataType::Binary),
        DataType::Null | DataType::Boolean | DataType::Utf8 | DataType::Binary | DataType::Dictionary(..) => {
            Ok(Arc::clone(column))
        }
        nested if nested.is_nested() => Ok(Arc::clone(column)),
        // The same instant: names of zones need a table of zones.
        DataType::Timestamp(unit, Some(zone)) if **zone != *"+00:00" => {
            texts(&cast(column, &DataType::Timestamp(*unit, Some("+00:00".into())))?)
        }
        _ => texts(column),
    }
}

fn texts(column: &ArrayRef) -> Result<ArrayRef, Unreadable> {
    let options = FormatOptions::default().with_display_error(false);
    let shown = ArrayFormatter::try_new(column, &options).map_err(|error| unreadable(column, 0, &error))?;
    let text = |row| {
        let text = column.is_valid(row).then(|| shown.value(row).try_to_string()).transpose();
        text.map_err(|error| unreadable(column, row, &error))
    };
    Ok(Arc::new((0..column.len()).map(text).collect::<Result<StringArray, _>>()?))
}

fn unreadable(column: &ArrayRef, row: usize, error: &ArrowError) -> Unreadable {
    let expected = format!("a value of the type {} that has a text", column.data_type());
    Unreadable { row, expected, found: error.to_string() }
}

fn value(values: &dyn Array, row: usize) -> Result<LineValue, usize> {
    if values.is_null(row) {
        return Ok(LineValue::Null);
    }
    Ok(match values.data_type() {
        DataType::Null => LineValue::Null,
        DataType::Boolean => LineValue::Bool(values.as_boolean().value(row)),
        DataType::Int64 => LineValue::Int(values.as_primitive::<Int64Type>().value(row)),
        DataType::UInt64 => {
            let number = values.as_primitive::<UInt64Type>().value(row);
            i64::try_from(number).map_or_else(|_| LineValue::Unheld(number.to_string()), LineValue::Int)
        }
        DataType::Float64 => LineValue::Float(values.as_primitive::<Float64Type>().value(row)),
        DataType::Utf8 => LineValue::Text(text(values.as_string(), row)?),
        DataType::Binary => LineValue::Text(utf8(values.as_binary::<i32>().value(row))?),
        DataType::Dictionary(..) => {
            let keys = values.as_dictionary::<Int32Type>();
            let key = keys.key(row).filter(|key| *key < keys.values().len()).ok_or(0_usize)?;
            return value(keys.values().as_ref(), key);
        }
        DataType::Struct(_) | DataType::Map(..) => LineValue::Object(Vec::new()),
        _ => LineValue::List,
    })
}

/// The decoder does not check that text with only a JSON annotation is UTF-8.
fn text(texts: &StringArray, row: usize) -> Result<String, usize> {
    let ends = [texts.value_offsets()[row], texts.value_offsets()[row + 1]];
    let [start, end] = ends.map(|end| usize::try_from(end).unwrap_or_default());
    utf8(&texts.value_data()[start..end])
}

fn utf8(bytes: &[u8]) -> Result<String, usize> {
    std::str::from_utf8(bytes).map(str::to_owned).map_err(|error| error.valid_up_to())
}

/// A column inside a column of structs, lists or maps; null in rows without the part.
impl Node for ArrayRef {
    fn member(&self, key: &str) -> Option<Self> {
        match self.data_type() {
            DataType::Struct(_) => {
                let parts = self.as_struct();
                let member = parts.column_by_name(key)?;
                let rows: UInt32Array = rows(self, Some);
                take(member, &rows, None).ok()
            }
            DataType::Map(..) => {
                let map = self.as_map();
                let keys = cast(map.keys(), &DataType::Utf8).ok()?;
                let keys = keys.as_string::<i32>();
                let found = |row: usize| {
                    let ends = &map.value_offsets()[row..=row + 1];
                    (ends[0]..ends[1]).filter_map(|at| usize::try_from(at).ok()).find(|at| keys.value(*at) == key)
                };
                take(map.values(), &rows(self, found), None).ok()
            }
            _ => None,
        }
    }

    fn item(&self, position: usize) -> Option<Self> {
        match self.data_type() {
            DataType::List(_) => {
                let list = self.as_list::<i32>();
                let found = |row: usize| {
                    let start = usize::try_from(list.value_offsets()[row]).ok()?;
                    (position < list.value(row).len()).then_some(start + position)
                };
                take(list.values(), &rows(self, found), None).ok()
            }
            DataType::LargeList(_) | DataType::FixedSizeList(..) => cast(self, &smaller(self)?).ok()?.item(position),
            _ => None,
        }
    }
}

fn smaller(list: &ArrayRef) -> Option<DataType> {
    match list.data_type() {
        DataType::LargeList(item) | DataType::FixedSizeList(item, _) => Some(DataType::List(Arc::clone(item))),
        _ => None,
    }
}

/// The positions of values that rows have; null for rows that are null themselves.
fn rows(column: &ArrayRef, find: impl Fn(usize) -> Option<usize>) -> UInt32Array {
    let found = |row| if column.is_valid(row) { find(row).and_then(|at| u32::try_from(at).ok()) } else { None };
    (0..column.len()).map(found).collect()
}
