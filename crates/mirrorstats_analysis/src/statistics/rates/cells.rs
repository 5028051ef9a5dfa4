//! Every cell with its count and intervals; by seed, if the design declares that episodes of one seed depend on each other.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::statistics::comparisons::compare::in_unit;
use crate::statistics::comparisons::matching::Units;
use crate::statistics::episodes::Replies;
use crate::study::{Block, RowKey, Study};
use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::catalogs::catalog::{Kind, StandardError};
use mirrorstats_score::cells::interval::{bounded, cell_interval};
use mirrorstats_score::cells::{Cells, Group, KeyValue};
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_score::tables::table::{CONDITION, MetricColumn};
use mirrorstats_statistics::comparisons::units::mean;
use mirrorstats_statistics::design::Cluster;
use mirrorstats_statistics::intervals::bootstrap;
use mirrorstats_statistics::intervals::clustered::{Clustered, clustered, clustered_rate};
use mirrorstats_statistics::intervals::coverage::{self, Withheld};
use mirrorstats_statistics::intervals::interval::{Interval, clopper_pearson, jeffreys, wilson, wilson_of_units};

/// Conditional metrics with fewer defined episodes are marked.
pub(crate) const FEW: u64 = 5;

/// One cell: the episodes of one group under one metric.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CellRow {
    /// The group, by the columns grouped by.
    pub key: IndexMap<String, KeyValue>,
    /// The metric.
    pub metric: String,
    /// A rate or a quantity.
    pub kind: Kind,
    /// The episodes of the group.
    pub episodes: u64,
    /// Those in which the metric is defined: the denominator.
    pub n: u64,
    /// The sum of the values; for a rate, the successes.
    pub sum: Decimal,
    /// The arithmetic mean.
    pub mean: Option<f64>,
    /// The standard error that the definition asks for.
    pub se: Option<f64>,
    /// The scenes, seeds or participants where some have several episodes; the intervals of a rate count each once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units: Option<Units>,
    /// The mean over these units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit_mean: Option<f64>,
    /// The intervals that fit the kind.
    pub intervals: Intervals,
    /// True if a conditional metric rests on fewer than five episodes here.
    pub few: bool,
    /// The episodes that were lost and are not counted; absent if none was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lost: Option<u64>,
    /// The replies of the cell's episodes that gave no decision; absent if each gave one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unusable_replies: Option<u64>,
}

/// Intervals of a mean, by kind.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, deny_unknown_fields)]
pub enum Intervals {
    /// Of a rate, from its counts.
    Rate {
        /// Score interval, the default.
        wilson: Option<Interval>,
        /// Exact interval.
        clopper_pearson: Option<Interval>,
        /// Equal-tailed credible interval.
        jeffreys: Option<Interval>,
    },
    /// Of the mean of a quantity.
    Quantity {
        /// Student's t with n - 1 degrees of freedom, within the values that a mean of steps can have.
        student_t: Option<Interval>,
        /// The reason for a missing interval.
        student_t_withheld: Option<Withheld>,
        /// Bias-corrected and accelerated bootstrap, seeded; none for very many values.
        bootstrap: Option<Interval>,
        /// The reason for a missing interval.
        bootstrap_withheld: Option<Withheld>,
    },
}

impl CellRow {
    /// Adds the counts of lost episodes and of replies without a decision.
    pub(crate) fn note_left_out(&mut self, lost: Option<&LostCounts>, replies: Option<&Replies>) {
        let lost = lost.into_iter().flat_map(LostCounts::iter);
        let lost = lost.filter(|(key, _)| self.is_of(&key.experiment, &key.model, Some(&key.condition)));
        let lost: u64 = lost.map(|(_, count)| count).sum();
        let replies = replies.into_iter().flat_map(|replies| &replies.cells);
        let replies = replies.filter(|it| self.is_of(&it.key.experiment, &it.key.model, it.key.condition.as_deref()));
        let unusable: u64 = replies.map(|it| it.unusable).sum();
        (self.lost, self.unusable_replies) = ((lost > 0).then_some(lost), (unusable > 0).then_some(unusable));
    }

    /// Returns true if the cell has episodes of this experiment, model and condition, without dividing them further.
    fn is_of(&self, experiment: &str, model: &str, condition: Option<&str>) -> bool {
        self.key.iter().all(|(name, value)| match (name.as_str(), value) {
            ("experiment", KeyValue::Text(text)) => text == experiment,
            ("model", KeyValue::Text(text)) => text == model,
            (CONDITION, KeyValue::Text(text)) => condition.is_none_or(|condition| condition == text),
            _ => false,
        })
    }

    pub(crate) fn all(study: &Study, cells: &Cells) -> Vec<Self> {
        let mut rows = vec![Vec::new(); cells.groups.len()];
        let members = cells.membership(study.table).expect("the cells are grouped by columns of this table");
        members.into_iter().zip(0..).for_each(|(group, row)| rows[group].push(row));
        cells.groups.iter().zip(&rows).flat_map(|(group, rows)| Self::of_group(study, cells, group, rows)).collect()
    }

    fn of_group(study: &Study, cells: &Cells, group: &Group, rows: &[usize]) -> Vec<Self> {
        let has_repeats = study.has_repeats(rows.iter().copied());
        let key: IndexMap<String, KeyValue> = cells.by.iter().cloned().zip(group.key.iter().cloned()).collect();
        let of_metric = |(name, moments): (&String, &Moments)| {
            let metric = study.metric(name);
            let value = |row: usize| study.column(name)?.get(row);
            let units: Option<Vec<Moments>> =
                has_repeats.then(|| study.units_of(rows.iter().copied(), value).into_values().collect());
            let unit_mean = units.as_deref().and_then(mean);
            let units = units.map(|units| units.len());
            let confidence = study.confidence;
            let intervals = match (metric.kind, moments.counts()) {
                (Kind::Rate, Some(_)) if has_repeats => Intervals::Rate {
                    wilson: unit_mean.zip(units).and_then(|(mean, n)| wilson_of_units(mean, n, confidence)),
                    clopper_pearson: None,
                    jeffreys: None,
                },
                (Kind::Rate, Some((k, n))) => Intervals::Rate {
                    wilson: wilson(k, n, confidence),
                    clopper_pearson: clopper_pearson(k, n, confidence),
                    jeffreys: jeffreys(k, n, confidence),
                },
                _ => Intervals::quantity(study, name, moments, rows, has_repeats),
            };
            let name_of_units = || study.name_of_unit(rows.first().copied()).to_owned();
            Self {
                key: key.clone(),
                metric: name.clone(),
                kind: metric.kind,
                episodes: group.episodes,
                n: moments.n,
                sum: metric.sums(moments)[0],
                mean: metric.mean(moments),
                se: metric.standard_error(moments),
                units: units.map(|n| Units { n: n as u64, name: name_of_units(), too_few: false }),
                unit_mean: unit_mean.map(|mean| metric.in_unit(mean)),
                intervals,
                few: moments.n < FEW && metric.when.is_some(),
                lost: None,
                unusable_replies: None,
            }
        };
        cells.metrics.iter().zip(&group.moments).map(of_metric).collect()
    }
}

impl Intervals {
    fn quantity(study: &Study, name: &str, moments: &Moments, rows: &[usize], has_repeats: bool) -> Self {
        if has_repeats {
            let withheld = Some(Withheld::Dependent);
            let (student_t_withheld, bootstrap_withheld) = (withheld, withheld);
            return Self::Quantity { student_t: None, student_t_withheld, bootstrap: None, bootstrap_withheld };
        }
        let (metric, range, confidence) = (study.metric(name), study.range(name), study.confidence);
        // 10,000 resamples are drawn only if their interval may be shown.
        let resampled = (moments.n >= coverage::BOOTSTRAP && moments.has_spread())
            .then(|| {
                let values = study.column(name)?;
                bootstrap::mean(&rows.iter().filter_map(|&row| values.get(row)).collect::<Vec<_>>(), confidence)
            })
            .flatten();
        let (student_t, student_t_withheld) = cell_interval(moments, metric, range, confidence);
        let (bootstrap, bootstrap_withheld) = bounded(resampled, moments, range, coverage::BOOTSTRAP);
        let [student_t, bootstrap] = [student_t, bootstrap].map(|found| found.map(|found| in_unit(found, metric)));
        Self::Quantity { student_t, student_t_withheld, bootstrap, bootstrap_withheld }
    }
}

/// The seeds of one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClusterRow {
    #[serde(flatten)]
    pub key: RowKey,
    /// The metric.
    pub metric: String,
    /// The defined episodes.
    pub n: u64,
    /// The seeds with a defined episode.
    pub seeds: usize,
    /// The arithmetic mean.
    pub mean: Option<f64>,
    /// The sample standard error that takes episodes as independent.
    pub se: Option<f64>,
    /// The interval with seeds as independent units; `None` for fewer than two seeds.
    pub by_seed: Option<Clustered>,
    /// The reason why it has no interval.
    pub withheld: Option<Withheld>,
}

impl ClusterRow {
    pub(crate) fn all(study: &Study) -> Vec<Self> {
        if study.design.clusters() != Some(Cluster::Seed) {
            return Vec::new();
        }
        let of_block = |block| study.table.metrics.iter().map(move |column| Self::of(study, block, column));
        study.blocks().flat_map(of_block).collect()
    }

    fn of(study: &Study, block: &Block, column: &MetricColumn) -> Self {
        // The units are seeds, as declared.
        let seeds: Vec<Moments> = study.by_unit(block, |row| column.get(row)).into_values().collect();
        let whole = block.moments(column);
        let metric = study.metric(&column.name);
        let found = match metric.kind {
            Kind::Rate => clustered_rate(&seeds, study.confidence),
            Kind::Quantity => clustered(&seeds, study.confidence),
        };
        let range = study.range(&column.name);
        let interval = found.and_then(|found| found.interval).map(|interval| interval.within(range.low, range.high));
        let (interval, withheld) =
            coverage::given(interval, seeds.len() as u64, coverage::CLUSTERS, found.is_some_and(|it| it.se > 0.0));
        let interval = interval.map(|interval| in_unit(interval, metric));
        Self {
            key: block.key(),
            metric: column.name.clone(),
            n: whole.n,
            seeds: seeds.len(),
            mean: metric.mean(&whole),
            se: whole.se(StandardError::Sample).map(|se| metric.in_unit(se)),
            by_seed: found.map(|found| Clustered { interval, se: metric.in_unit(found.se), ..found }),
            withheld,
        }
    }
}
