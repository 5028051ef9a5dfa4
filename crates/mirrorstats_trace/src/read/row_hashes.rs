//! A hash of the rows of an episode. Equal rows have equal hashes, in every form of a column, and in every run and on
//! every machine. Different rows rarely have equal hashes.
//!
//! Each value is multiplied by a number of its row and its column, and the products are summed. For 14 million
//! steps this took about 0.2 s of processor time. Cryptographic hashes of all rows took nine seconds.

use std::ops::Range;

use arrow::array::{Array as _, ArrayRef, AsArray as _, StringArray};
use arrow::datatypes::{DataType, Float64Type, Int32Type, Int64Type};

use mirrorstats_parquet_pages::Column;

use super::entry_use::lengths;
use super::parallel_scan::Episodes;
use super::projection::{EPISODE_ID, Layout, T};
use crate::schema::Kind;

/// Rows whose products are summed before the sum is mixed.
const BLOCK: usize = 1024;

/// Odd, without a pattern in its bits: 2^64 divided by the golden ratio.
const SPREAD: u64 = 0x9e37_79b9_7f4a_7c15;

const NULL: u64 = 0x6a09_e667_f3bc_c909;

pub(crate) fn row_hashes<'c>(
    columns: impl IntoIterator<Item = &'c Column>,
    rows: &[Range<usize>],
    seed: u64,
) -> Vec<u64> {
    let mut hashes: Vec<u64> = rows.iter().map(|rows| mixed(rows.len() as u64 ^ seed, SPREAD)).collect();
    columns.into_iter().for_each(|column| add(column, rows, &mut hashes));
    hashes
}

/// The hash of each episode. Leaves out its id, `t`, and columns of floats, which are not worth the time: only episodes
/// that share this hash are compared in all columns.
pub(crate) fn of_episodes(layout: &Layout, episodes: &Episodes) -> Vec<u64> {
    let starts = &episodes.offsets[..episodes.len()];
    let rows: Vec<Range<usize>> = episodes.offsets.windows(2).map(|ends| ends[0]..ends[1]).collect();
    let firsts: Vec<Range<usize>> = (0..starts.len()).map(|episode| episode..episode + 1).collect();
    let mut hashes = row_hashes([], &rows, 0);
    for (at, (column, values)) in layout.columns.iter().zip(&episodes.columns).enumerate() {
        if at == EPISODE_ID || at == T || column.kind == Kind::Float {
            continue;
        }
        match column.constant.then(|| values.at(starts)) {
            Some(Ok(values)) => add(&Column::Flat(values), &firsts, &mut hashes),
            _ => add(values, &rows, &mut hashes),
        }
    }
    hashes
}

fn add(column: &Column, rows: &[Range<usize>], hashes: &mut [u64]) {
    match column {
        Column::Flat(values) => add_flat(values, rows, hashes),
        Column::Keys(keyed) => {
            let mut values = [NULL; 256];
            values.iter_mut().zip(of_entries(keyed.values())).for_each(|(value, entry)| *value = entry);
            let keys = keyed.keys();
            if keys.null_count() == 0 {
                sum(rows, hashes, |rows| keys.values()[rows].iter().map(|key| values[usize::from(*key)]));
            } else {
                let value = |row: usize| if keys.is_null(row) { NULL } else { values[usize::from(keys.value(row))] };
                sum(rows, hashes, |rows| rows.map(value));
            }
        }
        Column::Runs(runs) => {
            let values = of_rows(runs.values());
            let mut of_row = vec![0; runs.rows()];
            for (start, run, length) in lengths(runs) {
                of_row[start..][..usize::try_from(length).unwrap_or_default()].fill(values[run]);
            }
            sum(rows, hashes, |rows| of_row[rows].iter().copied());
        }
    }
}

fn add_flat(values: &ArrayRef, rows: &[Range<usize>], hashes: &mut [u64]) {
    let plain = values.null_count() == 0;
    match values.data_type() {
        DataType::Int64 if plain => {
            let values = values.as_primitive::<Int64Type>().values();
            sum(rows, hashes, |rows| values[rows].iter().map(|value| value.cast_unsigned()));
        }
        DataType::Float64 if plain => {
            let values = values.as_primitive::<Float64Type>().values();
            sum(rows, hashes, |rows| values[rows].iter().map(|value| value.to_bits()));
        }
        DataType::Boolean if plain => {
            let values = values.as_boolean().values();
            sum(rows, hashes, |rows| rows.map(|row| u64::from(values.value(row))));
        }
        DataType::Dictionary(..) if plain && values.as_dictionary::<Int32Type>().values().len() <= values.len() => {
            let texts = values.as_dictionary::<Int32Type>();
            let (keys, values) = (texts.keys().values(), of_entries(texts.values()));
            sum(rows, hashes, |rows| keys[rows].iter().map(|key| values[key.cast_unsigned() as usize]));
        }
        _ => {
            let values = of_rows(values);
            sum(rows, hashes, |rows| values[rows].iter().copied());
        }
    }
}

fn sum<V: IntoIterator<Item = u64>>(rows: &[Range<usize>], hashes: &mut [u64], values: impl Fn(Range<usize>) -> V) {
    for (rows, hash_of) in rows.iter().zip(hashes) {
        let mut hash = *hash_of;
        for from in rows.clone().step_by(BLOCK) {
            // The factors differ by row; the hash so far makes them differ by column.
            let mut factor = hash | 1;
            let mut total = 0_u64;
            for value in values(from..rows.end.min(from + BLOCK)) {
                factor = factor.wrapping_add(SPREAD << 1);
                total = total.wrapping_add(mixed(value ^ SPREAD, factor));
            }
            hash = mixed(hash ^ total, SPREAD);
        }
        *hash_of = hash;
    }
}

#[expect(clippy::cast_possible_truncation, reason = "each half has 64 bits")]
fn mixed(a: u64, b: u64) -> u64 {
    let product = u128::from(a) * u128::from(b);
    (product as u64) ^ ((product >> 64) as u64)
}

fn of_entries(entries: &ArrayRef) -> Vec<u64> {
    match entries.as_string_opt::<i32>() {
        Some(texts) => (0..texts.len()).map(|at| text_at(texts, at)).collect(),
        None => of_rows(entries),
    }
}

fn of_rows(values: &ArrayRef) -> Vec<u64> {
    let of: Box<dyn Fn(usize) -> u64 + '_> = match values.data_type() {
        DataType::Boolean => {
            let values = values.as_boolean().values();
            Box::new(move |row| u64::from(values.value(row)))
        }
        DataType::Int64 => {
            let values = values.as_primitive::<Int64Type>().values();
            Box::new(move |row| values[row].cast_unsigned())
        }
        DataType::Float64 => {
            let values = values.as_primitive::<Float64Type>().values();
            Box::new(move |row| values[row].to_bits())
        }
        DataType::Dictionary(..) => {
            let texts = values.as_dictionary::<Int32Type>();
            let (keys, texts) = (texts.keys().values(), texts.values().as_string::<i32>());
            Box::new(move |row| text_at(texts, keys[row].cast_unsigned() as usize))
        }
        // A column of nulls has no type.
        _ => Box::new(|_| NULL),
    };
    (0..values.len()).map(|row| if values.is_null(row) { NULL } else { of(row) }).collect()
}

fn text_at(texts: &StringArray, at: usize) -> u64 {
    let bytes = texts.value(at).as_bytes();
    let words = bytes.chunks(8).map(|chunk| {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        u64::from_le_bytes(word)
    });
    words.fold(mixed(bytes.len() as u64 ^ NULL, SPREAD), |hash, word| mixed(hash ^ word, SPREAD))
}

#[cfg(test)]
mod tests {
    use std::slice;
    use std::sync::Arc;

    use arrow::array::{ArrayRef, BooleanArray, DictionaryArray, Float64Array, Int64Array, StringArray, UInt8Array};
    use arrow::datatypes::Int32Type;
    use mirrorstats_parquet_pages::{Column, Keys, Runs};
    use proptest::collection::vec;
    use proptest::option;
    use proptest::prelude::*;

    use super::row_hashes;

    const TEXTS: [&str; 4] = ["", "a", "green", "longer than eight bytes"];

    fn flat(values: impl Into<ArrayRef>) -> Column {
        Column::Flat(values.into())
    }

    fn whole(columns: &[&Column], seed: u64) -> u64 {
        row_hashes(columns.iter().copied(), slice::from_ref(&(0..columns[0].len())), seed)[0]
    }

    /// The forms of texts and of integers.
    fn forms(rows: &[Option<u8>]) -> [Vec<Column>; 2] {
        let text = |row: &Option<u8>| row.map(|at| TEXTS[usize::from(at)]);
        let texts = Arc::new(rows.iter().map(text).collect::<DictionaryArray<Int32Type>>()) as ArrayRef;
        let ints = Arc::new(rows.iter().map(|row| row.map(i64::from)).collect::<Int64Array>()) as ArrayRef;
        let keys = || rows.iter().copied().collect::<UInt8Array>();
        let of_keys = |values: ArrayRef| Column::Keys(Keys::new(keys(), values).unwrap());
        let (all_texts, all_ints) = (StringArray::from(TEXTS.to_vec()), Int64Array::from(vec![0, 1, 2, 3]));
        // A run may go on in the next one.
        let ends = || (1..).take(rows.len()).collect();
        [
            vec![flat(texts.clone()), of_keys(Arc::new(all_texts)), Column::Runs(Runs::new(texts, ends()))],
            vec![flat(ints.clone()), of_keys(Arc::new(all_ints)), Column::Runs(Runs::new(ints, ends()))],
        ]
    }

    proptest! {
        #[test]
        fn all_forms_of_equal_rows_have_equal_hashes(rows in vec(option::of(0..4_u8), 1..3000), cut in any::<prop::sample::Index>()) {
            let cut = cut.index(rows.len());
            for forms in forms(&rows) {
                let stretches = [0..cut, cut..rows.len(), 0..rows.len()];
                let of = |column: &Column| row_hashes([column], &stretches, 7);
                prop_assert_eq!(of(&forms[0]), of(&forms[1]));
                prop_assert_eq!(of(&forms[0]), of(&forms[2]));
                let end = forms[0].slice(cut, rows.len() - cut);
                prop_assert_eq!(whole(&[&end], 7), of(&forms[0])[1]);
            }
        }

        #[test]
        fn other_rows_have_other_hashes(rows in vec(option::of(0..4_u8), 2..3000), at in any::<[prop::sample::Index; 2]>(), to in option::of(0..4_u8)) {
            let [one, two] = at.map(|at| at.index(rows.len()));
            let (mut changed, mut swapped) = (rows.clone(), rows.clone());
            changed[one] = to;
            swapped.swap(one, two);
            let all = |rows: &[Option<u8>]| forms(rows).map(|forms| whole(&[&forms[0]], 7));
            for others in [changed, swapped, rows[1..].to_vec()] {
                for (one, other) in all(&rows).into_iter().zip(all(&others)) {
                    prop_assert_eq!(one == other, rows == others);
                }
            }
        }
    }

    #[test]
    fn columns_seeds_and_nulls_make_a_difference() {
        let bools = flat(Arc::new(BooleanArray::from(vec![true, false, true])) as ArrayRef);
        let others = flat(Arc::new(BooleanArray::from(vec![false, true, true])) as ArrayRef);
        let floats = flat(Arc::new(Float64Array::from(vec![0.0, -0.0, f64::NAN])) as ArrayRef);
        let nulls = flat(Arc::new(Float64Array::from(vec![Some(0.0), None, Some(f64::NAN)])) as ArrayRef);
        assert_ne!(whole(&[&bools, &others], 1), whole(&[&others, &bools], 1));
        assert_ne!(whole(&[&bools], 1), whole(&[&bools], 2));
        assert_ne!(whole(&[&floats], 1), whole(&[&nulls], 1));
    }
}
