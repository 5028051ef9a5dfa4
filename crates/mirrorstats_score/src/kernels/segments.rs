//! Kernels that know episode boundaries: spreading, windows, aggregates, lookups.
//!
//! A batch holds whole episodes one after another. Episode i has the rows `offsets[i]..offsets[i + 1]`, and its
//! timestep t is the row `offsets[i] + t - 1`. No kernel allocates per episode.

use std::ops::Range;
use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, ArrowPrimitiveType, BooleanArray, Int64Array, PrimitiveArray, UInt32Array, UInt64Array,
};
use arrow::buffer::{BooleanBuffer, NullBuffer};
use arrow::datatypes::Int64Type;
use arrow::error::ArrowError;

use mirrorstats_metric::logical_plan::plan::{Aggregate, Comparison};
use mirrorstats_parquet_pages::bits::{self, Bits};

#[derive(Clone, Copy, Debug)]
pub struct Segments<'a> {
    offsets: &'a [usize],
}

impl<'a> Segments<'a> {
    /// The episodes bounded by `offsets`: ascending, one more than there are episodes, each with at least one row.
    pub fn new(offsets: &'a [usize]) -> Self {
        Self { offsets }
    }

    pub(crate) fn len(self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    pub(crate) fn rows(self) -> usize {
        self.offsets.last().copied().unwrap_or(0)
    }

    pub(crate) fn each(self) -> impl Iterator<Item = (usize, usize)> + use<'a> {
        self.offsets.windows(2).map(|pair| (pair[0], pair[1] - pair[0]))
    }

    pub(crate) fn length(self, episode: usize) -> i64 {
        as_t(self.offsets[episode + 1] - self.offsets[episode])
    }

    pub(crate) fn lengths(self) -> Int64Array {
        self.each().map(|(_, length)| as_t(length)).collect::<Vec<_>>().into()
    }

    /// The timestep of every row; never null.
    pub(crate) fn times(self) -> Int64Array {
        let mut times = Vec::with_capacity(self.rows());
        self.each().for_each(|(_, length)| times.extend(1..=as_t(length)));
        times.into()
    }

    /// The first row of each episode; never null.
    pub(crate) fn first_rows(self) -> BooleanArray {
        let mut rows = Bits::with_capacity(self.rows());
        for (_, length) in self.each() {
            rows.fill(1, true);
            rows.fill(length - 1, false);
        }
        BooleanArray::new(rows.finish(), None)
    }

    pub(crate) fn spread_bools(self, values: &BooleanArray) -> BooleanArray {
        let bits = self.spread_bits(values.values());
        BooleanArray::new(bits, self.spread_nulls(values.nulls()))
    }

    pub(crate) fn spread<T: ArrowPrimitiveType>(self, values: &PrimitiveArray<T>) -> PrimitiveArray<T> {
        let mut rows = Vec::with_capacity(self.rows());
        for ((_, length), &value) in self.each().zip(values.values()) {
            rows.extend(std::iter::repeat_n(value, length));
        }
        PrimitiveArray::new(rows.into(), self.spread_nulls(values.nulls()))
    }

    fn spread_bits(self, bits: &BooleanBuffer) -> BooleanBuffer {
        let mut rows = Bits::with_capacity(self.rows());
        for ((_, length), bit) in self.each().zip(bits.iter()) {
            rows.fill(length, bit);
        }
        rows.finish()
    }

    pub(crate) fn spread_nulls(self, nulls: Option<&NullBuffer>) -> Option<NullBuffer> {
        nulls.map(|nulls| NullBuffer::new(self.spread_bits(nulls.inner())))
    }

    /// The timesteps that satisfy the comparison with a moment: one window per episode. Null if the moment is null.
    /// Timesteps are not materialised: a window is a run of set bits.
    pub(crate) fn window(self, comparison: Comparison, moments: &Int64Array) -> BooleanArray {
        let mut rows = Bits::with_capacity(self.rows());
        for ((_, length), &moment) in self.each().zip(moments.values()) {
            let window = inside(comparison, moment, length);
            let (from, to, inside) = (window.start, window.end, comparison != Comparison::NotEqual);
            rows.fill(from, !inside);
            rows.fill(to - from, inside);
            rows.fill(length - to, !inside);
        }
        BooleanArray::new(rows.finish(), self.spread_nulls(moments.nulls()))
    }

    pub(crate) fn whole(self) -> impl Iterator<Item = Stretch> + use<'a> {
        self.each().map(|(start, length)| (start, 0..length))
    }

    /// The rows of each episode that are in all these windows, empty if a moment is null. Windows compare the timestep
    /// with a moment of the episode by any operator but `NotEqual`.
    pub(crate) fn within(self, windows: &[(Comparison, &Int64Array)]) -> Vec<Stretch> {
        let mut stretches: Vec<Stretch> = self.whole().collect();
        for (comparison, moments) in windows {
            let nulls = moments.nulls();
            let each = stretches.iter_mut().zip(self.offsets.windows(2)).zip(moments.values()).enumerate();
            for (episode, (((_, rows), ends), moment)) in each {
                let window = inside(*comparison, *moment, ends[1] - ends[0]);
                let (from, to) = (rows.start.max(window.start), rows.end.min(window.end));
                let none = from > to || nulls.is_some_and(|nulls| nulls.is_null(episode));
                *rows = if none { 0..0 } else { from..to };
            }
        }
        stretches
    }

    /// An aggregate of a predicate over some rows of each episode. First, last and count return a timestep or a number
    /// of steps; other aggregates return true if the predicate holds at some row.
    pub(crate) fn search(
        aggregate: Aggregate,
        predicate: &BooleanArray,
        stretches: impl Iterator<Item = Stretch>,
    ) -> ArrayRef {
        let truths = truths(predicate);
        let (data, offset) = (truths.values(), truths.offset());
        let rows = stretches.map(|(start, rows)| (offset + start + rows.start, rows.len(), rows.start + 1));
        match aggregate {
            Aggregate::First => {
                let first = rows.map(|(start, length, t)| bits::first(data, start, length).map(|at| as_t(t + at)));
                Arc::new(optional::<Int64Type>(first))
            }
            Aggregate::Last => {
                let last = rows.map(|(start, length, t)| bits::last(data, start, length).map(|at| as_t(t + at)));
                Arc::new(optional::<Int64Type>(last))
            }
            Aggregate::Count => {
                let count = rows.map(|(start, length, _)| as_t(bits::count(data, start, length)));
                Arc::new(Int64Array::from(count.collect::<Vec<_>>()))
            }
            _ => {
                let any = rows.map(|(start, length, _)| bits::first(data, start, length).is_some());
                Arc::new(BooleanArray::new(any.collect(), None))
            }
        }
    }

    pub(crate) fn all(self, predicate: &BooleanArray) -> BooleanArray {
        let truths = truths(predicate);
        let holds = |(start, length)| bits::count(truths.values(), truths.offset() + start, length) == length;
        BooleanArray::new(self.each().map(holds).collect(), None)
    }

    /// A fold of each episode's non-null values; null without any.
    pub(crate) fn fold<T: ArrowPrimitiveType>(
        self,
        values: &PrimitiveArray<T>,
        fold: impl Fn(T::Native, T::Native) -> T::Native,
    ) -> PrimitiveArray<T> {
        let numbers = values.values();
        let folded = self.each().map(|(start, length)| {
            let valid = (start..start + length).filter(|&row| values.is_valid(row)).map(|row| numbers[row]);
            valid.reduce(&fold)
        });
        folded.collect()
    }

    /// The sum of each episode's non-null values; null without any. Only the whole sum must fit: intermediate sums
    /// cannot overflow in any order of the steps.
    pub(crate) fn sums(self, values: &Int64Array) -> Result<Int64Array, ArrowError> {
        let sum = |(start, length)| {
            let valid = (start..start + length).filter(|&row| values.is_valid(row));
            let sum = valid.map(|row| i128::from(values.value(row))).reduce(|a, b| a + b);
            let fit = |sum: i128| {
                i64::try_from(sum).map_err(|_| ArrowError::ArithmeticOverflow(format!("a sum comes to {sum}")))
            };
            sum.map(fit).transpose()
        };
        self.each().map(sum).collect()
    }

    /// The row of the requested timestep of each episode; null if there is no such step.
    pub(crate) fn rows_at(self, moments: &Int64Array) -> UInt64Array {
        let row = |((start, length), moment): ((usize, usize), Option<i64>)| {
            let moment = usize::try_from(moment?).ok()?;
            (1..=length).contains(&moment).then(|| (start + moment - 1) as u64)
        };
        self.each().zip(moments.iter()).map(row).collect()
    }

    /// The 1-based timesteps of one episode where a predicate holds.
    pub(crate) fn timesteps(self, episode: usize, predicate: &BooleanArray) -> Vec<i64> {
        let (start, length) = (self.offsets[episode], self.offsets[episode + 1] - self.offsets[episode]);
        truths(predicate).slice(start, length).set_indices().map(|at| as_t(at + 1)).collect()
    }
}

fn optional<T: ArrowPrimitiveType>(numbers: impl Iterator<Item = Option<T::Native>>) -> PrimitiveArray<T> {
    let (values, valid): (Vec<_>, Vec<_>) =
        numbers.map(|number| (number.unwrap_or_default(), number.is_some())).unzip();
    PrimitiveArray::new(values.into(), nulls_of(&valid))
}

pub(crate) fn repeat<T: ArrowPrimitiveType>(value: &PrimitiveArray<T>, length: usize) -> PrimitiveArray<T> {
    if value.is_null(0) {
        return PrimitiveArray::new_null(length);
    }
    PrimitiveArray::from_iter_values(std::iter::repeat_n(value.value(0), length))
}

pub(crate) fn repeat_bool(value: &BooleanArray, length: usize) -> BooleanArray {
    if value.is_null(0) {
        return BooleanArray::new_null(length);
    }
    let bits = if value.value(0) { BooleanBuffer::new_set(length) } else { BooleanBuffer::new_unset(length) };
    BooleanArray::new(bits, None)
}

/// True where the symbol's text satisfies `test`, null where the text is null.
pub(crate) fn test_symbols(symbols: &UInt32Array, mut test: impl FnMut(u32) -> bool) -> BooleanArray {
    let mut known: Vec<Option<bool>> = Vec::new();
    let valid: Vec<bool> = (0..symbols.len()).map(|row| symbols.is_valid(row)).collect();
    let bits = BooleanBuffer::collect_bool(symbols.len(), |row| {
        let symbol = symbols.value(row) as usize;
        if !valid[row] {
            return false;
        }
        if known.len() <= symbol {
            known.resize(symbol + 1, None);
        }
        *known[symbol].get_or_insert_with(|| test(symbols.value(row)))
    });
    BooleanArray::new(bits, nulls_of(&valid))
}

fn clamp(moment: i64, length: usize) -> usize {
    usize::try_from(moment.max(0)).map_or(length, |moment| moment.min(length))
}

fn as_t(rows: usize) -> i64 {
    i64::try_from(rows).expect("a batch has fewer than 2^63 rows")
}

/// Rows of an episode: the episode's first row, and a range relative to it.
pub(crate) type Stretch = (usize, Range<usize>);

/// The rows of an episode of `length` whose timestep satisfies the comparison with a moment, for all but `NotEqual`.
fn inside(comparison: Comparison, moment: i64, length: usize) -> Range<usize> {
    // Rows strictly before the moment, and rows up to it.
    let before = clamp(moment.saturating_sub(1), length);
    let until = clamp(moment, length);
    match comparison {
        Comparison::Less => 0..before,
        Comparison::LessEqual => 0..until,
        Comparison::Greater => until..length,
        Comparison::GreaterEqual => before..length,
        Comparison::Equal | Comparison::NotEqual => before..until,
    }
}

/// The bits of true values; null counts as not true.
pub(crate) fn truths(values: &BooleanArray) -> BooleanBuffer {
    match values.nulls() {
        None => values.values().clone(),
        Some(valid) => values.values() & valid.inner(),
    }
}

fn nulls_of(valid: &[bool]) -> Option<NullBuffer> {
    if valid.iter().all(|&valid| valid) {
        None
    } else {
        Some(NullBuffer::new(BooleanBuffer::new(bits::pack(valid).into(), 0, valid.len())))
    }
}
