//! Errors of an audit.

use super::{NamedTable, Terms};
use crate::published::CellLabel;
use exact::escape::visible;
use exact::number::Decimal;
use exact::suggest::hint;

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AuditError {
    #[error("{table}: the definitions `{definitions}` have no metric `{metric}`{hint}")]
    UnknownMetric { table: String, definitions: String, metric: String, hint: String },
    #[error("{table}: {experiment}, {model}: expected a number of episodes, found none; add `{experiment}=N` to --n")]
    NoEpisodes { table: String, experiment: String, model: String },
    #[error("--n: `{key}` names no row of the tables; expected an experiment, or EXPERIMENT/MODEL")]
    NoSuchRow { key: String },
    #[error("{cell}: expected a number of at most {MOST_DIGITS} digits, found `{found}`")]
    TooManyDigits { cell: String, found: String },
}

/// The most digits of a number, including those before the point: more would leave 128 bits.
pub(super) const MOST_DIGITS: u32 = 9;

pub(super) fn check(tables: &[NamedTable], terms: Terms<'_>) -> Result<(), AuditError> {
    for table in tables {
        for (name, cell) in &table.published.cells {
            check_cell(table, name, terms)?;
            let is_long = |number: &Decimal| {
                number.places() >= MOST_DIGITS || number.units().unsigned_abs() >= 10_u128.pow(MOST_DIGITS)
            };
            if let Some(number) = [cell.mean, cell.se].into_iter().flatten().find(is_long) {
                let CellLabel { experiment, model, metric } = name;
                let cell = visible(&format!("{}: {experiment}, {model}, {metric}", table.name));
                return Err(AuditError::TooManyDigits { cell, found: number.to_string() });
            }
        }
    }
    let cells = tables.iter().flat_map(|table| &table.published.cells);
    let rows: Vec<(&str, &str)> = cells.map(|(name, _)| (name.experiment.as_str(), name.model.as_str())).collect();
    let stranger = terms.episodes.stranger(&rows);
    stranger.map_or(Ok(()), |key| Err(AuditError::NoSuchRow { key: visible(key) }))
}

fn check_cell(table: &NamedTable, name: &CellLabel, terms: Terms<'_>) -> Result<(), AuditError> {
    if !terms.catalog.metric.contains_key(&name.metric) {
        return Err(AuditError::UnknownMetric {
            table: visible(&table.name),
            definitions: visible(&terms.catalog.name),
            metric: visible(&name.metric),
            hint: hint(&name.metric, terms.catalog.metric.keys().map(String::as_str)),
        });
    }
    match terms.episodes.of(&name.experiment, &name.model) {
        Some(_) => Ok(()),
        None => Err(AuditError::NoEpisodes {
            table: visible(&table.name),
            experiment: visible(&name.experiment),
            model: visible(&name.model),
        }),
    }
}
