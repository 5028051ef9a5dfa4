//! The JSON Schemas of command outputs, if no crate has the type, and of files that other programs write.

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, schema_for};
use serde_json::{Value, json};

use super::commands::definitions::CheckAnswer;
use super::commands::experiments::ExperimentsAnswer;
use super::commands::study::report::ReportAnswer;
use super::commands::table::rescore::RescoreAnswer;
use super::commands::trace::schema::Name;
use mirrorstats_log::to_trace::RecoverAnswer;

/// The schema of a printed answer: keys that are always present are required.
pub fn printed_schema<T: JsonSchema>() -> Value {
    json!(SchemaSettings::draft2020_12().for_serialize().into_generator().into_root_schema_for::<T>())
}

/// The schemas, each with the name of its file in `schemas/`.
pub fn schemas() -> Vec<(&'static str, Value)> {
    #[cfg_attr(not(any(feature = "sim", feature = "view")), expect(unused_mut, reason = "the feature adds to them"))]
    let mut schemas = vec![
        ("definitions-check", json!(schema_for!(CheckAnswer))),
        ("experiment", Name::Experiment.document()),
        ("experiments", Name::Experiments.document()),
        ("experiments-check", json!(schema_for!(ExperimentsAnswer))),
        ("recover", json!(schema_for!(RecoverAnswer))),
        ("report", json!(schema_for!(ReportAnswer))),
        ("reply-cubes", Name::ReplyCubes.document()),
        ("reply-exploration", Name::ReplyExploration.document()),
        ("rescore", json!(schema_for!(RescoreAnswer))),
        ("step", Name::Step.document()),
    ];
    #[cfg(feature = "sim")]
    schemas.extend([
        ("record", printed_schema::<super::commands::record::answer::RecordAnswer>()),
        ("record-forecast", json!(schema_for!(super::commands::record::forecast::ForecastAnswer))),
    ]);
    #[cfg(feature = "view")]
    schemas.extend([
        ("publish", json!(schema_for!(super::commands::study::publish::PublishAnswer))),
        ("publish-export", json!(schema_for!(super::commands::study::publish::ExportAnswer))),
    ]);
    schemas
}
