//! The order of an episode table: a permutation, found by sorting small integers.

use std::cmp::Ordering;
use std::ops::{BitOr, BitXor, Shl, Shr};

use arrow::array::Array as _;

use crate::tables::table::{EpisodeKeys, TextColumn, narrow};

/// The rows in key order; `None` if they are already sorted.
pub(crate) fn order(keys: &EpisodeKeys) -> Option<Vec<u32>> {
    let rows = Rows::of(keys);
    let order = match rows.bits {
        ..=64 => sorted::<u64>(&rows),
        65..=128 => sorted::<u128>(&rows),
        _ => compared(keys),
    };
    (!order.is_sorted()).then_some(order)
}

/// The integer type that the keys of a row are packed into.
trait Number:
    Ord
    + Copy
    + From<u32>
    + TryInto<u32>
    + BitOr<Output = Self>
    + BitXor<Output = Self>
    + Shl<u32, Output = Self>
    + Shr<u32, Output = Self>
{
}

impl Number for u64 {}
impl Number for u128 {}

fn sorted<N: Number>(rows: &Rows<'_>) -> Vec<u32> {
    let mut numbers: Vec<N> = (0..narrow(rows.keys.len())).map(|row| rows.number(row)).collect();
    // The row is in the lowest bits, so no two numbers are equal, and rows that differ only in their ids are adjacent.
    numbers.sort_unstable();
    let key = |number: N| number >> rows.row_bits;
    let row = |number: &N| (*number ^ (key(*number) << rows.row_bits)).try_into().ok();
    let mut order: Vec<u32> = numbers.iter().map(|number| row(number).expect("a row has 32 bits at most")).collect();
    sort_equal(rows.keys, &mut order, |at| key(numbers[at]));
    order
}

fn compared(keys: &EpisodeKeys) -> Vec<u32> {
    let mut order: Vec<u32> = (0..narrow(keys.len())).collect();
    order.sort_by(|a, b| keys.get(*a as usize).cmp(&keys.get(*b as usize)));
    order
}

fn sort_equal<N: Eq>(keys: &EpisodeKeys, order: &mut [u32], key: impl Fn(usize) -> N) {
    let mut start = 0;
    for end in 1..=order.len() {
        if end == order.len() || key(end) != key(start) {
            order[start..end].sort_by(|a, b| by_id(keys, *a, *b));
            start = end;
        }
    }
}

fn by_id(keys: &EpisodeKeys, a: u32, b: u32) -> Ordering {
    keys.episode_id.get(a as usize).cmp(&keys.episode_id.get(b as usize))
}

/// The packing of rows' keys into numbers: experiment, model, seed, run, row, each in as few bits as it needs.
struct Rows<'a> {
    keys: &'a EpisodeKeys,
    experiments: Vec<u32>,
    models: Vec<u32>,
    seed: Span,
    run: Span,
    model_bits: u32,
    row_bits: u32,
    bits: u32,
}

impl<'a> Rows<'a> {
    fn of(keys: &'a EpisodeKeys) -> Self {
        let (experiments, models) = (ranks(&keys.experiment), ranks(&keys.model));
        let (seed, run) = (Span::of(keys.seed.values()), Span::of(keys.run.values()));
        let bits_of = |count: usize| u64::BITS - (count as u64).leading_zeros();
        let (model_bits, row_bits) = (bits_of(models.len()), bits_of(keys.len()));
        let bits = bits_of(experiments.len()) + model_bits + seed.bits + run.bits + row_bits;
        Self { keys, experiments, models, seed, run, model_bits, row_bits, bits }
    }

    fn number<N: Number>(&self, row: u32) -> N {
        let (Self { keys, .. }, at) = (self, row as usize);
        let rank = |ranks: &[u32], column: &TextColumn| N::from(ranks[column.codes.value(at) as usize]);
        let mut number = rank(&self.experiments, &keys.experiment);
        number = number << self.model_bits | rank(&self.models, &keys.model);
        number = number << self.seed.bits | self.seed.offset(keys.seed.value(at)).into();
        number = number << self.run.bits | self.run.offset(keys.run.value(at)).into();
        number << self.row_bits | row.into()
    }
}

struct Span {
    smallest: i32,
    bits: u32,
}

impl Span {
    fn of(values: &[i32]) -> Self {
        let (smallest, largest) =
            values.iter().fold((i32::MAX, i32::MIN), |(low, high), value| (low.min(*value), high.max(*value)));
        let width = i64::from(largest).saturating_sub(smallest.into()).max(0);
        Self { smallest, bits: i64::BITS - width.leading_zeros() }
    }

    fn offset(&self, value: i32) -> u32 {
        value.abs_diff(self.smallest)
    }
}

fn ranks(column: &TextColumn) -> Vec<u32> {
    let mut codes: Vec<u32> = (0..narrow(column.texts.len())).collect();
    codes.sort_unstable_by_key(|code| column.texts.value(*code as usize));
    let mut ranks = vec![0; codes.len()];
    (0..).zip(codes).for_each(|(rank, code)| ranks[code as usize] = rank);
    ranks
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::order;
    use crate::tables::table::{EpisodeKey, EpisodeKeys};

    fn key() -> impl Strategy<Value = EpisodeKey> {
        let name = || proptest::string::string_regex("[a\u{0}\u{1}é\u{ff}]{0,2}").unwrap();
        let number = || prop_oneof![5 => -2..3, 1 => Just(i32::MIN), 1 => Just(i32::MAX)];
        (name(), name(), number(), number(), name()).prop_map(|(experiment, model, seed, run, episode_id)| EpisodeKey {
            experiment,
            model,
            seed,
            run,
            episode_id,
        })
    }

    proptest! {
        #[test]
        fn sorting_columns_equals_sorting_keys(keys in vec(key(), 0..40)) {
            let columns: EpisodeKeys = keys.iter().cloned().collect();
            let order = order(&columns).unwrap_or_else(|| (0..u32::try_from(keys.len()).unwrap()).collect());
            let found: Vec<&EpisodeKey> = order.iter().map(|row| &keys[*row as usize]).collect();
            let mut expected: Vec<&EpisodeKey> = keys.iter().collect();
            expected.sort();
            prop_assert_eq!(found, expected);
            let mut rows = order;
            rows.sort_unstable();
            prop_assert!(rows.into_iter().eq(0..u32::try_from(keys.len()).unwrap()));
        }
    }
}
