//! Running programs, each with its descendants: they are killed when their episode ends, and all together when the
//! process is about to end.
//!
//! A program has a process group. Processes that leave it (`setsid`) are found by an environment variable, on Linux.

use std::collections::BTreeMap;
use std::io;
use std::sync::{Arc, Mutex};

use tokio::process::{Child, Command};

use crate::locked;

/// The environment variable of a program and its descendants.
const MARK: &str = "_MIRRORSTATS_EXEC";

#[derive(Debug, Default)]
pub struct Groups(Mutex<Running>);

#[derive(Debug, Default)]
struct Running {
    marks: BTreeMap<i32, String>,
    started: u64,
    is_over: bool,
}

impl Groups {
    /// Kills all of them, and prevents further starts.
    pub(crate) fn kill_all(&self) {
        let mut running = locked(&self.0);
        running.is_over = true;
        running.marks.iter().for_each(|(id, mark)| kill(*id, mark));
    }
}

#[derive(Debug)]
pub struct Group {
    id: Option<i32>,
    groups: Arc<Groups>,
}

impl Group {
    pub fn start(shell: &mut Command, groups: &Arc<Groups>) -> io::Result<(Child, Self)> {
        // The lock is held until the process is registered: an unregistered process would outlive `kill_all`.
        let mut running = locked(&groups.0);
        if running.is_over {
            return Err(io::Error::new(io::ErrorKind::Interrupted, "the recording is being ended"));
        }
        running.started += 1;
        let mark = format!("{}-{}", std::process::id(), running.started);
        let child = shell.env(MARK, &mark).spawn()?;
        let id = child.id().and_then(|id| i32::try_from(id).ok());
        running.marks.extend(id.map(|id| (id, mark)));
        Ok((child, Self { id, groups: Arc::clone(groups) }))
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        if let Some(id) = self.id {
            let mark = locked(&self.groups.0).marks.remove(&id).unwrap_or_default();
            kill(id, &mark);
        }
    }
}

#[cfg(unix)]
fn kill(id: i32, mark: &str) {
    use nix::sys::signal::{Signal, kill, killpg};
    use nix::unistd::Pid;
    // Fails harmlessly if the whole group has already ended.
    let _ = killpg(Pid::from_raw(id), Signal::SIGKILL);
    // Killed processes may have started others in the meantime.
    for _ in 0..10 {
        let left = marked(mark);
        for id in &left {
            let _ = kill(Pid::from_raw(*id), Signal::SIGKILL);
        }
        if left.is_empty() {
            break;
        }
    }
}

/// The processes with this mark in their environment; none if there is no `/proc`.
#[cfg(unix)]
fn marked(mark: &str) -> Vec<i32> {
    let wanted = format!("{MARK}={mark}");
    let is_marked = |id: &i32| {
        let environment = std::fs::read(format!("/proc/{id}/environ")).unwrap_or_default();
        environment.split(|byte| *byte == 0).any(|variable| variable == wanted.as_bytes())
    };
    let processes = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    processes.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).filter(is_marked).collect()
}

#[cfg(not(unix))]
fn kill(_: i32, _: &str) {
    // The first process is killed with its handle; there are no groups.
}

#[cfg(all(test, unix))]
mod tests {
    use std::sync::Arc;

    use tokio::process::Command;

    use super::{Group, Groups};

    #[test]
    fn after_killing_all_groups_none_can_start() {
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
