//! Models that answered in place of the requested one, according to the recordings.

use serde_json::Value;

use crate::footers::model_id::{OWN_SERVER, answers_for};
use crate::read::open::TraceFile;
use mirrorstats_exact::escape::visible;

pub fn by_others(files: &[TraceFile]) -> Vec<String> {
    let note = |file: &TraceFile| {
        let recording = file.recording();
        let others: Vec<String> = others(&recording).into_iter().map(|id| format!("`{}`", visible(id))).collect();
        let asked = visible(recording["agent"]["id"].as_str().unwrap_or_default());
        let found = others.join(", ");
        (!others.is_empty())
            .then(|| format!("another model answered in {}: asked for `{asked}`, found {found}", file.name()))
    };
    files.iter().filter_map(note).collect()
}

fn others(recording: &Value) -> Vec<&str> {
    let agent = &recording["agent"];
    let patterns = agent["answers_as"].as_array().into_iter().flatten().filter_map(Value::as_str).map(str::to_owned);
    let patterns: Vec<String> = patterns.collect();
    let (Some(asked), false) = (
        agent["id"].as_str(),
        agent["backend"] == OWN_SERVER && patterns.is_empty() && agent["accepted_models"].is_null(),
    ) else {
        return Vec::new();
    };
    let parts = recording["fingerprints"].as_object().into_iter().flat_map(serde_json::Map::values);
    let mut others: Vec<&str> = parts.filter_map(|parts| parts["model"].as_str()).collect();
    others.retain(|returned| !answers_for(asked, returned, &patterns));
    others.sort_unstable();
    others.dedup();
    others
}
