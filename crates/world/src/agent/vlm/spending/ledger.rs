//! The total spending of all processes that record one model into one folder at the same time.
//!
//! Rule: one small file with an entry per process, read and written under its lock. The first process starts from the
//! journals; later ones add to it. A killed process keeps its entry until no process records into the folder: its
//! reservations may have been billed.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::Path;
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};

use super::shared_file::SharedFile;
use super::spend::{Entry, Others, Spend};

#[derive(Debug, Default, Serialize, Deserialize)]
struct Page {
    before: Spend,
    processes: BTreeMap<String, Entry>,
}

/// One process's access to the ledger.
#[derive(Debug)]
pub(super) struct Ledger {
    file: SharedFile,
    /// Locked by all recording processes, so that the first one knows that it is alone.
    live: File,
    process: String,
    patience: Duration,
}

impl Ledger {
    /// Opens the ledger at a path. If no other process has it open, it starts from `journals`.
    pub(super) fn open<E: From<io::Error>>(
        path: &Path,
        patience: Duration,
        journals: impl FnOnce() -> Result<Spend, E>,
    ) -> Result<Self, E> {
        let (file, live) = (SharedFile::open(path)?, SharedFile::open(&path.with_extension("live"))?.into_file());
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let process = format!("{}-{}", std::process::id(), since.as_nanos());
        let ledger = Self { file, live, process, patience };
        ledger.file.locked(|| {
            if ledger.live.try_lock().is_ok() {
                let opened = journals().and_then(|before| {
                    let page = Page { before, processes: BTreeMap::new() };
                    ledger.file.write(&page).map_err(E::from)
                });
                let _ = ledger.live.unlock();
                opened?;
            }
            let _ = ledger.live.lock_shared();
            Ok::<_, E>(())
        })?;
        Ok(ledger)
    }

    /// Decides with the others' spending, then stores this process's spending and reservations. An unreadable ledger
    /// reports no others, and is left unchanged.
    pub(super) fn exchange<T>(&self, decide: impl FnOnce(Option<Others>) -> (T, Entry)) -> T {
        self.file.locked(|| {
            let mut page = self.file.read::<Page>().ok();
            let (outcome, mut entry) = decide(page.as_ref().map(|page| self.others(page)));
            if let Some(page) = &mut page {
                entry.until = now() + self.patience.as_secs();
                page.processes.insert(self.process.clone(), entry);
                let _ = self.file.write(page);
            }
            outcome
        })
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
}

fn now() -> u64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs()
}
