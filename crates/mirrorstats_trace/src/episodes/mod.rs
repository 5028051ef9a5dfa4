pub mod answers;
pub mod episode;
pub mod episode_hash;
mod fields;
pub mod moments;
