//! Records in the order of their bytes, more of them than memory should hold: sorted runs, put away and merged.
//!
//! Rule: a run that is put away is a temporary file without a name, gone with the process. Memory holds the runs that
//! are not put away and one record of each other run that is merged. What a record means is the caller's business; one
//! whose key must decide the order begins with a form of it that no other key continues. What many records have in
//! common may be their title, which is kept once a run; titles come in the order of their bytes, too.
//!
//! A run in a file is a sequence of titles and records, each with its length before it; a title stands before its
//! records and has the highest bit of its length set.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read as _, Seek as _, Write as _};
use std::ops::Range;

use super::replace;

/// Runs that are merged at a time, each an open file; more of them are first made into one.
const FAN_IN: usize = 64;

/// Bytes of a file that are read or written at a time.
const BUFFER: usize = 64 * 1024;

/// Marks the length of a title in a file.
const TITLE: u32 = 1 << 31;

/// Records in order, in memory.
#[derive(Debug, Default)]
pub struct Run {
    bytes: Vec<u8>,
    sections: Vec<Section>,
    records: Vec<Place>,
}

/// The records of one title.
#[derive(Clone, Debug)]
pub struct Section {
    /// What they have in common.
    pub title: Vec<u8>,
    /// The position of the record behind them.
    pub end: usize,
}

/// Where a record is among some bytes.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Its first byte.
    pub start: u32,
    /// Its number of bytes.
    pub length: u32,
}

impl Place {
    /// The bytes of the record.
    pub fn range(self) -> Range<usize> {
        self.start as usize..self.start as usize + self.length as usize
    }
}

impl Run {
    /// The records at these places of some bytes. Titles ascend, each with a record at least, and the records of each
    /// ascend, too.
    pub fn new(bytes: Vec<u8>, sections: Vec<Section>, records: Vec<Place>) -> Self {
        Self { bytes, sections, records }
    }

    /// The bytes that it takes.
    pub fn size(&self) -> usize {
        let title = |section: &Section| size_of::<Section>() + section.title.len();
        let titles: usize = self.sections.iter().map(title).sum();
        self.bytes.len() + self.records.len() * size_of::<Place>() + titles
    }
}

/// Runs that were put away.
#[derive(Debug, Default)]
pub struct Runs(Vec<File>);

impl Runs {
    /// Puts runs away, as one.
    ///
    /// # Errors
    /// When there is no place for temporary files, or no more of it.
    pub fn put_away(&mut self, runs: Vec<Run>) -> io::Result<()> {
        let run = merged_into_one(heads_in_memory(runs))?;
        self.add(run)
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
    runs.into_iter().map(|run| Head::of(Source::Memory { run, next: 0, section: 0 })).collect()
}

fn heads_of_files(files: Vec<File>) -> io::Result<Vec<Head>> {
    let head = |mut file: File| {
        file.rewind()?;
        Ok(Head::of(Source::File { record: Vec::new(), rest: BufReader::with_capacity(BUFFER, file) }))
    };
    files.into_iter().map(head).collect()
}

fn merged_into_one(heads: Vec<Head>) -> io::Result<File> {
    let mut out = Out::new()?;
    let mut merge = Merge::of(heads)?;
    while let Some(Record { title, bytes }) = merge.next()? {
        if let Some(title) = title {
            out.put(title, TITLE)?;
        }
        out.put(bytes, 0)?;
    }
    out.finish()
}

/// A run on its way into a file.
struct Out(BufWriter<File>);

impl Out {
    fn new() -> io::Result<Self> {
        let file = tempfile::tempfile().map_err(replace::without_name)?;
        Ok(Self(BufWriter::with_capacity(BUFFER, file)))
    }

    fn put(&mut self, bytes: &[u8], mark: u32) -> io::Result<()> {
        let length = u32::try_from(bytes.len()).ok().filter(|length| *length < TITLE);
        let length = length.expect("a title or record is a few values of one row");
        self.0.write_all(&(length | mark).to_le_bytes())?;
        self.0.write_all(bytes)
    }

    fn finish(self) -> io::Result<File> {
        self.0.into_inner().map_err(io::IntoInnerError::into_error)
    }
}

/// The records of some runs, merged.
pub struct Merge {
    /// The runs; one that is behind stays where it is.
    heads: Vec<Head>,
    /// The title of the records that are handed out.
    title: Vec<u8>,
    /// Those of the heads that stand at that title.
    front: Vec<Front>,
    /// The place in front of the head that was handed out last.
    taken: Option<usize>,
    /// What the records of all others in front begin with, at the least.
    others: u64,
}

/// A head whose record may be the next one.
#[derive(Clone, Copy)]
struct Front {
    head: usize,
    /// The first eight bytes of its record as a number, which decides most comparisons; zeros where there are fewer.
    prefix: u64,
}

/// A record, handed out.
#[derive(Clone, Copy, Debug)]
pub struct Record<'a> {
    /// Its title, if it is the first one under it.
    pub title: Option<&'a [u8]>,
    /// Its own bytes.
    pub bytes: &'a [u8],
}

impl Merge {
    fn of(mut heads: Vec<Head>) -> io::Result<Self> {
        for head in &mut heads {
            head.advance()?;
        }
        Ok(Self { heads, title: Vec::new(), front: Vec::new(), taken: None, others: 0 })
    }

    /// The next record.
    ///
    /// # Errors
    /// When what was put away cannot be read.
    #[expect(clippy::should_implement_trait, reason = "an iterator cannot lend its items")]
    pub fn next(&mut self) -> io::Result<Option<Record<'_>>> {
        if let Some(taken) = self.taken {
            let Front { head, prefix } = &mut self.front[taken];
            let at = *head;
            if self.heads[at].advance()? == Step::Record {
                *prefix = self.heads[at].prefix();
                // Most records come from the run that the one before came from.
                if *prefix < self.others {
                    return Ok(Some(Record { title: None, bytes: self.heads[at].record() }));
                }
            } else {
                self.front.swap_remove(taken);
            }
        }
        let new = self.front.is_empty();
        if new {
            let left = || self.heads.iter().enumerate().filter(|(_, head)| !head.over);
            let Some(title) = left().map(|(_, head)| &head.title).min() else {
                self.taken = None;
                return Ok(None);
            };
            self.title.clone_from(title);
            let front = left().filter(|(_, head)| head.title == self.title);
            self.front.extend(front.map(|(at, head)| Front { head: at, prefix: head.prefix() }));
        }
        let (first, others) = self.first();
        (self.taken, self.others) = (Some(first), others);
        let bytes = self.heads[self.front[first].head].record();
        Ok(Some(Record { title: new.then_some(&self.title), bytes }))
    }

    /// The place in front whose record comes first, and what those of the others begin with, at the least.
    fn first(&self) -> (usize, u64) {
        let record = |front: &Front| self.heads[front.head].record();
        let (mut first, mut others) = (0, u64::MAX);
        for (at, front) in self.front.iter().enumerate().skip(1) {
            let best = &self.front[first];
            if front.prefix < best.prefix || front.prefix == best.prefix && record(front) < record(best) {
                others = best.prefix;
                first = at;
            } else {
                others = others.min(front.prefix);
            }
        }
        (first, others)
    }
}

/// A run, and where the merge is in it.
struct Head {
    source: Source,
    /// The title of its record.
    title: Vec<u8>,
    /// Whether there is no record left.
    over: bool,
}

enum Source {
    File {
        record: Vec<u8>,
        rest: BufReader<File>,
    },
    /// `next` is the record after the present one, which is in `section`.
    Memory {
        run: Run,
        next: usize,
        section: usize,
    },
}

/// What follows a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Another one under the same title.
    Record,
    /// One under another title, or the first one of all.
    Title,
    End,
}

impl Head {
    fn of(source: Source) -> Self {
        Self { source, title: Vec::new(), over: false }
    }

    fn record(&self) -> &[u8] {
        match &self.source {
            Source::File { record, .. } => record,
            Source::Memory { run, next, .. } => &run.bytes[run.records[*next - 1].range()],
        }
    }

    fn prefix(&self) -> u64 {
        let record = self.record();
        if let Some(bytes) = record.first_chunk() {
            return u64::from_be_bytes(*bytes);
        }
        let mut bytes = [0; 8];
        bytes[..record.len()].copy_from_slice(record);
        u64::from_be_bytes(bytes)
    }

    /// Goes on to the next record.
    fn advance(&mut self) -> io::Result<Step> {
        let step = match &mut self.source {
            Source::File { record, rest } => read(rest, &mut self.title, record)?,
            Source::Memory { run, next, section } => {
                let ended = run.sections.get(*section).is_none_or(|section| section.end == *next);
                *section += usize::from(ended && *next > 0);
                let step = match run.sections.get(*section) {
                    None => Step::End,
                    Some(_) if !ended && *next > 0 => Step::Record,
                    Some(section) => {
                        self.title.clone_from(&section.title);
                        Step::Title
                    }
                };
                *next += 1;
                step
            }
        };
        self.over = step == Step::End;
        Ok(step)
    }
}

/// Reads the next record, and the title before it if there is one.
fn read(rest: &mut BufReader<File>, title: &mut Vec<u8>, record: &mut Vec<u8>) -> io::Result<Step> {
    let mut step = Step::Record;
    loop {
        let mut length = [0; 4];
        match rest.read_exact(&mut length) {
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(Step::End),
            result => result?,
        }
        let length = u32::from_le_bytes(length);
        let bytes = if length & TITLE == 0 { &mut *record } else { &mut *title };
        bytes.resize((length & !TITLE) as usize, 0);
        rest.read_exact(bytes)?;
        if length & TITLE == 0 {
            return Ok(step);
        }
        step = Step::Title;
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::{FAN_IN, Place, Record, Run, Runs, Section};

    type Titled = (Vec<u8>, Vec<u8>);

    fn run(records: &[Titled]) -> Run {
        let mut records = records.to_vec();
        records.sort();
        let (mut bytes, mut sections, mut places): (Vec<u8>, Vec<Section>, Vec<Place>) = Default::default();
        for (title, record) in records {
            let narrow = |length: usize| u32::try_from(length).unwrap();
            places.push(Place { start: narrow(bytes.len()), length: narrow(record.len()) });
            bytes.extend(record);
            match sections.last_mut() {
                Some(section) if section.title == title => section.end += 1,
                _ => sections.push(Section { title, end: places.len() }),
            }
        }
        Run::new(bytes, sections, places)
    }

    fn handed_out(runs: Runs, last: Vec<Run>) -> Vec<Titled> {
        let mut merge = runs.merge(last).unwrap();
        let (mut found, mut present) = (Vec::new(), None::<Vec<u8>>);
        while let Some(Record { title, bytes }) = merge.next().unwrap() {
            if let Some(title) = title {
                assert!(present.as_deref() != Some(title), "a title comes once");
                present = Some(title.to_vec());
            }
            found.push((present.clone().expect("a title comes before its records"), bytes.to_vec()));
        }
        found
    }

    /// Put away so many runs at a time.
    fn merged(records: &[Titled], in_memory: usize, at_a_time: usize) -> Vec<Titled> {
        let mut runs = Runs::default();
        let mut pending = Vec::new();
        for chunk in records.chunks(in_memory) {
            if pending.len() == at_a_time {
                runs.put_away(std::mem::take(&mut pending)).unwrap();
            }
            pending.push(run(chunk));
        }
        handed_out(runs, pending)
    }

    proptest! {
        #[test]
        fn records_come_in_order_whatever_fits_into_memory(
            records in vec((vec(0..3_u8, 0..3), vec(prop_oneof![Just(0), any::<u8>()], 0..11)), 0..40),
            in_memory in 1_usize..50, at_a_time in 1_usize..4,
        ) {
            let mut expected = records.clone();
            expected.sort();
            prop_assert_eq!(merged(&records, in_memory, at_a_time), expected);
        }
    }

    #[test]
    fn more_runs_than_are_merged_at_a_time() {
        let records: Vec<Titled> = (0..u8::MAX).rev().map(|byte| (vec![byte / 100], vec![byte, 1])).collect();
        assert!(records.len() > 3 * FAN_IN);
        let mut expected = records.clone();
        expected.reverse();
        assert_eq!(merged(&records, 1, 1), expected);
    }
}
