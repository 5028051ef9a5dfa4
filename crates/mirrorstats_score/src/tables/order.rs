//! The order of an episode table: a permutation, found by sorting integers.

use arrow::array::Array as _;

use crate::tables::table::{EpisodeKeys, TextColumn, narrow};

/// The rows in key order; `None` if they are already sorted.
pub(crate) fn order(keys: &EpisodeKeys) -> Option<Vec<u32>> {
    let (experiments, models) = (ranks(&keys.experiment), ranks(&keys.model));
    let rank = |ranks: &[u32], column: &TextColumn, at: usize| ranks[column.codes.value(at) as usize];
    // Integers compare much faster than texts. 128 bits hold a key without its id.
    let number = |row: u32| {
        let at = row as usize;
        let names = [rank(&experiments, &keys.experiment, at), rank(&models, &keys.model, at)];
        let numbers = [keys.seed.value(at), keys.run.value(at)].map(|value| value.cast_unsigned() ^ 1 << 31);
        let number = names.into_iter().chain(numbers).fold(0, |number, part| number << 32 | u128::from(part));
        (number, row)
    };
    let mut numbers: Vec<(u128, u32)> = (0..narrow(keys.len())).map(number).collect();
    numbers.sort_unstable();
    let id = |(_, row): &(u128, u32)| keys.episode_id.get(*row as usize);
    for equal in numbers.chunk_by_mut(|a, b| a.0 == b.0) {
        equal.sort_by(|a, b| id(a).cmp(&id(b)));
    }
    let order: Vec<u32> = numbers.into_iter().map(|(_, row)| row).collect();
    (!order.is_sorted()).then_some(order)
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
