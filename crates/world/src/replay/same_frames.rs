//! Frames of a replay, compared by digest with those that the agent saw.

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::divergence::Divergence;
use trace::frame::{Frame, Likeness, TOLERANCE, likeness};
use trace::renderer::{self, Renderer};

/// How the frames of a replay compare with those that agents saw.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct FramesAnswer {
    /// Frames of the same bytes.
    pub equal: usize,
    /// Frames of other bytes whose digests have the same levels within `tolerance`.
    pub alike: usize,
    /// Other frames.
    pub different: usize,
    /// Levels of 255 by which the means of 8 x 6 blocks may differ in frames that are alike.
    pub tolerance: u8,
    /// What drew the recorded frames.
    pub recorded_with: Vec<Renderer>,
    /// What drew those of the replay; null where nothing could be drawn.
    pub drawn_with: Option<Renderer>,
    /// The reason why no frames were compared.
    pub not_compared: Option<String>,
}

impl FramesAnswer {
    /// Adds a trace: the recorded and the current renderer of its frames.
    pub(super) fn add_trace(&mut self, recording: Option<&Value>, drawn_with: Option<&Renderer>) {
        self.tolerance = TOLERANCE;
        self.drawn_with = drawn_with.cloned();
        for renderer in recording.map(renderer::of_recording).unwrap_or_default() {
            if !self.recorded_with.contains(&renderer) {
                self.recorded_with.push(renderer);
            }
        }
    }

    /// Compares a frame; returns the divergence if the picture differs.
    pub(super) fn add(&mut self, (episode_id, t): (&str, i32), recorded: &str, frame: &Frame) -> Option<Divergence> {
        let drawn = frame.digest();
        match likeness(recorded, &drawn) {
            Some(Likeness::Equal) => self.equal += 1,
            Some(Likeness::Alike) => self.alike += 1,
            Some(Likeness::Different) | None => {
                self.different += 1;
                return Some(Divergence {
                    episode_id: episode_id.to_owned(),
                    t,
                    column: "frame_digest".to_owned(),
                    expected: recorded.to_owned(),
                    found: drawn,
                });
            }
        }
        None
    }
}

/// Returns true if the trace has digests of its agents' frames.
pub(super) fn has_digests(recording: Option<&Value>) -> bool {
    recording.is_some_and(|recording| recording["frame_digest"].is_string())
}
