//! How far an input came in its target: counted over a corpus, it shows whether inputs are all refused at the door.

use std::cell::Cell;

/// Of an input that its target refused at once.
pub const REFUSED: &str = "refused";

thread_local! {
    static REACHED: Cell<&'static str> = const { Cell::new(REFUSED) };
}

/// Says that the input of this thread came so far.
pub fn reached(stage: &'static str) {
    REACHED.set(stage);
}

/// How far the last input of this thread came; the next one starts anew.
pub fn taken() -> &'static str {
    REACHED.replace(REFUSED)
}
