//! The driver's request: all of its input in one JSON file, in a private folder.

use std::collections::BTreeMap;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::check::{self, Rule};
use super::source::Group;
use super::{Cluster, Job, SparkError};
use mirrorstats_metric::columns::Type;
use mirrorstats_metric::logical_plan::plan::{Op, Plan};
use mirrorstats_metric::sql::{Dialect, lower};
use mirrorstats_score::format::{DEFINITIONS_KEY, HASH_KEY, KIND_KEY, SCORES_KIND};
use mirrorstats_trace::schema;

const KEYS: [(&str, &str); 5] =
    [("episode_id", "string"), ("model", "string"), ("experiment", "string"), ("seed", "int"), ("run", "int")];

pub(super) const TABLE: &str = "table.jsonl";
pub(super) const ANSWER: &str = "answer.json";

#[derive(Debug, Serialize)]
pub(super) struct Request<'a> {
    parent: u32,
    timeout: Option<NonZeroU32>,
    /// Settings that must not appear on a command line.
    settings: BTreeMap<&'a str, &'a str>,
    sources: &'a [Group],
    inspect: bool,
    columns: Vec<(String, &'static str)>,
    optional: Vec<String>,
    rows: Option<u64>,
    check: String,
    statement: String,
    results: Vec<(String, &'static str)>,
    metadata: BTreeMap<&'static str, String>,
    folder: Option<String>,
    table: PathBuf,
    answer: PathBuf,
}

impl<'a> Request<'a> {
    pub(super) fn new(
        job: Job<'a>,
        cluster: &'a Cluster,
        place: &Path,
        folder: Option<String>,
    ) -> Result<Self, SparkError> {
        let columns = columns(&job.definitions.plan, job.labels);
        let secrets = cluster.settings.iter().filter(|setting| setting.is_secret());
        Ok(Self {
            parent: std::process::id(),
            timeout: cluster.timeout_s,
            settings: secrets.map(|setting| (setting.key(), setting.value())).collect(),
            sources: &job.sources.groups,
            inspect: job.sources.rows.is_none(),
            rows: job.sources.rows,
            check: check::statement(&rules(job)),
            statement: statement(job)?,
            results: results(job),
            metadata: metadata(job)?,
            folder,
            table: place.join(TABLE),
            answer: place.join(ANSWER),
            optional: optional(&columns, job),
            columns,
        })
    }
}

/// The rules of the columns that are read; the driver names a broken one by its index.
pub(super) fn rules(job: Job<'_>) -> Vec<Rule> {
    let columns = columns(&job.definitions.plan, job.labels);
    let names = columns.iter().map(|(name, _)| name.as_str());
    check::rules(names, &job.definitions.catalog, job.sources.palette.as_ref())
}

/// Columns that some files may lack. The footer says whether a required column may be absent; it is read here for local
/// files only.
fn optional(columns: &[(String, &'static str)], job: Job<'_>) -> Vec<String> {
    let domain = check::domain_of(&job.definitions.catalog);
    let is_optional = |name: &str| {
        domain
            .column(name)
            .is_some_and(|column| column.default.is_some() && (job.sources.rows.is_some() || !column.required))
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
        let stored = schema::column(label).map(|column| column.stored.kind());
        add(label, if stored == Some(schema::Kind::Int) { "int" } else { "string" });
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
    let metrics = job.definitions.plan.outputs.iter().map(|output| {
        let ty = if output.decimals > 0 { "double" } else { "bigint" };
        (output.name.clone(), ty)
    });
    let labels = job.labels.iter().map(|label| (label.clone(), "string"));
    keys.into_iter().chain(metrics).chain(labels).collect()
}

fn metadata(job: Job<'_>) -> Result<BTreeMap<&'static str, String>, SparkError> {
    let catalog = &job.definitions.catalog;
    let definitions =
        serde_json::to_string(catalog).map_err(|error| SparkError::Answer { words: error.to_string() })?;
    let pairs = [(KIND_KEY, SCORES_KIND.to_owned()), (HASH_KEY, catalog.hash.clone()), (DEFINITIONS_KEY, definitions)];
    Ok(pairs.into())
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
            let sources = Sources::uris(Vec::new());
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
