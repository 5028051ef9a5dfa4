pub mod answers;
pub mod episode;
pub mod episode_hash;
pub mod frame;
pub mod labels;
pub mod lost;
pub mod palette;
pub mod replies;
