//! A column of some rows as it is held: a value a row, or a value a run of rows.
//!
//! Rule: both forms say the same. What asks for single rows may take either; what needs an array asks for one
//! ([`Column::flat`]), which costs as much as the rows are many.

use arrow::array::{Array as _, ArrayRef, AsArray as _, UInt32Array};
use arrow::compute::{cast, concat, take};
use arrow::datatypes::{DataType, Int32Type, Int64Type};
use arrow::error::ArrowError;

use super::open::text_type;

/// The values of some rows.
#[derive(Clone, Debug)]
pub(super) enum Column {
    /// A value a row.
    Flat(ArrayRef),
    /// A value a run.
    Runs(Runs),
}

/// Rows of which many in a row are equal: columns that are constant in an episode.
#[derive(Clone, Debug)]
pub(super) struct Runs {
    /// A value for each run; neighbours may be equal.
    values: ArrayRef,
    /// The row before which each run ends, counted from the first row of the first run; ascending.
    ends: UInt32Array,
    /// The first row of this slice, counted as the ends are.
    start: usize,
    length: usize,
}

impl Column {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Flat(values) => values.len(),
            Self::Runs(runs) => runs.length,
        }
    }

    /// `length` rows from row `start`; nothing is copied.
    pub(super) fn slice(&self, start: usize, length: usize) -> Self {
        match self {
            Self::Flat(values) => Self::Flat(values.slice(start, length)),
            Self::Runs(runs) => Self::Runs(runs.slice(start, length)),
        }
    }

    /// A value a row.
    pub(super) fn flat(&self) -> Result<ArrayRef, ArrowError> {
        match self {
            Self::Flat(values) => Ok(values.clone()),
            Self::Runs(runs) => runs.at(0..runs.length),
        }
    }

    /// The values of some rows, ascending.
    pub(super) fn at(&self, rows: &[usize]) -> Result<ArrayRef, ArrowError> {
        match self {
            Self::Flat(values) => {
                let rows: UInt32Array = rows.iter().map(|row| narrow(*row)).collect::<Vec<_>>().into();
                take(values, &rows, None)
            }
            Self::Runs(runs) => runs.at(rows.iter().copied()),
        }
    }

    /// The text at a row of a text column; `None` for null.
    pub(super) fn text(&self, row: usize) -> Option<&str> {
        let (values, row) = self.place(row);
        let values = values.as_dictionary::<Int32Type>();
        Some(values.values().as_string::<i32>().value(values.key(row)?))
    }

    /// The integer at a row of an integer column; `None` for null.
    pub(super) fn int(&self, row: usize) -> Option<i64> {
        let (values, row) = self.place(row);
        let values = values.as_primitive::<Int64Type>();
        values.is_valid(row).then(|| values.value(row))
    }

    fn place(&self, row: usize) -> (&ArrayRef, usize) {
        match self {
            Self::Flat(values) => (values, row),
            Self::Runs(runs) => (&runs.values, runs.run_of(row)),
        }
    }

    /// The rows of some columns of one kind, one after the other.
    pub(super) fn concat<'a>(parts: impl IntoIterator<Item = &'a Self>) -> Result<Self, ArrowError> {
        let arrays = parts.into_iter().map(|part| plain(&part.flat()?)).collect::<Result<Vec<_>, _>>()?;
        let arrays: Vec<_> = arrays.iter().map(AsRef::as_ref).collect();
        let joined = concat(&arrays)?;
        let texts = *joined.data_type() == DataType::Utf8;
        Ok(Self::Flat(if texts { cast(&joined, &text_type())? } else { joined }))
    }
}

/// Texts without a dictionary: theirs may be large, and the rows few.
fn plain(values: &ArrayRef) -> Result<ArrayRef, ArrowError> {
    match values.data_type() {
        DataType::Dictionary(_, _) => cast(values, &DataType::Utf8),
        _ => Ok(values.clone()),
    }
}

impl From<ArrayRef> for Column {
    fn from(values: ArrayRef) -> Self {
        Self::Flat(values)
    }
}

impl Runs {
    /// Runs of these values; each ends before the row of `ends` at its place.
    pub(super) fn new(values: ArrayRef, ends: Vec<u32>) -> Self {
        let length = ends.last().map_or(0, |end| *end as usize);
        Self { values, ends: ends.into(), start: 0, length }
    }

    fn slice(&self, start: usize, length: usize) -> Self {
        Self { start: self.start + start, length, ..self.clone() }
    }

    fn run_of(&self, row: usize) -> usize {
        self.ends.values().partition_point(|end| *end as usize <= self.start + row)
    }

    /// The row at which each run starts, and the position of its value; the first starts at row 0.
    pub(super) fn starts(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let ends = self.ends.values();
        let first = self.run_of(0);
        let start = move |run: usize| if run == first { 0 } else { ends[run - 1] as usize - self.start };
        (first..ends.len()).map(move |run| (start(run), run)).take_while(|(start, _)| *start < self.length)
    }

    /// The values of the runs, those of which no row is left included.
    pub(super) fn values(&self) -> &ArrayRef {
        &self.values
    }

    /// Whether a run starts at nothing but these rows, which ascend.
    pub(super) fn start_only_at(&self, rows: &[usize]) -> bool {
        let mut rows = rows.iter();
        self.starts().skip(1).all(|(start, _)| rows.by_ref().find(|row| **row >= start) == Some(&start))
    }

    /// The values of some rows, ascending.
    fn at(&self, rows: impl IntoIterator<Item = usize>) -> Result<ArrayRef, ArrowError> {
        let ends = self.ends.values();
        let mut run = self.run_of(0);
        let runs = rows.into_iter().map(|row| {
            while ends[run] as usize <= self.start + row {
                run += 1;
            }
            narrow(run)
        });
        take(&self.values, &UInt32Array::from(runs.collect::<Vec<_>>()), None)
    }
}

fn narrow(row: usize) -> u32 {
    u32::try_from(row)
        .expect("rows are decoded 65,536 at a time, and an episode of 2^32 steps does not fit into memory")
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{ArrayRef, AsArray as _, Int64Array};
    use arrow::datatypes::Int64Type;
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::{Column, Runs};

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
        fn runs_say_what_rows_say(runs in vec((0..3_i64, 1..5_u32), 1..9), cut in any::<(prop::sample::Index, prop::sample::Index)>()) {
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
        }
    }
}
