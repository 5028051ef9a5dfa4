use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;

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
    let next = &AtomicUsize::new(0);
    let work = &work;
    let (give, take) = mpsc::channel();
    thread::scope(|scope| {
        // The calling thread works too; results wait in the channel meanwhile.
        for _ in 1..threads {
            let give = give.clone();
            let worker = move || {
                while let Some((at, job)) = claim(next, jobs) {
                    if give.send((at, work(job))).is_err() {
                        return;
                    }
                }
            };
            if thread::Builder::new().spawn_scoped(scope, worker).is_err() {
                break;
            }
        }
        drop(give);
        let mut waiting = BTreeMap::new();
        for wanted in 0..jobs.len() {
            let result = loop {
                if let Some(result) = waiting.remove(&wanted) {
                    break result;
                }
                let (at, result) = match take.try_recv() {
                    Ok(other) => other,
                    Err(_) => match claim(next, jobs) {
                        Some((at, job)) => (at, work(job)),
                        None => take.recv().expect("a job is done by whoever has begun it, unless it panicked"),
                    },
                };
                waiting.insert(at, result);
            };
            sink(result).inspect_err(|_| next.store(jobs.len(), Ordering::Relaxed))?;
        }
        Ok(())
    })
}

fn claim<'a, J>(next: &AtomicUsize, jobs: &'a [J]) -> Option<(usize, &'a J)> {
    let at = next.fetch_add(1, Ordering::Relaxed);
    jobs.get(at).map(|job| (at, job))
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
