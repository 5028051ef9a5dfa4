//! Scores by the SQL lowering instead of the kernels: the same table, from independent code.

use std::collections::HashMap;
use std::num::NonZeroUsize;

use polars::prelude::{DataFrame, DataType, LazyFrame};
use polars::sql::SQLContext;

use super::frame::{self, FrameColumn};
use super::run::{self, PolarsError};
use metric::catalog::Kind;
use metric::definitions::Definitions;
use metric::overflow::may_overflow;
use metric::plan::NodeId;
use metric::sql::{self, Dialect};
use score::builder::TableBuilder;
use score::score_traces::unscored;
use score::table::{EpisodeKey, EpisodeTable, Header, MetricColumn};
use score::vocabulary::{declared_columns, kind_in};
use trace::open::{TraceFile, TraceSet};
use trace::scan::EPISODE_COLUMNS;

/// The table that [`score::score_traces::score`] gives, computed by Polars. The native reader checks the traces first,
/// so that damaged traces give the same errors. `threads` applies to that check alone: Polars has its own.
pub fn score(
    traces: &TraceSet,
    definitions: &Definitions,
    labels: &[String],
    threads: NonZeroUsize,
) -> Result<EpisodeTable, PolarsError> {
    let statement = sql::lower(&definitions.plan, Dialect::Polars)?;
    let episodes = unscored(traces, definitions, labels, threads)?;
    let steps = frame::steps(traces, &columns(traces, definitions))?;
    check_overflow(traces, definitions, &steps)?;
    let rows = answer(&steps, &statement)?;
    let metrics = metrics(definitions, &rows)?;
    check_rates(definitions, &metrics)?;
    Ok(table(&episodes, &keys(&rows)?, &metrics))
}

fn columns(traces: &TraceSet, definitions: &Definitions) -> Vec<FrameColumn> {
    let plan = &definitions.plan;
    let needed = plan.needed();
    let mut names: Vec<&str> = EPISODE_COLUMNS.into_iter().chain(["t"]).collect();
    for (name, _) in plan.columns(&needed) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let declared = declared_columns(definitions);
    let wide = |name: &str| FrameColumn::wide(name, kind_in(traces, &declared, name)?);
    names.into_iter().filter_map(wide).collect()
}

/// Checks numbers that may leave 64 bits: Polars wraps where the native engine returns an error.
fn check_overflow(traces: &TraceSet, definitions: &Definitions, steps: &LazyFrame) -> Result<(), PolarsError> {
    let plan = &definitions.plan;
    let needed = plan.needed();
    let rows = traces.files().iter().map(TraceFile::rows).sum();
    let suspects = may_overflow(plan, &needed, rows, |name| traces.schema_column(name)?.stored.range());
    let overflow = |node| Err(PolarsError::Overflow { metric: user_of(definitions, node) });
    if let Some(certain) = suspects.iter().find(|suspect| suspect.certain) {
        return overflow(certain.node);
    }
    let checked: Vec<NodeId> = suspects.into_iter().map(|suspect| suspect.node).collect();
    if checked.is_empty() {
        return Ok(());
    }
    let checks = match answer(steps, &sql::lower_checks(plan, Dialect::Polars, &checked)?) {
        Err(PolarsError::Failed(words)) if stopped_at_overflow(&words) => return overflow(checked[0]),
        checks => checks?,
    };
    for node in checked {
        if ints(&checks, &format!("g{}", node.index()))?.contains(&Some(1)) {
            return overflow(node);
        }
    }
    Ok(())
}

/// Returns true if Polars stopped at an overflow: always at a division, elsewhere in builds with overflow checks.
fn stopped_at_overflow(words: &str) -> bool {
    words.contains("with overflow") || words.contains("overflow in integer division")
}

fn user_of(definitions: &Definitions, node: NodeId) -> String {
    let plan = &definitions.plan;
    let user = plan.outputs.iter().find(|output| plan.needed_by([output.node]).contains(&node));
    user.map_or("the filter", |output| output.name.as_str()).to_owned()
}

fn answer(steps: &LazyFrame, statement: &str) -> Result<DataFrame, PolarsError> {
    run::on_deep_stack(|| {
        let mut context = SQLContext::new();
        context.register("steps", steps.clone());
        let frame = run::plan(&mut context, statement)?;
        run::collect(frame)
    })
}

fn keys(rows: &DataFrame) -> Result<Vec<EpisodeKey>, PolarsError> {
    let [ids, models, experiments] = [texts(rows, "episode_id")?, texts(rows, "model")?, texts(rows, "experiment")?];
    let [seeds, runs] = [ints(rows, "seed")?, ints(rows, "run")?];
    let number = |values: &[Option<i64>], row: usize| {
        values[row].and_then(|value| i32::try_from(value).ok()).ok_or_else(|| lost("a key of an episode"))
    };
    let text = |values: &[Option<String>], row: usize| values[row].clone().ok_or_else(|| lost("a key of an episode"));
    let key = |row: usize| {
        Ok(EpisodeKey {
            experiment: text(&experiments, row)?,
            model: text(&models, row)?,
            seed: number(&seeds, row)?,
            run: number(&runs, row)?,
            episode_id: text(&ids, row)?,
        })
    };
    (0..rows.height()).map(key).collect()
}

fn metrics(definitions: &Definitions, rows: &DataFrame) -> Result<Vec<MetricColumn>, PolarsError> {
    let one = |name: &String| {
        let values = ints(rows, &Dialect::Polars.output_alias(name))?;
        Ok(MetricColumn::new(name, values))
    };
    definitions.plan.outputs.iter().map(|output| one(&output.name)).collect()
}

fn table(episodes: &EpisodeTable, keys: &[EpisodeKey], metrics: &[MetricColumn]) -> EpisodeTable {
    let known: HashMap<&str, usize> =
        episodes.keys.iter().enumerate().map(|(row, key)| (key.episode_id, row)).collect();
    let metric_names = metrics.iter().map(|metric| metric.name.clone()).collect();
    let mut builder = TableBuilder::new(Header { metrics: metric_names, ..episodes.header() });
    for (row, key) in keys.iter().enumerate() {
        let seen = known.get(key.episode_id.as_str()).copied();
        let labels = episodes.labels.iter().map(|label| label.values.get(seen?));
        builder.push(key.as_ref(), labels, metrics.iter().map(|metric| metric.get(row)));
    }
    builder.finish()
}

fn check_rates(definitions: &Definitions, metrics: &[MetricColumn]) -> Result<(), PolarsError> {
    for (output, column) in definitions.plan.outputs.iter().zip(metrics) {
        let strange = column.iter().flatten().find(|value| !matches!(value, 0 | 1));
        if let Some(value) = strange.filter(|_| output.kind == Kind::Rate) {
            return Err(PolarsError::NotARate { metric: output.name.clone(), value });
        }
    }
    Ok(())
}

fn ints(rows: &DataFrame, name: &str) -> Result<Vec<Option<i64>>, PolarsError> {
    let column = rows.column(name)?.strict_cast(&DataType::Int64)?;
    Ok(column.i64()?.iter().collect())
}

fn texts(rows: &DataFrame, name: &str) -> Result<Vec<Option<String>>, PolarsError> {
    let column = rows.column(name)?.strict_cast(&DataType::String)?;
    Ok(column.str()?.iter().map(|text| text.map(str::to_owned)).collect())
}

fn lost(what: &str) -> PolarsError {
    PolarsError::Failed(format!("{what} is not in its answer"))
}
