//! A fingerprint of how an episode was recorded, from a few hashes: a sample mixes no fingerprints.
//!
//! Rule: equal recordings have equal fingerprints, and everything that can affect an agent is in one of the parts.

use serde_json::{Map, Value, json};

use mirrorstats_exact::hash;
use mirrorstats_trace::footers::renderer::Renderer;

/// Digits of a fingerprint's id: enough for all recordings of a study, and short in a table.
const DIGITS: usize = 16;
/// The keys of an experiment that do not affect episodes.
const WORDS: [&str; 6] = ["title", "order", "chance", "reference", "definitions", "definitions_hash"];
/// The keys of an agent's description that are separate parts.
const SAMPLING: [&str; 4] = ["temperature", "max_output_tokens", "reasoning_effort", "extra_body"];

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fingerprint {
    /// The value of the column `fingerprint`: the beginning of the hash of the parts.
    pub id: String,
    /// SHA-256 of `world`, `prompts`, `reply_schema`, `agent` and `sampling`, and the answering `model`; null if not
    /// applicable. In plain text, the `renderer` of the frames, if the agent sees them.
    pub parts: Value,
}

impl Fingerprint {
    /// The fingerprint of an episode, from its trace's metadata and the model's id as the provider returned it.
    /// `renderer` drew the frames that the agent saw, if any.
    pub fn new(recording: &Value, model: Option<&str>, renderer: Option<&Renderer>) -> Self {
        let mut agent = recording["agent"].as_object().cloned().unwrap_or_default();
        let mut experiment = recording["experiment"].clone();
        if let Some(experiment) = experiment.as_object_mut() {
            experiment.retain(|key, _| !WORDS.contains(&key.as_str()));
        }
        let prompts =
            experiment.as_object_mut().and_then(|experiment| experiment.remove("prompt_hash")).unwrap_or_default();
        // Scripts read neither.
        let reads = !agent.contains_key("scripted");
        let given = |value: &Value| (reads && !value.is_null()).then(|| hash_of(value));
        let taken = SAMPLING.iter().filter_map(|key| Some(((*key).to_owned(), agent.remove(*key)?)));
        let sampling: Map<String, Value> = taken.collect();
        let world = json!([recording["world_hash"], recording["scene_version"], experiment]);
        let mut parts = json!({
            "world": hash_of(&world),
            "prompts": given(&prompts),
            "reply_schema": given(&recording["reply_schema_hash"]),
            "agent": hash_of(&Value::Object(agent)),
            "sampling": (!sampling.is_empty()).then(|| hash_of(&Value::Object(sampling))),
            "model": model,
        });
        // Absent, not null: agents without frames have no such part in their fingerprints.
        if let Some(renderer) = renderer {
            parts["renderer"] = json!(renderer);
        }
        let mut id = hash_of(&parts);
        id.truncate(DIGITS);
        Self { id, parts }
    }
}

fn hash_of(value: &Value) -> String {
    let mut sorted = value.clone();
    sorted.sort_all_objects();
    hash::of_bytes(sorted.to_string().as_bytes())
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::{Fingerprint, Renderer};

    fn recording() -> Value {
        json!({
            "world_hash": "w", "scene_version": 1, "reply_schema_hash": "r",
            "experiment": { "name": "E1", "title": "One", "prompt_hash": "p", "steps": 7 },
            "agent": { "id": "x", "temperature": 0.2 },
        })
    }

    #[test]
    fn each_change_affects_one_part_of_the_fingerprint() {
        let base = Fingerprint::new(&recording(), Some("x-1"), None);
        let changed = |change: &dyn Fn(&mut Value), model| {
            let mut other = recording();
            change(&mut other);
            let other = Fingerprint::new(&other, model, None);
            assert_ne!(base.id, other.id);
            let (a, b) = (base.parts.as_object().unwrap(), other.parts.as_object().unwrap());
            let keys: Vec<&String> = a.keys().filter(|key| a[*key] != b[*key]).collect();
            assert_eq!(keys.len(), 1, "{keys:?}");
            keys[0].clone()
        };
        let same = |_: &mut Value| {};
        assert_eq!(changed(&|value| value["world_hash"] = json!("v"), Some("x-1")), "world");
        assert_eq!(changed(&|value| value["scene_version"] = json!(2), Some("x-1")), "world");
        assert_eq!(changed(&|value| value["experiment"]["steps"] = json!(8), Some("x-1")), "world");
        assert_eq!(changed(&|value| value["experiment"]["prompt_hash"] = json!("q"), Some("x-1")), "prompts");
        assert_eq!(changed(&|value| value["reply_schema_hash"] = json!("s"), Some("x-1")), "reply_schema");
        assert_eq!(changed(&|value| value["agent"]["id"] = json!("y"), Some("x-1")), "agent");
        assert_eq!(changed(&|value| value["agent"]["temperature"] = json!(0.7), Some("x-1")), "sampling");
        assert_eq!(changed(&same, Some("x-2")), "model");
        assert_eq!(changed(&same, None), "model");
        let mut retitled = recording();
        retitled["experiment"]["title"] = json!("Another title");
        assert_eq!(Fingerprint::new(&retitled, Some("x-1"), None), base);
    }

    #[test]
    fn a_renderer_is_a_part_where_frames_are_seen() {
        let renderer = |processor: &str| Renderer {
            name: "llvmpipe (LLVM 15.0.6, 256 bits)".to_owned(),
            version: Some("4.5 Mesa 22.3.6".to_owned()),
            vendor: Some("Mesa".to_owned()),
            processor: Some(processor.to_owned()),
        };
        let unseen = Fingerprint::new(&recording(), None, None);
        let [one, other] = ["x86_64 avx2", "x86_64 limited to sse2"]
            .map(|processor| Fingerprint::new(&recording(), None, Some(&renderer(processor))));
        assert!(unseen.id != one.id && one.id != other.id);
        assert_eq!(unseen.parts.get("renderer"), None);
        assert_eq!(other.parts["renderer"]["processor"], "x86_64 limited to sse2");
        assert_eq!(unseen.parts.as_object().unwrap().len(), 6);
    }

    #[test]
    fn the_order_of_keys_does_not_matter() {
        let [one, other] = [r#"{"agent":{"a":1,"b":2}}"#, r#"{"agent":{"b":2,"a":1}}"#];
        let of = |text: &str| Fingerprint::new(&serde_json::from_str(text).unwrap(), None, None);
        assert_eq!(of(one), of(other));
        assert_eq!(of(one).id.len(), 16);
    }
}
