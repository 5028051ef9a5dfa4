//! The driver's request: all of its input in one JSON file, in a private folder.

use std::fs;
use std::path::PathBuf;

use serde::Serialize;
use serde_json::{Map, Value};

use super::source::{Group, Sources};
use super::{Cluster, Job, SparkError, check};
use mirrorstats_exact::replace::TemporaryFolder;
use mirrorstats_metric::columns::Type;
use mirrorstats_metric::logical_plan::plan::{Op, Plan};
use mirrorstats_metric::sql::{Dialect, lower};
use mirrorstats_score::format::{DEFINITIONS_KEY, HASH_KEY, KIND_KEY, SCORES_KIND};
use mirrorstats_trace::schema;

const KEYS: [(&str, &str); 5] =
    [("episode_id", "string"), ("model", "string"), ("experiment", "string"), ("seed", "int"), ("run", "int")];

pub(super) const TABLE: &str = "table.jsonl";
pub(super) const ANSWER: &str = "answer.json";

/// The private folder of one submission: its request and the driver's answer.
pub(super) struct Place(TemporaryFolder);

impl Place {
    pub(super) fn new() -> Result<Self, SparkError> {
        // The request may hold secrets.
        let made = TemporaryFolder::private("spark");
        made.map(Self).map_err(|source| SparkError::System { what: "make a temporary folder".into(), source })
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(super) fn file(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, SparkError> {
        let path = self.path(name);
        fs::write(&path, bytes)
            .map_err(|source| SparkError::System { what: "write a temporary file".into(), source })?;
        Ok(path)
    }
}

#[derive(Debug, Serialize)]
pub(super) struct Request {
    parent: u32,
    timeout: Option<u32>,
    /// Settings that must not appear on a command line.
    settings: Map<String, Value>,
    sources: Vec<Group>,
    inspect: bool,
    columns: Vec<(String, &'static str)>,
    optional: Vec<String>,
    rows: Option<u64>,
    check: String,
    statement: String,
    results: Vec<(String, &'static str)>,
    metadata: Map<String, Value>,
    folder: Option<String>,
    table: String,
    answer: String,
}

impl Request {
    pub(super) fn new(
        job: Job<'_>,
        cluster: &Cluster,
        place: &Place,
        folder: Option<String>,
    ) -> Result<Self, SparkError> {
        let columns = columns(&job.definitions.plan, job.labels);
        let names = columns.iter().map(|(name, _)| name.as_str());
        let rules = check::rules(names, &job.definitions.catalog, job.sources.palette());
        let secrets = cluster.settings.iter().filter(|setting| setting.is_secret());
        let rows = match job.sources {
            Sources::Files { rows, .. } => Some(*rows),
            Sources::Uris(_) => None,
        };
        Ok(Self {
            parent: std::process::id(),
            timeout: cluster.timeout_s.map(std::num::NonZeroU32::get),
            settings: secrets.map(|setting| (setting.key().to_owned(), setting.value().into())).collect(),
            sources: job.sources.groups(),
            inspect: rows.is_none(),
            rows,
            check: check::statement(&rules),
            statement: statement(job)?,
            results: results(job),
            metadata: metadata(job)?,
            folder,
            table: place.path(TABLE).display().to_string(),
            answer: place.path(ANSWER).display().to_string(),
            optional: optional(&columns, job),
            columns,
        })
    }
}

/// Columns that some files may lack. The footer says whether a required column may be absent; it is read here for local
/// files only.
fn optional(columns: &[(String, &'static str)], job: Job<'_>) -> Vec<String> {
    let knows_footers = matches!(job.sources, Sources::Files { .. });
    let domain = check::domain_of(&job.definitions.catalog);
    let is_optional = |name: &str| {
        domain.column(name).is_some_and(|column| column.default.is_some() && (knows_footers || !column.required))
    };
    columns.iter().map(|(name, _)| name).filter(|name| is_optional(name)).cloned().collect()
}

pub(super) fn columns(plan: &Plan, labels: &[String]) -> Vec<(String, &'static str)> {
    let mut columns: Vec<(String, &str)> = KEYS.map(|(name, kind)| (name.to_owned(), kind)).to_vec();
    columns.push(("t".to_owned(), "int"));
    let mut add = |name: &str, kind| {
        if columns.iter().all(|(known, _)| known != name) {
            columns.push((name.to_owned(), kind));
        }
    };
    for id in plan.needed() {
        let node = plan.node(id);
        if let Op::Column(name) = &node.op {
            add(name, kind(node.ty));
        }
    }
    for label in labels {
        let stored = mirrorstats_trace::schema::column(label).map(|column| column.stored.kind());
        add(label, if stored == Some(mirrorstats_trace::schema::Kind::Int) { "int" } else { "string" });
    }
    columns
}

const fn kind(ty: Type) -> &'static str {
    match ty {
        Type::Bool => "bool",
        Type::Int => "int",
        Type::Float => "float",
        Type::Text => "string",
    }
}

fn statement(job: Job<'_>) -> Result<String, SparkError> {
    let scores = lower(&job.definitions.plan, Dialect::Spark)?;
    if job.labels.is_empty() {
        return Ok(scores);
    }
    let number = 0..job.labels.len();
    let read = job.labels.iter().zip(number.clone()).map(|(name, at)| {
        let label = format!("MIN(CAST(s.{name} AS STRING))");
        match schema::column(name).and_then(schema::Column::default_text) {
            None => format!("{label} AS l{at}"),
            Some(text) => format!("COALESCE({label}, {}) AS l{at}", Dialect::Spark.text(text)),
        }
    });
    let labels = format!(
        "SELECT s.episode_id AS episode_id, {} FROM steps s GROUP BY s.episode_id",
        read.collect::<Vec<_>>().join(", ")
    );
    let names: Vec<String> = number.map(|at| format!("labels.l{at}")).collect();
    let names = names.join(", ");
    Ok(format!(
        "SELECT scores.*, {names}\nFROM (\n{scores}) scores\nJOIN ({labels}) labels ON scores.episode_id = labels.episode_id\n"
    ))
}

/// Keys, metrics, labels: the order of [`statement`].
fn results(job: Job<'_>) -> Vec<(String, &'static str)> {
    let keys = KEYS.map(|(name, kind)| (name.to_owned(), kind));
    let metrics = job.definitions.plan.outputs.iter().map(|output| (output.name.clone(), "bigint"));
    let labels = job.labels.iter().map(|label| (label.clone(), "string"));
    keys.into_iter().chain(metrics).chain(labels).collect()
}

fn metadata(job: Job<'_>) -> Result<Map<String, Value>, SparkError> {
    let catalog = &job.definitions.catalog;
    let definitions =
        serde_json::to_string(catalog).map_err(|error| SparkError::Answer { words: error.to_string() })?;
    let pairs = [(KIND_KEY, SCORES_KIND.to_owned()), (HASH_KEY, catalog.hash.clone()), (DEFINITIONS_KEY, definitions)];
    Ok(pairs.into_iter().map(|(key, value)| (key.to_owned(), Value::String(value))).collect())
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use sqlparser::ast::visit_relations;
    use sqlparser::dialect::MySqlDialect;
    use sqlparser::parser::Parser;

    use super::{check, columns, statement};
    use crate::spark::Job;
    use crate::spark::source::Sources;
    use mirrorstats_metric::definitions::Definitions;
    use mirrorstats_score::vocabulary::schema_columns;

    /// The tables that a statement names; MySQL's grammar has Spark's quotes, escapes and division.
    fn tables(statement: &str) -> Vec<String> {
        let parsed = Parser::parse_sql(&MySqlDialect {}, statement).unwrap();
        assert_eq!(parsed.len(), 1, "{statement}");
        let mut names = Vec::new();
        let _ = visit_relations(&parsed, |name| {
            names.push(name.to_string());
            ControlFlow::<()>::Continue(())
        });
        names
    }

    #[test]
    fn statements_read_only_the_view_of_the_traces() {
        let hostile = r#"
            open = true
            [experiment."\\' UNION SELECT * FROM secrets -- "]
            title = "x"
            [metric.M]
            value = "any(selected_cube = '\\'' FROM secrets; --' or regexp_like(self_color, '`secrets`\\''|--'))"
            "#;
        let definitions = [
            Definitions::load("paper", &schema_columns()),
            Definitions::load("extended", &schema_columns()),
            Definitions::from_toml("hostile", hostile, &schema_columns()),
            Definitions::from_toml("closed", &hostile.replace("open = true", ""), &schema_columns()),
        ];
        for definitions in definitions {
            let definitions = definitions.unwrap();
            let labels = ["body_color".to_owned(), "distractors".to_owned()];
            let sources = Sources::Uris(Vec::new());
            let job = Job { definitions: &definitions, labels: &labels, sources: &sources };
            let read = columns(&definitions.plan, &labels);
            let rules = check::rules(read.iter().map(|(name, _)| name.as_str()), &definitions.catalog, None);
            for text in [statement(job).unwrap(), check::statement(&rules)] {
                let own = |name: &String| {
                    let stage = name.strip_prefix('e').is_some_and(|number| number.parse::<usize>().is_ok());
                    stage || ["steps", "episodes", "faults"].contains(&name.as_str())
                };
                let others: Vec<String> = tables(&text).into_iter().filter(|name| !own(name)).collect();
                assert_eq!(others, Vec::<String>::new(), "{text}");
            }
        }
    }
}
