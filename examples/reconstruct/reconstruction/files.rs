//! The files of the fixture: one a pair.

use super::published::Pair;

/// The name of a pair's file, `E1-ministral-3-14b.parquet`.
pub fn name(pair: &Pair) -> String {
    format!("{}-{}.parquet", pair.experiment, slug(&pair.model))
}

/// A model's name in file names and episode ids: lowercase letters and digits, joined by hyphens.
pub fn slug(model: &str) -> String {
    let words: Vec<&str> = model.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty()).collect();
    words.join("-").to_ascii_lowercase()
}
