//! What a trace says of how it was recorded: all that replay needs, and nothing that two recordings of the same differ in.

use serde_json::{Value, json};

use crate::agent::Player;
use crate::sim::config::WorldConfig;
use crate::sim::scene::SCENE_VERSION;

/// The version of this object's shape.
const VERSION: u32 = 1;

/// The value of `mirrorstats.recording`; the store adds the seeds.
pub fn recording(config: &WorldConfig, player: &dyn Player) -> Value {
    json!({
        "version": VERSION,
        "scene_version": SCENE_VERSION,
        "agent": player.description(),
        "view": { "width": config.eye.width, "height": config.eye.height_px, "fov_y": config.eye.fovy },
        "visibility_threshold_px": config.evidence.mirror_self_px,
        "world": config,
        "world_hash": config.hash(),
    })
}
