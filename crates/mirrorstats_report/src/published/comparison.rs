//! Compares one of our tables with a published one, cell by cell: printed mean, printed standard error, emphasis.
//!
//! Numbers are equal as values: a published `0.1` is our `0.10`. Every published cell is equal, excused (errata name
//! all its differences) or differing; a published cell that we lack differs. Cells that only we have are listed but not
//! compared.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use schemars::JsonSchema;
use serde::Serialize;

use crate::layout::{MetricCell, MetricRow, MetricTable};
use crate::published::errata::{Erratum, Field};
use crate::published::{CellLabel, PrintedCell, Published};
use crate::style::Style;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::number::Decimal;
use mirrorstats_tables::{Column, Emphasis, Look, Table, push_wrapped};

/// The result of a comparison.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[schemars(rename = "Comparison")]
pub struct PublishedComparison {
    /// The table of ours.
    pub table: String,
    /// The number of cells of the published table.
    pub cells: usize,
    /// The number of equal cells.
    pub same: usize,
    /// The number of cells that differ only as errata say.
    pub excused: usize,
    /// The number of differing cells.
    pub differing: usize,
    /// Every difference, in the order of the published table.
    pub differences: Vec<Difference>,
    /// Cells of ours that the published table has not.
    pub unpublished: Vec<CellLabel>,
    /// Errata of this table that excused nothing.
    pub unused_errata: Vec<Erratum>,
}

/// One field of one cell that is not as published.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Difference {
    /// The cell.
    #[serde(flatten)]
    pub cell: CellLabel,
    /// The field; `None` if our table lacks the cell.
    pub field: Option<Field>,
    /// The published text; empty for undefined and for no emphasis.
    pub published: String,
    /// The computed text.
    pub computed: String,
    /// The reason why that is the publication's slip, where errata say so.
    pub(crate) excused_by: Option<String>,
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ComparisonError {
    #[error(
        "no table of the style `{style}` has all the published metrics ({metrics}): expected those of {tables}; \
         give another --style"
    )]
    NoTable { style: String, metrics: String, tables: String },
    #[error(
        "the style `{style}` prints no standard errors in its table `{table}`: compare with a style of mean and standard error, such as `paper`"
    )]
    NoStandardErrors { style: String, table: String },
}

/// The table to compare: the first that has all the published metrics.
pub fn choose<'t>(
    tables: &'t [MetricTable],
    published: &Published,
    style: &Style,
) -> Result<&'t MetricTable, ComparisonError> {
    let style = style.name.clone();
    let metrics: BTreeSet<&str> = published.cells.iter().map(|(cell, _)| cell.metric.as_str()).collect();
    let table = tables.iter().find(|table| has_all(table, &metrics)).ok_or_else(|| ComparisonError::NoTable {
        style: style.clone(),
        metrics: metrics.iter().copied().collect::<Vec<_>>().join(", "),
        tables: tables.iter().map(described).collect::<Vec<_>>().join(", "),
    })?;
    let prints_se = table.form == crate::style::CellForm::MeanSe;
    if prints_se { Ok(table) } else { Err(ComparisonError::NoStandardErrors { style, table: table.name.clone() }) }
}

fn has_all(table: &MetricTable, metrics: &BTreeSet<&str>) -> bool {
    metrics.iter().all(|metric| table.columns.iter().any(|column| column.metric == *metric))
}

fn described(table: &MetricTable) -> String {
    let metrics: Vec<&str> = table.columns.iter().map(|column| column.metric.as_str()).collect();
    format!("`{}` ({})", table.name, metrics.join(", "))
}

pub fn compare(table: &MetricTable, published: &Published, errata: &[Erratum]) -> PublishedComparison {
    let ours = our_cells(table);
    let mut unused: Vec<&Erratum> = errata.iter().filter(|erratum| erratum.table == table.name).collect();
    let about_table = unused.clone();
    let (table, cells) = (table.name.clone(), published.cells.len());
    let unpublished = unpublished(&ours, published);
    let mut comparison = PublishedComparison { table, cells, unpublished, ..PublishedComparison::default() };
    for (name, theirs) in &published.cells {
        let mut found = differences(name, theirs, ours.get(name));
        for difference in &mut found {
            if let Some(&erratum) = about_table.iter().find(|erratum| excuses(erratum, difference)) {
                unused.retain(|other| !std::ptr::eq(*other, erratum));
                difference.excused_by = Some(erratum.reason.clone());
            }
        }
        let count = match () {
            () if found.is_empty() => &mut comparison.same,
            () if found.iter().all(|difference| difference.excused_by.is_some()) => &mut comparison.excused,
            () => &mut comparison.differing,
        };
        *count += 1;
        comparison.differences.extend(found);
    }
    comparison.unused_errata = unused.into_iter().cloned().collect();
    comparison
}

fn our_cells(table: &MetricTable) -> BTreeMap<CellLabel, PrintedCell> {
    let place = |key: &str| table.keys.iter().position(|of| of == key);
    let text = |row: &MetricRow, key: &str| place(key).map(|at| row.key[at].to_string()).unwrap_or_default();
    let cells = table.rows().flat_map(|row| {
        let (experiment, model) = (text(row, "experiment"), text(row, "model"));
        table.columns.iter().zip(&row.cells).map(move |(column, cell)| {
            let metric = column.metric.clone();
            (CellLabel { experiment: experiment.clone(), model: model.clone(), metric }, printed(cell))
        })
    });
    cells.collect()
}

fn printed(cell: &MetricCell) -> PrintedCell {
    PrintedCell { mean: cell.value.mean(), se: cell.value.se(), emphasis: cell.emphasis }
}

fn unpublished(ours: &BTreeMap<CellLabel, PrintedCell>, published: &Published) -> Vec<CellLabel> {
    let theirs: BTreeSet<&CellLabel> = published.cells.iter().map(|(name, _)| name).collect();
    ours.keys().filter(|name| !theirs.contains(name)).cloned().collect()
}

fn differences(name: &CellLabel, theirs: &PrintedCell, ours: Option<&PrintedCell>) -> Vec<Difference> {
    let difference = |field: Option<Field>, published: String, computed: String| Difference {
        cell: name.clone(),
        field,
        published,
        computed,
        excused_by: None,
    };
    let Some(ours) = ours else {
        return vec![difference(None, shown(theirs), String::new())];
    };
    let number = |field, theirs, ours| (field, is_same(theirs, ours), text(theirs), text(ours));
    let word = |emphasis: Emphasis| emphasis.name().to_owned();
    let fields = [
        number(Field::Mean, theirs.mean, ours.mean),
        number(Field::Se, theirs.se, ours.se),
        (Field::Emphasis, theirs.emphasis == ours.emphasis, word(theirs.emphasis), word(ours.emphasis)),
    ];
    let differing = fields.into_iter().filter(|(_, is_same, ..)| !is_same);
    differing.map(|(field, _, theirs, ours)| difference(Some(field), theirs, ours)).collect()
}

fn is_same(a: Option<Decimal>, b: Option<Decimal>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => a.cmp_value(b).is_eq(),
        (a, b) => a.is_none() && b.is_none(),
    }
}

fn text(value: Option<Decimal>) -> String {
    value.map(|value| value.to_string()).unwrap_or_default()
}

fn shown(cell: &PrintedCell) -> String {
    match (cell.mean, cell.se) {
        (Some(mean), Some(se)) => format!("{mean} ± {se}"),
        (mean, _) => text(mean),
    }
}

fn excuses(erratum: &Erratum, difference: &Difference) -> bool {
    let is_stated = |stated: &str, found: &str| match (stated.parse::<Decimal>(), found.parse::<Decimal>()) {
        (Ok(stated), Ok(found)) => stated.cmp_value(found).is_eq(),
        _ => stated == found,
    };
    let Erratum { experiment, model, metric, .. } = erratum;
    let cell = &difference.cell;
    (experiment, model, metric) == (&cell.experiment, &cell.model, &cell.metric)
        && difference.field == Some(erratum.field)
        && is_stated(&erratum.published, &difference.published)
        && is_stated(&erratum.computed, &difference.computed)
}

impl PublishedComparison {
    pub fn holds(&self) -> bool {
        self.differing == 0
    }

    pub fn render(&self, width: Option<usize>) -> String {
        let mut text = String::new();
        if !self.differences.is_empty() {
            push_differences(&mut text, &self.differences, width);
            text.push('\n');
        }
        for erratum in &self.unused_errata {
            let Erratum { experiment, model, metric, published, computed, .. } = erratum;
            let [experiment, model, metric] = [experiment, model, metric].map(|name| visible(name));
            let (field, published, computed) = (erratum.field.name(), visible(published), visible(computed));
            let _ = writeln!(
                text,
                "erratum not needed: {experiment}, {model}, {metric}, {field}: `{published}` for `{computed}`"
            );
        }
        if !self.unpublished.is_empty() {
            let _ = writeln!(text, "not in the published table: {} of our cells", self.unpublished.len());
        }
        let _ = writeln!(
            text,
            "{}: {} cells: {} as published, {} excused by errata, {} differ",
            visible(&self.table),
            self.cells,
            self.same,
            self.excused,
            self.differing
        );
        text
    }
}

fn push_differences(text: &mut String, differences: &[Difference], width: Option<usize>) {
    let header = ["experiment", "model", "metric", "field", "published", "computed", "verdict"];
    let mut table = Table::list(Look::Framed, 3, header.map(Column::left));
    let mut reasons = Vec::new();
    for difference in differences {
        let verdict = match &difference.excused_by {
            None => "differs".to_owned(),
            Some(reason) => {
                reasons.push(reason);
                format!("excused [{}]", reasons.len())
            }
        };
        table.push(record(difference, verdict));
    }
    *text += &table.within(width);
    for (at, reason) in reasons.iter().enumerate() {
        let number = format!("[{}] ", at + 1);
        push_wrapped(text, &format!("{number}{}", visible(reason)), width, number.len());
    }
}

fn record(difference: &Difference, verdict: String) -> [String; 7] {
    let or_none = |text: &str| if text.is_empty() { "(none)" } else { text }.to_owned();
    let (field, computed) = match difference.field {
        Some(field) => (field.name(), or_none(&difference.computed)),
        None => ("cell", "(not in the traces)".to_owned()),
    };
    let CellLabel { experiment, model, metric } = difference.cell.clone();
    [experiment, model, metric, field.to_owned(), or_none(&difference.published), computed, verdict]
}
