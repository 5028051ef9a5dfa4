//! MCAP logs of recordings: writing, reading, and recovery of truncated ones.
//!
//! A log holds the episodes of a model and an experiment, in the order of the trace. Any MCAP viewer plays it. The JSON
//! topics alone hold everything in the trace, so a trace can be made from a log.
//!
//! | topic | schema | contents |
//! |---|---|---|
//! | `/episode` | `mirrorstats.Episode` (JSON) | `begin` with the constants of an episode; `end` with its number of steps |
//! | `/camera` | `foxglove.CompressedImage` | the frame of a step, PNG |
//! | `/tf` | `foxglove.FrameTransforms` | poses of the moving bodies and the eye |
//! | `/scene` | `foxglove.SceneUpdate` | everything as shapes |
//! | `/census` | `mirrorstats.Census` (JSON) | visibility, counted in pixels |
//! | `/decision` | `mirrorstats.Decision` (JSON) | the row of the trace |
//!
//! Every message of step t has the time of the row's `frame_time`: the step's place on the time line, not a clock time.
//! The metadata record `mirrorstats.recording` holds the same as the trace's footer.
//!
//! Rule: each episode has its own chunks, one per step during recording, so that it can be read before it ends. The
//! chunk with its `end` is on disk before the next episode begins. So in a truncated log, every episode with an `end`
//! is complete.

pub mod assemble;
mod chunk;
mod error;
#[cfg(feature = "view")]
pub mod frames;
pub mod message;
pub mod read;
mod records;
pub mod recover;
pub mod to_trace;
#[cfg(feature = "sim")]
pub mod write;

pub use error::LogError;

pub const METADATA: &str = "mirrorstats.recording";
/// The key in it: the JSON of the trace's footer.
pub const METADATA_KEY: &str = "recording";

pub mod topic {
    pub const EPISODE: &str = "/episode";
    pub(crate) const CAMERA: &str = "/camera";
    pub const TRANSFORMS: &str = "/tf";
    pub const SCENE: &str = "/scene";
    pub const CENSUS: &str = "/census";
    pub(crate) const DECISION: &str = "/decision";
}
