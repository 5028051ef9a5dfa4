//! The words of random conditions and definitions.

use crate::author::Vocabulary;
use crate::differential::words::WORDS;

/// Integers so small that sums and products of a few stay within 64 bits, because an overflow gives no answer.
pub const TAME: Vocabulary = Vocabulary {
    ints: &["mirror_px", "mirror_self_px", "n4"],
    int_literals: &[1, 0, 2, -1, 3, -3, 9, 3_000_000_000],
    products: false,
    ..WORDS
};

/// The same words, for definitions in which engines may overflow at different parts of a sum.
pub const EVERYWHERE: Vocabulary = TAME;
