//! Finds episodes that copy others under another id: all rows are the same, except the id.
//!
//! A copy counts as an independent episode in every number, so it makes results look more certain than they are.

use std::collections::{BTreeSet, HashMap};
use std::num::NonZeroUsize;

use super::episodes::episode_hash::EPISODE_HASH;
use super::error::TraceError;
use super::read::open::TraceSet;
use super::read::parallel_scan::{Episodes, ScanEvent, pass};
use super::read::prints::prints;
use super::read::projection::{EPISODE_ID, Layout};
use super::schema::Kind;

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
        // Two prints of 64 bits: one alone might be equal by chance among millions of episodes.
        let [one, other] = [1, 2].map(|seed| prints(&episodes.columns[EPISODE_ID + 1..], &rows, seed));
        ids.into_iter().zip(one.into_iter().zip(other)).collect::<Vec<_>>()
    };
    let (mut first, mut found) = (HashMap::new(), Vec::new());
    pass(set.files(), &layout, threads, &work, |_, event| {
        let episodes = match event {
            ScanEvent::Whole(episodes) => episodes,
            ScanEvent::Fault(finding) => return Err(TraceError::from(finding)),
        };
        for (episode, print) in episodes {
            match first.get(&print) {
                // An id that comes twice is another finding.
                Some(of) if *of == episode => {}
                Some(of) => found.push(Copied { episode, of: String::clone(of) }),
                None => drop(first.insert(print, episode)),
            }
        }
        Ok(())
    })?;
    Ok(found)
}
