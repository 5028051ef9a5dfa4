//! The driver's answer and its table.

use std::path::Path;

use serde::Deserialize;
use serde_json::Number;

use super::cause::Failed;
use super::{Job, SparkError, Written, cause, request, source};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;
use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::logical_plan::plan::Output;
use mirrorstats_score::tables::builder::TableBuilder;
use mirrorstats_score::tables::table::{EpisodeKey, EpisodeTable, Header};
use mirrorstats_trace::diagnostic::{Code, Finding};
use mirrorstats_trace::schema::colors;

#[derive(Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Answer {
    Done(Written),
    Refused(Refused),
    Failed(Failed),
    Late {},
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Refused {
    Rows { expected: u64, found: u64 },
    Empty(String),
    Column { file: String, column: String, expected: String, found: Option<String> },
    Rule { fault: Option<Fault>, faults: u64 },
}

#[derive(Debug, Deserialize)]
pub(super) struct Fault {
    episode: Option<String>,
    /// The index in [`request::rules`].
    rule: usize,
    found: String,
}

impl Refused {
    pub(super) fn error(self, job: Job<'_>) -> SparkError {
        match self {
            Self::Rows { expected, found } => SparkError::Rows { expected, found },
            Self::Empty(uri) => SparkError::Empty { uri: source::without_user(&uri) },
            Self::Column { file, column, expected, found } => SparkError::Column {
                file: source::without_user(&file),
                column,
                expected: cause::kind(&expected).to_owned(),
                found: found.map_or_else(|| "no such column".to_owned(), |found| format!("the type `{found}`")),
            },
            Self::Rule { fault: None, .. } => {
                let finding = Finding::new(Code::NoEpisodes, job.sources.name(), "at least one row", "none");
                SparkError::Rule { finding: Box::new(finding), more: 0 }
            }
            Self::Rule { fault: Some(fault), faults } => match finding(fault, job) {
                Some(finding) => SparkError::Rule { finding: Box::new(finding), more: faults.saturating_sub(1) },
                None => SparkError::Answer { words: "a rule that was not asked for".into() },
            },
        }
    }
}

fn finding(fault: Fault, job: Job<'_>) -> Option<Finding> {
    let rule = request::rules(job).into_iter().nth(fault.rule)?;
    let mut finding = Finding::new(rule.code, job.sources.name(), rule.expected, fault.found).in_column(&rule.column);
    if let Some(color) = colors::column(&rule.column).filter(|_| rule.code == Code::InvalidColor) {
        let quoted = finding.found.strip_prefix('`').and_then(|found| found.strip_suffix('`'));
        let text = quoted.unwrap_or(&finding.found).to_owned();
        finding.found = format!("`{}`", text.escape_debug());
        finding.help = color.help(&text, job.sources.palette.as_ref());
    }
    Some(match fault.episode {
        Some(episode) => finding.in_episode(episode),
        None => finding,
    })
}

/// A line holds an episode's names, labels and some numbers.
const LONGEST_LINE: Limit = Limit::new("bytes in a line of an answer", 64 << 20);

pub(super) fn table(path: &Path, job: Job<'_>) -> Result<EpisodeTable, SparkError> {
    let fault = |words: String| SparkError::Answer { words };
    let outputs = &job.definitions.plan.outputs;
    let header = Header {
        catalog: job.definitions.catalog.clone(),
        labels: job.labels.to_vec(),
        metrics: outputs.iter().map(|output| output.name.clone()).collect(),
    };
    let mut builder = TableBuilder::new(header);
    for line in input::lines(path, LONGEST_LINE).map_err(|error| fault(error.to_string()))? {
        let line = line.map_err(|error| fault(error.to_string()))?;
        let row: Row = serde_json::from_slice(&line).map_err(|error| fault(error.to_string()))?;
        let Row(episode_id, model, experiment, seed, run, metrics, labels) = row;
        if (metrics.len(), labels.len()) != (outputs.len(), job.labels.len()) {
            return Err(fault(format!("an invalid episode: {}", String::from_utf8_lossy(&line).trim_end())));
        }
        let key = EpisodeKey { experiment, model, seed, run, episode_id };
        let stored = |(value, output): (&Option<Number>, &Output)| {
            value
                .as_ref()
                .map(|value| {
                    let exact: Option<Decimal> = value.to_string().parse().ok();
                    let units = exact.and_then(|exact| exact.with_places(output.decimals.into()));
                    units
                        .and_then(|exact| i64::try_from(exact.units()).ok())
                        .ok_or_else(|| fault(format!("`{}` is {value}", output.name)))
                })
                .transpose()
        };
        let metrics = metrics.iter().zip(outputs).map(stored).collect::<Result<Vec<_>, _>>()?;
        builder.push(key.as_ref(), labels.iter().map(Option::as_deref), metrics);
    }
    Ok(builder.finish())
}

#[derive(Deserialize)]
struct Row(String, String, String, i32, i32, Vec<Option<Number>>, Vec<Option<String>>);

#[cfg(test)]
mod tests {
    use super::{Fault, finding, request};
    use crate::spark::source::Sources;
    use crate::spark::{Job, check};
    use mirrorstats_metric::definitions::Definitions;
    use mirrorstats_score::vocabulary::schema_columns;
    use mirrorstats_trace::diagnostic::Code;
    use mirrorstats_trace::schema::colors::palette::Palette;

    #[test]
    fn a_color_is_refused_in_the_words_of_the_native_engine() {
        let definitions = Definitions::load("paper", &schema_columns()).unwrap();
        let sources = Sources::uris(vec!["s3a://b/x".to_owned()]);
        let job = Job { definitions: &definitions, labels: &[], sources: &sources };
        let columns = request::columns(&definitions.plan, &[]);
        let rules = check::rules(columns.iter().map(|(name, _)| name.as_str()), &definitions.catalog, None);
        for column in ["body_color", "self_color", "selected_cube"] {
            let is_wanted = |rule: &check::Rule| rule.code == Code::InvalidColor && rule.column == column;
            let rule = rules.iter().position(is_wanted).unwrap();
            let fault = Fault { episode: Some("e".to_owned()), rule, found: "`Red\u{a0}`".to_owned() };
            let found = finding(fault, job).unwrap().to_string();
            assert!(
                found.starts_with(&format!("invalid-color: s3a://b/x, episode `e`, column `{column}`\n")),
                "{found}"
            );
            assert!(found.ends_with("\n  found `Red\\u{a0}`\n  help: did you mean `red`?"), "{found}");
        }
    }

    #[test]
    fn a_color_outside_of_the_palette_is_refused_with_the_nearest_one() {
        let definitions = Definitions::load("paper", &schema_columns()).unwrap();
        let palette = Palette::of_names(["teal", "magenta"]).ok();
        let sources = Sources { names: vec!["a.parquet".to_owned()], groups: Vec::new(), rows: Some(1), palette };
        let job = Job { definitions: &definitions, labels: &[], sources: &sources };
        let columns = request::columns(&definitions.plan, &[]);
        let names = columns.iter().map(|(name, _)| name.as_str());
        let rules = check::rules(names, &definitions.catalog, sources.palette.as_ref());
        let is_wanted = |rule: &check::Rule| rule.code == Code::InvalidColor && rule.column == "body_color";
        let rule = rules.iter().position(is_wanted).unwrap();
        let fault = Fault { episode: Some("e".to_owned()), rule, found: "`magneta`".to_owned() };
        let expected = "invalid-color: a.parquet, episode `e`, column `body_color`\n  \
                        expected a colour of the palette (teal, magenta)\n  found `magneta`\n  help: did you mean `magenta`?";
        assert_eq!(finding(fault, job).unwrap().to_string(), expected);
    }
}
