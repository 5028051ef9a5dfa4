//! Recordings: an agent of the program's, or a Python function in its place.

use std::ffi::OsString;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use mirrorstats::cli::commands::record::{RecordArgs, Recorded};
use mirrorstats::cli::{self, Failure};
use pyo3::prelude::*;
use world::agent::Player;
use world::agent::exec::Images;
use world::agent::function::{Function, FunctionPlayer, Listener};
use world::record::folder_lock::parts_of;

use crate::answer::{self, Answer};
use crate::error;

/// The time between two looks at signals.
const GLANCE: Duration = Duration::from_millis(50);

/// A Python function that plays.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct PythonAgent {
    model: String,
    source: Option<String>,
    is_base64: bool,
    /// Gives the function of an episode, which takes a message as JSON and gives the text of a reply.
    listeners: Py<PyAny>,
}

impl PythonAgent {
    fn player(self, args: &RecordArgs) -> Arc<dyn Player> {
        let Self { model, source, is_base64, listeners } = self;
        let images = if is_base64 { Images::Base64 } else { Images::Path };
        let begin = move || Python::attach(|py| listeners.call0(py)).map(listener).map_err(|fault| fault.to_string());
        let scratch = parts_of(args.out());
        Arc::new(FunctionPlayer::new(Function { model, source, images, scratch, listeners: Box::new(begin) }))
    }
}

/// The function of one episode.
fn listener(function: Py<PyAny>) -> Listener {
    Box::new(move |message| {
        let message = serde_json::to_string(message).map_err(|fault| fault.to_string())?;
        Python::attach(|py| function.call1(py, (message,))?.extract(py)).map_err(|fault: PyErr| fault.to_string())
    })
}

/// Records as `mirrorstats record` with these options; with `agent` in the place of what `--agent` names.
#[pyfunction]
#[pyo3(signature = (options, agent=None))]
pub fn record(py: Python<'_>, options: Vec<OsString>, agent: Option<PythonAgent>) -> PyResult<Answer> {
    let failed = |failure: Failure| error::of_failure(&failure);
    let args: RecordArgs = cli::options_of("record", options).map_err(failed)?;
    let player = match agent {
        Some(agent) => agent.player(&args),
        None => py.detach(|| args.player().map_err(failed))?,
    };
    let recorded = py.detach(|| until_interrupted(&args, player.as_ref()))?;
    let Recorded { answer, gave_up, .. } = recorded.map_err(|failure| failed(*failure))?;
    match gave_up {
        Some(reason) => Err(error::of_input(reason)),
        None => answer::of(&answer, String::new()),
    }
}

/// Records on another thread, while this one looks for Ctrl-C, which only the main thread hears of. The first one lets the
/// steps under way be done; whole episodes stay.
fn until_interrupted(args: &RecordArgs, player: &dyn Player) -> PyResult<Result<Recorded, Box<Failure>>> {
    let (stop, (done, ended)) = (AtomicBool::new(false), channel());
    let stop = &stop;
    thread::scope(|scope| {
        scope.spawn(move || {
            // Whoever waits for it waits until this is done.
            let _ = done.send(args.record(player, stop).map_err(Box::new));
        });
        let mut interrupted = None;
        loop {
            match ended.recv_timeout(GLANCE) {
                Ok(recorded) => return interrupted.map_or(Ok(recorded), Err),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(error::of_input(
                        "the recording ended without an answer; this is a fault of mirrorstats",
                    ));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            if let Err(signal) = signals() {
                stop.store(true, Ordering::Relaxed);
                interrupted.get_or_insert(signal);
            }
        }
    })
}

/// Lets the interpreter handle what signals there are; an error is what it raised, for one `KeyboardInterrupt`.
fn signals() -> PyResult<()> {
    Python::attach(|py| {
        py.check_signals()?;
        Ok(())
    })
}
