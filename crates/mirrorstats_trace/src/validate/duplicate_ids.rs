//! Checks that episode ids are unique.
//!
//! Rule: the check is exact. It keeps eight bytes per episode: the hash of its id. If two hashes are equal, the traces
//! are read again to compare the ids themselves.

use std::collections::{HashMap, HashSet};
use std::hash::{DefaultHasher, Hasher};
use std::num::NonZeroUsize;

use super::rules::Located;
use crate::diagnostic::{Code, Finding};
use crate::error::TraceError;
use crate::read::open::TraceFile;
use crate::read::parallel_scan::{Episodes, ScanEvent, pass};
use crate::read::projection::Layout;

/// The id hashes of the episodes that begin at a row up to `last`, except episodes without an id.
pub(crate) fn hashes(episodes: &Episodes, last: usize) -> Vec<u64> {
    let firsts = &episodes.offsets[..episodes.len()];
    let begins = &firsts[..firsts.partition_point(|row| *row <= last)];
    episodes.ids(begins).flatten().map(hash).collect()
}

/// A hash that is the same in every run and rarely the same for two ids.
fn hash(id: &str) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(id.as_bytes());
    hasher.finish()
}

#[derive(Default)]
pub(crate) struct IdHashes(Vec<u64>);

impl IdHashes {
    pub(crate) fn add(&mut self, hashes: &[u64]) {
        self.0.extend_from_slice(hashes);
    }

    /// Errors: the first episode, by file and row, that repeats the id of an earlier one.
    pub(crate) fn check(self, files: &[TraceFile], layout: &Layout) -> Result<(), TraceError> {
        let count = self.0.len();
        let shared = repeated_numbers(self.0);
        // Equal hashes nearly always mean equal ids.
        if shared.is_empty() { Ok(()) } else { check_ids(files, layout, &shared, count) }
    }
}

fn repeated_numbers(mut numbers: Vec<u64>) -> HashSet<u64> {
    numbers.sort_unstable();
    numbers.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0]).collect()
}

/// Reads the first `count` episodes again, in file order, and compares the ids with one of these hashes.
fn check_ids(files: &[TraceFile], layout: &Layout, shared: &HashSet<u64>, count: usize) -> Result<(), TraceError> {
    let (mut ids, mut left) = (SeenIds::default(), count);
    let name = |file: usize| files[file].name().to_owned();
    pass(files, layout, NonZeroUsize::MIN, &|episodes| starts(&episodes), |file, event| {
        let starts = match event {
            ScanEvent::Whole(starts) => starts,
            ScanEvent::Fault(finding) if left > 0 => return Err(finding.into()),
            ScanEvent::Fault(_) => return Ok(()),
        };
        let counted = starts.len().min(left);
        left -= counted;
        for start in starts.into_iter().take(counted).filter(|start| shared.contains(&hash(&start.id))) {
            if let Some(Located { finding, .. }) = ids.admit(start, file, name) {
                return Err(finding.into());
            }
        }
        Ok(())
    })
}

/// The finding for a repeated id: in another file if `other` names it; `groups` are the first and second row group.
fn repeated(file: &str, id: &str, other: Option<&str>, groups: (usize, usize)) -> Finding {
    let finding = match other {
        None => {
            let found = format!("rows of it also in row group {}", groups.0);
            Finding::new(Code::EpisodeTwice, file, "the episode once in the file, its rows together", found)
        }
        Some(other) => {
            let found = format!("its id in {other} too");
            Finding::new(Code::EpisodeInTwoFiles, file, "the episode in one of the files only", found)
        }
    };
    finding.in_row_group(groups.1).in_episode(id).in_column("episode_id")
}

/// The ids so far, in file order: finds every repetition, but takes more memory.
#[derive(Default)]
pub(crate) struct SeenIds {
    seen: HashMap<String, (usize, usize)>,
}

pub(crate) struct Start {
    pub(crate) id: String,
    pub(crate) row: usize,
    pub(crate) row_group: usize,
}

impl SeenIds {
    /// Adds an episode; returns a finding if its id is known. `name` gives the names of files.
    pub(crate) fn admit(&mut self, start: Start, file: usize, name: impl Fn(usize) -> String) -> Option<Located> {
        let Start { id, row, row_group } = start;
        let Some(&(before, group)) = self.seen.get(&id) else {
            self.seen.insert(id, (file, row_group));
            return None;
        };
        let other = (before != file).then(|| name(before));
        Some(Located { row, finding: repeated(&name(file), &id, other.as_deref(), (group, row_group)) })
    }
}

pub(crate) fn starts(episodes: &Episodes) -> Vec<Start> {
    let rows = &episodes.offsets[..episodes.len()];
    let start = |(id, &row): (Option<&str>, &usize)| {
        Some(Start { id: id?.to_owned(), row, row_group: episodes.row_group(row) })
    };
    episodes.ids(rows).zip(rows).filter_map(start).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;
    use crate::inputs::resolve;
    use crate::read::open::TraceSet;

    proptest! {
        #[test]
        fn numbers_that_come_twice_are_found(
            numbers in vec((0..4_u64, 0..4_u64).prop_map(|(high, low)| high << 62 | high << 55 | low), 0..40),
        ) {
            let mut times: BTreeMap<u64, usize> = BTreeMap::new();
            for number in &numbers {
                *times.entry(*number).or_default() += 1;
            }
            times.retain(|_, times| *times > 1);
            prop_assert_eq!(repeated_numbers(numbers.clone()), times.into_keys().collect::<HashSet<u64>>());
        }
    }

    #[test]
    fn different_ids_with_equal_hashes_are_not_duplicates() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper").to_owned();
        let inputs = resolve(&[folder.into()], std::io::empty()).unwrap();
        let set = TraceSet::open(&inputs).unwrap();
        let layout = Layout::new(&set, [], []).unwrap();
        let mut all = HashSet::new();
        pass::<_, TraceError>(
            set.files(),
            &layout,
            NonZeroUsize::MIN,
            &|episodes| hashes(&episodes, usize::MAX),
            |_, event| {
                let ScanEvent::Whole(hashes) = event else { panic!("a fault in a fixture") };
                all.extend(hashes);
                Ok(())
            },
        )
        .unwrap();
        assert_eq!(all.len(), 840);
        // As if all hashes were equal: the ids themselves are compared, those of the first file twice.
        assert!(check_ids(set.files(), &layout, &all, 840).is_ok());
        let twice = TraceSet::open(&[&inputs[..1], &inputs].concat()).unwrap();
        let found = check_ids(twice.files(), &layout, &all, 861).unwrap_err().to_string();
        assert!(found.starts_with("episode-in-two-files"), "{found}");
        // Only the first 21 episodes count, before the repetitions.
        assert!(check_ids(twice.files(), &layout, &all, 21).is_ok());
    }
}
