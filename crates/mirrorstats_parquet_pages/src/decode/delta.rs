//! The lengths of texts stored as differences from the previous text: a few bytes can expand to many long texts.
//!
//! Source: the Parquet format's "Delta Strings" and "Delta Encoding".

use super::rle::varint;
use crate::error::Unsupported;

/// More small blocks per block than any writer makes; the Parquet library allocates them before it reads any.
const MOST_SMALL_BLOCKS: u64 = 1024;

/// The header of a delta encoding of integers: values per block, small blocks per block, number of values, and the
/// position of the first value.
pub(crate) struct Opening {
    block: u64,
    small_blocks: u64,
    pub(crate) count: u64,
    at: usize,
}

impl Opening {
    pub(crate) fn read(data: &[u8]) -> Result<Self, Unsupported> {
        let (block, at) = varint(data, 0)?;
        let (small_blocks, at) = varint(data, at)?;
        let (count, at) = varint(data, at)?;
        let sound = (1..=MOST_SMALL_BLOCKS).contains(&small_blocks) && block > 0 && block.is_multiple_of(small_blocks);
        if sound { Ok(Self { block, small_blocks, count, at }) } else { Err(Unsupported) }
    }
}

pub(crate) fn sum(data: &[u8]) -> Result<u64, Unsupported> {
    let Opening { block, small_blocks, count, at } = Opening::read(data)?;
    let (first, mut at) = zigzag(data, at)?;
    if count == 0 {
        return Ok(0);
    }
    let (mut value, mut sum) = (first, u64::try_from(first).map_err(|_| Unsupported)?);
    let small_block = block / small_blocks;
    let mut left = count - 1;
    while left > 0 {
        let (least, next) = zigzag(data, at)?;
        let widths =
            data.get(next..).and_then(|rest| rest.get(..usize::try_from(small_blocks).ok()?)).ok_or(Unsupported)?;
        at = next + widths.len();
        for width in widths.iter().map(|width| u64::from(*width)) {
            if left == 0 {
                break;
            }
            let values = small_block.min(left);
            let packed = data.get(at..).ok_or(Unsupported)?;
            for place in 0..values {
                value = value.wrapping_add(least.wrapping_add(bits(packed, place * width, width)?.cast_signed()));
                sum = sum.saturating_add(u64::try_from(value).map_err(|_| Unsupported)?);
            }
            left -= values;
            at = at.saturating_add(usize::try_from(small_block.saturating_mul(width) / 8).map_err(|_| Unsupported)?);
        }
    }
    Ok(sum)
}

fn bits(packed: &[u8], from: u64, width: u64) -> Result<u64, Unsupported> {
    if width == 0 {
        return Ok(0);
    }
    if width > 64 {
        return Err(Unsupported);
    }
    let (byte, shift) = (usize::try_from(from / 8).map_err(|_| Unsupported)?, from % 8);
    let bytes = packed.get(byte..).filter(|rest| rest.len() as u64 * 8 >= shift + width).ok_or(Unsupported)?;
    let mut whole = [0; 16];
    let held = bytes.len().min(16);
    whole[..held].copy_from_slice(&bytes[..held]);
    let number = u128::from_le_bytes(whole) >> shift & ((1 << width) - 1);
    u64::try_from(number).map_err(|_| Unsupported)
}

fn zigzag(data: &[u8], at: usize) -> Result<(i64, usize), Unsupported> {
    let (number, at) = varint(data, at)?;
    Ok(((number >> 1).cast_signed() ^ -(number & 1).cast_signed(), at))
}

#[cfg(test)]
mod tests {
    use super::{Opening, sum};

    #[test]
    fn lengths_are_summed() {
        // Blocks of 128 in 4; 5 values: 7, and deltas of -2 -2 -2 9 from a least of -2, of 4 bits: 0 0 0 11.
        let data = [&[0x80, 1, 4, 5, 14, 3, 4, 0, 0, 0][..], &[0x00, 0xb0], &[0; 14]].concat();
        assert_eq!(sum(&data).ok(), Some(7 + 5 + 3 + 1 + 10));
        assert!(sum(&data[..11]).is_err(), "cut");
        // A thousand million equal values in no bits at all.
        let same = [0x80, 1, 4, 0x80, 0x94, 0xeb, 0xdc, 3, 14, 0, 0, 0, 0, 0];
        assert_eq!(Opening::read(&same).ok().map(|opening| opening.count), Some(1_000_000_000));
    }

    #[test]
    fn invalid_lengths_are_refused() {
        // A negative number; no small blocks; too many small blocks.
        for data in [&[0x80, 1, 4, 1, 13][..], &[0x80, 1, 0, 1, 14], &[0x80, 0x80, 0x80, 1, 0x80, 0x80, 8, 1, 14]] {
            assert!(sum(data).is_err(), "{data:?}");
        }
    }
}
