//! Columns of tables with their values unchanged, infinities and NaN included, and the columns that rows of JSON become.
//!
//! Values of other types than numbers and truth values become text. A time in any zone becomes `2026-01-01T00:00:00Z`.
//! Bytes are text in UTF-8: some writers leave out the annotation.

use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, AsArray as _, BooleanArray, Float64Array, Int64Array, LargeStringArray, ListArray, NullArray,
    RecordBatch, RecordBatchOptions, StringArray, StringViewArray, StructArray, UInt32Array,
};
use arrow::buffer::{BooleanBuffer, NullBuffer, OffsetBuffer};
use arrow::compute::kernels::cmp::distinct;
use arrow::compute::{CastOptions, cast, cast_with_options, take};
use arrow::datatypes::{DataType, Field, Fields, Int32Type, Schema};
use arrow::error::ArrowError;
use arrow::util::display::{ArrayFormatter, FormatOptions};

use super::spelling;
use super::value::{Cell, SPELLED, TEXT, UNHELD_NUMBER};
use mirrorstats_trace::schema::Kind;

/// A value that a row cannot have; rows count from 0.
#[derive(Debug)]
pub(super) struct Unreadable {
    pub(super) row: usize,
    pub(super) expected: String,
    pub(super) found: String,
}

/// The column with one of the few types that a [`Cell`] has. Errors: the first row whose value has no text.
pub(super) fn plain(column: &ArrayRef) -> Result<ArrayRef, Unreadable> {
    let cast = |to: &DataType| cast(column, to).map_err(|error| unreadable(column, 0, &error));
    match column.data_type() {
        DataType::Null | DataType::Boolean | DataType::UInt64 => Ok(Arc::clone(column)),
        spelled if *spelled == SPELLED || *spelled == UNHELD_NUMBER => Ok(Arc::clone(column)),
        integer if integer.is_integer() => cast(&DataType::Int64),
        float if float.is_floating() => cast(&DataType::Float64),
        DataType::Utf8 | DataType::Binary | DataType::Dictionary(..) => utf8(column),
        DataType::LargeBinary | DataType::BinaryView | DataType::FixedSizeBinary(_) => utf8(&cast(&DataType::Binary)?),
        nested if nested.is_nested() => Ok(Arc::clone(column)),
        // The same instant: names of zones need a table of zones.
        DataType::Timestamp(unit, Some(zone)) if **zone != *"+00:00" => {
            texts(&cast(&DataType::Timestamp(*unit, Some("+00:00".into())))?)
        }
        decimal if decimal.is_decimal() => numbers(texts(column)?.as_string()),
        _ => texts(column),
    }
}

fn numbers(decimals: &StringArray) -> Result<ArrayRef, Unreadable> {
    let number = |(row, decimal): (usize, Option<&str>)| match decimal.map_or(Cell::Null, spelling::number) {
        Cell::Unheld(found) => Err(Unreadable { row, expected: spelling::held(), found: found.into_owned() }),
        number => Ok(number.into_owned()),
    };
    Ok(array(decimals.iter().enumerate().map(number).collect::<Result<Vec<_>, _>>()?))
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

/// The decoder does not check that text with only a JSON annotation is UTF-8, nor the keys of dictionaries.
fn utf8(column: &ArrayRef) -> Result<ArrayRef, Unreadable> {
    if let Some(texts) = checked(column) {
        return Ok(Arc::new(texts));
    }
    let text = |row| {
        let bytes = bytes(column.as_ref(), row).transpose()?;
        Some(bytes.and_then(|bytes| std::str::from_utf8(bytes).map_err(|error| error.valid_up_to())).map_err(|valid| {
            let found = format!("other bytes after the first {valid}");
            Unreadable { row, expected: "text in UTF-8".into(), found }
        }))
    };
    Ok(Arc::new((0..column.len()).map(|row| text(row).transpose()).collect::<Result<StringArray, _>>()?))
}

/// The same texts, checked all at once; `None` if one of them is not UTF-8, or for keys of a dictionary.
fn checked(column: &ArrayRef) -> Option<StringArray> {
    let (ends, data) = match column.data_type() {
        DataType::Utf8 => (column.as_string::<i32>().offsets(), column.as_string::<i32>().values()),
        DataType::Binary => (column.as_binary::<i32>().offsets(), column.as_binary::<i32>().values()),
        _ => return None,
    };
    StringArray::try_new(ends.clone(), data.clone(), column.nulls().cloned()).ok()
}

fn bytes(texts: &dyn Array, row: usize) -> Result<Option<&[u8]>, usize> {
    if texts.is_null(row) {
        return Ok(None);
    }
    let (ends, data) = match texts.data_type() {
        DataType::Utf8 => (texts.as_string::<i32>().offsets(), texts.as_string::<i32>().value_data()),
        DataType::Binary => (texts.as_binary::<i32>().offsets(), texts.as_binary::<i32>().value_data()),
        _ => {
            let keys = texts.as_dictionary_opt::<Int32Type>().ok_or(0_usize)?;
            let key = keys.key(row).filter(|key| *key < keys.values().len()).ok_or(0_usize)?;
            return bytes(keys.values().as_ref(), key);
        }
    };
    let [start, end] = [ends[row], ends[row + 1]].map(|end| usize::try_from(end).unwrap_or_default());
    Ok(data.get(start..end))
}

/// The type of a column with both; `None` if there is none. An integer that floats do not hold is in no column of floats.
fn joined(before: &DataType, value: &Cell<'_>) -> Option<DataType> {
    let now = data_type(value);
    match (before, &now) {
        (_, DataType::Null) => Some(before.clone()),
        (DataType::Null, _) => Some(now),
        (DataType::Int64, DataType::Float64) | (DataType::Float64, DataType::Int64) => Some(DataType::Float64),
        _ => (*before == now).then_some(now),
    }
}

fn data_type(value: &Cell<'_>) -> DataType {
    match value {
        Cell::Null => DataType::Null,
        Cell::Bool(_) => DataType::Boolean,
        Cell::Int(_) => DataType::Int64,
        Cell::Float(_) => DataType::Float64,
        Cell::Text(_) => TEXT,
        Cell::Spelled(_) => SPELLED,
        Cell::Unheld(_) => UNHELD_NUMBER,
        Cell::List => DataType::new_list(DataType::Null, true),
        Cell::Object => DataType::Struct(Fields::empty()),
    }
}

/// The values of a column so far, all of one type.
#[derive(Debug)]
pub(super) struct Builder {
    values: Vec<Cell<'static>>,
    kind: DataType,
    has_wide: bool,
}

impl Builder {
    /// A column whose first rows are null.
    pub(super) fn new(nulls: usize) -> Self {
        Self { values: vec![Cell::Null; nulls], kind: DataType::Null, has_wide: false }
    }

    /// Returns false if the column has values of another type, and if floats would not hold an integer.
    pub(super) fn takes(&self, value: &Cell<'_>) -> bool {
        let is_wide = self.has_wide || is_wide(value);
        joined(&self.kind, value).is_some_and(|kind| kind != DataType::Float64 || !is_wide)
    }

    pub(super) fn push(&mut self, row: usize, value: Cell<'_>) {
        self.values.resize(row, Cell::Null);
        let is_right = self.takes(&value);
        self.kind = joined(&self.kind, &value).filter(|_| is_right).unwrap_or(SPELLED);
        self.has_wide |= is_wide(&value);
        self.values.push(value.into_owned());
    }

    pub(super) fn finish(mut self, rows: usize) -> ArrayRef {
        self.values.resize(rows, Cell::Null);
        array_of(&self.values, &self.kind)
    }
}

fn is_wide(value: &Cell<'_>) -> bool {
    matches!(value, Cell::Int(number) if number.unsigned_abs() > 1 << 53)
}

/// The values as a column; spelled texts if they have several types.
pub(super) fn array<'a>(values: impl IntoIterator<Item = Cell<'a>>) -> ArrayRef {
    let mut column = Builder::new(0);
    values.into_iter().enumerate().for_each(|(row, value)| column.push(row, value));
    array_of(&column.values, &column.kind)
}

/// True in each row whose value differs from that of the row before, and in the first one.
pub(super) fn changes(values: &ArrayRef) -> BooleanBuffer {
    let Some(others) = values.len().checked_sub(1) else { return BooleanBuffer::new_unset(0) };
    match distinct(&values.slice(1, others), &values.slice(0, others)) {
        Ok(changes) => [true].into_iter().chain(changes.values()).collect(),
        // Lists and objects are not compared.
        Err(_) => BooleanBuffer::new_set(values.len()),
    }
}

/// A column with this value in every row.
pub(super) fn repeated(value: Cell<'_>, rows: usize) -> ArrayRef {
    let once = array([value]);
    take(&once, &UInt32Array::from(vec![0; rows]), None).expect("the position of the only value is valid")
}

fn array_of(values: &[Cell<'_>], kind: &DataType) -> ArrayRef {
    let texts = || values.iter().map(Cell::text);
    let valid = || Some(values.iter().map(|value| *value != Cell::Null).collect::<NullBuffer>());
    match kind {
        DataType::Boolean => Arc::new(values.iter().map(Cell::bool).collect::<BooleanArray>()),
        DataType::Int64 => Arc::new(values.iter().map(Cell::int).collect::<Int64Array>()),
        DataType::Float64 => Arc::new(values.iter().map(Cell::float).collect::<Float64Array>()),
        DataType::Utf8 => Arc::new(texts().collect::<StringArray>()),
        DataType::LargeUtf8 => Arc::new(texts().collect::<LargeStringArray>()),
        DataType::Utf8View => Arc::new(texts().collect::<StringViewArray>()),
        DataType::Struct(_) => Arc::new(StructArray::new_empty_fields(values.len(), valid())),
        DataType::List(_) => {
            let (item, ends) = (Field::new_list_field(DataType::Null, true), OffsetBuffer::new_zeroed(values.len()));
            Arc::new(ListArray::new(Arc::new(item), ends, Arc::new(NullArray::new(0)), valid()))
        }
        _ => Arc::new(NullArray::new(values.len())),
    }
}

/// A table of these columns, which may be none.
pub(super) fn table(columns: Vec<(String, ArrayRef)>, rows: usize) -> RecordBatch {
    let field = |(name, values): &(String, ArrayRef)| Field::new(name, values.data_type().clone(), true);
    let schema = Schema::new(columns.iter().map(field).collect::<Vec<_>>());
    let columns = columns.into_iter().map(|(_, values)| values).collect();
    let options = RecordBatchOptions::new().with_row_count(Some(rows));
    RecordBatch::try_new_with_options(schema.into(), columns, &options).expect("columns of one table have one length")
}

/// The column as a trace stores it. The check before it refused what would lose anything.
pub(super) fn stored(column: &ArrayRef, kind: Kind, to: &DataType) -> Result<ArrayRef, ArrowError> {
    let exact = CastOptions { safe: false, ..CastOptions::default() };
    if *column.data_type() == kind.data_type() {
        return cast_with_options(column, to, &exact);
    }
    let values: Vec<_> = (0..column.len()).map(|row| Cell::at(column, row).typed(kind)).collect();
    cast_with_options(&array_of(&values, &kind.data_type()), to, &exact)
}

/// A value, or a column of them, with parts.
pub(super) trait Node: Sized {
    fn member(&self, key: &str) -> Option<Self>;
    fn item(&self, position: usize) -> Option<Self>;
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
