//! Two steps of a work side by side: one thread makes items, another takes them.

use std::io;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread;

/// Runs `feed` here and `work` on a thread of its own, which gets what `feed` sends, in that order; at most `waiting`
/// items wait. What both give.
///
/// # Errors
/// When there is no thread to be had; neither has run then.
///
/// # Panics
/// When `work` does.
pub fn beside<T: Send, W: Send, F>(
    name: &str,
    waiting: usize,
    work: impl FnOnce(Receiver<T>) -> W + Send,
    feed: impl FnOnce(SyncSender<T>) -> F,
) -> io::Result<(F, W)> {
    thread::scope(|scope| {
        let (give, take) = mpsc::sync_channel(waiting);
        let thread = thread::Builder::new().name(name.into()).spawn_scoped(scope, move || work(take))?;
        let given = feed(give);
        let taken = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        Ok((given, taken))
    })
}

#[cfg(test)]
mod tests {
    use super::beside;

    #[test]
    fn items_come_in_order_and_an_early_end_is_seen() {
        let (sent, sum) = beside(
            "adds",
            1,
            |items| items.iter().collect::<Vec<i32>>(),
            |give| (0..100).map(|item| give.send(item).is_ok()).filter(|sent| *sent).count(),
        )
        .unwrap();
        assert_eq!((sent, sum), (100, (0..100).collect()));
        let (sent, first) =
            beside("stops", 0, |items| items.recv(), |give| (0..100).all(|item: i32| give.send(item).is_ok())).unwrap();
        assert_eq!((sent, first), (false, Ok(0)));
    }
}
