//! The total spending of all processes that record one model into one folder at the same time.
//!
//! Rule: one small file with an entry per process, read and written under its lock. The first process starts from the
//! journals; later ones add to it. A killed process keeps its entry until no process records into the folder: its
//! reservations may have been billed.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::Path;
use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::shared_file::{SharedFile, now};

/// The spending.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Spend {
    /// US dollars of the replies whose cost is known.
    pub cost_usd: f64,
    /// Replies whose cost is not known.
    pub uncosted: u64,
    /// Requests without an answer that may have been paid: timed out, broken off, or killed.
    pub unanswered: u64,
    /// US dollars at most of these requests, and of the replies whose cost is not known, as far as prices are known.
    pub uncosted_usd_at_most: f64,
    /// Tokens of requests and replies together.
    pub tokens: u64,
    /// Requests that went out.
    pub requests: u64,
}

impl Spend {
    pub(crate) fn add_unanswered(&mut self, at_most_usd: f64) {
        self.unanswered += 1;
        self.uncosted_usd_at_most += at_most_usd;
    }

    pub(crate) fn add_answer(&mut self, tokens: u64, cost_usd: Option<f64>, at_most_usd: f64) {
        self.tokens = self.tokens.saturating_add(tokens);
        if let Some(cost) = cost_usd {
            self.cost_usd += cost;
        } else {
            self.uncosted += 1;
            self.uncosted_usd_at_most += at_most_usd;
        }
    }

    pub fn add(&mut self, other: &Self) {
        self.cost_usd += other.cost_usd;
        self.uncosted += other.uncosted;
        self.unanswered += other.unanswered;
        self.uncosted_usd_at_most += other.uncosted_usd_at_most;
        self.tokens = self.tokens.saturating_add(other.tokens);
        self.requests += other.requests;
    }

    pub(crate) fn cost_at_most(&self) -> f64 {
        self.cost_usd + self.uncosted_usd_at_most
    }
}

/// The spending of one process, and its requests in flight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct LedgerEntry {
    pub(super) spend: Spend,
    pub(super) in_flight: u64,
    pub(super) reserved_usd: f64,
    /// The time until which its requests may be in flight, s since 1970.
    pub(super) until: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct OtherProcesses {
    pub(super) spend: Spend,
    pub(super) reserved_usd: f64,
    pub(super) is_waiting: bool,
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct Page {
    before: Spend,
    processes: BTreeMap<String, LedgerEntry>,
}

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
        let (file, live) = (SharedFile::open(path)?, SharedFile::open(&path.with_extension("live"))?.0);
        let process = format!("{}-{}", std::process::id(), now().as_nanos());
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
    pub(super) fn exchange<T>(&self, decide: impl FnOnce(Option<OtherProcesses>) -> (T, LedgerEntry)) -> T {
        self.file.locked(|| {
            let mut page = self.file.read::<Page>().ok();
            let (outcome, mut entry) = decide(page.as_ref().map(|page| self.others(page)));
            if let Some(page) = &mut page {
                entry.until = now().as_secs() + self.patience.as_secs();
                page.processes.insert(self.process.clone(), entry);
                let _ = self.file.write(page);
            }
            outcome
        })
    }

    fn others(&self, page: &Page) -> OtherProcesses {
        let mut others = OtherProcesses { spend: page.before, ..OtherProcesses::default() };
        for (_, entry) in page.processes.iter().filter(|(process, _)| **process != self.process) {
            others.spend.add(&entry.spend);
            others.reserved_usd += entry.reserved_usd;
            others.is_waiting |= entry.in_flight > 0 && entry.until >= now().as_secs();
        }
        others
    }
}
