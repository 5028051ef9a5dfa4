//! The renderers of the frames that agents saw, from the fingerprints of recordings. Pixels differ between drivers,
//! their versions, and the processor features that they use.

use std::fmt;

use indexmap::IndexSet;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::read::open::TraceFile;
use mirrorstats_exact::escape::visible;

/// A renderer, the part `renderer` of a fingerprint.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
pub struct Renderer {
    /// What OpenGL calls it, `GL_RENDERER`; `unknown` where it says nothing.
    pub name: String,
    /// `GL_VERSION`: that of OpenGL and of the driver.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub version: Option<String>,
    /// `GL_VENDOR`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vendor: Option<String>,
    /// What it may use of the processor, where that draws.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub processor: Option<String>,
}

impl fmt::Display for Renderer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&visible(&self.name))?;
        [&self.version, &self.processor].into_iter().flatten().try_for_each(|part| write!(f, ", {}", visible(part)))
    }
}

pub fn of_recording(recording: &Value) -> Vec<Renderer> {
    let parts = recording["fingerprints"].as_object().into_iter().flat_map(serde_json::Map::values);
    once(parts.filter_map(|parts| serde_json::from_value(parts["renderer"].clone()).ok()))
}

pub fn of_files(files: &[TraceFile]) -> Vec<Renderer> {
    once(files.iter().flat_map(|file| of_recording(&file.recording())))
}

/// A sentence with the renderers of some traces; `None` if no agent saw frames, or the renderers are unknown.
pub fn note(renderers: &[Renderer]) -> Option<String> {
    let names: Vec<String> = renderers.iter().map(ToString::to_string).collect();
    match names.as_slice() {
        [] => None,
        [one] => Some(format!("agents saw frames drawn by {one}")),
        all => Some(format!("agents saw frames of {} renderers, which may differ: {}", all.len(), all.join("; "))),
    }
}

fn once(all: impl Iterator<Item = Renderer>) -> Vec<Renderer> {
    all.collect::<IndexSet<_>>().into_iter().collect()
}
