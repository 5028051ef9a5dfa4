pub mod answers;
pub mod episode;
pub mod episode_hash;
pub mod frame;
pub mod identification;
pub mod moments;
pub mod palette;
