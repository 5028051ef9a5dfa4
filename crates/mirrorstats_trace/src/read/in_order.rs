use std::collections::VecDeque;
use std::num::NonZeroUsize;
use std::panic::resume_unwind;
use std::thread::{self, ScopedJoinHandle};

/// Runs all jobs, `threads` at a time, and passes the results to `sink` in the order of the jobs. If no thread can be
/// started, the calling thread does the work.
pub fn in_order<J: Sync, T: Send, E>(
    threads: NonZeroUsize,
    jobs: &[J],
    work: impl Fn(&J) -> T + Sync,
    mut sink: impl FnMut(T) -> Result<(), E>,
) -> Result<(), E> {
    let threads = threads.get().min(jobs.len());
    if threads < 2 {
        return jobs.iter().try_for_each(|job| sink(work(job)));
    }
    let work = &work;
    let joined = |running: ScopedJoinHandle<'_, T>| running.join().unwrap_or_else(|panic| resume_unwind(panic));
    thread::scope(|scope| {
        let mut running = VecDeque::new();
        for job in jobs {
            if running.len() == threads
                && let Some(first) = running.pop_front()
            {
                sink(joined(first))?;
            }
            if let Ok(thread) = thread::Builder::new().spawn_scoped(scope, move || work(job)) {
                running.push_back(thread);
            } else {
                running.drain(..).try_for_each(|first| sink(joined(first)))?;
                sink(work(job))?;
            }
        }
        running.into_iter().try_for_each(|first| sink(joined(first)))
    })
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroUsize;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::in_order;

    #[test]
    fn results_come_in_the_order_of_the_jobs() {
        let jobs: Vec<usize> = (0..100).collect();
        for threads in [1, 2, 5, 200] {
            let mut found = Vec::new();
            let sink = |result| {
                found.push(result);
                Ok::<_, ()>(())
            };
            in_order(NonZeroUsize::new(threads).unwrap(), &jobs, |job| job * 2, sink).unwrap();
            assert!(found.into_iter().eq((0..100).map(|job| job * 2)), "{threads} threads");
        }
    }

    #[test]
    fn an_error_ends_the_work() {
        for threads in [1, 2] {
            let (jobs, begun) = ([(); 100], AtomicUsize::new(0));
            let mut left = 3;
            let sink = |_| {
                left -= 1;
                if left == 0 { Err("full") } else { Ok(()) }
            };
            let work = |(): &()| begun.fetch_add(1, Ordering::Relaxed);
            assert_eq!(in_order(NonZeroUsize::new(threads).unwrap(), &jobs, work, sink), Err("full"));
            assert!(threads > 1 || begun.load(Ordering::Relaxed) == 3);
        }
    }
}
