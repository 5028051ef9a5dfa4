//! Recordings: with an agent of the program, or with a Python function.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use mirrorstats::cli::commands::record::{AnyPlayer, RecordArgs, Recorded};
use mirrorstats::cli::{self, Failure, Options};
use mirrorstats_agents::exec::Images;
use mirrorstats_agents::function::{Function, FunctionPlayer, Listener};
use mirrorstats_record::lock::{FolderLock, parts_of};
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

use crate::answer::{self, Answer};
use crate::error;

/// The time between two checks for signals.
const GLANCE: Duration = Duration::from_millis(50);

/// A Python function that plays.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct PythonAgent {
    model: String,
    source: Option<String>,
    is_base64: bool,
    /// True if an exception of the function loses its episode; else it ends the recording.
    is_lost: bool,
    /// Returns the function of an episode, which takes a message as JSON and returns the text of a reply.
    listeners: Py<PyAny>,
}

/// The early end of a recording: Ctrl-C, or the first error of a function.
#[derive(Clone, Debug, Default)]
struct Ending {
    stop: Arc<AtomicBool>,
    raised: Arc<Mutex<Option<PyErr>>>,
}

impl Ending {
    fn raise(&self, fault: PyErr) {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(fault);
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl PythonAgent {
    fn player(self, args: &RecordArgs, ending: &Ending) -> AnyPlayer {
        let Self { model, source, is_base64, is_lost, listeners } = self;
        let images = if is_base64 { Images::Base64 } else { Images::Path };
        let (scratch, stop, ending) = (parts_of(&args.out), Arc::clone(&ending.stop), ending.clone());
        let failed = move |py: Python<'_>, fault: PyErr| {
            let words = words(py, &fault);
            if !is_lost || !fault.is_instance_of::<PyException>(py) {
                ending.raise(fault);
            }
            words
        };
        let listeners = move || {
            Python::attach(|py| {
                let function = listeners.call0(py).map_err(|fault| failed(py, fault))?;
                Ok(listener(function, failed.clone()))
            })
        };
        let function = Function { model, source, images, scratch, listeners: Arc::new(listeners), stop };
        AnyPlayer::Other(Box::new(FunctionPlayer::new(function)))
    }
}

fn listener(function: Py<PyAny>, failed: impl Fn(Python<'_>, PyErr) -> String + Send + 'static) -> Listener {
    Box::new(move |message| {
        let message = serde_json::to_string(message).map_err(|fault| fault.to_string())?;
        Python::attach(|py| {
            let said = function.call1(py, (message,)).and_then(|said| said.extract(py));
            said.map_err(|fault: PyErr| failed(py, fault))
        })
    })
}

fn words(py: Python<'_>, fault: &PyErr) -> String {
    let traced = fault.traceback(py).and_then(|traceback| traceback.format().ok());
    traced.map_or_else(|| fault.to_string(), |traceback| format!("{fault}\n{}", traceback.trim_end()))
}

/// The keywords that `record` takes beside those of its own, as options of the command line.
#[pyfunction]
pub fn record_options() -> Vec<String> {
    cli::option_names::<RecordArgs>()
}

/// Records as `mirrorstats record` with these options, a JSON object; with `agent` in the place of what `--agent` names.
#[pyfunction]
#[pyo3(signature = (options, agent=None))]
pub fn record(py: Python<'_>, options: &str, agent: Option<PythonAgent>) -> PyResult<Answer> {
    let failed = |failure: Failure| error::of_failure(&failure, "RecordError");
    let options: Options = serde_json::from_str(options).map_err(error::of_argument)?;
    let wrong = |failure: Failure| error::of_failure(&failure, "ArgumentError");
    let args: RecordArgs = cli::options_of("record", &options).map_err(wrong)?;
    let ending = Ending::default();
    let lock = args.lock().map_err(failed)?;
    let player = match agent {
        Some(agent) => agent.player(&args, &ending),
        None => py.detach(|| args.player().map_err(failed))?,
    };
    let recorded = py.detach(|| until_ended(&args, lock, &player, &ending))?;
    if let Some(raised) = ending.raised.lock().unwrap_or_else(PoisonError::into_inner).take() {
        return Err(raised);
    }
    let Recorded { answer, gave_up, .. } = recorded.map_err(|failure| failed(*failure))?;
    match gave_up {
        Some(reason) => Err(failed(Failure::input(reason))),
        None => answer::of(&answer, String::new()),
    }
}

/// Records on another thread while this one watches for Ctrl-C, which only the main thread receives. The first Ctrl-C
/// ends functions at once but completes other current steps; the second ends these too. Complete episodes stay.
fn until_ended(
    args: &RecordArgs,
    lock: FolderLock,
    player: &AnyPlayer,
    ending: &Ending,
) -> PyResult<Result<Recorded, Box<Failure>>> {
    let (done, ended) = channel();
    thread::scope(|scope| {
        scope.spawn(move || {
            // The receiver waits until this is done.
            let _ = done.send(args.record(lock, player, &ending.stop).map_err(Box::new));
        });
        loop {
            match ended.recv_timeout(GLANCE) {
                Ok(recorded) => return Ok(recorded),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(error::of_input(
                        "the recording ended without an answer; this is a fault of mirrorstats",
                    ));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            if let Err(signal) = signals() {
                if ending.stop.load(Ordering::Relaxed) {
                    player.player().abandon();
                }
                ending.raise(signal);
                player.interrupt();
            }
        }
    })
}

/// Lets the interpreter handle pending signals; an error is the exception raised, such as `KeyboardInterrupt`.
fn signals() -> PyResult<()> {
    Python::attach(|py| {
        py.check_signals()?;
        Ok(())
    })
}
