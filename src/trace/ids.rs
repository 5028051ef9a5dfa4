//! Whether each episode has an id of its own, in bounded memory.
//!
//! Rule: exact. Of each episode its id's hash and its place are kept, beyond a fixed number of them in temporary files
//! ([`crate::base::runs`]). Where two hashes are equal, the ids themselves are read again and compared.

use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasherDefault, DefaultHasher, Hasher};
use std::io;

use super::decode::RowGroup;
use super::finding::{Code, Finding, TraceError};
use super::layout::Layout;
use super::open::TraceFile;
use super::pass::Episodes;
use super::rules::Located;
use crate::base::runs::Runs;

/// Episodes that are held in memory before they are put away.
const MEMORY: usize = 256 * 1024;

/// Where an episode begins. The order is that of files and rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Place {
    file: u32,
    row_group: u32,
    row: u64,
}

impl Place {
    fn new(file: usize, row_group: usize, row: usize) -> Self {
        let narrow = |index: usize| u32::try_from(index).expect("files and row groups are far fewer than 2^32");
        Self { file: narrow(file), row_group: narrow(row_group), row: row as u64 }
    }
}

/// An episode: its id as a number that two ids nearly never share, and where it begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Print {
    hash: u64,
    place: Place,
}

impl Print {
    const BYTES: usize = 24;

    /// The prints of the episodes that begin at a row up to `last`; an episode without an id has none.
    pub(super) fn of(episodes: &Episodes, last: usize) -> Vec<Self> {
        let firsts = &episodes.offsets[..episodes.len()];
        let begins = &firsts[..firsts.partition_point(|row| *row <= last)];
        let print = |(id, row): (Option<&str>, &usize)| {
            let (row_group, row) = episodes.place(*row);
            Some(Self { hash: hash(id?), place: Place::new(episodes.file, row_group, row) })
        };
        episodes.ids(begins).zip(begins).filter_map(print).collect()
    }

    /// Bytes that compare as prints do.
    fn to_bytes(self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        bytes[..8].copy_from_slice(&self.hash.to_be_bytes());
        bytes[8..12].copy_from_slice(&self.place.file.to_be_bytes());
        bytes[12..16].copy_from_slice(&self.place.row_group.to_be_bytes());
        bytes[16..].copy_from_slice(&self.place.row.to_be_bytes());
        bytes
    }

    fn from_bytes(bytes: [u8; Self::BYTES]) -> Self {
        let mut words =
            bytes.chunks_exact(4).map(|word| word.iter().fold(0, |value, &byte| value << 8 | u32::from(byte)));
        let mut word = || words.next().unwrap_or_default();
        let wide = |high: u32, low: u32| u64::from(high) << 32 | u64::from(low);
        let hash = wide(word(), word());
        let place = Place { file: word(), row_group: word(), row: wide(word(), word()) };
        Self { hash, place }
    }
}

/// The hash of a hash.
#[derive(Default)]
struct Itself(u64);

impl Hasher for Itself {
    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = self.0 << 8 | u64::from(*byte);
        }
    }

    fn write_u64(&mut self, hash: u64) {
        self.0 = hash;
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

/// The same number for the same id at every run.
fn hash(id: &str) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(id.as_bytes());
    hasher.finish()
}

/// The episodes met so far.
pub(super) struct Prints {
    pending: Vec<Print>,
    /// The hashes of those.
    met: HashSet<u64, BuildHasherDefault<Itself>>,
    /// Whether one of them was met twice.
    again: bool,
    runs: Runs,
    memory: usize,
}

impl Prints {
    pub(super) fn new() -> Self {
        Self {
            pending: Vec::new(),
            met: HashSet::with_capacity_and_hasher(MEMORY, BuildHasherDefault::default()),
            again: false,
            runs: Runs::default(),
            memory: MEMORY,
        }
    }

    /// Takes note of episodes.
    pub(super) fn add(&mut self, prints: &[Print]) -> Result<(), TraceError> {
        self.pending.extend_from_slice(prints);
        for print in prints {
            self.again |= !self.met.insert(print.hash);
        }
        if self.pending.len() >= self.memory {
            self.put_away().map_err(TraceError::Spill)?;
        }
        Ok(())
    }

    fn put_away(&mut self) -> io::Result<()> {
        self.pending.sort_unstable();
        self.met.clear();
        self.runs.put_away_records(self.pending.drain(..).map(Print::to_bytes))
    }

    /// The first episode by file and row whose id an episode before it has, if there is one.
    pub(super) fn first_repeated(
        mut self,
        files: &[TraceFile],
        layout: &Layout,
    ) -> Result<Option<Box<Finding>>, TraceError> {
        if self.runs.is_empty() && !self.again {
            return Ok(None);
        }
        self.put_away().map_err(TraceError::Spill)?;
        let mut alike = alike(self.runs).map_err(TraceError::Spill)?;
        // Equal hashes nearly always are equal ids, so that hardly more than the first two are read again.
        alike.sort_unstable_by_key(|places| places[1]);
        let mut first: Option<Repeated> = None;
        for places in alike {
            if first.as_ref().is_some_and(|first| places[1] > first.again) {
                break;
            }
            let earlier = |found: &Repeated| first.as_ref().is_none_or(|first| found.again < first.again);
            if let Some(found) = first_equal(&places, |place| id_at(files, layout, place))?.filter(earlier) {
                first = Some(found);
            }
        }
        Ok(first.map(|Repeated { before, again, id }| {
            let name = |place: Place| files[place.file as usize].name();
            let other = (before.file != again.file).then(|| name(before));
            let groups = (before.row_group as usize, again.row_group as usize);
            Box::new(repeated(name(again), &id, other, groups))
        }))
    }
}

/// An id, and the first two episodes that have it.
struct Repeated {
    before: Place,
    again: Place,
    id: String,
}

/// The first episode of these places whose id one before it has.
fn first_equal<E>(places: &[Place], id_at: impl Fn(Place) -> Result<String, E>) -> Result<Option<Repeated>, E> {
    let mut met: HashMap<String, Place> = HashMap::new();
    for &again in places {
        let id = id_at(again)?;
        if let Some(&before) = met.get(&id) {
            return Ok(Some(Repeated { before, again, id }));
        }
        met.insert(id, again);
    }
    Ok(None)
}

/// The places of episodes whose hashes are equal, ascending, two or more for each such hash.
fn alike(runs: Runs) -> io::Result<Vec<Vec<Place>>> {
    let mut merge = runs.merge(Vec::new())?;
    let mut found: Vec<Vec<Place>> = Vec::new();
    let (mut hash, mut places) = (0, Vec::new());
    while let Some(record) = merge.next()? {
        let record = record.try_into().map_err(|_| io::Error::from(io::ErrorKind::InvalidData))?;
        let print = Print::from_bytes(record);
        if print.hash != hash {
            hash = print.hash;
            if places.len() > 1 {
                found.push(std::mem::take(&mut places));
            }
            places.clear();
        }
        places.push(print.place);
    }
    if places.len() > 1 {
        found.push(places);
    }
    Ok(found)
}

/// Reads the id of an episode again.
fn id_at(files: &[TraceFile], layout: &Layout, place: Place) -> Result<String, TraceError> {
    let file = &files[place.file as usize];
    for rows in RowGroup::open(file, layout, place.row_group as usize).map_err(|finding| TraceError::from(*finding))? {
        let rows = rows.map_err(|finding| TraceError::from(*finding))?;
        let row = usize::try_from(place.row).unwrap_or(usize::MAX) - rows.first;
        if row < rows.len() {
            return Ok(rows.episode(row).unwrap_or_default().to_owned());
        }
    }
    let finding = Finding::new(Code::CorruptData, file.name(), "the same rows as before", "fewer");
    Err(finding.in_row_group(place.row_group as usize).into())
}

/// That an id was there before: in another file if `other` names it; `groups` are the row groups, before and again.
fn repeated(file: &str, id: &str, other: Option<&str>, groups: (usize, usize)) -> Finding {
    let finding = match other {
        None => {
            let found = format!("rows of it in row group {} already", groups.0);
            Finding::new(Code::EpisodeTwice, file, "the episode once in the file, its rows together", found)
        }
        Some(other) => {
            let found = format!("its id in {other} too");
            Finding::new(Code::EpisodeInTwoFiles, file, "the episode in one of the files only", found)
        }
    };
    finding.in_row_group(groups.1).in_episode(id).in_column("episode_id")
}

/// The ids met so far, in the order of the files: for those who want each repeated one, at the price of memory.
#[derive(Default)]
pub(super) struct Ids {
    /// File and row group where each one was met first.
    seen: HashMap<String, (usize, usize)>,
}

/// The start of an episode.
pub(super) struct Start {
    pub(super) id: String,
    pub(super) row: usize,
    pub(super) row_group: usize,
}

impl Ids {
    /// Takes note of an episode; a finding if its id was met before. `names` are the names of the files.
    pub(super) fn admit(&mut self, start: Start, file: usize, name: impl Fn(usize) -> String) -> Option<Located> {
        let Start { id, row, row_group } = start;
        let Some(&(before, group)) = self.seen.get(&id) else {
            self.seen.insert(id, (file, row_group));
            return None;
        };
        let other = (before != file).then(|| name(before));
        Some(Located { row, finding: repeated(&name(file), &id, other.as_deref(), (group, row_group)) })
    }
}

/// The episodes' starts, without those that have no id.
pub(super) fn starts(episodes: &Episodes) -> Vec<Start> {
    let rows = &episodes.offsets[..episodes.len()];
    let start = |(id, &row): (Option<&str>, &usize)| {
        Some(Start { id: id?.to_owned(), row, row_group: episodes.row_group(row) })
    };
    episodes.ids(rows).zip(rows).filter_map(start).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn alike_are_those_of_one_hash_and_only_they(hashes in vec(0..12_u64, 0..30), memory in 1_usize..8) {
            let mut prints = Prints { memory, ..Prints::new() };
            let mut expected: HashMap<u64, Vec<Place>> = HashMap::new();
            for (row, &hash) in hashes.iter().enumerate() {
                let place = Place::new(row % 2, row % 3, row);
                expected.entry(hash).or_default().push(place);
                prints.add(&[Print { hash, place }]).unwrap();
            }
            for places in expected.values_mut() {
                places.sort();
            }
            let expected: HashSet<_> = expected.into_values().filter(|places| places.len() > 1).collect();
            prints.put_away().unwrap();
            let found = alike(prints.runs).unwrap();
            prop_assert_eq!(found.into_iter().collect::<HashSet<_>>(), expected);
        }
    }

    #[test]
    fn equal_hashes_of_different_ids_are_no_repetition() {
        let ids = ["a", "b", "c", "b", "a"];
        let places: Vec<Place> = (0..ids.len()).map(|row| Place::new(0, 0, row)).collect();
        let id_at = |place: Place| Ok::<_, ()>(ids[usize::try_from(place.row).unwrap()].to_owned());
        let found = first_equal(&places, id_at).unwrap().unwrap();
        assert_eq!((found.before, found.again, found.id.as_str()), (places[1], places[3], "b"));
        assert!(first_equal(&places[..3], id_at).unwrap().is_none());
    }
}
