//! The effect of Ctrl-C on a recording.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::player::AnyPlayer;
use crate::cli::Failure;

pub type Playing = Arc<Mutex<Option<Arc<AnyPlayer>>>>;

/// The first Ctrl-C ends a recording after the current steps, or at once for people; a second one ends everything at
/// once.
pub fn stop_at_interrupt(stop: &'static AtomicBool, playing: Playing) -> Result<(), Failure> {
    ctrlc::set_handler(move || {
        let is_second = stop.swap(true, Ordering::Relaxed);
        let playing = playing.lock().unwrap_or_else(PoisonError::into_inner);
        match playing.as_ref() {
            Some(player) if is_second => player.player().abandon(),
            Some(player) => player.interrupt(),
            None => {}
        }
        if is_second {
            leave(130);
        }
    })
    .map_err(|error| Failure::input(format!("cannot listen for Ctrl-C: {error}")))
}

/// Ends the process at once, without the exit handlers of libraries: those of the renderer would destroy objects that
/// other threads are drawing with. Only temporary data is lost; the next recording sweeps it.
#[cfg(unix)]
fn leave(code: i32) -> ! {
    signal_hook::low_level::exit(code)
}

#[cfg(not(unix))]
fn leave(code: i32) -> ! {
    std::process::exit(code)
}
