//! MCAP logs of recordings: in, out, and what can be saved of a cut one.
//!
//! A log holds the episodes of a model and an experiment, one after the other in the order of the trace. Any viewer of
//! MCAP plays it; the JSON topics alone hold all that the trace has, so that a trace can be made of a log.
//!
//! | topic | schema | what |
//! |---|---|---|
//! | `/episode` | `mirrorstats.Episode` (JSON) | `begin` with the constants of an episode; `end` with its number of steps |
//! | `/camera` | `foxglove.CompressedImage` | the frame of a step, PNG |
//! | `/tf` | `foxglove.FrameTransforms` | where the moving bodies and the eye are |
//! | `/scene` | `foxglove.SceneUpdate` | everything as shapes |
//! | `/census` | `mirrorstats.Census` (JSON) | what the eye could see, counted in pixels |
//! | `/decision` | `mirrorstats.Decision` (JSON) | the row of the trace |
//!
//! Every message of step t has the time of the row's `frame_time`, which is no clock's but the step's own place on the
//! time line; the metadata record `mirrorstats.recording` holds what the trace's footer does.
//!
//! Rule: an episode fills chunks of its own, one for each step while it is recorded, so that it can be read before it ends, and
//! the chunk with its `end` is on disk before the next one begins: of a log
//! that was cut off, every episode whose `end` is there is whole.

pub mod assemble;
mod chunk;
mod error;
#[cfg(feature = "view")]
pub mod frames;
pub mod message;
mod messages;
mod parse;
pub mod read;
mod records;
pub mod recover;
#[cfg(feature = "sim")]
pub mod write;

pub use error::LogError;

/// The name of the metadata record.
pub const METADATA: &str = "mirrorstats.recording";
/// The key in it: the JSON of the trace's footer.
pub const METADATA_KEY: &str = "recording";

/// The topics, in the order of their channels.
pub mod topic {
    /// Begin and end of episodes.
    pub const EPISODE: &str = "/episode";
    /// Frames.
    pub const CAMERA: &str = "/camera";
    /// Poses.
    pub const TRANSFORMS: &str = "/tf";
    /// Shapes.
    pub const SCENE: &str = "/scene";
    /// Pixel counts.
    pub const CENSUS: &str = "/census";
    /// Rows of the trace.
    pub const DECISION: &str = "/decision";
}
