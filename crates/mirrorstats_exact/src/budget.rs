//! Budgets for the work that an input may cause: bytes read, bytes inflated, values decoded, nodes expanded.
//!
//! Rule: budgets count work and never time, so that the same input is refused everywhere or nowhere. Where small data
//! can expand, a budget grows with the stored bytes: normal files of any size pass, and a small file cannot ask for
//! much. A caller that trusts an input multiplies all limits with [`SETTING`].

use std::io;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// The environment variable that multiplies every limit: a whole number from 1.
pub const SETTING: &str = "MIRRORSTATS_BUDGET";

/// The largest factor: no limit overflows below it.
const LARGEST: u64 = 1_000_000;

/// An upper limit, before [`SETTING`] multiplies it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limit {
    what: &'static str,
    most: u64,
}

impl Limit {
    /// At most `most` of `what`, such as `bytes of a style`.
    pub const fn new(what: &'static str, most: u64) -> Self {
        Self { what, most }
    }

    /// At most `floor` plus `factor` per stored byte.
    pub const fn in_proportion(what: &'static str, floor: u64, factor: u64, bytes: u64) -> Self {
        Self { what, most: floor.saturating_add(factor.saturating_mul(bytes)) }
    }

    /// Adds `factor` for each of the `bytes` beyond the first `from`.
    #[must_use]
    pub const fn and_beyond(self, from: u64, factor: u64, bytes: u64) -> Self {
        Self::in_proportion(self.what, self.most, factor, bytes.saturating_sub(from))
    }

    pub fn most(&self) -> u64 {
        self.most.saturating_mul(factor())
    }

    pub fn check(&self, found: u64) -> Result<(), Exceeded> {
        let most = self.most();
        if found > most { Err(Exceeded { what: self.what, most }) } else { Ok(()) }
    }
}

/// A limit and its use so far, shared by any number of threads.
#[derive(Debug)]
pub struct Budget {
    limit: Limit,
    used: AtomicU64,
}

impl Budget {
    pub const fn new(limit: Limit) -> Self {
        Self { limit, used: AtomicU64::new(0) }
    }

    pub fn spend(&self, amount: u64) -> Result<(), Exceeded> {
        let before =
            self.used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |used| Some(used.saturating_add(amount)));
        self.limit.check(before.unwrap_or(u64::MAX).saturating_add(amount))
    }
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected {}, found more; {}", self.expected(), Self::help())]
pub struct Exceeded {
    what: &'static str,
    most: u64,
}

impl Exceeded {
    /// The limit, as the expected value of an error.
    pub fn expected(&self) -> String {
        format!("at most {} {}", self.most, self.what)
    }

    pub fn help() -> String {
        format!("if you trust the file, the environment variable {SETTING}=10 allows ten times as much of everything")
    }
}

impl From<Exceeded> for io::Error {
    fn from(exceeded: Exceeded) -> Self {
        Self::new(io::ErrorKind::FileTooLarge, exceeded)
    }
}

fn factor() -> u64 {
    static FACTOR: OnceLock<u64> = OnceLock::new();
    *FACTOR.get_or_init(|| setting().unwrap_or(1))
}

/// The factor in the environment; 1 if it is not set.
pub fn setting() -> Result<u64, String> {
    std::env::var_os(SETTING).map_or(Ok(1), |value| parsed(&value.to_string_lossy()))
}

fn parsed(value: &str) -> Result<u64, String> {
    let factor = value.parse().ok().filter(|factor| (1..=LARGEST).contains(factor));
    factor.ok_or_else(|| {
        let found = super::escape::visible(value);
        format!("the environment variable {SETTING}: expected a whole number from 1 to {LARGEST}, found `{found}`")
    })
}

#[cfg(test)]
mod tests {
    use super::{Budget, Limit, parsed};

    #[test]
    fn a_limit_holds_exactly() {
        let limit = Limit::in_proportion("bytes", 10, 3, 2);
        assert!(limit.check(16).is_ok());
        assert_eq!(limit.and_beyond(2, 5, 2), limit);
        assert_eq!(limit.and_beyond(2, 5, 4).most(), 16 + 10);
        let told = limit.check(17).unwrap_err().to_string();
        assert!(told.contains("at most 16 bytes") && told.contains("MIRRORSTATS_BUDGET"), "{told}");
        let budget = Budget::new(limit);
        assert!(budget.spend(16).is_ok() && budget.spend(0).is_ok());
        assert!(budget.spend(1).is_err() && budget.spend(u64::MAX).is_err() && budget.spend(0).is_err());
    }

    #[test]
    fn a_factor_is_a_number_from_one() {
        assert_eq!((parsed("1"), parsed("40")), (Ok(1), Ok(40)));
        for value in ["", "0", "-1", "1.5", "ten", "1000001", "99999999999999999999", "\u{1b}[31m"] {
            let told = parsed(value).unwrap_err();
            assert!(told.contains("from 1 to") && !told.contains('\u{1b}'), "{told}");
        }
    }
}
