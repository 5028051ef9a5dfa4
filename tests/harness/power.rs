//! A folder after a loss of power: unsynchronised changes are lost, in part or altogether.
//!
//! Synchronising a file keeps its bytes, and synchronising a folder keeps its names. Later changes may or may not have
//! reached the disk, each name and each write independently.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use super::faults::{Call, Draws};

/// The part of unsynchronised changes that survives.
#[derive(Clone, Copy, Debug)]
pub enum Unsynced {
    /// Nothing.
    Gone,
    /// All names, and no bytes: files that were renamed too early are empty.
    Names,
    /// Random changes; of a file's last write a part, or zeros in place of its bytes.
    Some(u64),
}

#[derive(Clone, Debug, PartialEq)]
enum Node {
    Folder,
    /// A file, by its unique index in [`Disk`].
    File(usize),
}

#[derive(Clone, Debug)]
enum Change {
    Cut(usize),
    Write(usize, Vec<u8>),
}

#[derive(Clone, Debug, Default)]
struct Content {
    synced: Vec<u8>,
    since: Vec<Change>,
}

impl Change {
    fn apply(&self, bytes: &mut Vec<u8>) {
        match self {
            Self::Cut(length) => bytes.resize(*length, 0),
            Self::Write(at, new) => {
                bytes.resize(bytes.len().max(at + new.len()), 0);
                bytes[*at..at + new.len()].copy_from_slice(new);
            }
        }
    }
}

/// A path and its new node; `None` if the path was removed.
type Named = (PathBuf, Option<Node>);

/// The contents of a disk, and the pending changes.
#[derive(Debug, Default)]
pub struct Disk {
    files: Vec<Content>,
    /// The index of the file behind each number in the log.
    numbers: BTreeMap<usize, usize>,
    /// The names that the program sees.
    names: BTreeMap<PathBuf, Node>,
    kept: BTreeMap<PathBuf, Node>,
    /// Unsynchronised changes of names; changes in one folder that belong together are one entry.
    since: Vec<Vec<Named>>,
}

impl Disk {
    /// The disk after these calls in an empty folder.
    pub fn after(calls: &[Call]) -> Self {
        let mut disk = Self::default();
        for call in calls {
            disk.call(call);
        }
        disk
    }

    fn call(&mut self, call: &Call) {
        match call {
            Call::Open(_) | Call::Allocations(_) | Call::Failed(..) => {}
            Call::Create(path, number) => {
                self.files.push(Content::default());
                self.numbers.insert(*number, self.files.len() - 1);
                self.name(vec![(path.clone(), Some(Node::File(self.files.len() - 1)))]);
            }
            Call::Truncate(number, length) => self.change(*number, Change::Cut(*length)),
            Call::Write(number, at, bytes) => self.change(*number, Change::Write(*at, bytes.clone())),
            Call::Sync(number) => {
                let Content { synced, since } = &mut self.files[self.numbers[number]];
                since.drain(..).for_each(|change| change.apply(synced));
            }
            Call::SyncFolder(folder) => self.sync(folder),
            Call::Rename(from, to) => {
                let node = self.names.get(from).cloned().unwrap_or_else(|| panic!("{} has no name", from.display()));
                assert!(node != Node::Folder, "folders are not renamed here");
                if from.parent() == to.parent() {
                    self.name(vec![(from.clone(), None), (to.clone(), Some(node))]);
                } else {
                    self.name(vec![(to.clone(), Some(node))]);
                    self.name(vec![(from.clone(), None)]);
                }
            }
            Call::Unlink(path) => self.name(vec![(path.clone(), None)]),
            Call::MakeFolder(path) => self.name(vec![(path.clone(), Some(Node::Folder))]),
            Call::Link(from, to) => self.name(vec![(to.clone(), Some(self.names[from].clone()))]),
        }
    }

    fn change(&mut self, number: usize, change: Change) {
        self.files[self.numbers[&number]].since.push(change);
    }

    fn name(&mut self, change: Vec<Named>) {
        apply(&mut self.names, &change);
        self.since.push(change);
    }

    fn sync(&mut self, folder: &Path) {
        let (synced, since): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.since).into_iter().partition(|change| change[0].0.parent() == Some(folder));
        for change in &synced {
            apply(&mut self.kept, change);
        }
        self.since = since;
    }

    /// Writes the contents of `from` after a loss of power into the folder `to`.
    pub fn restore(&self, unsynced: Unsynced, from: &Path, to: &Path) {
        let mut draws = Draws::new(if let Unsynced::Some(seed) = unsynced { seed } else { 0 });
        let mut names = self.kept.clone();
        for change in &self.since {
            let is_kept = match unsynced {
                Unsynced::Gone => false,
                Unsynced::Names => true,
                Unsynced::Some(_) => draws.below(2) == 0,
            };
            if is_kept {
                apply(&mut names, change);
            }
        }
        let mut folders = BTreeSet::from([from.to_owned()]);
        // Paths are sorted, so folders come before their contents.
        for (path, node) in names {
            let (Some(above), Ok(inside)) = (path.parent(), path.strip_prefix(from)) else { continue };
            if !folders.contains(above) {
                continue;
            }
            match node {
                Node::Folder => {
                    fs::create_dir(to.join(inside)).unwrap();
                    folders.insert(path);
                }
                Node::File(at) => fs::write(to.join(inside), self.files[at].after(unsynced, &mut draws)).unwrap(),
            }
        }
    }
}

impl Content {
    fn after(&self, unsynced: Unsynced, draws: &mut Draws) -> Vec<u8> {
        let mut bytes = self.synced.clone();
        if let Unsynced::Some(_) = unsynced {
            let count = draws.below(self.since.len() + 1);
            self.since[..count].iter().for_each(|change| change.apply(&mut bytes));
            if let Some(Change::Write(at, new)) = self.since.get(count) {
                let length = draws.below(new.len() + 1);
                let part = if draws.below(3) == 0 { vec![0; length] } else { new[..length].to_vec() };
                Change::Write(*at, part).apply(&mut bytes);
            }
        }
        bytes
    }
}

fn apply(names: &mut BTreeMap<PathBuf, Node>, change: &[Named]) {
    for (path, node) in change {
        match node {
            Some(node) => names.insert(path.clone(), node.clone()),
            None => names.remove(path),
        };
    }
}
