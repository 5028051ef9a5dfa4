//! The reason why no data can give a cell, in a sentence, with feasible values instead.

use std::collections::BTreeSet;

use super::row::{Definitions, LARGEST_VALUE, Refused, Row, RowQuestion, World};
use crate::errata::Field;
use exact::format::counted;
use exact::moments::Moments;
use exact::number::Decimal;
use metric::catalog::Kind;
use metric::implied::Defined;
use statistics::feasible::attain::Search;
use statistics::feasible::{Print, Sample};

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Reason {
    pub(super) field: Field,
    pub(super) words: String,
    pub(super) nearest: Vec<String>,
}

impl Reason {
    fn of_mean(words: String) -> Self {
        Self { field: Field::Mean, words, nearest: Vec::new() }
    }
}

pub(super) fn reason(row: &Row, refused: &Refused, definitions: Definitions<'_>, search: &mut Search) -> Reason {
    let cells = [refused.cell];
    let question = RowQuestion { row_n: row.n, metric: &refused.metric, cells: &cells, definitions };
    let ns: BTreeSet<u64> = refused.worlds.iter().flat_map(|world| question.defined_in(world)).collect();
    let because = condition(row, &refused.metric, definitions);
    let Some(print) = refused.cell.numbers() else {
        return Reason::of_mean(format!("printed as undefined, but defined in {}{because}", episodes(&ns)));
    };
    // A printed number has at least one value behind it.
    let ns: BTreeSet<u64> = ns.into_iter().filter(|n| *n > 0).collect();
    let samples: Vec<Sample> = ns.iter().map(|n| question.sample(*n)).collect();
    if samples.is_empty() {
        return Reason::of_mean(format!("undefined: there is no episode{because}"));
    }
    let kind = definitions.catalog.metric[&refused.metric].kind;
    let cell = CheckedCell { print, samples, kind, among: format!("{}{because}", episodes(&ns)) };
    cell.no_mean().or_else(|| cell.no_spread(search)).unwrap_or_else(|| conflict(row, refused, &question, &ns))
}

struct CheckedCell {
    print: Print,
    samples: Vec<Sample>,
    kind: Kind,
    among: String,
}

impl CheckedCell {
    fn no_mean(&self) -> Option<Reason> {
        let has_sum = |sample: &Sample| {
            let (low, high) = sample.sums(&[self.print]);
            low <= high
        };
        if self.samples.iter().any(has_sum) {
            return None;
        }
        let beside = self.samples.iter().map(|sample| (sample.n, sample.sums_beside(&self.print)));
        let prints = |n: u64, sum: i128| {
            let mean = self.print.rounding.ratio(sum, n.into(), self.print.mean.places())?;
            Some((mean, format!("{mean} ({sum}/{n})")))
        };
        let sides: Vec<[Option<(Decimal, String)>; 2]> =
            beside.map(|(n, sums)| sums.map(|sum| sum.and_then(|sum| prints(n, sum)))).collect();
        let nearest = nearest(sides);
        let what = match self.kind {
            Kind::Rate => "count".to_owned(),
            Kind::Quantity => match self.samples[0].range {
                (low, high) if low > -LARGEST_VALUE && high < LARGEST_VALUE => {
                    format!("sum of integers from {low} to {high}")
                }
                _ => "sum of integers".to_owned(),
            },
        };
        let words =
            format!("no {what} over {} has a mean that prints {}{}", self.among, self.print.mean, listed(&nearest));
        Some(Reason { field: Field::Mean, words, nearest })
    }

    fn no_spread(&self, search: &mut Search) -> Option<Reason> {
        let se = self.print.se?;
        let mut sides = Vec::new();
        for sample in &self.samples {
            let (low, high) = sample.sums(&[self.print]);
            for sum in low..=high {
                if sample.with_sum(sum, &[self.print], search).is_some() {
                    return None;
                }
                let beside = if sample.n > 1 { sample.spreads_beside(sum, &self.print, search) } else { [None; 2] };
                sides.push(beside.map(|moments| moments.and_then(|moments| self.spread(moments, sample))));
            }
        }
        let nearest = nearest(sides);
        let mean = self.print.mean;
        let words =
            format!("with the mean {mean} over {}, no standard error prints {se}{}", self.among, listed(&nearest));
        Some(Reason { field: Field::Se, words, nearest })
    }

    fn spread(&self, moments: Moments, sample: &Sample) -> Option<(Decimal, String)> {
        let (above, below) = moments.se_squared(sample.form)?;
        let se = self.print.rounding.root(above, below, self.print.se?.places())?;
        Some((se, se.to_string()))
    }
}

fn nearest(sides: Vec<[Option<(Decimal, String)>; 2]>) -> Vec<String> {
    let (below, above): (Vec<_>, Vec<_>) = sides.into_iter().map(|[below, above]| (below, above)).unzip();
    let below = below.into_iter().flatten().max_by(|a, b| a.0.cmp_value(b.0));
    let above = above.into_iter().flatten().min_by(|a, b| a.0.cmp_value(b.0));
    below.into_iter().chain(above).map(|(_, text)| text).collect()
}

fn listed(nearest: &[String]) -> String {
    match nearest {
        [] => String::new(),
        [one] => format!("; the nearest prints {one}"),
        several => format!("; the nearest print {}", several.join(" and ")),
    }
}

/// The reason for a cell that is feasible alone, but not beside the cells accepted before it.
fn conflict(row: &Row, refused: &Refused, question: &RowQuestion<'_>, ns: &BTreeSet<u64>) -> Reason {
    if let Some(earlier) = refused.accepted.first() {
        let other = shown(earlier.cell.mean, earlier.cell.se);
        return Reason::of_mean(format!(
            "no data prints this and {other}, which another table prints for the same cell"
        ));
    }
    let allowed = |world: &World| ns.iter().filter_map(|n| question.allowed(*n, world)).collect::<Vec<_>>();
    let allowed: Vec<(i128, i128)> =
        refused.worlds.iter().flat_map(allowed).filter(|(low, high)| low <= high).collect();
    let restricted = question.definitions.implied[&refused.metric].restricts.as_ref();
    let whole = restricted.map(|restricted| beside(row, &restricted.metric)).unwrap_or_default();
    let (low, high) = (allowed.iter().map(|span| span.0).min(), allowed.iter().map(|span| span.1).max());
    let bounds =
        low.zip(high).map(|(low, high)| format!(": it can be true in {}", between(low, high))).unwrap_or_default();
    let among = format!("{}{}", episodes(ns), condition(row, &refused.metric, question.definitions));
    Reason::of_mean(format!("feasible by itself over {among}, but not beside {whole} of the same row{bounds}"))
}

fn between(low: i128, high: i128) -> String {
    if low == high { format!("{low}") } else { format!("{low} to {high}") }
}

/// ` with TSA = 1 (printed 0.57 ± 0.11)`: the condition on the episodes that count.
fn condition(row: &Row, metric: &str, definitions: Definitions<'_>) -> String {
    match &definitions.implied[metric].defined {
        Defined::Where { metric, is } if row.metrics.contains_key(metric) => {
            format!(" with {metric} = {} (printed {})", u8::from(*is), printed(row, metric))
        }
        _ => String::new(),
    }
}

fn beside(row: &Row, metric: &str) -> String {
    format!("{metric} = {}", printed(row, metric))
}

fn printed(row: &Row, metric: &str) -> String {
    let cell = row.metrics.get(metric).and_then(|cells| cells.first());
    cell.map_or_else(String::new, |cell| shown(cell.cell.mean, cell.cell.se))
}

pub(super) fn shown(mean: Option<Decimal>, se: Option<Decimal>) -> String {
    match (mean, se) {
        (None, _) => "--".to_owned(),
        (Some(mean), None) => mean.to_string(),
        (Some(mean), Some(se)) => format!("{mean} ± {se}"),
    }
}

/// `21 episodes`, `0 to 21 episodes`.
fn episodes(ns: &BTreeSet<u64>) -> String {
    match (ns.first(), ns.last()) {
        (Some(low), Some(high)) if low == high => counted(*low, "episode"),
        (Some(low), Some(high)) => format!("{low} to {high} episodes"),
        _ => "no episode".to_owned(),
    }
}
