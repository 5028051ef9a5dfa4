//! One pass over traces: decodes row groups in parallel and hands on complete episodes in the order of the files.
//!
//! Each row group is one job. A worker decodes it and processes the episodes that are wholly inside. The episodes at
//! its ends may continue in the neighbouring row groups: their rows go to the receiving thread, which joins them. The
//! receiver's input and its order depend only on the files, never on threads. Only a few row groups are in progress at
//! a time, so memory does not grow with the data.

use std::collections::VecDeque;
use std::num::NonZeroUsize;
use std::sync::mpsc::{self, Receiver, Sender, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use arrow::array::{Array as _, AsArray as _};
use arrow::datatypes::Int32Type;

use super::budget::{LONGEST_EPISODE, most_episodes, most_joined};
use super::decode::{Ids, RowGroup, Rows};
use super::episode_index::Ahead;
use super::footer::trace_file::{Readable, TraceFile};
use super::projection::{EPISODE_ID, Layout};
use crate::diagnostic::{Code, Finding};
use crate::error::TraceError;
use mirrorstats_exact::budget::Budget;
use mirrorstats_parquet_pages::Column;

#[derive(Clone, Debug)]
pub(crate) struct Episodes {
    pub(crate) file: usize,
    pub(crate) columns: Vec<Column>,
    pub(crate) offsets: Vec<usize>,
    pub(crate) pieces: Vec<Piece>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    pub(crate) at: usize,
    pub(crate) row_group: usize,
    pub(crate) row: usize,
}

impl Episodes {
    pub(crate) fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    pub(crate) fn row_group(&self, row: usize) -> usize {
        self.pieces[self.pieces.partition_point(|piece| piece.at <= row) - 1].row_group
    }

    pub(crate) fn id(&self, row: usize) -> Option<&str> {
        self.columns[EPISODE_ID].text(row)
    }

    /// The ids of the episodes of some rows, which must ascend; `None` for null.
    pub(crate) fn ids<'a>(&'a self, rows: &'a [usize]) -> impl Iterator<Item = Option<&'a str>> {
        self.columns[EPISODE_ID].texts(rows)
    }
}

pub(crate) enum ScanEvent<T> {
    Whole(T),
    /// The file cannot be decoded further; this is its last event.
    Fault(Box<Finding>),
}

enum ScanPart<T> {
    Head(Vec<Rows>),
    Whole(T, usize),
    Tail(Vec<Rows>),
    Fault(Box<Finding>),
}

type Order<T> = (Job, SyncSender<ScanPart<T>>);

#[derive(Clone, Copy)]
struct Job {
    file: usize,
    row_group: usize,
}

/// The number of results that may wait in a row group's queue before its worker must.
const QUEUED_PARTS: usize = 16;

/// Runs `work` on all complete episodes and passes the results to `receive` with their file, in order.
pub(crate) fn pass<T: Send, E: From<TraceError>>(
    files: &[TraceFile],
    layout: &Layout,
    threads: NonZeroUsize,
    work: &(impl Fn(Episodes) -> T + Sync),
    receive: impl FnMut(usize, ScanEvent<T>) -> Result<(), E>,
) -> Result<(), E> {
    let jobs = files.iter().enumerate().flat_map(|(file, trace)| {
        (0..trace.row_groups())
            .filter(|row_group| trace.row_group_rows(*row_group) > 0)
            .map(move |row_group| Job { file, row_group })
    });
    let jobs: VecDeque<Job> = jobs.collect();
    let (give, take) = mpsc::channel::<Order<T>>();
    // Only workers hold it, so that sending fails once all of them have panicked.
    let take = Arc::new(Mutex::new(take));
    let ahead = &Ahead::new(files, layout);
    thread::scope(|scope| {
        // Dropped when this closure returns, even early: workers then find no job and end.
        let (give, take) = (give, take);
        let wanted = threads.get().min(jobs.len());
        for started in 0..wanted {
            let worker = thread::Builder::new().name("trace".into());
            let take = Arc::clone(&take);
            let spawned = worker.spawn_scoped(scope, move || run_jobs(&take, files, layout, ahead, work));
            match spawned {
                Err(source) if started == 0 => return Err(TraceError::Threads { threads: wanted, source }.into()),
                // Fewer threads give the same results.
                Err(_) => break,
                Ok(_) => {}
            }
        }
        drop(take);
        let budget = Budget::new(most_episodes(files.iter().map(TraceFile::bytes).sum()));
        Joiner { files, work, receive, open: Vec::new(), budget, file: 0, failed: false }.run(&give, jobs, wanted + 2)
    })
}

fn run_jobs<T>(
    take: &Mutex<Receiver<Order<T>>>,
    files: &[TraceFile],
    layout: &Layout,
    ahead: &Ahead,
    work: &impl Fn(Episodes) -> T,
) {
    loop {
        let next = take.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok((job, parts)) = next else { return };
        let ids = ahead.take(job.file, job.row_group);
        Splitter {
            file: &files[job.file],
            layout,
            job,
            work,
            parts: &parts,
            open: Vec::new(),
            headed: job.row_group == 0 || ids.as_ref().is_some_and(|ids| ids.begins),
        }
        .run(ids);
    }
}

struct Splitter<'a, T, W> {
    file: &'a TraceFile,
    layout: &'a Layout,
    job: Job,
    work: &'a W,
    parts: &'a SyncSender<ScanPart<T>>,
    open: Vec<Rows>,
    headed: bool,
}

struct Abandoned;

impl<T, W: Fn(Episodes) -> T> Splitter<'_, T, W> {
    fn run(mut self, ids: Option<Ids>) {
        let result = match RowGroup::open(self.file, self.layout, self.job.row_group, ids) {
            Ok(rows) => self.split(rows),
            Err(finding) => self.send(ScanPart::Fault(finding)),
        };
        // The receiver has gone, so the result is not needed.
        drop(result);
    }

    fn split(&mut self, row_group: RowGroup<'_>) -> Result<(), Abandoned> {
        for rows in row_group {
            match rows {
                Ok(rows) => {
                    self.add(&rows)?;
                    if let Some(finding) = too_long(self.file, &self.open) {
                        return self.send(ScanPart::Fault(finding));
                    }
                }
                Err(finding) => return self.send(ScanPart::Fault(finding)),
            }
        }
        if self.job.row_group + 1 == self.file.row_groups() {
            return self.close();
        }
        match std::mem::take(&mut self.open) {
            open if open.is_empty() => Ok(()),
            open if self.headed => self.send(ScanPart::Tail(open)),
            open => self.send(ScanPart::Head(open)),
        }
    }

    fn add(&mut self, rows: &Rows) -> Result<(), Abandoned> {
        let mut starts = starts(rows);
        let goes_on = self.open.first().is_some_and(|open| open.episode(0) == rows.episode(0));
        if !goes_on {
            self.close()?;
        }
        if rows.whole {
            starts.push(rows.len());
        }
        let Some(last) = starts.pop().filter(|last| *last > 0) else {
            self.open.push(rows.clone());
            return Ok(());
        };
        // If no episode continues, the first one here is complete, unless it may have begun before this row group.
        let from = if self.open.is_empty() && self.headed { 0 } else { starts.get(1).copied().unwrap_or(last) };
        if from > 0 {
            self.open.push(rows.slice(0, from));
            self.close()?;
        }
        if from < last {
            let offsets = starts.iter().chain([&last]).filter(|start| **start >= from).map(|start| start - from);
            let inside = rows.slice(from, last - from);
            self.send_whole(Episodes {
                file: self.job.file,
                offsets: offsets.collect(),
                pieces: vec![Piece { at: 0, row_group: inside.row_group, row: inside.first }],
                columns: inside.columns,
            })?;
        }
        if last < rows.len() {
            self.open.push(rows.slice(last, rows.len() - last));
        }
        Ok(())
    }

    fn close(&mut self) -> Result<(), Abandoned> {
        let open = std::mem::take(&mut self.open);
        if open.is_empty() {
            return Ok(());
        }
        if !std::mem::replace(&mut self.headed, true) {
            return self.send(ScanPart::Head(open));
        }
        match join(self.job.file, &open) {
            Ok(episode) => self.send_whole(episode),
            Err(why) => self.send(ScanPart::Fault(unjoined(self.file, &open, why))),
        }
    }

    fn send_whole(&self, episodes: Episodes) -> Result<(), Abandoned> {
        let count = episodes.len();
        self.send(ScanPart::Whole((self.work)(episodes), count))
    }

    fn send(&self, part: ScanPart<T>) -> Result<(), Abandoned> {
        self.parts.send(part).map_err(|_| Abandoned)
    }
}

struct Started<T> {
    job: Job,
    parts: Receiver<ScanPart<T>>,
    /// Held so that a file's footer is read once for all its row groups.
    _footer: Option<Arc<Readable>>,
}

/// Joins the parts of the row groups, on the receiving thread.
struct Joiner<'a, W, R> {
    files: &'a [TraceFile],
    work: &'a W,
    receive: R,
    open: Vec<Rows>,
    /// Counts the episodes of all files together: many small files have many episodes.
    budget: Budget,
    file: usize,
    /// True after a fault of the file; the rest of it is ignored.
    failed: bool,
}

impl<T, E: From<TraceError>, W: Fn(Episodes) -> T, R: FnMut(usize, ScanEvent<T>) -> Result<(), E>> Joiner<'_, W, R> {
    fn run(mut self, give: &Sender<Order<T>>, mut jobs: VecDeque<Job>, under_way: usize) -> Result<(), E> {
        let mut started: VecDeque<Started<T>> = VecDeque::new();
        loop {
            while started.len() < under_way {
                let Some(job) = jobs.pop_front() else { break };
                let footer = self.files[job.file].footer().ok();
                let (parts, listen) = mpsc::sync_channel(QUEUED_PARTS);
                if give.send((job, parts)).is_err() {
                    break;
                }
                started.push_back(Started { job, parts: listen, _footer: footer });
            }
            let Some(Started { job, parts, .. }) = started.pop_front() else { break };
            if job.file != self.file {
                self.close()?;
                (self.file, self.failed) = (job.file, false);
            }
            for part in parts {
                if !self.failed {
                    self.take(part)?;
                }
            }
        }
        self.close()
    }

    fn take(&mut self, part: ScanPart<T>) -> Result<(), E> {
        match part {
            ScanPart::Head(rows) => {
                let goes_on = self.open.first().zip(rows.first()).is_some_and(|(a, b)| a.episode(0) == b.episode(0));
                if !goes_on {
                    self.close()?;
                }
                self.open.extend(rows);
                too_long(&self.files[self.file], &self.open).map_or(Ok(()), |finding| self.fail(finding))
            }
            ScanPart::Whole(result, count) => {
                self.close()?;
                self.pass_on(result, count)
            }
            ScanPart::Tail(rows) => {
                self.close()?;
                self.open = rows;
                Ok(())
            }
            ScanPart::Fault(finding) => self.fail(finding),
        }
    }

    fn pass_on(&mut self, result: T, count: usize) -> Result<(), E> {
        match self.budget.spend(count as u64) {
            Ok(()) => (self.receive)(self.file, ScanEvent::Whole(result)),
            Err(exceeded) => self.fail(Box::new(Finding::over_budget(self.files[self.file].name(), &exceeded))),
        }
    }

    fn fail(&mut self, finding: Box<Finding>) -> Result<(), E> {
        self.failed = true;
        self.open.clear();
        (self.receive)(self.file, ScanEvent::Fault(finding))
    }

    fn close(&mut self) -> Result<(), E> {
        let open = std::mem::take(&mut self.open);
        if open.is_empty() {
            return Ok(());
        }
        match join(self.file, &open) {
            Ok(episode) => self.pass_on((self.work)(episode), 1),
            Err(why) => self.fail(unjoined(&self.files[self.file], &open, why)),
        }
    }
}

fn too_long(file: &TraceFile, open: &[Rows]) -> Option<Box<Finding>> {
    let steps: usize = open.iter().map(Rows::len).sum();
    let first = open.first()?;
    let values = steps * first.columns.len();
    let checked = LONGEST_EPISODE.check(steps as u64).and_then(|()| most_joined(file.bytes()).check(values as u64));
    let finding = Finding::over_budget(file.name(), &checked.err()?).in_row_group(first.row_group);
    Some(Box::new(finding))
}

fn join(file: usize, parts: &[Rows]) -> Result<Episodes, String> {
    let (mut pieces, mut at) = (Vec::with_capacity(parts.len()), 0);
    for rows in parts {
        pieces.push(Piece { at, row_group: rows.row_group, row: rows.first });
        at += rows.len();
    }
    let columns = if let [rows] = parts {
        rows.columns.clone()
    } else {
        let column =
            |i: usize| Column::concat(parts.iter().map(|rows| &rows.columns[i])).map_err(|error| error.to_string());
        (0..parts[0].columns.len()).map(column).collect::<Result<_, _>>()?
    };
    Ok(Episodes { file, columns, offsets: vec![0, at], pieces })
}

fn unjoined(file: &TraceFile, parts: &[Rows], why: String) -> Box<Finding> {
    let finding = Finding::new(Code::CorruptData, file.name(), "rows that can be put together", why);
    Box::new(finding.in_row_group(parts[0].row_group))
}

fn starts(rows: &Rows) -> Vec<usize> {
    let differ = |row: &usize| rows.episode(*row) != rows.episode(row - 1);
    let mut starts = vec![0];
    match &rows.columns[EPISODE_ID] {
        Column::Runs(ids) => starts.extend(ids.text_changes()),
        Column::Flat(ids) if ids.null_count() == 0 => {
            // Equal keys are equal ids; but a dictionary may hold one id under two keys.
            let keys = ids.as_dictionary::<Int32Type>().keys().values();
            starts.extend((1..keys.len()).filter(|row| keys[*row] != keys[row - 1]).filter(differ));
        }
        ids => starts.extend((1..ids.len()).filter(differ)),
    }
    starts
}
