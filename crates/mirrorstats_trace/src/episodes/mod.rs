pub mod answers;
pub mod episode;
pub mod episode_hash;
mod fields;
pub mod identification;
pub mod moments;
