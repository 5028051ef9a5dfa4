//! Records in the order of their bytes, more of them than memory should hold: sorted runs, put away and merged.
//!
//! Rule: a run that is put away is a temporary file without a name, gone with the process. Memory holds the run that
//! grows and one record of each run that is merged. What a record means is the caller's business; one whose key must
//! decide the order begins with a form of it that no other key continues.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Cursor, Read, Seek as _, Write as _};

use super::temporary;

/// Runs that are merged at a time, each an open file; more of them are first made into one.
const FAN_IN: usize = 64;

/// Records one after the other, each with its length before it.
#[derive(Debug, Default)]
pub struct Run(Vec<u8>);

impl Run {
    /// Adds a record, which must not come before the last one.
    pub fn push(&mut self, record: &[u8]) {
        let length = u32::try_from(record.len()).expect("a record is a few values of one row");
        self.0.extend_from_slice(&length.to_le_bytes());
        self.0.extend_from_slice(record);
    }
}

/// Runs that were put away.
#[derive(Debug, Default)]
pub struct Runs(Vec<File>);

impl Runs {
    /// Puts a run away.
    ///
    /// # Errors
    /// When there is no place for temporary files, or no more of it.
    pub fn put_away(&mut self, run: &Run) -> io::Result<()> {
        if self.0.len() == FAN_IN {
            let merged = merged_into_one(std::mem::take(&mut self.0))?;
            self.0.push(merged);
        }
        let mut file = tempfile::tempfile().map_err(temporary::without_name)?;
        file.write_all(&run.0)?;
        self.0.push(file);
        Ok(())
    }

    /// All records, those of the last run among them, in order.
    ///
    /// # Errors
    /// When what was put away cannot be read.
    pub fn merge(self, last: Run) -> io::Result<Merge> {
        let mut sources = sources(self.0)?;
        sources.push(Box::new(Cursor::new(last.0)));
        Merge::of(sources)
    }
}

fn sources(files: Vec<File>) -> io::Result<Vec<Box<dyn Read + Send>>> {
    let source = |mut file: File| {
        file.rewind()?;
        Ok(Box::new(BufReader::with_capacity(64 * 1024, file)) as Box<dyn Read + Send>)
    };
    files.into_iter().map(source).collect()
}

fn merged_into_one(files: Vec<File>) -> io::Result<File> {
    let mut out = BufWriter::new(tempfile::tempfile().map_err(temporary::without_name)?);
    let mut merge = Merge::of(sources(files)?)?;
    while let Some(record) = merge.next()? {
        let length = u32::try_from(record.len()).expect("it was read with a length of 32 bits");
        out.write_all(&length.to_le_bytes())?;
        out.write_all(record)?;
    }
    out.into_inner().map_err(io::IntoInnerError::into_error)
}

/// The records of some runs, merged.
pub struct Merge {
    heads: BinaryHeap<Head>,
    /// Whether the first head has been handed out.
    taken: bool,
}

impl Merge {
    fn of(sources: Vec<Box<dyn Read + Send>>) -> io::Result<Self> {
        let mut heads = BinaryHeap::with_capacity(sources.len());
        for rest in sources {
            let mut head = Head { record: Vec::new(), rest };
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
        Ok(self.heads.peek().map(|head| head.record.as_slice()))
    }
}

/// The first record of a run that is not behind yet, and those after it.
struct Head {
    record: Vec<u8>,
    rest: Box<dyn Read + Send>,
}

impl Head {
    /// Goes on to the next record; whether there is one.
    fn advance(&mut self) -> io::Result<bool> {
        let mut length = [0; 4];
        match self.rest.read_exact(&mut length) {
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(false),
            result => result?,
        }
        self.record.resize(u32::from_le_bytes(length) as usize, 0);
        self.rest.read_exact(&mut self.record)?;
        Ok(true)
    }
}

impl Ord for Head {
    /// The greatest head of a heap is the one whose record comes first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.record.cmp(&self.record)
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

    use super::{FAN_IN, Run, Runs};

    fn run(records: &[Vec<u8>]) -> Run {
        let mut sorted = records.to_vec();
        sorted.sort();
        let mut run = Run::default();
        for record in &sorted {
            run.push(record);
        }
        run
    }

    fn merged(records: &[Vec<u8>], in_memory: usize) -> Vec<Vec<u8>> {
        let mut chunks = records.chunks(in_memory).map(run);
        let last = chunks.next_back().unwrap_or_default();
        let mut runs = Runs::default();
        chunks.for_each(|chunk| runs.put_away(&chunk).unwrap());
        let mut merge = runs.merge(last).unwrap();
        let mut found = Vec::new();
        while let Some(record) = merge.next().unwrap() {
            found.push(record.to_vec());
        }
        found
    }

    proptest! {
        #[test]
        fn records_come_in_order_whatever_fits_into_memory(
            records in vec(vec(any::<u8>(), 0..4), 0..40), in_memory in 1_usize..50,
        ) {
            let mut expected = records.clone();
            expected.sort();
            prop_assert_eq!(merged(&records, in_memory), expected);
        }
    }

    #[test]
    fn more_runs_than_are_merged_at_a_time() {
        let records: Vec<Vec<u8>> = (0..u8::MAX).rev().map(|byte| vec![byte, 1]).collect();
        assert!(records.len() > 3 * FAN_IN);
        let mut expected = records.clone();
        expected.reverse();
        assert_eq!(merged(&records, 1), expected);
    }
}
