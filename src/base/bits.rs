//! Bits in bytes, the lowest bit of a byte first, as Arrow and Parquet hold them.

/// Bits of a word that [`word`] gives for certain, wherever it starts.
const STEP: usize = 56;

/// Eight bytes from a byte on, zeros beyond the end.
#[inline]
pub fn word(data: &[u8], at: usize) -> u64 {
    if let Some(bytes) = data.get(at..).and_then(|rest| rest.first_chunk()) {
        return u64::from_le_bytes(*bytes);
    }
    let rest = data.get(at..).unwrap_or_default();
    rest.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
}

/// The words of some bits in order, each with the position of its first bit, counted from `start`.
fn words(data: &[u8], start: usize, length: usize) -> impl DoubleEndedIterator<Item = (usize, u64)> {
    (0..length.div_ceil(STEP)).map(move |step| {
        let at = step * STEP;
        let mask = (1_u64 << STEP.min(length - at)) - 1;
        (at, word(data, (start + at) / 8) >> ((start + at) % 8) & mask)
    })
}

/// The bits of some truth values, eight of them a byte; the last byte is filled with zeros.
pub fn pack(truths: &[bool]) -> Vec<u8> {
    /// Moves the lowest bit of each byte of a word to its own place in the highest byte.
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let (words, rest) = truths.as_chunks::<8>();
    let byte =
        |eight: &[bool; 8]| (u64::from_le_bytes(eight.map(u8::from)).wrapping_mul(GATHER) >> 56).to_le_bytes()[0];
    let mut bytes: Vec<u8> = words.iter().map(byte).collect();
    if !rest.is_empty() {
        bytes.push(rest.iter().rev().fold(0, |byte, truth| byte << 1 | u8::from(*truth)));
    }
    bytes
}

/// How many of `length` bits from `start` are set.
pub fn count(data: &[u8], start: usize, length: usize) -> usize {
    words(data, start, length).map(|(_, word)| word.count_ones() as usize).sum()
}

/// The position of the first set bit, counted from `start`.
pub fn first(data: &[u8], start: usize, length: usize) -> Option<usize> {
    // Bits behind the last one may be looked at, too, and count for nothing.
    (0..length)
        .step_by(STEP)
        .find_map(|at| {
            let found = word(data, (start + at) / 8) >> ((start + at) % 8);
            (found != 0).then(|| at + found.trailing_zeros() as usize)
        })
        .filter(|at| *at < length)
}

/// The position of the last set bit, counted from `start`.
pub fn last(data: &[u8], start: usize, length: usize) -> Option<usize> {
    let set = words(data, start, length).rev().find(|(_, word)| *word != 0);
    set.map(|(at, word)| at + 63 - word.leading_zeros() as usize)
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::{count, first, last, pack};

    proptest! {
        #[test]
        fn bits_are_packed_in_order(truths in vec(any::<bool>(), 0..40)) {
            let bytes = pack(&truths);
            prop_assert_eq!(bytes.len(), truths.len().div_ceil(8));
            let bit = |at: usize| bytes[at / 8] >> (at % 8) & 1 == 1;
            prop_assert!((0..bytes.len() * 8).all(|at| bit(at) == truths.get(at).is_some_and(|truth| *truth)));
        }

        #[test]
        fn searches_find_what_a_look_at_each_bit_finds(data in vec(prop_oneof![Just(0_u8), any::<u8>()], 1..40), cut in any::<(prop::sample::Index, prop::sample::Index)>()) {
            let start = cut.0.index(data.len() * 8);
            let length = cut.1.index(data.len() * 8 - start + 1);
            let set: Vec<usize> =
                (0..length).filter(|at| data[(start + at) / 8] >> ((start + at) % 8) & 1 == 1).collect();
            prop_assert_eq!(count(&data, start, length), set.len());
            prop_assert_eq!(first(&data, start, length), set.first().copied());
            prop_assert_eq!(last(&data, start, length), set.last().copied());
        }
    }
}
