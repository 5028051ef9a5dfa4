//! `croissant.json`: metadata of the data set with the fields of responsible AI.
//!
//! The Hub makes the core of it from the tables. This file adds what only the author knows, and names every source
//! with its hash: a second record beside the manifest.

use std::path::Path;

use mirrorstats_report::bundle::Output;
use mirrorstats_trace::read::open::TraceSet;
use serde_json::{Map, Value, json};

use crate::PublishError;
use crate::manifest::{Settings, list, output_of};
use crate::sources::TRACES;

pub(crate) const NAME: &str = "croissant.json";

/// The context of Croissant 1.0.
const CONTEXT: &str = include_str!("../../../assets/publish/croissant-context.json");

/// The files that a bundle is made from.
const SOURCES: [&str; 4] = [TRACES, "definitions", "styles", "prompts"];

/// The sources of a bundle.
pub(crate) fn sources(base: &Path) -> Result<Vec<Output>, PublishError> {
    let is_source = |path: &String| SOURCES.iter().any(|folder| path.starts_with(&format!("{folder}/")));
    list(base)?.into_iter().filter(is_source).map(|path| output_of(base, path)).collect()
}

/// The sources as a published `croissant.json` states them.
pub(crate) fn stated(text: &[u8]) -> Vec<(String, String)> {
    let root: Value = serde_json::from_slice(text).unwrap_or_default();
    let files = root["distribution"].as_array().into_iter().flatten();
    let pair = |file: &Value| Some((file["contentUrl"].as_str()?.to_owned(), file["sha256"].as_str()?.to_owned()));
    files.filter_map(pair).collect()
}

pub(crate) fn text(base: &Path, settings: &Settings, traces: &TraceSet) -> Result<String, PublishError> {
    let about = &settings.about;
    let has_people = traces.files().iter().any(|file| file.declares("participant"));
    let is_recorded = traces.files().iter().any(|file| file.recording()["world"].is_object());
    let or = |given: &Option<String>, default: &str| Value::from(given.as_deref().unwrap_or(default));
    let people = "Answers of people under codes. Names and links are not in the data. People who declined or withdrew are left out.";
    let nobody = "None: no person took part.";
    let context: Value = serde_json::from_str(CONTEXT).expect("the context is constant and tested");
    let mut root = Map::new();
    for (key, value) in [
        ("@context", context),
        ("@type", "sc:Dataset".into()),
        ("name", about.title().into()),
        ("description", about.description().into()),
        ("conformsTo", json!(["http://mlcommons.org/croissant/1.0", "http://mlcommons.org/croissant/RAI/1.0"])),
        ("license", or(&about.license, "unknown")),
        ("url", or(&about.url, "https://huggingface.co/datasets")),
        ("creator", about.authors.iter().map(|name| json!({"@type": "sc:Person", "name": name})).collect()),
        (
            "rai:dataLimitations",
            or(
                &about.limitations,
                "Scores hold for these models, prompts and scenes. `report/` names what the data cannot show.",
            ),
        ),
        ("rai:dataBiases", or(&about.biases, "Not examined.")),
        ("rai:personalSensitiveInformation", or(&about.personal, if has_people { people } else { nobody })),
        (
            "rai:dataUseCases",
            or(
                &about.uses,
                "Evaluation and comparison of agents. Not for training: a model trained on it can no longer be evaluated with it.",
            ),
        ),
        ("rai:dataSocialImpact", or(&about.impact, "Not examined.")),
        ("rai:hasSyntheticData", about.synthetic.unwrap_or(is_recorded).into()),
        ("prov:wasDerivedFrom", about.derived_from.iter().map(|from| json!({"@id": from})).collect()),
        (
            "prov:wasGeneratedBy",
            or(
                &about.generated_by,
                concat!(
                    "mirrorstats ",
                    env!("CARGO_PKG_VERSION"),
                    ": `experiments/`, `world/` and `prompts/` have the settings."
                ),
            ),
        ),
        ("distribution", sources(base)?.iter().map(file_object).collect()),
    ] {
        root.insert(key.to_owned(), value);
    }
    Ok(serde_json::to_string_pretty(&root).expect("a map of JSON values") + "\n")
}

fn file_object(file: &Output) -> Value {
    let format = match file.path.rsplit('.').next() {
        Some("parquet") => "application/x-parquet",
        Some("toml") => "application/toml",
        Some("jsonl") => "application/jsonlines",
        Some("txt") => "text/plain",
        _ => "application/octet-stream",
    };
    json!({
        "@type": "cr:FileObject", "@id": file.path, "name": file.path, "contentUrl": file.path,
        "contentSize": format!("{} B", file.bytes), "encodingFormat": format, "sha256": file.sha256,
    })
}
