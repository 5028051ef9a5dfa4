//! The order of keys and metrics in tables.
//!
//! Rule: experiments are ordered by the definitions, models and metrics by the style, everything else by value. So a
//! list beside a table has the same order.

use crate::style::{MAIN_TABLE, Style};
use mirrorstats_analysis::changes::Changes;
use mirrorstats_metric::catalogs::catalog::Catalog;
use mirrorstats_score::cells::KeyValue;

#[derive(Clone, Copy, Debug)]
pub struct TableOrder<'a> {
    pub catalog: &'a Catalog,
    pub style: &'a Style,
}

impl TableOrder<'_> {
    /// The rank of a key of these columns; keys in headings come before the row's own.
    pub fn of_key(self, by: &[String], key: &[KeyValue]) -> Vec<(usize, KeyValue)> {
        let own = row_key(by);
        let heading = (0..key.len()).filter(|at| *at != own);
        let all = heading.chain((own < key.len()).then_some(own));
        all.map(|at| (self.place(&by[at], &key[at]), key[at].clone())).collect()
    }

    /// The rank of a metric: by the first table that shows it, then by definition.
    pub(crate) fn of_metric(self, metric: &str) -> (usize, usize) {
        let sheet = &self.style.sheet;
        let mut tables: Vec<_> = sheet.table.iter().collect();
        tables.sort_by_key(|(name, _)| *name != MAIN_TABLE);
        let columns: Vec<&String> = tables.into_iter().flat_map(|(_, table)| &table.columns).collect();
        let shown = columns.iter().position(|column| *column == metric).unwrap_or(columns.len());
        let defined = &self.catalog.metric;
        (shown, defined.get_index_of(metric).unwrap_or(defined.len()))
    }

    pub fn sort(self, changes: &mut Changes) {
        let by = changes.by.clone();
        changes.cells.sort_by_cached_key(|cell| {
            let key: Vec<KeyValue> = cell.key.values().cloned().collect();
            (self.of_key(&by, &key), self.of_metric(&cell.metric))
        });
        let by = ["experiment", "model", "seed", "run", "episode_id"].map(str::to_owned);
        changes.flips.sort_by_cached_key(|flip| {
            let text = |value: &String| KeyValue::Text(value.clone());
            let name = &flip.episode;
            let [seed, run] = [name.seed, name.run].map(|value| KeyValue::Int(value.into()));
            let [experiment, model, id] = [&name.experiment, &name.model, &name.episode_id].map(text);
            let key = [experiment, model, seed, run, id];
            let places = by.iter().zip(key).map(|(name, value)| (self.place(name, &value), value));
            (self.of_metric(&flip.metric), places.collect::<Vec<_>>())
        });
    }

    fn place(self, column: &str, value: &KeyValue) -> usize {
        match (column, value) {
            ("experiment", KeyValue::Text(name)) => self.catalog.experiment_rank(name),
            ("model", KeyValue::Text(name)) => {
                let order = &self.style.sheet.row_order;
                order.iter().position(|model| model == name).unwrap_or(order.len())
            }
            _ => 0,
        }
    }
}

pub(crate) fn row_key(by: &[String]) -> usize {
    by.iter().position(|key| key == "model").unwrap_or(by.len().saturating_sub(1))
}
