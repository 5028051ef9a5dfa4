//! Reads Parquet's hybrid of runs and packed bits as spans.
//!
//! Source: the Parquet format's "Run Length Encoding / Bit-Packing Hybrid (RLE = 3)".

use bytes::Bytes;

use crate::bits::word;
use crate::error::Unsupported;

/// Stored numbers of a fixed width: runs of one number, and packed ones.
pub(crate) struct Hybrid {
    data: Bytes,
    at: usize,
    width: usize,
    run: Run,
    count: usize,
    left: usize,
}

#[derive(Clone, Copy)]
enum Run {
    Same(u32),
    /// Packed numbers from this bit of the data.
    Packed(usize),
}

pub(crate) enum Span<'a> {
    Same { value: u32, count: usize },
    Packed(Packed<'a>),
}

pub(crate) struct Packed<'a> {
    data: &'a [u8],
    bit: usize,
    width: usize,
    pub(crate) count: usize,
}

impl Hybrid {
    /// At most `most` numbers of `width` bits; at most 32 bits.
    pub(crate) fn new(data: Bytes, width: u8, most: usize) -> Result<Self, Unsupported> {
        let width = usize::from(width);
        if width > 32 {
            return Err(Unsupported);
        }
        Ok(Self { data, at: 0, width, run: Run::Same(0), count: 0, left: most })
    }

    /// The next numbers: at least one, at most `most`.
    #[inline]
    pub(crate) fn span(&mut self, most: usize) -> Result<Span<'_>, Unsupported> {
        while self.count == 0 {
            self.next_run()?;
        }
        let count = most.min(self.count);
        self.count -= count;
        Ok(match &mut self.run {
            Run::Same(value) => Span::Same { value: *value, count },
            Run::Packed(bit) => {
                let packed = Packed { data: &self.data, bit: *bit, width: self.width, count };
                *bit += count * self.width;
                Span::Packed(packed)
            }
        })
    }

    /// Takes the next `count` numbers span by span.
    #[inline]
    pub(crate) fn each_span(&mut self, mut count: usize, mut take: impl FnMut(Span<'_>)) -> Result<(), Unsupported> {
        while count > 0 {
            let span = self.span(count)?;
            count -= span.count();
            take(span);
        }
        Ok(())
    }

    pub(crate) fn append<N: Number>(&mut self, count: usize, out: &mut Vec<N>) -> Result<(), Unsupported> {
        if self.width > N::WIDTH {
            return Err(Unsupported);
        }
        self.each_span(count, |span| {
            let start = out.len();
            match span {
                Span::Same { value, count } => out.resize(start + count, N::of(value)),
                Span::Packed(packed) => {
                    out.resize(start + packed.count, N::default());
                    packed.unpack(&mut out[start..]);
                }
            }
        })
    }

    fn next_run(&mut self) -> Result<(), Unsupported> {
        let data: &[u8] = &self.data;
        let (header, from) = varint(data, self.at)?;
        let count = usize::try_from(header >> 1).map_err(|_| Unsupported)?;
        if header & 1 == 0 {
            let stored = data.get(from..from + self.width.div_ceil(8)).ok_or(Unsupported)?;
            let value = stored.iter().rev().fold(0, |value, byte| value << 8 | u64::from(*byte));
            if count == 0 || count > self.left || value >> self.width != 0 {
                return Err(Unsupported);
            }
            self.run = Run::Same(low(value));
            (self.at, self.count, self.left) = (from + stored.len(), count, self.left - count);
            return Ok(());
        }
        // Groups of eight. A writer may cut the last one short at the end of the data.
        let stored = count.checked_mul(self.width).ok_or(Unsupported)?;
        let there = data.len() - from;
        let groups = count;
        let (bytes, count) =
            if stored <= there { (stored, count.saturating_mul(8)) } else { (there, there * 8 / self.width) };
        if count == 0 || groups > MOST_GROUPS {
            return Err(Unsupported);
        }
        self.run = Run::Packed(from * 8);
        (self.at, self.count, self.left) = (from + bytes, count, self.left.saturating_sub(count));
        Ok(())
    }

    pub(crate) fn finish(&self) -> Result<(), Unsupported> {
        let is_over = matches!(self.run, Run::Packed(_)) || self.count == 0;
        if is_over && self.data[self.at..].iter().all(|byte| *byte == 0) { Ok(()) } else { Err(Unsupported) }
    }

    /// Checks the end after all values are taken. Any bytes may follow the last group. DuckDB pads its last run to 256
    /// values, which damage to a length can imitate: only zeros may follow it. The same holds without values.
    pub(crate) fn finish_values(&self) -> Result<(), Unsupported> {
        let is_last_group = match self.run {
            Run::Same(_) => self.count == 0 && self.at > 0,
            Run::Packed(_) => self.count < GROUP,
        };
        if is_last_group { Ok(()) } else { self.finish() }
    }
}

pub(crate) fn varint(data: &[u8], mut at: usize) -> Result<(u64, usize), Unsupported> {
    let mut value = 0;
    for shift in (0..35).step_by(7) {
        let byte = *data.get(at).ok_or(Unsupported)?;
        at += 1;
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Ok((value, at));
        }
    }
    Err(Unsupported)
}

/// Splits data at the length that comes first: the bytes within it, and the rest.
pub(crate) fn prefixed(data: &Bytes) -> Result<(Bytes, Bytes), Unsupported> {
    let length = data.first_chunk().map(|length| u32::from_le_bytes(*length)).ok_or(Unsupported)?;
    let end = usize::try_from(length).ok().and_then(|length| length.checked_add(4)).ok_or(Unsupported)?;
    if end > data.len() {
        return Err(Unsupported);
    }
    Ok((data.slice(4..end), data.slice(end..)))
}

impl Span<'_> {
    pub(crate) fn count(&self) -> usize {
        match self {
            Self::Same { count, .. } => *count,
            Self::Packed(packed) => packed.count,
        }
    }
}

/// Numbers in a group; a group ends at a byte boundary.
const GROUP: usize = 8;
/// The longest run that the Parquet library accepts.
const MOST_GROUPS: usize = i32::MAX as usize / GROUP;

pub(crate) trait Number: Copy + Default + From<u8> {
    const WIDTH: usize;

    fn of(stored: u32) -> Self;
}

impl Number for u8 {
    const WIDTH: usize = 8;

    #[expect(clippy::cast_possible_truncation, reason = "the number fits")]
    fn of(stored: u32) -> Self {
        stored as Self
    }
}

impl Number for i32 {
    const WIDTH: usize = 32;

    fn of(stored: u32) -> Self {
        stored.cast_signed()
    }
}

impl Packed<'_> {
    pub(crate) fn each(&self, mut take: impl FnMut(u32)) {
        self.blocks(|some| some.iter().for_each(|number| take(number.cast_unsigned())));
    }

    pub(crate) fn blocks(&self, mut take: impl FnMut(&[i32])) {
        let mut numbers = [0_i32; 64];
        for first in (0..self.count).step_by(numbers.len()) {
            let count = numbers.len().min(self.count - first);
            let some = &mut numbers[..count];
            Self { bit: self.bit + first * self.width, ..*self }.unpack(some);
            take(some);
        }
    }

    fn unpack<N: Number>(&self, out: &mut [N]) {
        // Whole groups start at bytes; the numbers before the first and after the last one are read singly.
        let to_byte = (0..GROUP).find(|ahead| (self.bit + ahead * self.width).is_multiple_of(8)).unwrap_or(0);
        let (before, rest) = out.split_at_mut(to_byte.min(out.len()));
        self.singly(self.bit, before);
        let bit = self.bit + before.len() * self.width;
        let (groups, after) = rest.as_chunks_mut::<GROUP>();
        match self.width {
            1 => self.groups::<1, N>(bit, groups),
            2 => self.groups::<2, N>(bit, groups),
            3 => self.groups::<3, N>(bit, groups),
            4 => self.groups::<4, N>(bit, groups),
            5 => self.groups::<5, N>(bit, groups),
            6 => self.groups::<6, N>(bit, groups),
            7 => self.groups::<7, N>(bit, groups),
            8 => self.groups::<8, N>(bit, groups),
            _ => self.singly(bit, groups.as_flattened_mut()),
        }
        self.singly(bit + groups.len() * GROUP * self.width, after);
    }

    /// Groups of numbers of `WIDTH` bits from the start of a byte: one word each.
    fn groups<const WIDTH: usize, N: Number>(&self, bit: usize, groups: &mut [[N; GROUP]]) {
        for (at, group) in groups.iter_mut().enumerate() {
            *group = spread::<WIDTH>(word(self.data, bit / 8 + at * WIDTH)).to_le_bytes().map(N::from);
        }
    }

    fn singly<N: Number>(&self, bit: usize, out: &mut [N]) {
        let mask = low((1_u64 << self.width) - 1);
        for (at, number) in out.iter_mut().enumerate() {
            let bit = bit + at * self.width;
            *number = N::of(low(word(self.data, bit / 8) >> (bit % 8)) & mask);
        }
    }

    pub(crate) fn bits(&self) -> (&[u8], usize) {
        debug_assert_eq!(self.width, 1, "bits are numbers of one bit");
        (self.data, self.bit)
    }
}

/// Eight numbers of `WIDTH` bits, each moved to its own byte: halves are separated, then quarters, then eighths.
fn spread<const WIDTH: usize>(packed: u64) -> u64 {
    let lowest = |count: usize| (1_u64 << (count * WIDTH)) - 1;
    let half = lowest(4);
    let halves = packed & half | (packed >> (4 * WIDTH) & half) << 32;
    let quarter = lowest(2) * 0x0000_0001_0000_0001;
    let quarters = halves & quarter | (halves >> (2 * WIDTH) & quarter) << 16;
    let one = lowest(1) * 0x0001_0001_0001_0001;
    quarters & one | (quarters >> WIDTH & one) << 8
}

#[expect(clippy::cast_possible_truncation, reason = "the lower half is what is asked for")]
fn low(word: u64) -> u32 {
    word as u32
}

#[cfg(test)]
mod tests {
    use bytes::Bytes;
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::{Hybrid, Number, Span};

    fn read<N: Number + Into<i64>>(data: &[u8], width: u8, count: usize, most: usize) -> Vec<i64> {
        let mut hybrid = Hybrid::new(Bytes::copy_from_slice(data), width, count).ok().unwrap();
        let mut found: Vec<N> = Vec::new();
        while found.len() < count {
            hybrid.append(most.min(count - found.len()), &mut found).ok().unwrap();
        }
        found.into_iter().map(Into::into).collect()
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
        fn packed_values_round_trip(width in 1..=32_u8, words in vec(any::<u32>(), 1..80), same in any::<u32>(), most in 1..40_usize) {
            let mask = u32::MAX >> (32 - width);
            let mut values: Vec<u32> = words.iter().map(|word| word & mask).collect();
            let mut data = packed(&values, width);
            values.resize(values.len().div_ceil(8) * 8, 0);
            data.push(7 << 1);
            data.extend(&(same & mask).to_le_bytes()[..usize::from(width.div_ceil(8))]);
            values.extend([same & mask; 7]);
            let expected: Vec<i64> = values.iter().map(|value| value.cast_signed().into()).collect();
            prop_assert_eq!(&read::<i32>(&data, width, values.len(), most), &expected);
            if width <= 8 {
                prop_assert_eq!(read::<u8>(&data, width, values.len(), most), expected);
            } else {
                let mut narrow: Vec<u8> = Vec::new();
                prop_assert!(Hybrid::new(data.into(), width, values.len()).ok().unwrap().append(1, &mut narrow).is_err());
            }
        }

        #[test]
        fn any_bytes_give_numbers_or_an_error(data in vec(any::<u8>(), 0..40), width in 0..=40_u8) {
            let Ok(mut hybrid) = Hybrid::new(Bytes::from(data), width, 50_000) else { return Ok(()) };
            for _ in 0..50 {
                let Ok(span) = hybrid.span(1000) else { break };
                if let Span::Packed(packed) = span {
                    packed.each(drop);
                }
            }
        }
    }
}
