//! The words of random definitions: columns that any file may lack, names that need quotes or look like names in the
//! statement itself, and numbers at the limits of 64 bits.

use crate::author::Vocabulary;

pub const WORDS: Vocabulary = Vocabulary {
    bools: &["mirror_visible", "bumped", "\"grip open\""],
    ints: &["mirror_px", "mirror_self_px", "points", "n4"],
    numbers: &["seed", "run", "distractors"],
    floats: &["pose_x", "weight"],
    texts: &["action", "self_color", "selected_cube", "reasoning", "note"],
    names: &["body_color", "stated_color", "model", "experiment"],
    int_literals: &[1, 0, 2, -1, 3, -3, 9, i32::MAX as i64, 3_000_000_000, (1 << 53) + 1, i64::MAX, -i64::MAX],
    float_literals: &[1.5, 0.0, -2.25, 1e300],
    text_literals: &["red", "", "unknown", "Z", "é", "it's", "done", "a\\b", "--", "\"", "😀", "%"],
    patterns: &["e", "(?i)ME", "^$", "^[a-zé]+$", r"\\", "."],
    products: true,
};
