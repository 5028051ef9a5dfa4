//! How far an input got in its target. Counted over a corpus, it shows whether all inputs are refused early.

use std::cell::Cell;

/// The depth of an input that its target refused at once.
pub const REFUSED: &str = "refused";

thread_local! {
    static REACHED: Cell<&'static str> = const { Cell::new(REFUSED) };
}

/// Records that this thread's input reached `stage`.
pub fn reached(stage: &'static str) {
    REACHED.set(stage);
}

/// Returns the depth of this thread's last input and resets it.
pub fn taken() -> &'static str {
    REACHED.replace(REFUSED)
}
