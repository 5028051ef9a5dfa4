//! One block minus another under one metric: paired if they have pairs, else as independent samples.

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::statistics::comparisons::losses::{LossCase, LossCases, Toward};
use crate::statistics::comparisons::matching::{Matched, Sides, Units, outcomes, selection};
use crate::statistics::comparisons::retest::repeat_variance;
use crate::statistics::rates::durations::{decided, is_duration};
use crate::study::{Block, Study, Unit};
use mirrorstats_exact::moments::Moments;
use mirrorstats_metric::catalogs::catalog::{Metric, StandardError};
use mirrorstats_score::tables::table::MetricColumn;
use mirrorstats_statistics::comparisons::holm::{is_significant, level};
use mirrorstats_statistics::comparisons::margin::Counts;
use mirrorstats_statistics::comparisons::paired::Pairs;
use mirrorstats_statistics::comparisons::units;
use mirrorstats_statistics::comparisons::unpaired::{fisher, newcombe, welch};
use mirrorstats_statistics::durations::competing::{Ending, Outcome};
use mirrorstats_statistics::durations::restricted::{
    Difference, by_units, fewest, independent, paired, shared_horizon,
};
use mirrorstats_statistics::intervals::coverage::{self, Withheld};
use mirrorstats_statistics::intervals::interval::{Interval, student_t};
use mirrorstats_statistics::outcomes::ExactTest;

/// The test of a difference, and the method of its interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Pairs of a rate: the exact test of `McNemar`, Newcombe's interval for pairs.
    #[default]
    Mcnemar,
    /// Independent rates: Fisher's exact test, Newcombe's hybrid score interval.
    Fisher,
    /// Pairs of a duration: restricted means, Student's t interval and test of their difference.
    RestrictedMeanPaired,
    /// Independent durations: the same with Satterthwaite's degrees of freedom.
    RestrictedMean,
    /// Pairs of another quantity: Student's t interval of the differences; no test.
    StudentPaired,
    /// Independent samples of another quantity: Welch's t interval; no test.
    Welch,
    /// Rates of scenes, seeds or participants with several episodes, or of which some are pairs: the exact permutation
    /// test within shared units and among the others; no interval.
    Units,
}

/// The test of a difference smaller than a margin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Equivalence {
    /// The margin, in the unit of the metric.
    pub margin: f64,
    /// The p value of a difference of the margin or more in either direction, adjusted by Holm's method over the family.
    pub p_adjusted: f64,
    /// True if the difference is shown to be smaller than the margin.
    pub is_shown: bool,
}

/// The first minus the second.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Comparison {
    /// The test and the interval.
    pub method: Method,
    /// The episodes compared: of each side those in which the metric is defined; of pairs, those defined in both.
    pub n: [u64; 2],
    /// The successes among them; none for quantities.
    pub successes: Option<[u64; 2]>,
    /// The 2x2 table; none if the samples are independent.
    pub pairs: Option<Pairs>,
    /// Pairs left out because the metric is undefined in one episode or both.
    pub undefined: u64,
    /// The horizon of restricted means, in steps.
    pub horizon: Option<i64>,
    /// The first mean minus the second: over the units, where each counts once, else over the episodes compared.
    pub difference: Option<f64>,
    /// The means of both sides with each unit counted once; null if each episode is its own unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit_means: Option<[f64; 2]>,
    /// Its interval, not adjusted for the number of comparisons.
    pub interval: Option<Interval>,
    /// The reason why there is no interval.
    pub withheld: Option<Withheld>,
    /// The interval that holds together with those of all tests of the family (Bonferroni).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simultaneous: Option<Interval>,
    /// The test of a difference within the margin that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equivalence: Option<Equivalence>,
    /// The standard error from repeats alone: by how much the difference of means varies if the same scenes are played
    /// again; none unless both sides repeat scenes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeat_se: Option<f64>,
    /// The p value, two-sided: exact and by minimum likelihood for rates; for durations by Student's t, and by permutation
    /// where the sides have unequal sizes.
    pub p: Option<f64>,
    /// The Monte Carlo standard error of `p`, where sides of unequal size are permuted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_error: Option<f64>,
    /// The mid-p value of a rate, which is not guaranteed to keep the level.
    pub mid_p: Option<f64>,
    /// `p` adjusted by Holm's method over the family.
    pub p_adjusted: Option<f64>,
    /// True if the value adjusted by Holm reaches the level of significance.
    pub separated: bool,
    /// The units of analysis of both sides where the test counts each once, however many episodes it has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units: Option<Units>,
    /// The test with the lost episodes of both sides; none if none was lost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub losses: Option<LossCases>,
    /// The reason why the difference only describes these episodes and has no test: a condition selects them, or sides share
    /// seeds unevenly.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub selected: Option<String>,
    /// The setting in which the two sides were recorded differently, so that nothing is compared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub incomparable: Option<String>,
    /// The counts of a rate by unit; empty for other metrics.
    #[serde(skip)]
    pub(crate) counts: Counts,
}

pub(crate) struct Compared<'s, 'a> {
    pub study: &'s Study<'a>,
    pub first: &'s Block<'a>,
    pub second: &'s Block<'a>,
    pub matched: &'s Matched,
    pub horizon: Option<i64>,
    pub confidence: f64,
}

impl Compared<'_, '_> {
    /// The comparison under one metric, in its unit, before adjustment.
    pub(crate) fn under(&self, column: &MetricColumn) -> Comparison {
        self.stored(column).in_unit(self.study.metric(&column.name))
    }

    /// The comparison of the stored values.
    fn stored(&self, column: &MetricColumn) -> Comparison {
        let sides = Sides::of(self.study, column, &[(self.first, self.second)]);
        let found = self.assuming(None, column, sides.as_ref());
        let selected = selection(self.study, column, [self.first, self.second]);
        if let Some(selected) = selected.or_else(|| self.against_seeds(column, &found)) {
            let Comparison { method, n, successes, difference, unit_means, undefined, .. } = found;
            let (withheld, selected) = (Some(Withheld::Selected), Some(selected));
            let untested = Comparison::of(method, n);
            return Comparison { successes, undefined, difference, unit_means, withheld, selected, ..untested };
        }
        let lost = if found.p.is_some() { self.lost() } else { 0 };
        let losses = LossCases::of(lost, |toward| {
            let Comparison { difference, p, .. } = self.assuming(Some(toward), column, sides.as_ref());
            LossCase { difference, p }
        });
        let noise = |block| repeat_variance(self.study, block, column);
        let repeat_se = noise(self.first).zip(noise(self.second)).map(|(a, b)| (a + b).sqrt());
        Comparison { repeat_se, losses, ..found }
    }

    /// The reason to withhold a significant difference of independent rates: the sides have unequal shares of the seeds,
    /// and within seeds the difference has the other sign (Simpson 1951). The common difference weights each seed as
    /// Mantel and Haenszel (1959) do.
    fn against_seeds(&self, column: &MetricColumn, found: &Comparison) -> Option<String> {
        let is_shown = found.p.is_some_and(|p| is_significant(p, self.confidence));
        if found.method != Method::Fisher || !is_shown || !self.study.design.has_pairs() {
            return None;
        }
        let mut seeds: BTreeMap<i32, [(i64, i64); 2]> = BTreeMap::new();
        for (side, block) in [self.first, self.second].into_iter().enumerate() {
            for (row, value) in block.rows().filter_map(|row| Some((row, column.get(row)?))) {
                let (n, sum) = &mut seeds.entry(self.study.table.keys.seed(row)).or_default()[side];
                (*n, *sum) = (*n + 1, *sum + value);
            }
        }
        let common = |[(m, a), (n, b)]: &[(i64, i64); 2]| (a * n - b * m) as f64 / (m + n) as f64;
        let common: f64 = seeds.values().map(common).sum();
        (common * found.difference? < 0.0).then(|| "the difference within seeds has the other sign".to_owned())
    }

    /// The comparison without the lost episodes of both sides, or with them. In a comparison by pairs or units, each
    /// lost episode is a pair against a known outcome, which is its largest possible effect.
    fn assuming(&self, lost: Option<Toward>, column: &MetricColumn, sides: Option<&Sides>) -> Comparison {
        let rates = self.study.is_rate(&column.name);
        match sides {
            Some(sides) if rates => self.rates_by_unit(lost, column, sides),
            _ if !rates && self.is_dependent() => self.quantity_by_unit(lost, column),
            _ => self.of_episodes(lost, column),
        }
    }

    fn lost(&self) -> u64 {
        self.first.lost + self.second.lost
    }

    fn moments(&self, lost: Option<Toward>, column: &MetricColumn) -> [Moments; 2] {
        [(self.first, true), (self.second, false)]
            .map(|(block, is_first)| Toward::assumed(lost, block, column, is_first))
    }

    /// Returns true if a unit occurs more than once in the comparison of episodes.
    fn is_dependent(&self) -> bool {
        let Some(pairs) = &self.matched.pairs else {
            return self.first.repeats || self.second.repeats;
        };
        let units: BTreeSet<Unit> = pairs.iter().map(|&(row, _)| self.study.unit(row)).collect();
        units.len() < pairs.len()
    }

    fn rates_by_unit(&self, lost: Option<Toward>, column: &MetricColumn, sides: &Sides) -> Comparison {
        let [a, b] = self.moments(lost, column);
        let test = sides.test(&lost.map_or_else(Vec::new, |toward| toward.units(self.lost())));
        let least = test.map_or(1.0, |test| test.least);
        let pairs = self.matched.pairs.as_ref().filter(|_| !self.is_dependent());
        let [first, second] = sides.means();
        let unit_means = first.zip(second).map(<[f64; 2]>::from);
        let counts = sides.divided().map(|units| Counts::of_units(&units)).unwrap_or_default();
        let found = Comparison {
            successes: a.counts().zip(b.counts()).map(|(a, b)| [a.0, b.0]),
            difference: test.map(|test| test.difference).or_else(|| unit_means.map(|[a, b]| a - b)),
            unit_means,
            pairs: pairs.map(|rows| outcomes(column, rows)),
            p: test.map(|test| test.p),
            units: Some(Units::between(self.study, [self.first, self.second], sides, least)),
            counts,
            ..Comparison::of(Method::Units, [a.n, b.n])
        };
        // Without a test, the means of the units are not the estimate that the interval is of.
        let interval = test.and_then(|_| found.rate_interval(self.confidence));
        let (interval, withheld) = coverage::given(interval, counts.len(), coverage::UNITS, true);
        Comparison { interval, withheld, ..found }
    }

    /// Compares a duration by unit if all its times up to the horizon are known; other quantities have no test.
    fn quantity_by_unit(&self, lost: Option<Toward>, column: &MetricColumn) -> Comparison {
        let seen = self.of_episodes(None, column);
        let seen = Comparison { interval: None, withheld: Some(Withheld::Dependent), p: None, ..seen };
        let of_units =
            |value: &dyn Fn(usize) -> Option<i64>| Sides::by(self.study, &[(self.first, self.second)], value);
        if !is_duration(self.study, &column.name) {
            let [first, second] = of_units(&|row| column.get(row)).means();
            let unit_means = first.zip(second).map(<[f64; 2]>::from);
            return Comparison { difference: unit_means.map(|[a, b]| a - b), unit_means, ..seen };
        }
        let rows = || [self.first, self.second].into_iter().flat_map(Block::rows);
        let Some(horizon) = seen.horizon else { return seen };
        let unknown = |row: &usize| {
            let end = decided(self.study, column, *row);
            end.is_some_and(|end| end.outcome == Outcome::Unfinished && end.steps < horizon)
        };
        let unknown = rows().filter(unknown).count() as u64;
        if unknown > 0 {
            let units = Units { n: unknown, name: "interrupted episodes".to_owned(), too_few: true };
            return Comparison { units: Some(units), ..seen };
        }
        let time = |row| decided(self.study, column, row).map(|end| end.steps.min(horizon));
        let times = of_units(&time);
        let [first, second] = times.means();
        let Some(mut sides) = times.divided() else { return seen };
        if let Some(toward) = lost {
            self.add_lost(&mut sides, horizon, toward);
        }
        let is_paired = !sides.shared.is_empty();
        let n = if is_paired { sides.shared.len() } else { sides.first.len().min(sides.second.len()) };
        let found = by_units(&sides, horizon, self.confidence);
        let least = if (n as u64) < fewest_of(self.confidence) { 1.0 } else { 0.0 };
        let units = Units::new(self.study, self.first, n, least);
        let method = if is_paired { Method::RestrictedMeanPaired } else { Method::RestrictedMean };
        let tested = Comparison::of_durations(method, [n as u64; 2], found, self.confidence);
        Comparison { n: seen.n, units: Some(units), unit_means: first.zip(second).map(<[f64; 2]>::from), ..tested }
    }

    /// Adds each lost episode as its own unit, decided at once or never.
    fn add_lost(&self, sides: &mut units::Sides, horizon: i64, toward: Toward) {
        let one = |steps: i64| Moments::default().with(steps).unwrap_or_default();
        let [first, second] = toward.ends([1, horizon]).map(one);
        if sides.shared.is_empty() {
            sides.first.extend((0..self.first.lost).map(|_| first));
            sides.second.extend((0..self.second.lost).map(|_| second));
        } else {
            sides.shared.extend((0..self.lost()).map(|_| (first, second)));
        }
    }

    fn of_episodes(&self, lost: Option<Toward>, column: &MetricColumn) -> Comparison {
        if is_duration(self.study, &column.name) {
            return self.durations(lost, column);
        }
        let rates = self.study.is_rate(&column.name);
        match &self.matched.pairs {
            Some(pairs) if rates => self.paired_rate(lost, column, pairs),
            Some(pairs) => self.paired_quantity(column, pairs),
            None => self.independent(lost, column, rates),
        }
    }

    fn paired_rate(&self, lost: Option<Toward>, column: &MetricColumn, rows: &[(usize, usize)]) -> Comparison {
        let seen = outcomes(column, rows);
        let pairs = lost.map_or(seen, |toward| toward.pairs(seen, self.lost()));
        let found = Comparison {
            successes: Some([pairs.both + pairs.first_only, pairs.both + pairs.second_only]),
            pairs: Some(pairs),
            undefined: rows.len() as u64 - seen.n(),
            difference: pairs.difference(),
            counts: Counts::of_pairs(pairs),
            ..Comparison::of(Method::Mcnemar, [pairs.n(); 2]).tested(pairs.test())
        };
        Comparison { interval: found.rate_interval(self.confidence), ..found }
    }

    fn paired_quantity(&self, column: &MetricColumn, rows: &[(usize, usize)]) -> Comparison {
        let mut differences = rows.iter().filter_map(|&(a, b)| column.get(a)?.checked_sub(column.get(b)?));
        // If a sum of squares exceeds 128 bits, there is no interval.
        let moments = differences.try_fold(Moments::default(), Moments::with).unwrap_or_default();
        let interval = student_t(&moments, StandardError::Sample, self.confidence);
        let spread = moments.se(StandardError::Sample).is_some_and(|se| se > 0.0);
        let (interval, withheld) = coverage::given(interval, moments.n, coverage::STUDENT, spread);
        Comparison {
            undefined: rows.len() as u64 - moments.n,
            difference: moments.mean(),
            interval,
            withheld,
            ..Comparison::of(Method::StudentPaired, [moments.n; 2])
        }
    }

    fn independent(&self, lost: Option<Toward>, column: &MetricColumn, rates: bool) -> Comparison {
        let [a, b] = self.moments(lost.filter(|_| rates), column);
        let difference = a.mean().zip(b.mean()).map(|(a, b)| a - b);
        let counted = rates.then(|| a.counts().zip(b.counts())).flatten();
        if let Some((first, second)) = counted {
            let found = Comparison {
                successes: Some([first.0, second.0]),
                difference,
                counts: Counts::of_sides([first, second]),
                ..Comparison::of(Method::Fisher, [a.n, b.n]).tested(fisher(first, second))
            };
            return Comparison { interval: found.rate_interval(self.confidence), ..found };
        }
        let spread = [a, b].iter().any(|side| side.se(StandardError::Sample).is_some_and(|se| se > 0.0));
        let (interval, withheld) =
            coverage::given(welch(&a, &b, self.confidence), a.n.min(b.n), coverage::WELCH, spread);
        Comparison { difference, interval, withheld, ..Comparison::of(Method::Welch, [a.n, b.n]) }
    }

    fn durations(&self, lost: Option<Toward>, column: &MetricColumn) -> Comparison {
        let mut sides = self.endings(column);
        let (method, undefined) = match &self.matched.pairs {
            Some(pairs) => (Method::RestrictedMeanPaired, (pairs.len() - sides[0].len()) as u64),
            None => (Method::RestrictedMean, 0),
        };
        let horizon = self.horizon.or_else(|| shared_horizon(&sides[0], &sides[1]));
        if let Some((toward, horizon)) = lost.zip(horizon) {
            // Decided at once or never.
            let [fast, slow] = [(1, Outcome::Correct), (horizon, Outcome::Unfinished)];
            let ends = toward.ends([fast, slow]).map(|(steps, outcome)| Ending { steps, outcome });
            let is_paired = self.matched.pairs.is_some();
            let counts = if is_paired { [self.lost(); 2] } else { [self.first.lost, self.second.lost] };
            for ((side, end), count) in sides.iter_mut().zip(ends).zip(counts) {
                side.extend((0..count).map(|_| end));
            }
        }
        let found = horizon.and_then(|horizon| self.restricted(&sides, horizon));
        let n = sides.map(|side| side.len() as u64);
        Comparison { undefined, ..Comparison::of_durations(method, n, found, self.confidence) }
    }

    /// The endings of both sides' episodes. For pairs, only those with both endings, in the same order.
    fn endings(&self, column: &MetricColumn) -> [Vec<Ending>; 2] {
        let ending = |row: usize| decided(self.study, column, row);
        match &self.matched.pairs {
            Some(pairs) => pairs.iter().filter_map(|&(a, b)| ending(a).zip(ending(b))).unzip().into(),
            None => [self.first, self.second].map(|block| block.rows().filter_map(ending).collect()),
        }
    }

    fn restricted(&self, [first, second]: &[Vec<Ending>; 2], horizon: i64) -> Option<Difference> {
        if self.matched.pairs.is_none() {
            return independent(first, second, horizon, self.confidence);
        }
        let pairs: Vec<_> = first.iter().copied().zip(second.iter().copied()).collect();
        paired(&pairs, horizon, self.confidence)
    }
}

impl Comparison {
    fn of(method: Method, n: [u64; 2]) -> Self {
        Self { method, n, ..Self::default() }
    }

    fn in_unit(self, metric: &Metric) -> Self {
        let number = |stored: f64| metric.in_unit(stored);
        Self {
            difference: self.difference.map(number),
            unit_means: self.unit_means.map(|means| means.map(number)),
            interval: self.interval.map(|interval| in_unit(interval, metric)),
            ..self
        }
    }

    pub(crate) fn unless(self, incomparable: Option<String>) -> Self {
        if incomparable.is_none() {
            return self;
        }
        let Self { method, n, successes, .. } = self;
        Self { successes, withheld: Some(Withheld::Incomparable), incomparable, ..Self::of(method, n) }
    }

    /// The test needs as many units as any other test, the interval as many as its coverage requires.
    fn of_durations(method: Method, n: [u64; 2], found: Option<Difference>, confidence: f64) -> Self {
        let least = fewest_of(confidence);
        let (interval, withheld) = coverage::given(
            found.and_then(|found| found.interval),
            n[0].min(n[1]),
            coverage::DIFFERENCE,
            found.is_none_or(|found| found.p.is_some()),
        );
        Self {
            horizon: found.map(|found| found.horizon),
            difference: found.map(|found| found.difference),
            interval,
            withheld,
            p: found.and_then(|found| found.p).filter(|_| n[0].min(n[1]) >= least),
            p_error: found.and_then(|found| found.p_error).filter(|_| n[0].min(n[1]) >= least),
            ..Self::of(method, n)
        }
    }

    /// The interval of a difference of rates.
    pub(crate) fn rate_interval(&self, confidence: f64) -> Option<Interval> {
        match (self.method, self.pairs, self.successes, self.n) {
            (Method::Mcnemar, Some(pairs), ..) => pairs.interval(confidence),
            (Method::Fisher, _, Some([k, l]), [m, n]) => newcombe((k, m), (l, n), confidence),
            _ => self.counts.interval(confidence),
        }
    }

    fn tested(self, test: Option<ExactTest>) -> Self {
        Self { p: test.map(|test| test.p), mid_p: test.map(|test| test.mid_p), ..self }
    }

    /// The units, pairs or episodes that are too few for a verdict, or the lost episodes that decide it; else `None`.
    pub(crate) fn unsaid(&self, confidence: f64) -> Option<Units> {
        if let Some(units) = &self.units {
            return units.too_few.then(|| units.clone()).or_else(|| LossCases::unsettled(self.losses.as_ref()));
        }
        let [m, n] = self.n;
        let (least, name) = match self.method {
            Method::Mcnemar => (0.5f64.powf(m as f64 - 1.0), "pairs"),
            Method::Fisher => {
                let divisions: f64 = (1..=m.min(n)).map(|k| (m.max(n) + k) as f64 / k as f64).product();
                (if m == n { 2.0 / divisions } else { 1.0 / divisions }, "episodes")
            }
            Method::RestrictedMeanPaired | Method::RestrictedMean if m.min(n) < fewest_of(confidence) => {
                (f64::INFINITY, if self.method == Method::RestrictedMean { "episodes" } else { "pairs" })
            }
            _ => return LossCases::unsettled(self.losses.as_ref()),
        };
        let is_hopeless =
            (self.p.is_some() || least == f64::INFINITY) && level(confidence).is_some_and(|level| least > level);
        let hopeless = is_hopeless.then(|| Units { n: m.min(n), name: name.to_owned(), too_few: true });
        hopeless.or_else(|| LossCases::unsettled(self.losses.as_ref()))
    }

    /// Returns true if no outcome of these units could be a verdict, or there is no test.
    pub fn cannot_say(&self, confidence: f64) -> bool {
        self.p.is_none() || self.unsaid(confidence).is_some()
    }

    /// The sign of a shown difference; `None` if no difference is shown.
    pub fn sign(&self) -> Option<Sign> {
        let difference = self.difference.filter(|_| self.separated)?;
        Some(if difference > 0.0 { Sign::Higher } else { Sign::Lower })
    }
}

/// An interval of stored values in the unit of their metric.
pub(crate) fn in_unit(Interval { low, high }: Interval, metric: &Metric) -> Interval {
    Interval { low: metric.in_unit(low), high: metric.in_unit(high) }
}

fn fewest_of(confidence: f64) -> u64 {
    level(confidence).map_or(u64::MAX, |level| fewest(level) as u64)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    Higher,
    Lower,
}
