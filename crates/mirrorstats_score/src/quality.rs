//! Reply quality by experiment, model and condition: how many replies could be read, how long they took, what they
//! cost.
//!
//! Rule: sums are exact, so they do not depend on the order of files or threads. Values that a trace does not record
//! are not counted, which differs from zero.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use arrow::array::{Array as _, ArrayRef, ArrowPrimitiveType, AsArray as _, BooleanArray};
use arrow::datatypes::{Float64Type, Int64Type};
use schemars::JsonSchema;
use serde::Serialize;

use super::kernels::vectors::Coded;
use super::tables::builder::episode_ids;
use super::tables::table::{CONDITION, UnusableCount, default_text};
use mirrorstats_identification::UNREADABLE;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::scan::EpisodeBatch;
use mirrorstats_trace::schema::{self, Kind};
pub use mirrorstats_trace::validate::replies::statuses;
use mirrorstats_trace::validate::replies::{REPLY_STATUS, ReplyCounts};

const TEXTS: [&str; 3] = [REPLY_STATUS, "reply_repair", "reply_fault"];
const NUMBERS: [&str; 4] = ["latency_ms", "prompt_tokens", "completion_tokens", "cost_usd"];
/// The separator between the repairs of one reply.
const AND: char = '+';
/// Costs are summed in billionths of a dollar.
const NANO: f64 = 1e9;

/// Whose replies they are.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, JsonSchema)]
pub struct CellKey {
    /// The experiment.
    pub experiment: String,
    /// The model.
    pub model: String,
    /// The condition; `default` where the trace names none.
    pub condition: String,
}

/// The reply quality of one cell.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Quality {
    /// Episodes in the traces.
    pub episodes: u64,
    /// Their steps.
    pub steps: u64,
    /// Episodes that the infrastructure ended, or kept from being recorded; null where nobody counted them.
    pub lost: Option<u64>,
    /// Replies by status; empty where the traces do not record it.
    pub statuses: BTreeMap<String, u64>,
    /// Repairs by name; a reply with two is counted under both.
    pub repairs: BTreeMap<String, u64>,
    /// The reason why replies gave no decision or no identification, in the words of their parser.
    #[serde(skip)]
    pub faults: BTreeMap<String, u64>,
    /// Unusable and all replies of each episode with a reply.
    #[serde(skip)]
    pub by_episode: BTreeMap<String, UnusableCount>,
    /// Milliseconds from request to reply: how many replies took so long.
    #[serde(skip)]
    pub latencies: BTreeMap<i64, u64>,
    /// Tokens of requests.
    pub prompt_tokens: Total,
    /// Tokens of replies.
    pub completion_tokens: Total,
    /// Costs, in billionths of a US dollar.
    pub cost_nano_usd: Total,
}

/// A sum, and over how many replies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Total {
    /// Replies with a value.
    pub replies: u64,
    /// The sum of the values.
    pub sum: i128,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct QualityByCell(pub BTreeMap<CellKey, Quality>);

impl Total {
    fn add(&mut self, value: i128) {
        self.replies += 1;
        self.sum += value;
    }

    #[expect(clippy::cast_precision_loss, reason = "a mean for people")]
    pub fn mean(self) -> Option<f64> {
        (self.replies > 0).then(|| self.sum as f64 / self.replies as f64)
    }
}

impl Quality {
    pub fn replies(&self) -> u64 {
        self.statuses.values().sum()
    }

    pub fn unusable(&self) -> u64 {
        self.unread().map(|(_, replies)| replies).sum()
    }

    pub fn unread(&self) -> impl Iterator<Item = (&String, &u64)> {
        self.statuses.iter().filter(|(status, _)| !ReplyCounts::is_read(status))
    }

    /// The most frequent reason for replies without a decision, with its count; ties go to the alphabetically first.
    pub fn commonest_fault(&self) -> Option<(&str, u64)> {
        let faults = self.faults.iter().filter(|(fault, _)| !fault.starts_with(UNREADABLE));
        let faults = faults.map(|(fault, replies)| (fault.as_str(), *replies));
        faults.max_by(|(a, few), (b, many)| few.cmp(many).then_with(|| b.cmp(a)))
    }

    /// The identifications that no rule reads, with their counts.
    pub fn unread_identifications(&self) -> impl Iterator<Item = (&str, u64)> {
        self.faults.iter().filter_map(|(fault, replies)| Some((fault.strip_prefix(UNREADABLE)?, *replies)))
    }

    pub fn of_status(&self, status: &str) -> u64 {
        self.statuses.get(status).copied().unwrap_or(0)
    }

    /// The lowest latency that this share of replies does not exceed, ms; `None` if none is recorded.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_sign_loss,
        clippy::cast_possible_truncation,
        reason = "counts of replies are far below 2^53"
    )]
    pub fn latency(&self, share: f64) -> Option<i64> {
        let all: u64 = self.latencies.values().sum();
        let wanted = ((all as f64 * share).ceil() as u64).max(1);
        let mut seen = 0;
        self.latencies
            .iter()
            .find(|(_, replies)| {
                seen += **replies;
                seen >= wanted
            })
            .map(|(latency, _)| *latency)
    }

    fn merge(&mut self, other: Self) {
        self.episodes += other.episodes;
        self.steps += other.steps;
        self.lost = match (self.lost, other.lost) {
            (Some(one), Some(other)) => Some(one + other),
            (one, other) => one.or(other),
        };
        add(&mut self.statuses, other.statuses);
        add(&mut self.repairs, other.repairs);
        add(&mut self.faults, other.faults);
        self.by_episode.extend(other.by_episode);
        add(&mut self.latencies, other.latencies);
        for (total, more) in [
            (&mut self.prompt_tokens, other.prompt_tokens),
            (&mut self.completion_tokens, other.completion_tokens),
            (&mut self.cost_nano_usd, other.cost_nano_usd),
        ] {
            total.replies += more.replies;
            total.sum += more.sum;
        }
    }
}

fn add<K: Ord>(counts: &mut BTreeMap<K, u64>, more: impl IntoIterator<Item = (K, u64)>) {
    for (key, replies) in more {
        *counts.entry(key).or_default() += replies;
    }
}

impl QualityByCell {
    pub fn merge(&mut self, other: Self) {
        for (key, quality) in other.0 {
            self.0.entry(key).or_default().merge(quality);
        }
    }

    /// Takes the unusable and total replies of each episode out of this tally.
    pub fn take_by_episode(&mut self) -> BTreeMap<String, UnusableCount> {
        self.0.values_mut().flat_map(|quality| std::mem::take(&mut quality.by_episode)).collect()
    }

    pub fn has_conditions(&self) -> bool {
        self.0.keys().any(|key| Some(key.condition.as_str()) != default_text(CONDITION))
    }

    pub fn is_recorded(&self) -> bool {
        self.0.values().any(|quality| !quality.statuses.is_empty())
    }

    pub fn whole(&self) -> Quality {
        let mut whole = Quality::default();
        self.0.values().cloned().for_each(|quality| whole.merge(quality));
        whole
    }
}

#[derive(Clone, Debug)]
pub struct QualityReader {
    columns: Vec<String>,
    has_condition: bool,
}

impl QualityReader {
    /// A reader of the columns that record replies in these traces. Skips columns whose type differs from the schema's.
    pub fn of(traces: &TraceSet) -> Self {
        Self::of_columns(traces, TEXTS.iter().chain(&NUMBERS))
    }

    /// Like [`QualityReader::of`], for the statuses of replies alone.
    pub fn of_statuses(traces: &TraceSet) -> Self {
        Self::of_columns(traces, &[REPLY_STATUS])
    }

    fn of_columns<'n>(traces: &TraceSet, names: impl IntoIterator<Item = &'n &'n str>) -> Self {
        let fits = |name: &&&str| {
            let known = schema::column(name).map(|column| column.stored.kind());
            traces.declares(name) && traces.column(name).map(|column| column.kind) == known
        };
        let columns = names.into_iter().filter(fits).map(|name| (*name).to_owned()).collect();
        let has_condition =
            traces.declares(CONDITION) && traces.column(CONDITION).is_some_and(|c| c.kind == Kind::String);
        Self { columns, has_condition }
    }

    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    pub fn constants(&self) -> Option<String> {
        self.has_condition.then(|| CONDITION.to_owned())
    }

    pub fn read(&self, batch: &EpisodeBatch, kept: Option<&BooleanArray>) -> QualityByCell {
        let mut cells = ReplyCells::default();
        let columns = ReplyColumns::of(batch);
        let keys = ["experiment", "model", CONDITION].map(|name| Coded::of(&[], &batch.episodes, name));
        let ids = if columns.texts[0].is_some() { episode_ids(batch) } else { Vec::new() };
        for (episode, rows) in batch.offsets.windows(2).enumerate() {
            if kept.is_some_and(|kept| !(kept.is_valid(episode) && kept.value(episode))) {
                continue;
            }
            let counts = cells.at(&keys, episode);
            counts.rest.episodes += 1;
            counts.rest.steps += (rows[1] - rows[0]) as u64;
            if !self.columns.is_empty() {
                columns.add(rows[0]..rows[1], counts);
                let replies = columns.replies(rows[0]..rows[1]).filter(|count| count.replies > 0);
                counts.rest.by_episode.extend(ids.get(episode).cloned().zip(replies));
            }
        }
        cells.finish(&columns)
    }
}

/// Quality by cell while a batch is read; texts are indices of distinct values.
#[derive(Default)]
struct ReplyCells {
    known: HashMap<[Option<usize>; 3], usize>,
    cells: Vec<(CellKey, Counts)>,
}

#[derive(Default)]
struct Counts {
    texts: [Vec<u64>; 3],
    rest: Quality,
}

impl ReplyCells {
    fn at(&mut self, keys: &[Option<Coded<'_>>; 3], episode: usize) -> &mut Counts {
        let codes = keys.each_ref().map(|column| column.as_ref()?.code(episode));
        let at = *self.known.entry(codes).or_insert_with(|| {
            let [experiment, model, condition] = [0, 1, 2].map(|at| Some(keys[at].as_ref()?.texts.value(codes[at]?)));
            let key = CellKey {
                experiment: experiment.unwrap_or_default().to_owned(),
                model: model.unwrap_or_default().to_owned(),
                condition: condition.or(default_text(CONDITION)).unwrap_or_default().to_owned(),
            };
            self.cells.push((key, Counts::default()));
            self.cells.len() - 1
        });
        &mut self.cells[at].1
    }

    fn finish(self, columns: &ReplyColumns<'_>) -> QualityByCell {
        let mut found = QualityByCell::default();
        for (key, Counts { texts, rest: mut quality }) in self.cells {
            let [statuses, repairs, faults] = [0, 1, 2].map(|at| named(columns.texts[at].as_ref(), &texts[at]));
            add(&mut quality.statuses, statuses);
            for (repairs, replies) in repairs {
                let each = repairs.split(AND).filter(|repair| !repair.is_empty());
                add(&mut quality.repairs, each.map(|repair| (repair.to_owned(), replies)));
            }
            add(&mut quality.faults, faults);
            found.0.entry(key).or_default().merge(quality);
        }
        found
    }
}

fn named(column: Option<&Coded<'_>>, counts: &[u64]) -> Vec<(String, u64)> {
    let all = counts.iter().enumerate().filter(|(_, count)| **count > 0);
    all.filter_map(|(code, count)| Some((column?.texts.value(code).to_owned(), *count))).collect()
}

/// The columns of [`TEXTS`] and [`NUMBERS`] in a batch.
struct ReplyColumns<'a> {
    texts: [Option<Coded<'a>>; 3],
    numbers: [Option<&'a ArrayRef>; 4],
}

impl<'a> ReplyColumns<'a> {
    fn of(batch: &'a EpisodeBatch) -> Self {
        let numbers = NUMBERS.map(|name| batch.steps.column_by_name(name));
        Self { texts: TEXTS.map(|name| Coded::of(&batch.texts, &batch.steps, name)), numbers }
    }

    fn replies(&self, rows: Range<usize>) -> Option<UnusableCount> {
        let status = self.texts[0].as_ref()?;
        let mut count = UnusableCount::default();
        for code in rows.filter_map(|row| status.code(row)) {
            let unusable = u64::from(!ReplyCounts::is_read(status.texts.value(code)));
            count.add(UnusableCount { unusable, replies: 1 });
        }
        Some(count)
    }

    fn add(&self, rows: Range<usize>, Counts { texts, rest }: &mut Counts) {
        for (column, counts) in self.texts.iter().zip(texts) {
            let Some(column) = column else { continue };
            counts.resize(counts.len().max(column.texts.len()), 0);
            rows.clone().filter_map(|row| column.code(row)).for_each(|code| counts[code] += 1);
        }
        let [latency, prompt, completion, cost] = self.numbers;
        each::<Int64Type>(latency, rows.clone(), |latency| *rest.latencies.entry(latency).or_default() += 1);
        for (column, total) in [(prompt, &mut rest.prompt_tokens), (completion, &mut rest.completion_tokens)] {
            each::<Int64Type>(column, rows.clone(), |tokens| total.add(tokens.into()));
        }
        each::<Float64Type>(cost, rows, |cost| {
            if cost.is_finite() {
                rest.cost_nano_usd.add(rounded(cost * NANO));
            }
        });
    }
}

fn each<T: ArrowPrimitiveType>(column: Option<&ArrayRef>, rows: Range<usize>, mut take: impl FnMut(T::Native)) {
    let Some(column) = column.and_then(|column| column.as_primitive_opt::<T>()) else { return };
    let values = column.values();
    match column.nulls().filter(|nulls| nulls.null_count() > 0) {
        None => values[rows].iter().for_each(|value| take(*value)),
        Some(nulls) => rows.filter(|row| nulls.is_valid(*row)).for_each(|row| take(values[row])),
    }
}

/// The nearest integer, halves away from zero. The function `round` and integers of 128 bits took two fifths of
/// the time.
#[expect(clippy::cast_possible_truncation, reason = "a cost of a reply is far below 2^127 billionths")]
fn rounded(value: f64) -> i128 {
    const EXACT: f64 = 4_503_599_627_370_496.0; // 2^52
    if value.abs() >= EXACT {
        return value.round() as i128;
    }
    let whole = value as i64;
    #[expect(clippy::cast_precision_loss, reason = "it is below 2^52")]
    let rest = value - whole as f64;
    i128::from(whole + i64::from(rest >= 0.5) - i64::from(rest <= -0.5))
}

#[cfg(test)]
mod tests {
    use super::{CellKey, Quality, QualityByCell};

    fn of(latencies: &[i64]) -> Quality {
        let mut quality = Quality { episodes: 1, steps: latencies.len() as u64, ..Quality::default() };
        for latency in latencies {
            *quality.latencies.entry(*latency).or_default() += 1;
        }
        quality
    }

    #[test]
    fn a_share_of_latencies_is_the_least_that_is_not_exceeded() {
        let quality = of(&[10, 20, 20, 40]);
        assert_eq!(
            [0.0, 0.25, 0.5, 0.75, 0.76, 1.0].map(|share| quality.latency(share).unwrap()),
            [10, 10, 20, 20, 40, 40]
        );
        assert_eq!(Quality::default().latency(0.5), None);
    }

    #[test]
    fn parts_add_up() {
        let key = CellKey { experiment: "E1".into(), model: "m".into(), condition: "default".into() };
        let part = |status: &str, lost| {
            let statuses = [(status.to_owned(), 2)].into();
            QualityByCell([(key.clone(), Quality { lost, statuses, ..of(&[5]) })].into())
        };
        let mut all = part("ok", None);
        all.merge(part("refusal", Some(1)));
        all.merge(part("refusal", Some(2)));
        let whole = all.whole();
        assert_eq!((whole.episodes, whole.replies(), whole.unusable(), whole.lost), (3, 6, 4, Some(3)));
        assert_eq!((whole.of_status("refusal"), whole.of_status("timeout"), whole.latencies[&5]), (4, 0, 3));
        assert!(all.is_recorded() && !all.has_conditions());
    }
}
