//! `croissant.json`: metadata of the data set with the fields of responsible AI.
//!
//! The Hub makes the core of it from the tables. This file adds what only the author knows, and names every source
//! with its hash: a second record beside the manifest.

use std::path::Path;

use mirrorstats_report::bundle::Output;
use mirrorstats_trace::read::open::TraceSet;
use serde_json::{Value, json};

use crate::PublishError;
use crate::manifest::{Settings, list, output_of};
use crate::sources::TRACES;

pub(crate) const NAME: &str = "croissant.json";

/// The metadata of every data set in the order of its keys, with the words for what the author leaves open.
const TEMPLATE: &str = include_str!("../../../assets/publish/croissant.json");
const PEOPLE: &str =
    "Answers of people under codes. Names and links are not in the data. People who declined or withdrew are left out.";
const GENERATED_BY: &str =
    concat!("mirrorstats ", env!("CARGO_PKG_VERSION"), ": `experiments/`, `world/` and `prompts/` have the settings.");

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
    let is_recorded = traces.files().iter().any(|file| file.recording()["world"].is_object());
    let mut root: Value = serde_json::from_str(TEMPLATE).expect("the template is constant and tested");
    root["name"] = about.title().into();
    root["description"] = about.description().into();
    root["creator"] = about.authors.iter().map(|name| json!({"@type": "sc:Person", "name": name})).collect();
    if traces.files().iter().any(|file| file.declares("participant")) {
        root["rai:personalSensitiveInformation"] = PEOPLE.into();
    }
    root["rai:hasSyntheticData"] = about.synthetic.unwrap_or(is_recorded).into();
    root["prov:wasDerivedFrom"] = about.derived_from.iter().map(|from| json!({"@id": from})).collect();
    root["prov:wasGeneratedBy"] = GENERATED_BY.into();
    root["distribution"] = sources(base)?.iter().map(file_object).collect();
    for (key, stated) in [
        ("license", &about.license),
        ("url", &about.url),
        ("rai:dataLimitations", &about.limitations),
        ("rai:dataBiases", &about.biases),
        ("rai:personalSensitiveInformation", &about.personal),
        ("rai:dataUseCases", &about.uses),
        ("rai:dataSocialImpact", &about.impact),
        ("prov:wasGeneratedBy", &about.generated_by),
    ] {
        if let Some(words) = stated {
            root[key] = words.as_str().into();
        }
    }
    Ok(serde_json::to_string_pretty(&root).expect("a tree of JSON values") + "\n")
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
