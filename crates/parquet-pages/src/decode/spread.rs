//! Values stored without the nulls between them, moved to their rows.

use arrow::buffer::BooleanBuffer;

use super::rle::Number;
use crate::bits::Bits;

pub(crate) fn spread_keys<N: Number>(keys: &[N], valid: &BooleanBuffer) -> Vec<N> {
    let mut spread = vec![N::default(); valid.len()];
    let mut keys = keys;
    for (start, end) in valid.set_slices() {
        let (here, rest) = keys.split_at(keys.len().min(end - start));
        spread[start..start + here.len()].copy_from_slice(here);
        keys = rest;
    }
    spread
}

pub(crate) fn spread_bits(bits: &BooleanBuffer, valid: &BooleanBuffer) -> BooleanBuffer {
    let mut spread = Bits::with_capacity(valid.len());
    let mut taken = bits.offset();
    for (start, end) in valid.set_slices() {
        spread.fill(start - spread.count(), false);
        spread.append(bits.values(), taken, end - start);
        taken += end - start;
    }
    spread.fill(valid.len() - spread.count(), false);
    spread.finish()
}
