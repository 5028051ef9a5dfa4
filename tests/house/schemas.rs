//! Checks `schemas/` against the types. `MIRRORSTATS_WRITE_SCHEMAS=1 cargo test --test house schemas` writes it.

use std::fs;
use std::path::PathBuf;

use mirrorstats::cli::printed_schema;
use mirrorstats_agents::reply;
use mirrorstats_analysis::changes::Changes;
use mirrorstats_analysis::gate::Gate;
use mirrorstats_analysis::plan::Plan;
use mirrorstats_analysis::plan::register::RegisteredPlan;
use mirrorstats_analysis::statistics::{Sequential, Statistics};
use mirrorstats_experiment::Experiment;
use mirrorstats_log::message::{Decision, EpisodeMessage};
use mirrorstats_metric::logical_plan::explain::Explanation;
use mirrorstats_metric::shape::DefinitionFile;
use mirrorstats_report::bundle::Manifest;
use mirrorstats_report::published::audit::Audit;
use mirrorstats_report::published::comparison::PublishedComparison;
use mirrorstats_report::sensitivity::Sensitivity;
use mirrorstats_report::style::StyleSheet;
use mirrorstats_score::evidence::Evidence;
use mirrorstats_study::agreement::LabelAgreement;
use mirrorstats_study::import::ImportAnswer;
use mirrorstats_study::quality::QualityCheckAnswer;
use mirrorstats_study::verify::Verification;
use mirrorstats_trace::beside::label_line::LabelLine;
use mirrorstats_trace::info::Info;
use mirrorstats_trace::schema::describe::SchemaDocument;
use mirrorstats_trace::validate::Validation;
use mirrorstats_trace::write::seal::SealAnswer;
use schemars::schema_for;
use serde_json::{Value, json};

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("schemas")
}

/// Every file of the folder: formats that people write, and JSON that the program reads and prints.
fn current() -> Vec<(&'static str, Value)> {
    let mut schemas = vec![
        ("audit", json!(schema_for!(Audit))),
        ("check", json!(schema_for!(QualityCheckAnswer))),
        ("comparison", json!(schema_for!(PublishedComparison))),
        ("decision", json!(schema_for!(Decision))),
        ("definitions-explain", json!(schema_for!(Explanation))),
        ("definitions", json!(schema_for!(DefinitionFile))),
        ("diff", printed_schema::<Changes>()),
        ("episode", json!(schema_for!(EpisodeMessage))),
        ("gate", printed_schema::<Gate>()),
        ("import", printed_schema::<ImportAnswer>()),
        ("info", json!(schema_for!(Info))),
        ("label", json!(schema_for!(LabelLine))),
        ("labels", json!(schema_for!(LabelAgreement))),
        ("manifest", printed_schema::<Manifest>()),
        ("plan", json!(schema_for!(Plan))),
        ("plan-register", json!(schema_for!(RegisteredPlan))),
        ("seal", json!(schema_for!(SealAnswer))),
        ("score-explain", printed_schema::<Evidence>()),
        ("sensitivity", json!(schema_for!(Sensitivity))),
        ("stats", printed_schema::<Statistics>()),
        ("stats-sequential", json!(schema_for!(Sequential))),
        ("style", json!(schema_for!(StyleSheet))),
        ("trace", json!(SchemaDocument::current())),
        ("validation", printed_schema::<Validation>()),
        ("verify", json!(schema_for!(Verification))),
    ];
    schemas.extend(mirrorstats::cli::schemas());
    #[cfg(feature = "view")]
    schemas.extend([
        ("about", json!(schema_for!(mirrorstats_publish::about::About))),
        ("bundle", json!(schema_for!(mirrorstats_publish::Manifest))),
    ]);
    #[cfg(feature = "sim")]
    schemas.extend([
        ("participants-remove", json!(schema_for!(mirrorstats_record::participants::Removed))),
        ("census", json!(schema_for!(mirrorstats_sim::visibility::Visibility))),
        ("replay", json!(schema_for!(mirrorstats_record::replay::verify::ReplayAnswer))),
        ("exec-message", json!(schema_for!(mirrorstats_agents::exec::message::Message))),
        ("models", json!(schema_for!(mirrorstats_vlm::models::Models))),
        ("lost", json!(schema_for!(mirrorstats_record::failures::LostEpisode))),
        ("scene", json!(schema_for!(mirrorstats_sim::scene::Scene))),
        ("world-config", json!(schema_for!(mirrorstats_sim::config::WorldConfig))),
    ]);
    schemas
}

#[test]
fn the_schema_files_are_current() {
    for (name, value) in current() {
        let path = folder().join(format!("{name}.schema.json"));
        let text = format!("{value:#}\n");
        if std::env::var_os("MIRRORSTATS_WRITE_SCHEMAS").is_some() {
            fs::write(&path, &text).unwrap();
        }
        let committed = fs::read_to_string(&path).unwrap_or_default();
        assert!(committed == text, "{name}.schema.json is not current; MIRRORSTATS_WRITE_SCHEMAS=1 writes it");
    }
}

/// A reply's schema without the keywords for people.
fn keys_and_types(schema: &Value) -> Value {
    let mut schema = schema.clone();
    let object = schema.as_object_mut().unwrap();
    object.retain(|keyword, _| keyword != "$schema" && keyword != "title");
    for property in object["properties"].as_object_mut().unwrap().values_mut() {
        property.as_object_mut().unwrap().retain(|keyword, _| keyword != "description" && keyword != "enum");
    }
    schema
}

/// People and other harnesses get these files; agents get only the structure.
#[test]
fn reply_schemas_match_their_files() {
    let replies =
        [(Experiment::E1, "reply-cubes", "Reply in E1 to E4"), (Experiment::E5, "reply-exploration", "Reply in E5")];
    for (experiment, name, title) in replies {
        let schema = reply::schema(title, &experiment);
        let text = fs::read_to_string(folder().join(format!("{name}.schema.json"))).unwrap();
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), schema);
        let without_words = [schema.clone(), reply::structure(&experiment)].map(|schema| keys_and_types(&schema));
        assert_eq!(without_words[0], without_words[1], "{name}");
    }
}

#[test]
fn the_folder_holds_nothing_else() {
    // These types need the feature `sim`; their files always exist.
    let of_worlds = [
        "census",
        "exec-message",
        "lost",
        "participants-remove",
        "record",
        "record-forecast",
        "replay",
        "scene",
        "world-config",
    ];
    let names = current().into_iter().map(|(name, _)| name).chain(of_worlds);
    let expected: std::collections::BTreeSet<String> = names.map(|name| format!("{name}.schema.json")).collect();
    let found =
        fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    assert_eq!(expected, found);
}
