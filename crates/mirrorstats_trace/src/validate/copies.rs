//! Finds episodes that copy others under another id: all rows are the same, except the id.
//!
//! A copy counts as an independent episode in every number, so it makes results look more certain than they are.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::num::NonZeroUsize;
use std::ops::Range;

use arrow::array::{Array as _, AsArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Int64Type};

use crate::episodes::episode_hash::EPISODE_HASH;
use crate::error::TraceError;
use crate::footers::declared::StepHashes;
use crate::read::open::TraceSet;
use crate::read::parallel_scan::{Episodes, ScanEvent, pass};
use crate::read::projection::{EPISODE_ID, Layout};
use crate::read::row_hashes::row_hashes;
use crate::schema::Kind;

/// Columns that say which episode it is and how its replies came, but not what happened in it.
const NOT_DECISIVE: [&str; 16] = [
    "model",
    "seed",
    "run",
    "condition",
    "scene",
    "repetition",
    "participant",
    "fingerprint",
    "t",
    "reply_status",
    "reply_repair",
    "reply_fault",
    LATENCY,
    "prompt_tokens",
    "completion_tokens",
    "cost_usd",
];
const LATENCY: &str = "latency_ms";
/// Latencies that are kept of each episode; more do not distinguish better.
const LATENCIES: usize = 16;

/// The decisive columns of every episode, by its id.
pub fn decisive(set: &TraceSet, threads: NonZeroUsize) -> Result<BTreeMap<String, StepHashes>, TraceError> {
    let is_plain = |name: &&str| {
        *name != EPISODE_HASH
            && (*name == LATENCY || !NOT_DECISIVE.contains(name))
            && set.domain().column(name).is_some()
            && set.column(name).is_some_and(|column| column.kind != Kind::Unsupported && column.conflict.is_none())
    };
    let layout = Layout::new(set, set.column_names().into_iter().filter(is_plain), [])?;
    let is_decisive = |at: &usize| *at != EPISODE_ID && !NOT_DECISIVE.contains(&layout.columns[*at].name.as_str());
    let places: Vec<usize> = (0..layout.columns.len()).filter(is_decisive).collect();
    let latency = layout.columns.iter().position(|column| column.name == LATENCY);
    let work = |episodes: Episodes| {
        let rows: Vec<_> = episodes.offsets.windows(2).map(|ends| ends[0]..ends[1]).collect();
        let of = |seed| row_hashes(places.iter().map(|at| &episodes.columns[*at]), &rows, seed);
        let latencies = latency.and_then(|at| cast(&episodes.columns[at].flat().ok()?, &DataType::Int64).ok());
        let latencies = |rows: &Range<usize>| {
            let column = latencies.as_ref().map(AsArray::as_primitive::<Int64Type>);
            let first = rows.clone().take(LATENCIES);
            column
                .into_iter()
                .flat_map(|column| first.clone().filter(|row| column.is_valid(*row)).map(|row| column.value(row)))
                .collect()
        };
        let prints = of(1).into_iter().zip(of(2));
        let each = rows.iter().zip(prints).filter_map(|(rows, print)| {
            Some((episodes.id(rows.start)?.to_owned(), StepHashes { print, latencies: latencies(rows) }))
        });
        each.collect::<Vec<_>>()
    };
    let mut found = BTreeMap::new();
    pass(set.files(), &layout, threads, &work, |_, event| {
        match event {
            ScanEvent::Whole(episodes) => found.extend(episodes),
            ScanEvent::Fault(finding) => return Err(TraceError::from(finding)),
        }
        Ok(())
    })?;
    Ok(found)
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Copied {
    pub episode: String,
    /// The first episode with the same rows.
    pub of: String,
}

/// The copies among these episodes, in the order of the files. The hash of an episode's rows is left out, because it
/// includes the id.
pub fn copies(set: &TraceSet, may_be: &BTreeSet<String>, threads: NonZeroUsize) -> Result<Vec<Copied>, TraceError> {
    if may_be.is_empty() {
        return Ok(Vec::new());
    }
    let is_plain = |name: &&str| {
        *name != EPISODE_HASH
            && set.column(name).is_some_and(|column| column.kind != Kind::Unsupported && column.conflict.is_none())
    };
    let layout = Layout::new(set, set.column_names().into_iter().filter(is_plain), [])?;
    let work = |episodes: Episodes| {
        let rows = episodes.offsets.windows(2).map(|ends| ends[0]..ends[1]);
        let (ids, rows): (Vec<String>, Vec<_>) = rows
            .filter_map(|rows| Some((episodes.id(rows.start).filter(|id| may_be.contains(*id))?.to_owned(), rows)))
            .unzip();
        // Two hashes of 64 bits: one alone might be equal by chance among millions of episodes.
        let [one, other] = [1, 2].map(|seed| row_hashes(&episodes.columns[EPISODE_ID + 1..], &rows, seed));
        ids.into_iter().zip(one.into_iter().zip(other)).collect::<Vec<_>>()
    };
    let (mut first, mut found) = (HashMap::new(), Vec::new());
    pass(set.files(), &layout, threads, &work, |_, event| {
        let episodes = match event {
            ScanEvent::Whole(episodes) => episodes,
            ScanEvent::Fault(finding) => return Err(TraceError::from(finding)),
        };
        for (episode, hash) in episodes {
            match first.get(&hash) {
                // An id that comes twice is another finding.
                Some(of) if *of == episode => {}
                Some(of) => found.push(Copied { episode, of: String::clone(of) }),
                None => drop(first.insert(hash, episode)),
            }
        }
        Ok(())
    })?;
    Ok(found)
}
