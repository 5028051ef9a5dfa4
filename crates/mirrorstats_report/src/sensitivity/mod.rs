//! Cells as functions of the threshold of mirror evidence, and thresholds that change a conclusion.
//!
//! Rule: this module scores no episodes and tests nothing. The results for each threshold arrive as cells and
//! statistics ([`Level`]); it arranges them for people and for programs.

mod changes;
mod table;

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::Serialize;

use crate::layout::{MetricTable, key_field};
use crate::style::Style;
use mirrorstats_analysis::statistics::Statistics;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::number::{Decimal, full_precision};
use mirrorstats_metric::catalogs::catalog::Kind;
use mirrorstats_score::cells::{Cell, Cells, Group, KeyValue};
use mirrorstats_tables::{Table, Terminal, escape_markdown, wrapped};

pub use changes::{Change, Question, Says};

const HEADING: &str = "Where a conclusion changes";
const NONE: &str = "No conclusion changes.";
const ROOM: usize = 110;

#[derive(Clone, Debug)]
pub struct Level {
    /// The least number of pixels that counts as evidence; `None` for the unchanged definitions.
    pub px: Option<u32>,
    pub cells: Cells,
    pub statistics: Statistics,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reference {
    /// True if the evidence is the recorded one; definitions may use other evidence.
    pub is_recorded: bool,
    /// The thresholds in pixels that the footers declare, ascending; empty if they declare none.
    pub px: Vec<u64>,
}

impl Reference {
    /// `recorded`, or `defined` if the definitions use evidence other than the recorded one.
    pub const fn word(&self) -> &'static str {
        if self.is_recorded { "recorded" } else { "defined" }
    }

    /// The word and the thresholds: `recorded (60 px)`.
    pub fn words(&self) -> String {
        let px: Vec<String> = self.px.iter().map(u64::to_string).collect();
        match px.split_last().filter(|_| self.is_recorded) {
            None => self.word().to_owned(),
            Some((last, [])) => format!("{} ({last} px)", self.word()),
            Some((last, rest)) => format!("{} ({} and {last} px)", self.word(), rest.join(", ")),
        }
    }
}

/// Cells as functions of the threshold.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Sensitivity {
    /// The definition file's own name.
    pub definitions: String,
    /// SHA-256 of the definitions as they are.
    pub definitions_hash: String,
    /// The meaning of a null threshold: `recorded (60 px)`.
    pub reference: String,
    /// The thresholds that the recordings' footers declare, ascending, px.
    pub recorded_px: Vec<u64>,
    /// The thresholds that were tried, ascending, px.
    pub thresholds: Vec<u32>,
    /// The columns that cells are grouped by.
    pub by: Vec<String>,
    /// The metrics that depend on the threshold, in the order of the definitions.
    pub metrics: Vec<String>,
    /// The metrics that do not.
    pub independent: Vec<String>,
    /// Every cell under every threshold.
    pub cells: Vec<ThresholdCell>,
    /// The thresholds with another conclusion than under the recorded definitions.
    pub changes: Vec<Change>,
    /// The cells as one table.
    #[serde(skip)]
    pub table: MetricTable,
}

/// One cell under one threshold.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ThresholdCell {
    /// The group, by the columns grouped by.
    pub key: IndexMap<String, KeyValue>,
    /// The threshold, px; null for the definitions as they are.
    pub threshold: Option<u32>,
    /// The metric.
    pub metric: String,
    /// A rate or a quantity.
    pub kind: Kind,
    /// The episodes of the group.
    pub episodes: u64,
    /// Those in which the metric is defined.
    pub n: u64,
    /// The sum of the values; for a rate, the successes.
    pub sum: Decimal,
    /// The arithmetic mean; null where nothing is defined.
    pub mean: Option<f64>,
    /// The standard error that the definition asks for; null without one.
    pub se: Option<f64>,
}

impl Sensitivity {
    /// Arranges the results: the unchanged definitions first, then the thresholds, ascending. `metrics` depend on the
    /// threshold, `independent` do not.
    ///
    /// # Panics
    /// If there are no levels.
    pub fn from_levels(
        levels: &[Level],
        reference: &Reference,
        metrics: &[String],
        independent: &[String],
        style: &Style,
    ) -> Self {
        let first = &levels.first().expect("the definitions as they are come first").cells;
        let keys = table::keys(levels, first, style);
        Self {
            definitions: first.catalog.name.clone(),
            definitions_hash: first.catalog.hash.clone(),
            reference: reference.words(),
            recorded_px: reference.px.clone(),
            thresholds: levels.iter().filter_map(|level| level.px).collect(),
            by: first.by.clone(),
            metrics: metrics.to_vec(),
            independent: independent.to_vec(),
            cells: cells(levels, &keys, metrics),
            changes: changes::changes(levels, reference, metrics),
            table: table::Rows { levels, first, reference, metrics, style }.table(&keys, independent),
        }
    }

    pub fn render(&self, on: Terminal) -> String {
        let mut lines = vec![String::new()];
        if self.changes.is_empty() {
            lines.push(NONE.to_owned());
        } else {
            lines.push(HEADING.to_owned());
            let sentences = self.changes.iter().map(|change| format!("- {}", visible(&change.sentence)));
            lines.extend(sentences.flat_map(|sentence| wrapped(&sentence, on.width.unwrap_or(ROOM), 2)));
        }
        self.table.printed().terminal(on) + &lines.join("\n") + "\n"
    }

    pub fn markdown(&self) -> String {
        let text = self.table.printed().markdown();
        if self.changes.is_empty() {
            return text + "\n" + NONE + "\n";
        }
        let sentences: Vec<String> =
            self.changes.iter().map(|change| format!("- {}\n", escape_markdown(&change.sentence))).collect();
        text + "\n**" + HEADING + ".**\n\n" + &sentences.concat()
    }

    pub fn latex(&self) -> String {
        self.table.printed().latex()
    }

    /// As comma-separated values in full precision: the key columns, then `threshold,metric,n,sum,mean,se`. The
    /// threshold of the unchanged definitions is `recorded` or `defined`; undefined values are empty.
    pub fn csv(&self) -> String {
        let tail = ["threshold", "metric", "n", "sum", "mean", "se"];
        let header = self.by.iter().map(String::as_str).chain(tail);
        Table::of_texts(header).with(self.cells.iter().map(|cell| record(self, cell))).csv()
    }
}

fn record(found: &Sensitivity, cell: &ThresholdCell) -> Vec<String> {
    let word = || found.reference.split(' ').next().unwrap_or_default().to_owned();
    let number = |value: Option<f64>| value.map(full_precision).unwrap_or_default();
    let keys = cell.key.values().map(key_field);
    keys.chain([
        cell.threshold.map_or_else(word, |px| px.to_string()),
        cell.metric.clone(),
        cell.n.to_string(),
        if cell.n == 0 { String::new() } else { cell.sum.to_string() },
        number(cell.mean),
        number(cell.se),
    ])
    .collect()
}

fn cells(levels: &[Level], keys: &[Vec<KeyValue>], metrics: &[String]) -> Vec<ThresholdCell> {
    let groups = keys.iter().flat_map(|key| levels.iter().filter_map(|level| Some((level, level.group(key)?))));
    let cells = |(level, group)| metrics.iter().filter_map(move |metric| ThresholdCell::of(level, group, metric));
    groups.flat_map(cells).collect()
}

impl ThresholdCell {
    fn of(level: &Level, group: &Group, name: &str) -> Option<Self> {
        let Cell { metric, moments, .. } = level.cells.of_metric(group, name)?;
        Some(Self {
            key: level.cells.by.iter().cloned().zip(group.key.iter().cloned()).collect(),
            threshold: level.px,
            metric: name.to_owned(),
            kind: metric.kind,
            episodes: group.episodes,
            n: moments.n,
            sum: metric.sums(moments)[0],
            mean: metric.mean(moments),
            se: metric.standard_error(moments),
        })
    }
}

impl Level {
    fn group(&self, key: &[KeyValue]) -> Option<&Group> {
        self.cells.groups.iter().find(|group| group.key == key)
    }
}
