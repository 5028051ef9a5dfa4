//! Records in the order of their bytes, more of them than memory should hold: sorted runs, put away and merged.
//!
//! Rule: a run that is put away is a temporary file without a name, gone with the process. Memory holds the runs that
//! are not put away and one record of each other run that is merged. What a record means is the caller's business; one
//! whose key must decide the order begins with a form of it that no other key continues.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read as _, Seek as _, Write as _};
use std::ops::Range;

use super::temporary;

/// Runs that are merged at a time, each an open file; more of them are first made into one.
const FAN_IN: usize = 64;

/// Bytes of a file that are read or written at a time.
const BUFFER: usize = 64 * 1024;

/// Records in order, in memory.
#[derive(Debug, Default)]
pub struct Run {
    bytes: Vec<u8>,
    records: Vec<Range<usize>>,
}

impl Run {
    /// The records at these places of some bytes, none before the one ahead of it.
    pub fn new(bytes: Vec<u8>, records: Vec<Range<usize>>) -> Self {
        Self { bytes, records }
    }

    /// The bytes of its records, and of whatever else lies between them.
    pub fn size(&self) -> usize {
        self.bytes.len()
    }
}

/// Runs that were put away: files of records, each with its length before it.
#[derive(Debug, Default)]
pub struct Runs(Vec<File>);

impl Runs {
    /// Whether nothing was put away.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Puts runs away, as one.
    ///
    /// # Errors
    /// When there is no place for temporary files, or no more of it.
    pub fn put_away(&mut self, runs: Vec<Run>) -> io::Result<()> {
        let run = merged_into_one(heads_in_memory(runs))?;
        self.add(run)
    }

    /// Puts records away, none of which comes before the one ahead of it.
    ///
    /// # Errors
    /// When there is no place for temporary files, or no more of it.
    pub fn put_away_records<R: AsRef<[u8]>>(&mut self, records: impl IntoIterator<Item = R>) -> io::Result<()> {
        let mut out = Out::new()?;
        records.into_iter().try_for_each(|record| out.put(record.as_ref()))?;
        self.add(out.finish()?)
    }

    fn add(&mut self, run: File) -> io::Result<()> {
        if self.0.len() == FAN_IN {
            let files = std::mem::take(&mut self.0);
            self.0.push(merged_into_one(heads_of_files(files)?)?);
        }
        self.0.push(run);
        Ok(())
    }

    /// All records, those of the last runs among them, in order.
    ///
    /// # Errors
    /// When what was put away cannot be read.
    pub fn merge(self, last: Vec<Run>) -> io::Result<Merge> {
        let mut heads = heads_of_files(self.0)?;
        heads.extend(heads_in_memory(last));
        Merge::of(heads)
    }
}

fn heads_in_memory(runs: Vec<Run>) -> Vec<Head> {
    runs.into_iter().map(|run| Head::Memory { run, next: 0 }).collect()
}

fn heads_of_files(files: Vec<File>) -> io::Result<Vec<Head>> {
    let head = |mut file: File| {
        file.rewind()?;
        Ok(Head::File { record: Vec::new(), rest: BufReader::with_capacity(BUFFER, file) })
    };
    files.into_iter().map(head).collect()
}

fn merged_into_one(heads: Vec<Head>) -> io::Result<File> {
    let mut out = Out::new()?;
    let mut merge = Merge::of(heads)?;
    while let Some(record) = merge.next()? {
        out.put(record)?;
    }
    out.finish()
}

/// A run on its way into a file.
struct Out(BufWriter<File>);

impl Out {
    fn new() -> io::Result<Self> {
        let file = tempfile::tempfile().map_err(temporary::without_name)?;
        Ok(Self(BufWriter::with_capacity(BUFFER, file)))
    }

    fn put(&mut self, record: &[u8]) -> io::Result<()> {
        let length = u32::try_from(record.len()).expect("a record is a few values of one row");
        self.0.write_all(&length.to_le_bytes())?;
        self.0.write_all(record)
    }

    fn finish(self) -> io::Result<File> {
        self.0.into_inner().map_err(io::IntoInnerError::into_error)
    }
}

/// The records of some runs, merged.
pub struct Merge {
    heads: BinaryHeap<Head>,
    /// Whether the first head has been handed out.
    taken: bool,
}

impl Merge {
    fn of(sources: Vec<Head>) -> io::Result<Self> {
        let mut heads = BinaryHeap::with_capacity(sources.len());
        for mut head in sources {
            if head.advance()? {
                heads.push(head);
            }
        }
        Ok(Self { heads, taken: false })
    }

    /// The next record.
    ///
    /// # Errors
    /// When what was put away cannot be read.
    #[expect(clippy::should_implement_trait, reason = "an iterator cannot lend its items")]
    pub fn next(&mut self) -> io::Result<Option<&[u8]>> {
        if self.taken
            && let Some(mut first) = self.heads.peek_mut()
            && !first.advance()?
        {
            PeekMut::pop(first);
        }
        self.taken = true;
        Ok(self.heads.peek().map(Head::record))
    }
}

/// The first record of a run that is not behind yet, and those after it.
enum Head {
    File {
        record: Vec<u8>,
        rest: BufReader<File>,
    },
    /// `next` is the record after the first one.
    Memory {
        run: Run,
        next: usize,
    },
}

impl Head {
    fn record(&self) -> &[u8] {
        match self {
            Self::File { record, .. } => record,
            Self::Memory { run, next } => &run.bytes[run.records[*next - 1].clone()],
        }
    }

    /// Goes on to the next record; whether there is one.
    fn advance(&mut self) -> io::Result<bool> {
        match self {
            Self::File { record, rest } => {
                let mut length = [0; 4];
                match rest.read_exact(&mut length) {
                    Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(false),
                    result => result?,
                }
                record.resize(u32::from_le_bytes(length) as usize, 0);
                rest.read_exact(record)?;
                Ok(true)
            }
            Self::Memory { run, next } => {
                *next += 1;
                Ok(*next <= run.records.len())
            }
        }
    }
}

impl Ord for Head {
    /// The greatest head of a heap is the one whose record comes first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.record().cmp(self.record())
    }
}

impl PartialOrd for Head {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Head {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Head {}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use std::ops::Range;

    use super::{FAN_IN, Run, Runs};

    fn run(records: &[Vec<u8>]) -> Run {
        let mut places: Vec<Range<usize>> = Vec::new();
        for record in records {
            let start = places.last().map_or(0, |last| last.end);
            places.push(start..start + record.len());
        }
        let bytes = records.concat();
        places.sort_by_key(|place| bytes[place.clone()].to_vec());
        Run::new(bytes, places)
    }

    /// Put away so many runs at a time.
    fn merged(records: &[Vec<u8>], in_memory: usize, at_a_time: usize) -> Vec<Vec<u8>> {
        let mut runs = Runs::default();
        let mut pending = Vec::new();
        for chunk in records.chunks(in_memory) {
            if pending.len() == at_a_time {
                runs.put_away(std::mem::take(&mut pending)).unwrap();
            }
            if chunk.len() == 3 {
                let mut chunk = chunk.to_vec();
                chunk.sort();
                runs.put_away_records(chunk).unwrap();
                continue;
            }
            pending.push(run(chunk));
        }
        let mut merge = runs.merge(pending).unwrap();
        let mut found = Vec::new();
        while let Some(record) = merge.next().unwrap() {
            found.push(record.to_vec());
        }
        found
    }

    proptest! {
        #[test]
        fn records_come_in_order_whatever_fits_into_memory(
            records in vec(vec(any::<u8>(), 0..4), 0..40), in_memory in 1_usize..50, at_a_time in 1_usize..4,
        ) {
            let mut expected = records.clone();
            expected.sort();
            prop_assert_eq!(merged(&records, in_memory, at_a_time), expected);
        }
    }

    #[test]
    fn more_runs_than_are_merged_at_a_time() {
        let records: Vec<Vec<u8>> = (0..u8::MAX).rev().map(|byte| vec![byte, 1]).collect();
        assert!(records.len() > 3 * FAN_IN);
        let mut expected = records.clone();
        expected.reverse();
        assert_eq!(merged(&records, 1, 1), expected);
    }
}
