//! A column of some rows in memory: one value per row, one value per run of rows, or one key per row.
//!
//! Rule: all forms are equivalent. Code that reads single rows accepts any of them. Code that needs an array calls
//! [`Column::flat`], whose cost grows with the number of rows.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use arrow::array::{
    Array as _, ArrayBuilder as _, ArrayRef, AsArray as _, DictionaryArray, Int32Array, Int32Builder, StringArray,
    StringBuilder, UInt8Array, UInt32Array,
};
use arrow::compute::{concat, take};
use arrow::datatypes::{ArrowNativeType as _, DataType, Int32Type, Int64Type};
use arrow::error::ArrowError;

#[derive(Clone, Debug)]
pub enum Column {
    /// One value per row.
    Flat(ArrayRef),
    /// One value per run.
    Runs(Runs),
    /// One byte per row: texts or integers with few distinct values.
    Keys(Keys),
}

#[derive(Clone, Debug)]
pub struct Keys {
    keys: UInt8Array,
    /// A value for each key, never null: integers or texts.
    values: ArrayRef,
}

/// Rows with many consecutive equal values: columns that are constant in an episode.
#[derive(Clone, Debug)]
pub struct Runs {
    values: ArrayRef,
    /// The end of each run (exclusive), counted from the first row of the first run; ascending.
    ends: UInt32Array,
    start: usize,
    length: usize,
}

impl Column {
    pub fn len(&self) -> usize {
        match self {
            Self::Flat(values) => values.len(),
            Self::Runs(runs) => runs.length,
            Self::Keys(keyed) => keyed.keys.len(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub fn data_type(&self) -> &DataType {
        let (Self::Flat(values) | Self::Runs(Runs { values, .. }) | Self::Keys(Keys { values, .. })) = self;
        values.data_type()
    }

    /// `length` rows from row `start`, without copying.
    #[must_use]
    pub fn slice(&self, start: usize, length: usize) -> Self {
        match self {
            Self::Flat(values) => Self::Flat(values.slice(start, length)),
            Self::Runs(runs) => Self::Runs(runs.slice(start, length)),
            Self::Keys(Keys { keys, values }) => {
                Self::Keys(Keys { keys: keys.slice(start, length), values: values.clone() })
            }
        }
    }

    pub fn flat(&self) -> Result<ArrayRef, ArrowError> {
        match self {
            Self::Flat(values) => Ok(values.clone()),
            Self::Runs(runs) => runs.at(0..runs.length),
            Self::Keys(keyed) => keyed.of(&keyed.keys),
        }
    }

    /// The values of some rows, which must ascend.
    pub fn at(&self, rows: &[usize]) -> Result<ArrayRef, ArrowError> {
        match self {
            Self::Flat(values) => {
                let rows: UInt32Array = rows.iter().map(|row| narrow(*row)).collect::<Vec<_>>().into();
                take(values, &rows, None)
            }
            Self::Runs(runs) => runs.at(rows.iter().copied()),
            Self::Keys(keyed) => {
                let key = |row: &usize| keyed.keys.is_valid(*row).then(|| keyed.keys.value(*row));
                keyed.of(&rows.iter().map(key).collect())
            }
        }
    }

    /// The distinct values of the rows; may include unused values and duplicates.
    pub fn entries(&self) -> &ArrayRef {
        let (Self::Flat(values) | Self::Runs(Runs { values, .. }) | Self::Keys(Keys { values, .. })) = self;
        values.as_any_dictionary_opt().map_or(values, |texts| texts.values())
    }

    pub fn byte_texts(&self) -> Option<(&UInt8Array, &StringArray)> {
        let Self::Keys(Keys { keys, values }) = self else { return None };
        values.as_string_opt().map(|texts| (keys, texts))
    }

    pub fn text(&self, row: usize) -> Option<&str> {
        match self {
            Self::Flat(values) => text_at(values, row),
            Self::Runs(runs) => runs.text(row),
            Self::Keys(keyed) => Some(keyed.values.as_string::<i32>().value(keyed.key(row)?)),
        }
    }

    /// The texts at some rows, which must ascend, of a text column; `None` for null.
    pub fn texts<'a>(&'a self, rows: &'a [usize]) -> impl Iterator<Item = Option<&'a str>> {
        let runs = if let Self::Runs(runs) = self { Some((runs, DictionaryTexts::of(&runs.values))) } else { None };
        let mut run = runs.map_or(0, |(runs, _)| runs.run_of(0));
        rows.iter().map(move |row| match runs {
            Some((runs, texts)) => {
                runs.advance(&mut run, *row);
                texts.at(run)
            }
            None => self.text(*row),
        })
    }

    /// The integer at a row of an integer column; `None` for null.
    pub fn int(&self, row: usize) -> Option<i64> {
        let (values, row) = match self {
            Self::Flat(values) => (values, row),
            Self::Runs(runs) => (&runs.values, runs.run_of(row)),
            Self::Keys(keyed) => (&keyed.values, keyed.key(row)?),
        };
        let values = values.as_primitive::<Int64Type>();
        values.is_valid(row).then(|| values.value(row))
    }

    pub fn concat<'a>(parts: impl IntoIterator<Item = &'a Self>) -> Result<Self, ArrowError> {
        let parts: Vec<&Self> = parts.into_iter().collect();
        let holds_texts = |part: &&Self| matches!(part.data_type(), DataType::Dictionary(_, _) | DataType::Utf8);
        if parts.iter().all(holds_texts) {
            return joined_texts(&parts).map(Self::Flat);
        }
        let arrays = parts.into_iter().map(Self::flat).collect::<Result<Vec<_>, _>>()?;
        let arrays: Vec<_> = arrays.iter().map(AsRef::as_ref).collect();
        Ok(Self::Flat(concat(&arrays)?))
    }
}

/// The texts of some columns under one dictionary, without unused texts. Repeated texts are stored once: written out,
/// they could exceed the size of an array.
fn joined_texts(parts: &[&Column]) -> Result<ArrayRef, ArrowError> {
    let mut texts = StringBuilder::new();
    let mut keys = Int32Builder::new();
    // The parts do not change meanwhile, so the same address means the same text.
    let mut known: HashMap<(*const u8, usize), i32> = HashMap::new();
    for (part, row) in parts.iter().flat_map(|part| (0..part.len()).map(move |row| (part, row))) {
        let key = |text: &str| match known.entry((text.as_ptr(), text.len())) {
            Entry::Occupied(key) => Ok(*key.get()),
            Entry::Vacant(place) => {
                let next = narrow_key(texts.len())?;
                narrow_key(texts.values_slice().len() + text.len())?;
                texts.append_value(text);
                Ok::<_, ArrowError>(*place.insert(next))
            }
        };
        keys.append_option(part.text(row).map(key).transpose()?);
    }
    Ok(Arc::new(DictionaryArray::try_new(keys.finish(), Arc::new(texts.finish()))?))
}

/// A position in an array of texts, which has at most 2^31.
fn narrow_key(place: usize) -> Result<i32, ArrowError> {
    i32::try_from(place).map_err(|_| ArrowError::OffsetOverflowError(place))
}

impl Keys {
    /// Rows with these keys, arbitrary for nulls; `None` if a key has no value.
    pub fn new(keys: UInt8Array, values: ArrayRef) -> Option<Self> {
        // The keys of nulls are in range too, unless there are no values at all.
        let largest = keys.values().iter().copied().fold(0, u8::max);
        let within = keys.null_count() == keys.len() || usize::from(largest) < values.len();
        (within && values.null_count() == 0).then_some(Self { keys, values })
    }

    pub fn keys(&self) -> &UInt8Array {
        &self.keys
    }

    pub fn values(&self) -> &ArrayRef {
        &self.values
    }

    fn key(&self, row: usize) -> Option<usize> {
        self.keys.is_valid(row).then(|| self.keys.value(row).into())
    }

    fn of(&self, keys: &UInt8Array) -> Result<ArrayRef, ArrowError> {
        if *self.values.data_type() != DataType::Utf8 {
            return take(&self.values, keys, None);
        }
        let keys = keys.iter().map(|key| key.map(i32::from)).collect::<Int32Array>();
        Ok(Arc::new(DictionaryArray::try_new(keys, Arc::clone(&self.values))?))
    }

    /// Returns true if the integers of each stretch of rows, bounded by `offsets`, are 1, 2, and so on. May return
    /// false wrongly if a value has two keys.
    pub fn count_from_one(&self, offsets: &[usize]) -> bool {
        let stretches = || offsets.windows(2).map(|ends| ends[0]..ends[1]);
        // The keys of 1, 2, and so on, while they exist.
        let values = self.values.as_primitive::<Int64Type>().values();
        let key_of = |t: i64| values.iter().position(|value| *value == t).and_then(|key| u8::try_from(key).ok());
        let counting: Vec<u8> = (1..).map_while(key_of).collect();
        let keys = self.keys.values();
        self.keys.null_count() == 0 && stretches().all(|rows| counting.get(..rows.len()) == Some(&keys[rows]))
    }
}

impl Runs {
    /// Runs of these values; each ends before the row in `ends` at the same index.
    pub fn new(values: ArrayRef, ends: Vec<u32>) -> Self {
        let length = ends.last().map_or(0, |end| *end as usize);
        Self { values, ends: ends.into(), start: 0, length }
    }

    pub const fn rows(&self) -> usize {
        self.length
    }

    #[must_use]
    pub fn slice(&self, start: usize, length: usize) -> Self {
        Self { start: self.start + start, length, ..self.clone() }
    }

    fn run_of(&self, row: usize) -> usize {
        self.ends.values().partition_point(|end| *end as usize <= self.start + row)
    }

    fn advance(&self, run: &mut usize, row: usize) {
        let ends = self.ends.values();
        while ends[*run] as usize <= self.start + row {
            *run += 1;
        }
    }

    /// The rows whose text differs from the row before, except row 0.
    pub fn text_changes(&self) -> impl Iterator<Item = usize> + '_ {
        let texts = DictionaryTexts::of(&self.values);
        let differs = move |(_, run): &(usize, usize)| !texts.same(*run, run - 1);
        self.starts().skip(1).filter(differs).map(|(start, _)| start)
    }

    pub fn text(&self, row: usize) -> Option<&str> {
        text_at(&self.values, self.run_of(row))
    }

    /// The most rows from `first`, up to `most`, that end with a run or with the last row; `most` if no run ends there.
    pub fn until(&self, first: usize, most: usize) -> usize {
        if most >= self.length - first {
            return self.length - first;
        }
        let first = self.start + first;
        let ended = self.ends.values().partition_point(|end| *end as usize <= first + most);
        let last = ended.checked_sub(1).map_or(0, |run| self.ends.value(run) as usize);
        if last > first { last - first } else { most }
    }

    /// The row at which each run starts, and the position of its value; the first starts at row 0.
    pub fn starts(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let ends = self.ends.values();
        let first = self.run_of(0);
        let start = move |run: usize| if run == first { 0 } else { ends[run - 1] as usize - self.start };
        (first..ends.len()).map(move |run| (start(run), run)).take_while(|(start, _)| *start < self.length)
    }

    /// The values of the runs, including runs without remaining rows.
    pub fn values(&self) -> &ArrayRef {
        &self.values
    }

    /// Returns true if runs start only at these rows, which must ascend.
    pub fn start_only_at(&self, rows: &[usize]) -> bool {
        let mut rows = rows.iter();
        self.starts().skip(1).all(|(start, _)| rows.by_ref().find(|row| **row >= start) == Some(&start))
    }

    fn at(&self, rows: impl IntoIterator<Item = usize>) -> Result<ArrayRef, ArrowError> {
        let mut run = self.run_of(0);
        let runs = rows.into_iter().map(|row| {
            self.advance(&mut run, row);
            narrow(run)
        });
        take(&self.values, &UInt32Array::from(runs.collect::<Vec<_>>()), None)
    }
}

pub(crate) fn all_within(keys: &[i32], count: usize) -> bool {
    // A negative key counts as a very large one.
    keys.iter().map(|key| key.cast_unsigned()).max().is_none_or(|largest| (largest as usize) < count)
}

pub fn text_at(column: &ArrayRef, row: usize) -> Option<&str> {
    DictionaryTexts::of(column).at(row)
}

#[derive(Clone, Copy)]
struct DictionaryTexts<'a> {
    keys: &'a Int32Array,
    texts: &'a StringArray,
}

impl<'a> DictionaryTexts<'a> {
    fn of(column: &'a ArrayRef) -> Self {
        let column = column.as_dictionary::<Int32Type>();
        Self { keys: column.keys(), texts: column.values().as_string() }
    }

    fn key(self, row: usize) -> Option<usize> {
        self.keys.is_valid(row).then(|| self.keys.value(row).as_usize())
    }

    fn at(self, row: usize) -> Option<&'a str> {
        self.key(row).map(|key| self.texts.value(key))
    }

    fn same(self, a: usize, b: usize) -> bool {
        let (a, b) = (self.key(a), self.key(b));
        let text = |key: Option<usize>| key.map(|key| self.texts.value(key));
        a == b || text(a) == text(b)
    }
}

pub(crate) fn narrow(row: usize) -> u32 {
    u32::try_from(row)
        .expect("rows are decoded some thousands at a time, and an episode of 2^32 steps does not fit into memory")
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{Array as _, ArrayRef, AsArray as _, DictionaryArray, Int64Array, StringArray, UInt8Array};
    use arrow::datatypes::{Int32Type, Int64Type};
    use proptest::collection::vec;
    use proptest::option;
    use proptest::prelude::*;

    use super::{Column, Keys, Runs};

    fn both(runs: &[(i64, u32)]) -> (Column, Column) {
        let values = |values: Vec<i64>| Arc::new(Int64Array::from(values)) as ArrayRef;
        let flat = runs.iter().flat_map(|(value, count)| std::iter::repeat_n(*value, *count as usize)).collect();
        let ends = runs.iter().scan(0, |end, (_, count)| {
            *end += count;
            Some(*end)
        });
        let coded = Runs::new(values(runs.iter().map(|(value, _)| *value).collect()), ends.collect());
        (Column::Flat(values(flat)), Column::Runs(coded))
    }

    proptest! {
        #[test]
        fn runs_and_rows_have_equal_values(runs in vec((0..3_i64, 1..5_u32), 1..9), cut in any::<(prop::sample::Index, prop::sample::Index)>()) {
            let (flat, coded) = both(&runs);
            let from = cut.0.index(flat.len());
            let length = 1 + cut.1.index(flat.len() - from);
            let (flat, coded) = (flat.slice(from, length), coded.slice(from, length));
            prop_assert_eq!(flat.len(), coded.len());
            prop_assert_eq!(&flat.flat().unwrap(), &coded.flat().unwrap());
            let odd: Vec<usize> = (0..length).step_by(2).collect();
            prop_assert_eq!(&flat.at(&odd).unwrap(), &coded.at(&odd).unwrap());
            for row in 0..length {
                prop_assert_eq!(flat.int(row), coded.int(row));
            }
            let Column::Runs(coded) = coded else { unreachable!() };
            let array = flat.flat().unwrap();
            let values = array.as_primitive::<Int64Type>().values();
            let changes: Vec<usize> = (1..length).filter(|row| values[*row] != values[row - 1]).collect();
            let starts: Vec<usize> = coded.starts().map(|(start, _)| start).collect();
            prop_assert!(changes.iter().all(|change| starts.contains(change)));
            prop_assert!(coded.start_only_at(&starts));
            prop_assert_eq!(coded.start_only_at(&[0]), starts.len() == 1);
            for most in 1..=length {
                let rows = coded.until(0, most);
                let ends: Vec<usize> = starts.iter().copied().skip(1).chain([length]).collect();
                let expected = ends.into_iter().rfind(|end| *end <= most).unwrap_or(most);
                prop_assert_eq!(rows, expected);
            }
        }

        #[test]
        fn keys_count_as_their_integers_do(
            values in Just((0..6_i64).collect::<Vec<_>>()).prop_shuffle(), lengths in vec(1..5_i64, 1..4), odd in option::of(0..8_usize),
        ) {
            let mut rows: Vec<i64> = lengths.iter().flat_map(|length| 1..=*length).collect();
            let counted = odd.filter(|row| *row < rows.len()).map(|row| rows[row] = 0).is_none();
            let keys = rows.iter().map(|row| u8::try_from(values.iter().position(|value| value == row).unwrap()).unwrap());
            let keys = Keys::new(keys.collect::<Vec<_>>().into(), Arc::new(Int64Array::from(values))).unwrap();
            let mut offsets = vec![0];
            for length in &lengths {
                offsets.push(offsets.last().unwrap() + usize::try_from(*length).unwrap());
            }
            prop_assert_eq!(keys.count_from_one(&offsets), counted);
            let column = Column::Keys(keys);
            let flat = Column::Flat(Arc::new(Int64Array::from(rows)));
            prop_assert_eq!(&column.flat().unwrap(), &flat.flat().unwrap());
            let (column, flat) = (column.slice(1, flat.len() - 1), flat.slice(1, flat.len() - 1));
            let odd: Vec<usize> = (0..flat.len()).step_by(2).collect();
            prop_assert_eq!(&column.at(&odd).unwrap(), &flat.at(&odd).unwrap());
            prop_assert!((0..flat.len()).all(|row| column.int(row) == flat.int(row)));
        }
    }

    /// The forms of rows of texts; `None` is null, and excludes the form of runs.
    fn forms(rows: &[Option<&str>]) -> Vec<Column> {
        let flat: DictionaryArray<Int32Type> = rows.iter().copied().collect();
        let texts: StringArray = rows.iter().flatten().copied().collect::<Vec<_>>().into();
        let mut next = 0..;
        let keys: UInt8Array = rows.iter().map(|row| row.and_then(|_| next.next())).collect();
        let mut forms =
            vec![Column::Flat(Arc::new(flat.clone())), Column::Keys(Keys::new(keys, Arc::new(texts)).unwrap())];
        if rows.iter().all(Option::is_some) {
            let ends = (1..).take(rows.len()).collect();
            forms.push(Column::Runs(Runs::new(Arc::new(flat), ends)));
        }
        forms
    }

    #[test]
    fn texts_of_all_forms_are_put_together() {
        let (some, others) = ([Some("a"), Some("a"), Some(""), Some("é")], [None, Some("a"), Some("b"), None]);
        for (first, second) in forms(&some).iter().flat_map(|a| forms(&others).into_iter().map(move |b| (a, b))) {
            let joined = Column::concat([first, &second]).unwrap();
            let found: Vec<Option<&str>> = (0..joined.len()).map(|row| joined.text(row)).collect();
            assert_eq!(found, [&some[..], &others[..]].concat());
            let flat = second.flat().unwrap();
            let flat = flat.as_dictionary::<Int32Type>().downcast_dict::<StringArray>().unwrap();
            assert_eq!(flat.into_iter().collect::<Vec<_>>(), others);
        }
    }

    #[test]
    fn over_4_gib_of_one_text_are_concatenated_without_a_copy() {
        let rows = 35_000;
        let text = "x".repeat(64 * 1024);
        let texts = || Arc::new(StringArray::from(vec![text.as_str()])) as ArrayRef;
        let keyed = Column::Keys(Keys::new(vec![0; rows].into(), texts()).unwrap());
        let values = DictionaryArray::<Int32Type>::new(vec![0].into(), texts());
        let runs = Column::Runs(Runs::new(Arc::new(values), vec![u32::try_from(rows).unwrap()]));
        assert_eq!(keyed.flat().unwrap().len(), rows);
        assert!(2 * rows * text.len() > u32::MAX as usize);
        let joined = Column::concat([&keyed, &runs]).unwrap();
        assert_eq!(joined.len(), 2 * rows);
        assert!([0, rows, 2 * rows - 1].iter().all(|row| joined.text(*row) == Some(&text)));
        let Column::Flat(values) = joined else { unreachable!() };
        assert!(values.get_array_memory_size() < 2 << 20);
    }

    #[test]
    fn keys_without_a_value_are_refused() {
        let values = || Arc::new(Int64Array::from(vec![1, 2])) as ArrayRef;
        let keys = |keys: Vec<Option<u8>>, values: ArrayRef| Keys::new(keys.into(), values);
        assert!(keys(vec![Some(0), Some(1)], values()).is_some() && keys(Vec::new(), values()).is_some());
        assert!(keys(vec![Some(0), Some(2)], values()).is_none());
        let none = || Arc::new(Int64Array::from(Vec::<i64>::new())) as ArrayRef;
        assert!(keys(vec![None, None], none()).is_some() && keys(vec![None, Some(0)], none()).is_none());
    }
}
