//! What all processes spend that record one model into one folder at the same time.
//!
//! Rule: one small file, read and written under its lock, with an entry per process. Who comes first counts what the journals
//! say; who comes later adds to it. A process that was killed keeps its entry until nobody records into the folder: what it had
//! reserved may have been paid.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::Path;
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};

use super::limits::Spend;
use exact::replace::{folder_of, make_folder};

/// What one process has spent, and has in flight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Entry {
    pub(super) spend: Spend,
    pub(super) in_flight: u64,
    pub(super) reserved_usd: f64,
    /// Until when its requests may be in flight, s since 1970.
    until: u64,
}

/// The content of the file.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Page {
    before: Spend,
    processes: BTreeMap<String, Entry>,
}

/// What others have spent and reserved.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Others {
    pub(super) spend: Spend,
    pub(super) reserved_usd: f64,
    pub(super) is_waiting: bool,
}

/// The ledger, as one process uses it.
#[derive(Debug)]
pub(super) struct Ledger {
    file: File,
    /// Locked by all that record, so that the first one knows that it is alone.
    live: File,
    process: String,
    patience: Duration,
}

impl Ledger {
    /// Opens the ledger at a path. If no other process has it open, it begins with what `journals` say.
    pub(super) fn open<E: From<io::Error>>(
        path: &Path,
        patience: Duration,
        journals: impl FnOnce() -> Result<Spend, E>,
    ) -> Result<Self, E> {
        make_folder(folder_of(path))?;
        let open = |path: &Path| OpenOptions::new().create(true).truncate(false).read(true).write(true).open(path);
        let (file, live) = (open(path)?, open(&path.with_extension("live"))?);
        // Where the file system has no locks, each process counts alone.
        let _ = file.lock();
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let process = format!("{}-{}", std::process::id(), since.as_nanos());
        let ledger = Self { file, live, process, patience };
        if ledger.live.try_lock().is_ok() {
            let opened = journals().and_then(|before| {
                let page = Page { before, processes: BTreeMap::new() };
                ledger.write(&page).map_err(E::from)
            });
            let _ = ledger.live.unlock();
            opened?;
        }
        let _ = ledger.live.lock_shared();
        let _ = ledger.file.unlock();
        Ok(ledger)
    }

    /// Decides with what others have spent, and notes what this process has spent and reserved then. A ledger that cannot be
    /// read tells nothing of others, and is left as it is.
    pub(super) fn exchange<T>(&self, decide: impl FnOnce(Option<Others>) -> (T, Entry)) -> T {
        let _ = self.file.lock();
        let mut page = self.read().ok();
        let (outcome, mut entry) = decide(page.as_ref().map(|page| self.others(page)));
        if let Some(page) = &mut page {
            entry.until = now() + self.patience.as_secs();
            page.processes.insert(self.process.clone(), entry);
            let _ = self.write(page);
        }
        let _ = self.file.unlock();
        outcome
    }

    fn others(&self, page: &Page) -> Others {
        let mut others = Others { spend: page.before, ..Others::default() };
        for (_, entry) in page.processes.iter().filter(|(process, _)| **process != self.process) {
            others.spend.add(&entry.spend);
            others.reserved_usd += entry.reserved_usd;
            others.is_waiting |= entry.in_flight > 0 && entry.until >= now();
        }
        others
    }

    fn read(&self) -> io::Result<Page> {
        let mut text = String::new();
        let mut file = &self.file;
        file.rewind()?;
        file.read_to_string(&mut text)?;
        Ok(serde_json::from_str(&text)?)
    }

    fn write(&self, page: &Page) -> io::Result<()> {
        let mut text = serde_json::to_vec(page)?;
        let before = usize::try_from(self.file.metadata()?.len()).unwrap_or_default();
        text.resize(text.len().max(before), b' ');
        let mut file = &self.file;
        file.rewind()?;
        file.write_all(&text)
    }
}

fn now() -> u64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs()
}
