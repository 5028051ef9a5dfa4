//! Bits in bytes, the lowest bit of a byte first, as Arrow and Parquet hold them.

use arrow::buffer::BooleanBuffer;

/// Bits processed per step at any alignment: [`wide`] always returns this number.
const STEP: usize = 120;

/// The same for [`word`].
const WORD: usize = 56;

/// Eight bytes from a byte on, padded with zeros at the end.
#[inline]
pub fn word(data: &[u8], at: usize) -> u64 {
    if let Some(bytes) = data.get(at..).and_then(|rest| rest.first_chunk()) {
        return u64::from_le_bytes(*bytes);
    }
    let rest = data.get(at..).unwrap_or_default();
    rest.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
}

/// Up to [`STEP`] of the `length` bits from `start`, beginning with bit `at`; zeros beyond the last.
#[inline]
fn wide(data: &[u8], start: usize, length: usize, at: usize) -> u128 {
    let (byte, ahead) = ((start + at) / 8, (start + at) % 8);
    let bits = match data.get(byte..).and_then(|rest| rest.first_chunk()) {
        Some(bytes) => u128::from_le_bytes(*bytes),
        None => u128::from(word(data, byte + 8)) << 64 | u128::from(word(data, byte)),
    };
    bits >> ahead & ((1 << STEP.min(length - at)) - 1)
}

#[derive(Debug, Default)]
pub struct Bits {
    words: Vec<u64>,
    open: u64,
    length: usize,
}

impl Bits {
    pub fn with_capacity(bits: usize) -> Self {
        Self { words: Vec::with_capacity(bits.div_ceil(64)), ..Self::default() }
    }

    pub fn count(&self) -> usize {
        self.length
    }

    /// Adds the `count` lowest bits of a word, at most 64; the other bits must be zero.
    #[inline]
    fn push(&mut self, bits: u64, count: usize) {
        let filled = self.length % 64;
        self.open |= bits << filled;
        self.length += count;
        if filled + count >= 64 {
            self.words.push(self.open.to_le());
            self.open = if filled == 0 { 0 } else { bits >> (64 - filled) };
        }
    }

    #[inline]
    pub fn fill(&mut self, count: usize, bit: bool) {
        for at in (0..count).step_by(64) {
            let count = (count - at).min(64);
            self.push(if bit { u64::MAX >> (64 - count) } else { 0 }, count);
        }
    }

    /// Adds `length` bits of some bytes from the bit `start` on. Returns the number of set bits.
    #[inline]
    pub fn append(&mut self, data: &[u8], start: usize, length: usize) -> usize {
        let mut set = 0;
        for at in (0..length).step_by(WORD) {
            let count = (length - at).min(WORD);
            let bits = word(data, (start + at) / 8) >> ((start + at) % 8) & ((1 << count) - 1);
            set += bits.count_ones() as usize;
            self.push(bits, count);
        }
        set
    }

    pub fn finish(mut self) -> BooleanBuffer {
        if !self.length.is_multiple_of(64) {
            self.words.push(self.open.to_le());
        }
        BooleanBuffer::new(self.words.into(), 0, self.length)
    }
}

/// The bits of some truth values, eight per byte; the last byte is padded with zeros.
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

pub fn count(data: &[u8], start: usize, length: usize) -> usize {
    (0..length).step_by(STEP).map(|at| wide(data, start, length, at).count_ones() as usize).sum()
}

/// The position of the first set bit, counted from `start`.
pub fn first(data: &[u8], start: usize, length: usize) -> Option<usize> {
    let mut at = 0;
    while at < length {
        let bits = wide(data, start, length, at);
        if bits != 0 {
            return Some(at + bits.trailing_zeros() as usize);
        }
        at += STEP;
    }
    None
}

/// The position of the last set bit, counted from `start`.
pub fn last(data: &[u8], start: usize, length: usize) -> Option<usize> {
    let steps = (0..length).step_by(STEP).rev().map(|at| (at, wide(data, start, length, at)));
    let mut set = steps.filter(|(_, bits)| *bits != 0);
    set.next().map(|(at, bits)| at + 127 - bits.leading_zeros() as usize)
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::{Bits, count, first, last, pack};

    proptest! {
        #[test]
        fn bits_are_packed_in_order(truths in vec(any::<bool>(), 0..40)) {
            let bytes = pack(&truths);
            prop_assert_eq!(bytes.len(), truths.len().div_ceil(8));
            let bit = |at: usize| bytes[at / 8] >> (at % 8) & 1 == 1;
            prop_assert!((0..bytes.len() * 8).all(|at| bit(at) == truths.get(at).is_some_and(|truth| *truth)));
        }

        #[test]
        fn bits_come_one_after_the_other(parts in vec((any::<bool>(), vec(any::<u8>(), 0..30), any::<(prop::sample::Index, prop::sample::Index)>()), 0..20)) {
            let (mut bits, mut expected) = (Bits::with_capacity(9), Vec::new());
            for (bit, data, cut) in parts {
                let start = cut.0.index(data.len() * 8 + 1);
                let length = cut.1.index(data.len() * 8 - start + 1);
                let stored: Vec<bool> = (start..start + length).map(|at| data[at / 8] >> (at % 8) & 1 == 1).collect();
                bits.fill(length, bit);
                expected.extend(std::iter::repeat_n(bit, length));
                prop_assert_eq!(bits.append(&data, start, length), stored.iter().filter(|bit| **bit).count());
                expected.extend(stored);
            }
            prop_assert_eq!(bits.count(), expected.len());
            prop_assert_eq!(bits.finish().iter().collect::<Vec<bool>>(), expected);
        }

        #[test]
        fn searches_agree_with_a_look_at_each_bit(data in vec(prop_oneof![4 => Just(0_u8), 1 => any::<u8>()], 1..60), cut in any::<(prop::sample::Index, prop::sample::Index)>()) {
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
