//! Turns a panic in a third-party decoder into an error of the file that caused it.

use std::cell::Cell;
use std::io::{self, Write as _};
use std::panic::{self, AssertUnwindSafe};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, Once, PoisonError};

thread_local! {
    static CONTAINING: Cell<bool> = const { Cell::new(false) };
}

/// True in a process that runs a command.
static IN_COMMAND: AtomicBool = AtomicBool::new(false);

/// The file and line of the last contained panic.
static PLACE: Mutex<String> = Mutex::new(String::new());

/// The number of running calls that contain panics of all threads.
static EVERYWHERE: AtomicUsize = AtomicUsize::new(0);

/// The result of `decode`, or the message of its panic, which is not printed.
///
/// Only for calls into a decoder whose state is discarded afterwards.
pub fn contained<R>(decode: impl FnOnce() -> R) -> Result<R, String> {
    silence_contained_panics();
    let before = CONTAINING.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(decode));
    CONTAINING.set(before);
    result.map_err(|payload| {
        let text = payload.downcast_ref::<&str>().map(ToString::to_string);
        let text = text.or_else(|| payload.downcast_ref::<String>().cloned());
        // zstd panics where it gets no memory.
        let is_memory = |text: &String| text.contains("null pointer when creating new context");
        let text = text.map(|text| if is_memory(&text) { "not enough memory for the decoder".into() } else { text });
        text.unwrap_or_else(|| "the decoder gave up".into())
    })
}

/// Like [`contained`], for a library with its own threads: panics are not printed on any thread.
#[cfg(feature = "polars")]
pub fn contained_on_all_threads<R>(run: impl FnOnce() -> R) -> Result<R, String> {
    EVERYWHERE.fetch_add(1, Ordering::SeqCst);
    let result = contained(run);
    EVERYWHERE.fetch_sub(1, Ordering::SeqCst);
    result
}

/// Like [`contained`], for a whole command. The message ends with the file and line of the panic. A panic of another
/// thread is printed as an error at once, since nothing may wait for the thread.
pub fn caught<R>(run: impl FnOnce() -> R) -> Result<R, String> {
    IN_COMMAND.store(true, Ordering::SeqCst);
    contained(run).map_err(|text| {
        let place = PLACE.lock().unwrap_or_else(PoisonError::into_inner).clone();
        format!("{text} ({place})")
    })
}

fn silence_contained_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let report = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            let place = info.location().map_or_else(String::new, |location| {
                let file = location.file().rsplit(['/', '\\']).next().unwrap_or_default();
                format!("{file}:{}", location.line())
            });
            if CONTAINING.get() || EVERYWHERE.load(Ordering::SeqCst) > 0 {
                *PLACE.lock().unwrap_or_else(PoisonError::into_inner) = place;
            } else if IN_COMMAND.load(Ordering::SeqCst) {
                let text = info.payload_as_str().unwrap_or("no message");
                let _ = writeln!(io::stderr(), "error: internal error: {text} ({place})");
            } else {
                report(info);
            }
        }));
    });
}

#[cfg(test)]
mod tests {
    use super::{caught, contained};

    #[test]
    fn a_panic_becomes_its_message() {
        assert_eq!(contained(|| 7), Ok(7));
        let empty: Vec<i32> = Vec::new();
        assert!(contained(|| empty[3]).unwrap_err().contains("out of bounds"));
        let words = caught(|| empty[3]).unwrap_err();
        assert!(words.contains("out of bounds") && words.contains("(catch_panic.rs:"), "{words}");
    }
}
