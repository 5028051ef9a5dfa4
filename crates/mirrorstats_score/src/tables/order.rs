//! The order of an episode table: a permutation, found by sorting integers.

use arrow::array::{Array as _, LargeStringArray};

use crate::tables::table::{EpisodeKeys, TextColumn, narrow};

/// The rows in key order; `None` if they are already sorted.
pub(crate) fn order(keys: &EpisodeKeys) -> Option<Vec<u32>> {
    let (experiments, models) = (ranks(&keys.experiment), ranks(&keys.model));
    let starts = starts(&keys.episode_id.texts);
    let rank = |ranks: &[u32], column: &TextColumn, at: usize| ranks[column.codes.value(at) as usize];
    // Integers compare much faster than texts. 128 bits hold a key without its id.
    let number = |row: u32| {
        let at = row as usize;
        let names = [rank(&experiments, &keys.experiment, at), rank(&models, &keys.model, at)];
        let numbers = [keys.seed.value(at), keys.run.value(at)].map(|value| value.cast_unsigned() ^ 1 << 31);
        let number = names.into_iter().chain(numbers).fold(0, |number, part| number << 32 | u128::from(part));
        (number, starts[keys.episode_id.codes.value(at) as usize], row)
    };
    let mut numbers: Vec<(u128, u64, u32)> = (0..narrow(keys.len())).map(number).collect();
    numbers.sort_unstable();
    let id = |(_, _, row): &(u128, u64, u32)| keys.episode_id.get(*row as usize);
    for equal in numbers.chunk_by_mut(|a, b| (a.0, a.1) == (b.0, b.1)) {
        equal.sort_by(|a, b| id(a).cmp(&id(b)));
    }
    let order: Vec<u32> = numbers.into_iter().map(|(_, _, row)| row).collect();
    (!order.is_sorted()).then_some(order)
}

/// Eight bytes of each text, after the bytes that all texts begin with. Texts are in their order, unless these are
/// equal. Other programs repeat seeds and runs, so ids decide the order. Comparing the ids took a twentieth of
/// a report.
fn starts(texts: &LargeStringArray) -> Vec<u64> {
    let bytes = |at: usize| texts.value(at).as_bytes();
    let common = (1..texts.len())
        .fold(usize::MAX, |common, at| bytes(0).iter().zip(bytes(at)).take(common).take_while(|(a, b)| a == b).count());
    let start = |at: usize| {
        let mut start = [0; 8];
        let rest = bytes(at).iter().skip(common);
        start.iter_mut().zip(rest).for_each(|(start, byte)| *start = *byte);
        u64::from_be_bytes(start)
    };
    (0..texts.len()).map(start).collect()
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
        let id = || (proptest::string::string_regex("(ab){0,5}").unwrap(), name()).prop_map(|(a, b)| a + &b);
        let number = || prop_oneof![5 => -2..3, 1 => Just(i32::MIN), 1 => Just(i32::MAX)];
        (name(), name(), number(), number(), id()).prop_map(|(experiment, model, seed, run, episode_id)| EpisodeKey {
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
