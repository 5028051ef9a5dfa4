pub mod answered;
pub mod checksums;
pub mod declared;
pub mod declared_experiment;
pub mod model_id;
pub mod renderer;

use serde_json::Value;

/// Parses the recording in a footer; null if it is missing or not JSON, since it declares nothing then.
pub(crate) fn recording(text: Option<&str>) -> Value {
    text.and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default()
}
