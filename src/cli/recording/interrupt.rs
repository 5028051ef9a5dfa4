//! The effect of Ctrl-C on a recording.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crate::cli::outcome::Failure;
use world::agent::Player;

/// The current player.
pub type Playing = Arc<Mutex<Option<Arc<dyn Player>>>>;

/// The first Ctrl-C ends a recording when the steps under way are done, those of people at once; a second one ends all at
/// once.
pub fn stop_at_interrupt(stop: &'static AtomicBool, playing: Playing) -> Result<(), Failure> {
    ctrlc::set_handler(move || {
        let is_second = stop.swap(true, Ordering::Relaxed);
        let playing = playing.lock().unwrap_or_else(PoisonError::into_inner);
        match playing.as_ref() {
            Some(player) if is_second => player.abandon(),
            Some(player) => player.interrupt(),
            None => {}
        }
        if is_second {
            leave(130);
        }
    })
    .map_err(|error| Failure::input(format!("cannot listen for Ctrl-C: {error}")))
}

/// Ends the process at once, without the exit handlers of libraries: those of the renderer would take apart what other
/// threads are drawing with. What is lost is temporary, and swept by the next recording.
#[cfg(unix)]
fn leave(code: i32) -> ! {
    signal_hook::low_level::exit(code)
}

#[cfg(not(unix))]
fn leave(code: i32) -> ! {
    std::process::exit(code)
}
