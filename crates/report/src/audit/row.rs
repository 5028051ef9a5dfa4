//! The cells of one row together: its metrics share counts of episodes.
//!
//! Rule: a cell is feasible if some data prints it and all cells accepted before it. Metrics come after those that
//! their definitions name, so a fault is found at the dependent cell. An infeasible cell is ignored for later cells, so
//! one fault is reported once. A world is one way to count the metrics that others depend on; metrics without a shared
//! metric are solved separately. Unprinted values are open.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use indexmap::IndexMap;

use crate::published::PrintedCell;
use exact::rounding::Rounding;
use metric::catalog::{Catalog, Kind};
use metric::implied::{Defined, Implied};
use statistics::feasible::attain::Search;
use statistics::feasible::{Print, Sample};

/// The largest absolute value, if mean and standard error have at most [`MOST_DIGITS`](super::error::MOST_DIGITS)
/// digits: a value is at most n standard errors from the mean.
pub(super) const LARGEST_VALUE: i64 = 3_000_000_000_000;

#[derive(Clone, Copy, Debug)]
pub(super) struct Definitions<'d> {
    pub(super) catalog: &'d Catalog,
    pub(super) implied: &'d IndexMap<String, Implied>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct RowCell {
    pub(super) at: (usize, usize),
    pub(super) cell: PrintedCell,
    pub(super) rounding: Rounding,
    pub(super) zero_may_be_undefined: bool,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Row {
    pub(super) n: u64,
    pub(super) metrics: BTreeMap<String, Vec<RowCell>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Count {
    pub(super) n: u64,
    pub(super) sum: i128,
}

pub(super) type World = BTreeMap<String, Count>;

/// A cell that no data can give together with the cells accepted before it.
#[derive(Clone, Debug)]
pub(super) struct Refused {
    pub(super) metric: String,
    pub(super) cell: RowCell,
    pub(super) accepted: Vec<RowCell>,
    pub(super) worlds: Vec<World>,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Solved {
    pub(super) refused: Vec<Refused>,
    pub(super) zeros: Vec<(usize, usize)>,
}

impl Refused {
    /// Returns true if some data would print the cell under another rounding, together with the same other cells.
    pub(super) fn is_feasible(
        &self,
        row: &Row,
        rounding: Rounding,
        definitions: Definitions<'_>,
        search: &mut Search,
    ) -> bool {
        let cells: Vec<RowCell> = self.accepted.iter().copied().chain([RowCell { rounding, ..self.cell }]).collect();
        let question = RowQuestion { row_n: row.n, metric: &self.metric, cells: &cells, definitions };
        !question.counts_in(&self.worlds, false, search).is_empty()
    }
}

impl Row {
    pub(super) fn solve(&self, definitions: Definitions<'_>, search: &mut Search) -> Solved {
        let mut solved = Solved::default();
        for group in definitions.groups(self.metrics.keys()) {
            let mut worlds = vec![World::new()];
            for metric in group.iter().filter(|metric| self.metrics.contains_key(*metric)) {
                let is_needed = group.iter().any(|other| definitions.needs(other).contains(&metric.as_str()));
                worlds = self.accept(metric, worlds, is_needed, definitions, search, &mut solved);
            }
        }
        solved
    }

    fn accept(
        &self,
        metric: &str,
        mut worlds: Vec<World>,
        is_needed: bool,
        definitions: Definitions<'_>,
        search: &mut Search,
        solved: &mut Solved,
    ) -> Vec<World> {
        let mut accepted: Vec<RowCell> = Vec::new();
        let mut counted: Vec<(usize, Count)> = Vec::new();
        for cell in &self.metrics[metric] {
            let cells: Vec<RowCell> = accepted.iter().chain([cell]).copied().collect();
            let question = RowQuestion { row_n: self.n, metric, cells: &cells, definitions };
            let found = question.counts_in(&worlds, is_needed, search);
            if found.is_empty() {
                let (metric, worlds) = (metric.to_owned(), worlds.clone());
                solved.refused.push(Refused { metric, cell: *cell, accepted: accepted.clone(), worlds });
            } else {
                accepted.push(*cell);
                counted = found;
            }
        }
        if accepted.is_empty() {
            return worlds;
        }
        if counted.iter().all(|(_, count)| count.n == 0) {
            solved.zeros.extend(accepted.iter().filter(|cell| cell.cell.mean.is_some()).map(|cell| cell.at));
        }
        if is_needed {
            let named = |(at, count): (usize, Count)| {
                let mut world = worlds[at].clone();
                world.insert(metric.to_owned(), count);
                world
            };
            return counted.into_iter().map(named).collect();
        }
        let possible: BTreeSet<usize> = counted.iter().map(|(at, _)| *at).collect();
        let mut at = 0..;
        worlds.retain(|_| at.next().is_some_and(|at| possible.contains(&at)));
        worlds
    }
}

#[derive(Clone, Copy)]
pub(super) struct RowQuestion<'q> {
    pub(super) row_n: u64,
    pub(super) metric: &'q str,
    pub(super) cells: &'q [RowCell],
    pub(super) definitions: Definitions<'q>,
}

impl RowQuestion<'_> {
    /// The counts that print these cells, each with its world; one count per world unless `all` is true.
    fn counts_in(&self, worlds: &[World], all: bool, search: &mut Search) -> Vec<(usize, Count)> {
        let needs = self.definitions.needs(self.metric);
        let mut known: BTreeMap<Vec<Option<Count>>, Vec<Count>> = BTreeMap::new();
        let mut found = Vec::new();
        for (at, world) in worlds.iter().enumerate() {
            let of_needs = needs.iter().map(|metric| world.get(*metric).copied()).collect();
            let counts = known.entry(of_needs).or_insert_with(|| self.counts_of_world(world, all, search));
            found.extend(counts.iter().map(|count| (at, *count)));
        }
        found
    }

    fn counts_of_world(&self, world: &World, all: bool, search: &mut Search) -> Vec<Count> {
        let mut found = Vec::new();
        for n in self.defined_in(world) {
            found.extend(self.counts(n, world, all, search));
            if !all && found.last().is_some_and(|count| count.n > 0) {
                break;
            }
        }
        found
    }

    pub(super) fn defined_in(&self, world: &World) -> RangeInclusive<u64> {
        match &self.definitions.implied[self.metric].defined {
            Defined::Always => self.row_n..=self.row_n,
            Defined::Where { metric, is } => world.get(metric).map_or(0..=self.row_n, |count| {
                let holding = u64::try_from(count.sum).expect("the sum of a rate is a count");
                let n = if *is { holding } else { count.n - holding };
                n..=n
            }),
            Defined::Sometimes => 0..=self.row_n,
        }
    }

    fn counts(&self, n: u64, world: &World, all: bool, search: &mut Search) -> Vec<Count> {
        if n == 0 {
            let can_be_undefined = self.cells.iter().all(RowCell::can_be_undefined);
            return if can_be_undefined { vec![Count { n, sum: 0 }] } else { Vec::new() };
        }
        let Some(prints) = self.prints() else { return Vec::new() };
        let sample = self.sample(n);
        let span = self.allowed(n, world).unwrap_or(sample.all_sums());
        if !sample.reaches(span, &prints) {
            return Vec::new();
        }
        let (low, high) = sample.sums(&prints);
        let sums = low.max(span.0)..=high.min(span.1);
        let mut fitting = sums.filter(|sum| sample.with_sum(*sum, &prints, search).is_some());
        let counts = |sum| Count { n, sum };
        if all { fitting.map(counts).collect() } else { fitting.next().map(counts).into_iter().collect() }
    }

    /// The sums that the restricted metric leaves for a rate; `None` if it gives no restriction.
    pub(super) fn allowed(&self, n: u64, world: &World) -> Option<(i128, i128)> {
        if self.definitions.catalog.metric[self.metric].kind != Kind::Rate {
            return None;
        }
        let restricted = self.definitions.implied[self.metric].restricts.as_ref()?;
        let whole = world.get(&restricted.metric)?;
        let outside = i128::from(whole.n) - i128::from(n);
        Some(match restricted.elsewhere {
            Some(value) => {
                let sum = whole.sum - i128::from(value) * outside;
                (sum, sum)
            }
            None => ((whole.sum - outside).max(0), whole.sum.min(n.into())),
        })
    }

    pub(super) fn sample(&self, n: u64) -> Sample {
        let (low, high) = self.definitions.implied[self.metric].range;
        Sample {
            n,
            range: (low.max(-LARGEST_VALUE), high.min(LARGEST_VALUE)),
            form: self.definitions.catalog.metric[self.metric].se,
        }
    }

    pub(super) fn prints(&self) -> Option<Vec<Print>> {
        self.cells.iter().map(RowCell::numbers).collect()
    }
}

impl RowCell {
    /// Its numbers; `None` if it is printed as undefined.
    pub(super) fn numbers(&self) -> Option<Print> {
        Some(Print { mean: self.cell.mean?, se: self.cell.se, rounding: self.rounding })
    }

    pub(super) fn can_be_undefined(&self) -> bool {
        let is_zero = |number: Option<exact::number::Decimal>| number.is_none_or(|number| number.units() == 0);
        self.cell.mean.is_none() || self.zero_may_be_undefined && is_zero(self.cell.mean) && is_zero(self.cell.se)
    }
}

impl Definitions<'_> {
    pub(super) fn needs(&self, metric: &str) -> Vec<&str> {
        let implied = &self.implied[metric];
        let condition = match &implied.defined {
            Defined::Where { metric, .. } => Some(metric.as_str()),
            Defined::Always | Defined::Sometimes => None,
        };
        condition.into_iter().chain(implied.restricts.as_ref().map(|restricted| restricted.metric.as_str())).collect()
    }

    /// The metrics in groups without a shared metric, each after the metrics that it needs.
    fn groups<'m>(&self, metrics: impl Iterator<Item = &'m String>) -> Vec<Vec<String>> {
        let mut groups: Vec<Vec<String>> = Vec::new();
        for metric in metrics {
            let mut ordered = Vec::new();
            self.visit(metric, &mut ordered);
            let (linked, apart): (Vec<_>, Vec<_>) =
                groups.into_iter().partition(|group| group.iter().any(|member| ordered.contains(member)));
            let mut joined: Vec<String> = Vec::new();
            for member in linked.into_iter().flatten().chain(ordered) {
                if !joined.contains(&member) {
                    joined.push(member);
                }
            }
            groups = apart;
            groups.push(joined);
        }
        groups
    }

    fn visit(&self, metric: &str, ordered: &mut Vec<String>) {
        for needed in self.needs(metric) {
            self.visit(needed, ordered);
        }
        if !ordered.iter().any(|known| known == metric) {
            ordered.push(metric.to_owned());
        }
    }
}
