//! Process groups of programs that run now: each is killed when its episode lets go of it, and all at once when the
//! process is about to end.

use std::collections::BTreeSet;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::process::{Child, Command};

/// The groups of all programs that run now.
#[derive(Debug, Default)]
pub struct Groups(Mutex<Running>);

#[derive(Debug, Default)]
struct Running {
    ids: BTreeSet<i32>,
    is_over: bool,
}

impl Groups {
    /// Kills all of them, and lets none be started any more.
    pub fn kill_all(&self) {
        let mut running = self.running();
        running.is_over = true;
        running.ids.iter().copied().for_each(kill);
    }

    fn running(&self) -> MutexGuard<'_, Running> {
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
    /// Starts the first process of a group.
    pub fn start(shell: &mut Command, groups: &Arc<Groups>) -> io::Result<(Child, Self)> {
        // Held until the process is known: one that was started and not known yet would outlive `kill_all`.
        let mut running = groups.running();
        if running.is_over {
            return Err(io::Error::new(io::ErrorKind::Interrupted, "the recording is being ended"));
        }
        let child = shell.spawn()?;
        let id = child.id().and_then(|id| i32::try_from(id).ok());
        running.ids.extend(id);
        Ok((child, Self { id, groups: Arc::clone(groups) }))
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        if let Some(id) = self.id {
            self.groups.running().ids.remove(&id);
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

#[cfg(all(test, unix))]
mod tests {
    use std::sync::Arc;

    use tokio::process::Command;

    use super::{Group, Groups};

    #[test]
    fn nothing_is_started_after_all_were_killed() {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let groups = Arc::<Groups>::default();
            let sleeper = || {
                let mut command = Command::new("sleep");
                command.arg("600").process_group(0).kill_on_drop(true);
                command
            };
            let (mut child, _group) = Group::start(&mut sleeper(), &groups).unwrap();
            groups.kill_all();
            assert!(!child.wait().await.unwrap().success());
            let error = Group::start(&mut sleeper(), &groups).unwrap_err();
            assert_eq!(error.to_string(), "the recording is being ended");
        });
    }
}
