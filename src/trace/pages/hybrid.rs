//! Parquet's hybrid of runs and packed bits, read as spans.
//!
//! Source: the Parquet format's "Run Length Encoding / Bit-Packing Hybrid (RLE = 3)".

use bytes::Bytes;

use super::Unfit;
use crate::base::bits::word;

/// Numbers of a fixed width, as they are stored: runs of one number, and packed ones.
pub(super) struct Hybrid {
    data: Bytes,
    at: usize,
    width: usize,
    left: Left,
}

/// What is left of the run under way.
#[derive(Clone, Copy)]
enum Left {
    Same {
        value: u32,
        count: usize,
    },
    /// `count` numbers from this bit of the data.
    Packed {
        bit: usize,
        count: usize,
    },
}

/// Some numbers, one after the other.
pub(super) enum Span<'a> {
    Same { value: u32, count: usize },
    Packed(Packed<'a>),
}

/// Packed numbers.
pub(super) struct Packed<'a> {
    data: &'a [u8],
    bit: usize,
    width: usize,
    pub(super) count: usize,
}

impl Hybrid {
    /// Numbers of `width` bits, at most 32.
    pub(super) fn new(data: Bytes, width: u8) -> Result<Self, Unfit> {
        let width = usize::from(width);
        if width > 32 {
            return Err(Unfit);
        }
        Ok(Self { data, at: 0, width, left: Left::Same { value: 0, count: 0 } })
    }

    /// The next numbers, `most` of them at most and one at least.
    pub(super) fn span(&mut self, most: usize) -> Result<Span<'_>, Unfit> {
        while matches!(self.left, Left::Same { count: 0, .. } | Left::Packed { count: 0, .. }) {
            self.left = self.run()?;
        }
        Ok(match &mut self.left {
            Left::Same { value, count: left } => {
                let count = most.min(*left);
                *left -= count;
                Span::Same { value: *value, count }
            }
            Left::Packed { bit, count: left } => {
                let count = most.min(*left);
                let packed = Packed { data: &self.data, bit: *bit, width: self.width, count };
                *left -= count;
                *bit += count * self.width;
                Span::Packed(packed)
            }
        })
    }

    fn run(&mut self) -> Result<Left, Unfit> {
        let header = self.varint()?;
        let count = usize::try_from(header >> 1).map_err(|_| Unfit)?;
        if header & 1 == 0 {
            let bytes = self.width.div_ceil(8);
            let stored = self.data.get(self.at..self.at + bytes).ok_or(Unfit)?;
            let value = stored.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte));
            self.at += bytes;
            return Ok(Left::Same { value, count });
        }
        // Groups of eight. A writer may cut the last one short where the data end.
        let bytes = count.checked_mul(self.width).ok_or(Unfit)?.min(self.data.len() - self.at);
        let held = (bytes * 8).checked_div(self.width).unwrap_or(usize::MAX);
        let left = Left::Packed { bit: self.at * 8, count: held.min(count.saturating_mul(8)) };
        self.at += bytes;
        if held == 0 { Err(Unfit) } else { Ok(left) }
    }

    fn varint(&mut self) -> Result<u64, Unfit> {
        let mut value = 0;
        for shift in (0..35).step_by(7) {
            let byte = *self.data.get(self.at).ok_or(Unfit)?;
            self.at += 1;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(Unfit)
    }
}

/// Numbers of which a byte boundary follows.
const GROUP: usize = 8;

impl Packed<'_> {
    /// The numbers, behind those of `out`.
    pub(super) fn append(&self, out: &mut Vec<i32>) {
        let start = out.len();
        out.resize(start + self.count, 0);
        self.unpack(&mut out[start..]);
    }

    /// Gives each number to `take`.
    pub(super) fn each(&self, take: impl FnMut(u32)) {
        let mut numbers = vec![0; self.count];
        self.unpack(&mut numbers);
        numbers.into_iter().map(i32::cast_unsigned).for_each(take);
    }

    fn unpack(&self, out: &mut [i32]) {
        // Whole groups begin at bytes; before the first and after the last one numbers are taken singly.
        let to_byte = (0..GROUP).find(|ahead| (self.bit + ahead * self.width).is_multiple_of(8)).unwrap_or(0);
        let (before, rest) = out.split_at_mut(to_byte.min(out.len()));
        self.singly(self.bit, before);
        let bit = self.bit + before.len() * self.width;
        let (groups, after) = rest.as_chunks_mut::<GROUP>();
        match self.width {
            1 => self.groups::<1>(bit, groups),
            2 => self.groups::<2>(bit, groups),
            3 => self.groups::<3>(bit, groups),
            4 => self.groups::<4>(bit, groups),
            5 => self.groups::<5>(bit, groups),
            6 => self.groups::<6>(bit, groups),
            7 => self.groups::<7>(bit, groups),
            8 => self.groups::<8>(bit, groups),
            _ => self.singly(bit, groups.as_flattened_mut()),
        }
        self.singly(bit + groups.len() * GROUP * self.width, after);
    }

    /// Groups of numbers of `WIDTH` bits from the start of a byte: one word each.
    fn groups<const WIDTH: usize>(&self, bit: usize, groups: &mut [[i32; GROUP]]) {
        let mask = (1_u32 << WIDTH) - 1;
        for (at, group) in groups.iter_mut().enumerate() {
            let word = word(self.data, bit / 8 + at * WIDTH);
            for (place, number) in group.iter_mut().enumerate() {
                *number = (low(word >> (place * WIDTH)) & mask).cast_signed();
            }
        }
    }

    fn singly(&self, bit: usize, out: &mut [i32]) {
        let mask = low((1_u64 << self.width) - 1);
        for (at, number) in out.iter_mut().enumerate() {
            let bit = bit + at * self.width;
            *number = (low(word(self.data, bit / 8) >> (bit % 8)) & mask).cast_signed();
        }
    }

    /// The data and the bit at which the numbers begin, for numbers of one bit.
    pub(super) fn bits(&self) -> (&[u8], usize) {
        debug_assert_eq!(self.width, 1, "bits are numbers of one bit");
        (self.data, self.bit)
    }
}

/// The lower half of a word.
#[expect(clippy::cast_possible_truncation, reason = "the lower half is what is asked for")]
fn low(word: u64) -> u32 {
    word as u32
}

#[cfg(test)]
mod tests {
    use bytes::Bytes;
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::{Hybrid, Span};

    /// What some runs decode to, read `most` at a time.
    fn read(data: Vec<u8>, width: u8, count: usize, most: usize) -> Vec<u32> {
        let mut hybrid = Hybrid::new(Bytes::from(data), width).ok().unwrap();
        let mut found = Vec::new();
        while found.len() < count {
            match hybrid.span(most.min(count - found.len())).ok().unwrap() {
                Span::Same { value, count } => found.extend(std::iter::repeat_n(value, count)),
                Span::Packed(packed) => {
                    let mut numbers = Vec::new();
                    packed.append(&mut numbers);
                    found.extend(numbers.into_iter().map(i32::cast_unsigned));
                }
            }
        }
        found
    }

    fn packed(values: &[u32], width: u8) -> Vec<u8> {
        let groups = values.len().div_ceil(8);
        let mut bytes = vec![0; groups * usize::from(width)];
        for (at, value) in values.iter().enumerate() {
            for bit in (0..usize::from(width)).filter(|bit| value >> bit & 1 == 1) {
                let place = at * usize::from(width) + bit;
                bytes[place / 8] |= 1 << (place % 8);
            }
        }
        bytes.insert(0, u8::try_from(groups << 1 | 1).unwrap());
        bytes
    }

    proptest! {
        #[test]
        fn what_was_packed_comes_back(width in 1..=32_u8, words in vec(any::<u32>(), 1..80), same in any::<u32>(), most in 1..40_usize) {
            let mask = u32::MAX >> (32 - width);
            let mut values: Vec<u32> = words.iter().map(|word| word & mask).collect();
            let mut data = packed(&values, width);
            values.resize(values.len().div_ceil(8) * 8, 0);
            data.push(7 << 1);
            data.extend(&(same & mask).to_le_bytes()[..usize::from(width.div_ceil(8))]);
            values.extend([same & mask; 7]);
            prop_assert_eq!(read(data, width, values.len(), most), values);
        }

        #[test]
        fn any_bytes_give_numbers_or_an_error(data in vec(any::<u8>(), 0..40), width in 0..=40_u8) {
            let Ok(mut hybrid) = Hybrid::new(Bytes::from(data), width) else { return Ok(()) };
            for _ in 0..50 {
                let Ok(span) = hybrid.span(1000) else { break };
                if let Span::Packed(packed) = span {
                    packed.each(drop);
                }
            }
        }
    }
}
