//! A trace's metadata on its recording: all that a replay needs; equal for equal recordings.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use mirrorstats_agents::{Player, reply};
use mirrorstats_experiment::{Experiment, Spec};
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::scene::SCENE_VERSION;
use mirrorstats_trace::footers::declared::Registration;
use mirrorstats_trace::schema::colors::Color;

/// A key that grows with the recorded episodes.
pub(super) const SEEDS: &str = "seeds";
/// A key that grows with the recorded episodes: their settings, by fingerprint.
pub(super) const FINGERPRINTS: &str = "fingerprints";

/// The version of this object's shape.
const VERSION: u32 = 3;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recordings(BTreeMap<Experiment, Value>);

impl Recordings {
    /// The metadata of some experiments; `condition` is absent for the default one.
    pub fn new(
        experiments: &[Experiment],
        config: &WorldConfig,
        player: &dyn Player,
        condition: Option<&str>,
        registration: Option<&Registration>,
    ) -> Self {
        let of = |experiment: &Experiment| recording(experiment, config, player, condition, registration);
        Self(experiments.iter().map(|experiment| (experiment.clone(), of(experiment))).collect())
    }

    /// The metadata of an experiment; null if it is not recorded.
    pub fn get(&self, experiment: &Experiment) -> &Value {
        self.0.get(experiment).unwrap_or(&Value::Null)
    }
}

/// The value of `mirrorstats.recording`; the store adds the seeds and fingerprints.
///
/// Episodes with equal scenes are pairs. A seed is no cluster: each of its runs has a separate room.
fn recording(
    experiment: &Spec,
    config: &WorldConfig,
    player: &dyn Player,
    condition: Option<&str>,
    registration: Option<&Registration>,
) -> Value {
    let config = &config.for_experiment(experiment);
    let mut recording = json!({
        "version": VERSION,
        "kind": "recording",
        "design": { "pairs": "scene", "cluster": null },
        "condition": condition.unwrap_or("default"),
        "scene_version": SCENE_VERSION,
        "experiment": experiment,
        "reply_schema_hash": reply::structure_hash(experiment),
        "palette": Color::ALL.map(Color::name),
        "agent": player.description(),
        "view": { "width": config.eye.width, "height": config.eye.height_px, "fov_y": config.eye.fovy },
        "visibility_threshold_px": config.evidence.mirror_self_px,
        "world": config,
        "world_hash": config.hash(),
    });
    if player.looks() {
        recording["frame_digest"] = json!(mirrorstats_trace::frame::DIGEST);
    }
    if let Some(registration) = registration {
        recording["registration"] = json!(registration);
    }
    recording
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}: expected {expected}, found {found}")]
pub(super) struct Difference {
    pub what: String,
    pub expected: String,
    pub found: String,
}

pub(super) fn difference(ours: &Value, theirs: &Value) -> Option<Difference> {
    // The scoring definitions do not affect episodes.
    let recorded = |value: &Value| {
        let mut value = value.clone();
        if let Some(experiment) = value.get_mut("experiment").and_then(Value::as_object_mut) {
            experiment.retain(|key, _| !["definitions", "definitions_hash"].contains(&key.as_str()));
        }
        value
    };
    let (ours, theirs) = (&recorded(ours), &recorded(theirs));
    let keys = |value: &Value| -> Vec<String> {
        value.as_object().map(|object| object.keys().cloned().collect()).unwrap_or_default()
    };
    let grows = |name: &String| [SEEDS, FINGERPRINTS].contains(&name.as_str());
    let mut names = keys(ours).into_iter().chain(keys(theirs)).filter(|name| !grows(name));
    let name = names.find(|name| ours.get(name) != theirs.get(name))?;
    Some(first_difference(&name, ours.get(&name), theirs.get(&name)))
}

fn first_difference(name: &str, ours: Option<&Value>, theirs: Option<&Value>) -> Difference {
    if let (Some(Value::Object(a)), Some(Value::Object(b))) = (ours, theirs) {
        let inner = a.keys().chain(b.keys()).find(|key| a.get(*key) != b.get(*key));
        if let Some(key) = inner {
            return first_difference(&format!("{name}.{key}"), a.get(key), b.get(key));
        }
    }
    let text = |value: Option<&Value>| value.map_or_else(|| "nothing".to_owned(), Value::to_string);
    Difference { what: name.to_owned(), expected: text(ours), found: text(theirs) }
}
