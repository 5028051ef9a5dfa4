//! The agreement of coders: Cohen's kappa for each label and each pair of coders.

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::Serialize;

use crate::{Study, StudyError};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::format::{counted, fixed};
use mirrorstats_statistics::agreement::{FEWEST, Kappa};
use mirrorstats_statistics::comparisons::paired::Pairs;
use mirrorstats_statistics::intervals::interval::Interval;
use mirrorstats_tables::Table;

/// The labels of some traces and how far coders agree.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct LabelAgreement {
    /// The episodes of the traces.
    pub episodes: u64,
    /// Those that somebody coded.
    pub coded: u64,
    /// Coded episodes that the traces lack, or that the filter leaves out.
    pub elsewhere: u64,
    /// The coders by name.
    pub coders: Vec<CoderCount>,
    /// The labels by name.
    pub labels: Vec<LabelCount>,
    /// Each label and each pair of coders.
    pub agreement: Vec<PairAgreement>,
}

/// A coder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct CoderCount {
    pub coder: String,
    /// The episodes that the coder coded.
    pub episodes: u64,
}

/// A label.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct LabelCount {
    pub label: String,
    /// The episodes where a coder puts it.
    pub episodes: u64,
}

/// The agreement of two coders on a label, over the episodes that both coded.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct PairAgreement {
    pub label: String,
    pub coders: [String; 2],
    /// The episodes that both coded.
    pub n: u64,
    #[serde(flatten)]
    pub counts: Pairs,
    /// The share of episodes on which they agree; null without an episode.
    pub agreement: Option<f64>,
    /// Cohen's kappa; null if it cannot be said.
    pub kappa: Option<f64>,
    /// Its interval; null if it cannot be said.
    pub interval: Option<Interval>,
    /// The reason why kappa or its interval cannot be said.
    pub cannot_say: Option<String>,
}

type Coded<'l> = BTreeMap<&'l str, BTreeSet<&'l str>>;

const MOST_COMPARISONS: Limit = Limit::new("pairs of coders times labels; leave episodes out with --where", 20_000);

impl PairAgreement {
    #[expect(clippy::cast_precision_loss, reason = "counts of episodes are far below 2^53")]
    fn new(label: &str, coders: [&str; 2], counts: Pairs, confidence: f64) -> Self {
        let (n, kappa) = (counts.n(), Kappa::of(counts, confidence));
        let interval = kappa.and_then(|kappa| kappa.interval);
        let cannot_say = match (kappa, interval) {
            (None, _) if n < FEWEST => Some(format!("{n} episodes coded by both, expected {FEWEST}")),
            (None, _) => Some("both say the same of every episode".to_owned()),
            (Some(_), None) => Some("no interval: they never differ".to_owned()),
            (Some(_), Some(_)) => None,
        };
        Self {
            label: label.to_owned(),
            coders: coders.map(str::to_owned),
            n,
            counts,
            agreement: (n > 0).then(|| (counts.both + counts.neither) as f64 / n as f64),
            kappa: kappa.map(|kappa| kappa.value),
            interval,
            cannot_say,
        }
    }
}

/// The labels beside the traces, and the agreement of each pair of coders at this confidence. Errors: as
/// [`Study::score`]; scores in the place of traces.
pub fn agreement(study: &Study, confidence: f64) -> Result<LabelAgreement, StudyError> {
    let labels = study.traces()?.labels();
    let table = study.score()?.episodes;
    let ids: BTreeSet<&str> = table.keys.iter().map(|key| key.episode_id).collect();
    let coded = labels.episodes().filter(|id| ids.contains(id)).count() as u64;
    let elsewhere = labels.episodes().count() as u64 - coded;
    let mut coders = labels.by_coder();
    for episodes in coders.values_mut() {
        episodes.retain(|id, _| ids.contains(id));
    }
    coders.retain(|_, episodes| !episodes.is_empty());
    let words: BTreeSet<&str> = coders.values().flat_map(BTreeMap::values).flatten().copied().collect();
    let names: Vec<&str> = coders.keys().copied().collect();
    let pairs = names.len() as u64 * (names.len() as u64).saturating_sub(1) / 2;
    MOST_COMPARISONS.check(pairs.saturating_mul(words.len() as u64))?;
    let mut agreement = Vec::new();
    for (at, first) in names.iter().enumerate() {
        for second in &names[at + 1..] {
            let counts = compared(&coders[first], &coders[second], &words);
            let of = |(label, counts): (&&str, Pairs)| PairAgreement::new(label, [*first, *second], counts, confidence);
            agreement.extend(words.iter().zip(counts).map(of));
        }
    }
    agreement.sort_by(|one, other| one.label.cmp(&other.label));
    let mut with: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (id, labels) in coders.values().flatten() {
        for label in labels {
            with.entry(label).or_default().insert(id);
        }
    }
    Ok(LabelAgreement {
        episodes: ids.len() as u64,
        coded,
        elsewhere,
        coders: coders
            .iter()
            .map(|(coder, episodes)| CoderCount { coder: (*coder).to_owned(), episodes: episodes.len() as u64 })
            .collect(),
        labels: with
            .into_iter()
            .map(|(label, ids)| LabelCount { label: label.to_owned(), episodes: ids.len() as u64 })
            .collect(),
        agreement,
    })
}

/// The counts of two coders for each label, in one pass over the episodes that both coded.
fn compared(first: &Coded<'_>, second: &Coded<'_>, words: &BTreeSet<&str>) -> Vec<Pairs> {
    let (mut n, mut given) = (0, BTreeMap::<&str, Pairs>::new());
    for (own, other) in first.iter().filter_map(|(id, own)| Some((own, second.get(id)?))) {
        n += 1;
        for label in own.union(other) {
            let counts = given.entry(label).or_default();
            match (own.contains(label), other.contains(label)) {
                (true, true) => counts.both += 1,
                (true, false) => counts.first_only += 1,
                (false, _) => counts.second_only += 1,
            }
        }
    }
    let whole = |label: &&str| {
        let counts = given.get(label).copied().unwrap_or_default();
        Pairs { neither: n - counts.n(), ..counts }
    };
    words.iter().map(whole).collect()
}

impl LabelAgreement {
    /// The labels and the agreement as text.
    pub fn render(&self, width: Option<usize>) -> String {
        let mut parts = vec![format!("{} of {} coded\n", self.coded, counted(self.episodes, "episode"))];
        if self.elsewhere > 0 {
            let elsewhere = counted(self.elsewhere, "episode");
            parts.push(format!("{elsewhere} more coded, which the traces lack or --where leaves out\n"));
        }
        let coders = self.coders.iter().map(|coder| [coder.coder.clone(), coder.episodes.to_string()]);
        let labels = self.labels.iter().map(|label| [label.label.clone(), label.episodes.to_string()]);
        for (title, table) in [
            ("", Table::of_texts(["coder", "episodes"]).aligned_right([1]).with(coders)),
            ("", Table::of_texts(["label", "episodes"]).aligned_right([1]).with(labels)),
            ("agreement of two coders\n", pairs(&self.agreement)),
        ] {
            if !table.is_empty() {
                parts.push(format!("\n{title}{}", table.within(width)));
            }
        }
        if self.coders.len() == 1 {
            parts.push("\nOne coder: agreement needs a second one on the same episodes.\n".to_owned());
        }
        parts.concat()
    }
}

fn pairs(pairs: &[PairAgreement]) -> Table {
    let header =
        ["label", "coders", "n", "both", "first only", "second only", "neither", "agree", "kappa", "95 % interval"];
    let rows = pairs.iter().map(|pair| {
        let counts = pair.counts;
        let shown = pair
            .interval
            .map(|interval| format!("[{}, {}]", fixed(Some(interval.low), 2), fixed(Some(interval.high), 2)));
        let why = pair.cannot_say.as_ref().map(|why| format!("cannot say: {why}"));
        [
            pair.label.clone(),
            pair.coders.join(", "),
            pair.n.to_string(),
            counts.both.to_string(),
            counts.first_only.to_string(),
            counts.second_only.to_string(),
            counts.neither.to_string(),
            fixed(pair.agreement, 2),
            fixed(pair.kappa, 2),
            shown.or(why).unwrap_or_default(),
        ]
    });
    Table::of_texts(header).aligned_right(2..=8).with(rows)
}
