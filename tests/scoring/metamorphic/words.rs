//! The words of random conditions and definitions.

use crate::author::Vocabulary;
use crate::differential::words::WORDS;

/// Integers that sums and products of a few of them do not lead out of 64 bits: an overflow is no answer.
pub const TAME: Vocabulary = Vocabulary {
    ints: &["mirror_px", "mirror_self_px", "n4"],
    int_literals: &[1, 0, 2, -1, 3, -3, 9, 3_000_000_000],
    products: false,
    ..WORDS
};

/// The same, for definitions in which engines need not agree on which part of a sum overflows.
pub const EVERYWHERE: Vocabulary = TAME;
