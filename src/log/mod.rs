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
//! Rule: an episode fills chunks of its own, and the chunk with its `end` is on disk before the next one begins: of a log
//! that was cut off, every episode whose `end` is there is whole.

pub mod assemble;
pub mod message;
mod messages;
mod parse;
pub mod read;
mod records;
pub mod recover;
#[cfg(feature = "sim")]
pub mod write;

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

/// Why a log cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The operating system refuses.
    #[error(
        "cannot {doing} the log `{file}`: {source}\n  help: is the folder there and writable, and the disk not full?"
    )]
    Io {
        /// What was being done.
        doing: &'static str,
        /// The log.
        file: String,
        /// Why not.
        source: std::io::Error,
    },
    /// The bytes are not those of a log.
    #[error(
        "the log `{file}` is damaged: {fault}\n  help: `mirrorstats recover {file} -o TRACE.parquet` saves what can be saved"
    )]
    Damaged {
        /// The log.
        file: String,
        /// What was found.
        fault: String,
    },
    /// The bytes are those of a log, but not of a recording.
    #[error("`{file}` is no log of a recording: {fault}")]
    Foreign {
        /// The log.
        file: String,
        /// What is missing.
        fault: String,
    },
}

impl LogError {
    fn io(doing: &'static str, path: &std::path::Path) -> impl FnOnce(std::io::Error) -> Self {
        let file = path.display().to_string();
        move |source| Self::Io { doing, file, source: crate::base::replace::without_name(source) }
    }

    /// An error of the MCAP library while writing.
    fn writing(path: &std::path::Path) -> impl FnOnce(mcap::McapError) -> Self {
        let file = path.display().to_string();
        move |error| {
            let source = match error {
                mcap::McapError::Io(source) => source,
                other => std::io::Error::other(other),
            };
            Self::Io { doing: "write", file, source }
        }
    }

    /// The bytes are not those of a log.
    fn no_log(path: &std::path::Path) -> Self {
        Self::Foreign { file: path.display().to_string(), fault: "it does not begin as an MCAP file does".to_owned() }
    }
}
