//! A file system that fails or loses data: the result is the old file or the new one, never anything else.

mod power;
mod record;
mod storm;
mod verbs;

use std::any::Any;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::os::unix::process::ExitStatusExt as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use tempfile::TempDir;

use crate::harness::faults::{Call, Draws, EACCES, EIO, EMFILE, ENOSPC, Fault};
use crate::harness::files::contents;
use crate::harness::program::stderr;

/// The calls that may fail, and their errors.
const ERRORS: [(&str, &[i32]); 8] = [
    ("open", &[EMFILE, EACCES, EIO]),
    ("write", &[ENOSPC, EIO]),
    ("fsync", &[EIO, ENOSPC]),
    ("rename", &[EIO, ENOSPC]),
    ("unlink", &[EIO, EACCES]),
    ("mkdir", &[ENOSPC, EIO]),
    ("truncate", &[EIO, ENOSPC]),
    ("link", &[EIO, EACCES]),
];

/// Every possible fault of these calls.
fn faults(calls: &[Call]) -> Vec<Fault> {
    let mut counts = BTreeMap::<&str, usize>::new();
    for kind in calls.iter().filter_map(Call::kind) {
        *counts.entry(kind).or_default() += 1;
    }
    let mut faults = Vec::new();
    let mut add = |kind: &'static str, count: usize, errors: &[i32]| {
        for at in 1..=count {
            faults.extend(
                errors.iter().flat_map(|error| [false, true].map(|stays| Fault { kind, at, error: *error, stays })),
            );
        }
    };
    for (kind, errors) in ERRORS {
        add(kind, counts.get(kind).copied().unwrap_or_default(), errors);
    }
    // Faults that end the process before each call that changes something.
    let changes = counts.iter().filter(|(kind, _)| **kind != "open").map(|(_, count)| count).sum::<usize>();
    let made = calls.iter().filter(|call| matches!(call, Call::Create(..))).count();
    add("*", changes + made, &[0]);
    // A process cannot end twice.
    faults.retain(|fault| fault.error != 0 || !fault.stays);
    faults
}

/// Checks the message of a fault: it names the file and the cause. Without a fault there must be no message.
fn check_words(output: &Output, fault: Fault, is_new: bool, calls: &[Call], outputs: &[&str]) -> Result<(), String> {
    let said = stderr(output);
    if said.contains("panicked") || output.status.signal().is_some() {
        return Err("it panicked".to_owned());
    }
    if said.contains(".mirrorstats-") && !said.contains(".mirrorstats-unfinished") {
        return Err("it names a temporary file".to_owned());
    }
    if output.status.success() {
        return if is_new { Ok(()) } else { Err("it ended well without the new output".to_owned()) };
    }
    let failed = calls.iter().filter_map(|call| match call {
        Call::Failed(_, path) => Some(path),
        _ => None,
    });
    let parts = failed.flat_map(|path| path.iter().map(|part| shown(&part.to_string_lossy())));
    // A failure to synchronise a folder is reported with the file that needed it.
    let outputs = outputs.iter().filter_map(|output| Path::new(output).file_name()?.to_str().map(str::to_owned));
    let names: BTreeSet<String> = parts.chain(outputs).filter(|name| name.len() > 1 && name != "tmp").collect();
    if !said.starts_with("error: ") && !said.contains("\nerror: ") {
        return Err("it gives no error".to_owned());
    }
    if !said.contains(&fault.words()) {
        return Err(format!("it does not say `{}`", fault.words()));
    }
    let is_named = names.iter().any(|name| said.contains(name.as_str()));
    if is_named { Ok(()) } else { Err(format!("it names none of {names:?}")) }
}

/// A temporary name as messages show it.
fn shown(name: &str) -> String {
    let target = name.strip_prefix(".mirrorstats-").and_then(|rest| rest.rsplit_once('.'));
    target.map_or(name, |(target, _)| target).to_owned()
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        let kind = entry.file_type().unwrap();
        if kind.is_dir() {
            copy(&entry.path(), &target);
        } else if kind.is_symlink() {
            std::os::unix::fs::symlink(fs::read_link(entry.path()).unwrap(), target).unwrap();
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

fn leftovers(home: &Path) -> Vec<String> {
    contents(home).into_keys().filter(|name| name.contains(".mirrorstats-")).collect()
}

/// A copy of a folder for one run, with a log beside it.
struct Round(TempDir);

impl Round {
    fn new(from: &Path) -> Self {
        let round = Self(tempfile::tempdir().unwrap());
        copy(from, &round.home());
        round
    }

    fn home(&self) -> PathBuf {
        self.0.path().join("home")
    }

    fn log(&self) -> PathBuf {
        self.0.path().join("log")
    }
}

/// Runs `each` on all items, on as many threads as there are processors; panics if one of them panics.
fn all_at_once<'a, T: Sync>(items: &'a [T], each: impl Fn(&'a T) + Sync) {
    let next = AtomicUsize::new(0);
    let threads = thread::available_parallelism().map_or(2, usize::from);
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed)) {
                    each(item);
                }
            });
        }
    });
}

/// Like [`all_at_once`], but runs all items before it panics with all messages.
fn check_all<'a, T: Sync>(items: &'a [T], check: impl Fn(&'a T) + Sync) {
    let failed = Mutex::new(Vec::new());
    all_at_once(items, |item| {
        if let Err(words) = catch_unwind(AssertUnwindSafe(|| check(item))) {
            failed.lock().unwrap().push(words_of(words.as_ref()));
        }
    });
    let failed = failed.into_inner().unwrap();
    assert!(failed.is_empty(), "{} of {} rounds:\n{}", failed.len(), items.len(), failed.join("\n\n"));
}

fn words_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().cloned();
    text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned())).unwrap_or_default()
}

/// Reduces the items to this many, spread over all and always the same.
fn sample<T>(items: &mut Vec<T>, most: usize) {
    let mut draws = Draws::new(16);
    for at in (1..items.len()).rev() {
        items.swap(at, draws.below(at + 1));
    }
    items.truncate(most);
}
