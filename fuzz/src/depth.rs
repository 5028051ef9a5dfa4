//! The depth that an input reached in its target: counted over a corpus, it shows whether all inputs are refused early.

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

/// The depth of this thread's last input; the next one starts anew.
pub fn taken() -> &'static str {
    REACHED.replace(REFUSED)
}
