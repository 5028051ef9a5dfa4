//! Which of many numbers come more than once, in bounded memory.
//!
//! Rule: exact. Beyond a fixed count numbers are put away in a temporary file without a name, gone with the process: in
//! sorted shares, so that those which begin with the same byte can be read together at the end. That takes little memory
//! where numbers are spread evenly over all 64 bits, as hashes are.

use std::collections::HashSet;
use std::fs::File;
use std::io::{self, BufWriter, Read as _, Seek as _, SeekFrom, Write as _};

use super::replace;

/// Numbers that are held in memory before they are put away.
const MEMORY: usize = 256 * 1024;

/// Bytes of a number.
const WIDTH: usize = size_of::<u64>();

/// The numbers met so far.
pub struct Repeats {
    pending: Vec<u64>,
    /// What the numbers begin with.
    once: Beginnings,
    /// What two of them begin with: only those can be equal.
    twice: Beginnings,
    away: Option<File>,
    /// For each share of the file where it has the numbers that begin with each byte, and where it ends.
    shares: Vec<Vec<u64>>,
    memory: usize,
}

impl Default for Repeats {
    fn default() -> Self {
        let (once, twice) = (Beginnings::none(), Beginnings::none());
        Self { pending: Vec::new(), once, twice, away: None, shares: Vec::new(), memory: MEMORY }
    }
}

impl Repeats {
    /// Takes note of numbers.
    ///
    /// # Errors
    /// When there is no place for temporary files, or no more of it.
    pub fn add(&mut self, numbers: &[u64]) -> io::Result<()> {
        self.pending.extend_from_slice(numbers);
        for number in numbers {
            if self.once.contains(*number) {
                self.twice.insert(*number);
            }
            self.once.insert(*number);
        }
        if self.pending.len() >= self.memory { self.put_away() } else { Ok(()) }
    }

    fn put_away(&mut self) -> io::Result<()> {
        self.pending.sort_unstable();
        let file = match &mut self.away {
            Some(file) => file,
            none => none.insert(tempfile::tempfile().map_err(replace::without_name)?),
        };
        let start = self.shares.last().and_then(|share| share.last()).copied().unwrap_or(0);
        let place = |byte: u64| self.pending.partition_point(|number| first_byte(*number) < byte) as u64;
        self.shares.push((0..=256).map(|byte| start + place(byte)).collect());
        let mut out = BufWriter::new(file);
        self.pending.drain(..).try_for_each(|number| out.write_all(&number.to_le_bytes()))?;
        out.flush()
    }

    /// The numbers that came more than once.
    ///
    /// # Errors
    /// When what was put away cannot be read.
    pub fn finish(mut self) -> io::Result<HashSet<u64>> {
        let mut found = HashSet::new();
        if self.away.is_some() {
            self.put_away()?;
        }
        let Some(mut file) = self.away else {
            self.pending.retain(|number| self.twice.contains(*number));
            find(&mut self.pending, &mut found);
            return Ok(found);
        };
        let mut bytes = Vec::new();
        for byte in 0..256 {
            for share in &self.shares {
                let (from, to) = (share[byte], share[byte + 1]);
                file.seek(SeekFrom::Start(from * WIDTH as u64))?;
                bytes.resize(usize::try_from(to - from).map_err(io::Error::other)? * WIDTH, 0);
                file.read_exact(&mut bytes)?;
                self.pending.extend(bytes.as_chunks().0.iter().map(|number| u64::from_le_bytes(*number)));
            }
            find(&mut self.pending, &mut found);
        }
        Ok(found)
    }
}

/// Adds the numbers that are there more than once; none of all is left.
fn find(numbers: &mut Vec<u64>, found: &mut HashSet<u64>) {
    numbers.sort_unstable();
    found.extend(numbers.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0]));
    numbers.clear();
}

fn first_byte(number: u64) -> u64 {
    number >> (u64::BITS - u8::BITS)
}

/// What some numbers begin with, as a set of bits.
struct Beginnings(Vec<u64>);

impl Beginnings {
    /// Highest bits of a number that are looked at: eight times as many values as numbers are pending.
    const BITS: u32 = 21;

    fn none() -> Self {
        Self(vec![0; 1 << (Self::BITS - u64::BITS.ilog2())])
    }

    fn place(number: u64) -> (usize, u64) {
        let beginning = number >> (u64::BITS - Self::BITS);
        let word = usize::try_from(beginning / 64).expect("a few bits fit");
        (word, 1 << (beginning % 64))
    }

    fn contains(&self, number: u64) -> bool {
        let (word, bit) = Self::place(number);
        self.0[word] & bit != 0
    }

    fn insert(&mut self, number: u64) {
        let (word, bit) = Self::place(number);
        self.0[word] |= bit;
    }
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, HashSet};

    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::Repeats;

    proptest! {
        #[test]
        fn those_that_come_twice_and_only_they_whatever_fits_into_memory(
            numbers in vec((0..4_u64, 0..4_u64).prop_map(|(high, low)| high << 62 | high << 55 | low), 0..40), memory in 1_usize..50,
        ) {
            let mut repeats = Repeats { memory, ..Repeats::default() };
            let mut expected: BTreeMap<u64, usize> = BTreeMap::new();
            for some in numbers.chunks(3) {
                repeats.add(some).unwrap();
                for number in some {
                    *expected.entry(*number).or_default() += 1;
                }
            }
            expected.retain(|_, times| *times > 1);
            prop_assert_eq!(repeats.finish().unwrap(), expected.into_keys().collect::<HashSet<u64>>());
        }
    }
}
