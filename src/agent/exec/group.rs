//! Process groups of programs that run now: each is killed when its episode lets go of it, and all at once when the
//! process is about to end.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The groups of all programs that run now.
#[derive(Debug, Default)]
pub struct Groups(Mutex<BTreeSet<i32>>);

impl Groups {
    /// Kills all of them.
    pub fn kill_all(&self) {
        for id in self.running().iter() {
            kill(*id);
        }
    }

    fn running(&self) -> MutexGuard<'_, BTreeSet<i32>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// One group; killed when it is dropped.
#[derive(Debug)]
pub struct Group {
    id: Option<i32>,
    groups: Arc<Groups>,
}

impl Group {
    /// The group whose first process has this id.
    pub fn of(id: Option<u32>, groups: &Arc<Groups>) -> Self {
        let id = id.and_then(|id| i32::try_from(id).ok());
        groups.running().extend(id);
        Self { id, groups: Arc::clone(groups) }
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        if let Some(id) = self.id {
            self.groups.running().remove(&id);
            kill(id);
        }
    }
}

#[cfg(unix)]
fn kill(id: i32) {
    use nix::sys::signal::{Signal, killpg};
    // Fails where all of it has ended by itself, which is what is wanted.
    let _ = killpg(nix::unistd::Pid::from_raw(id), Signal::SIGKILL);
}

#[cfg(not(unix))]
fn kill(_: i32) {
    // The first process is killed with its handle; there are no groups.
}
