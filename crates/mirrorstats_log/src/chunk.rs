//! Parses records, and unpacks the contents of a chunk within a budget.
//!
//! Rule: every length is first compared with the rest of the record, since the library allocates memory for a text
//! before it knows that the text is there.
//!
//! Rule: a chunk states its unpacked size and is never unpacked beyond that. Before unpacking, the stated size is
//! compared with the chunk's own bytes and counted against the whole log's budget.

use mcap::McapError;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use mirrorstats_exact::budget::{Budget, Exceeded, Limit};

/// The longest record of a log, chunks included; longer ones are damage.
pub(super) const LONGEST: usize = 1 << 30;

pub(super) const FRAME: usize = 9;

/// The budgets for unpacking a log, and for searching it for chunks after damage.
///
/// Frames are compressed already, and rows of text shrink about twenty times in a chunk. So a log is far below the
/// limit, but a chunk of zeros is not.
#[derive(Debug)]
pub(super) struct Budgets {
    unpacked: Budget,
    searched: Budget,
}

impl Budgets {
    pub(super) fn new(bytes: u64) -> Self {
        let unpacked = Limit::in_proportion("bytes unpacked from a log of its size", 128 << 20, 64, bytes);
        let searched = Limit::in_proportion("bytes looked at for chunks behind damage", 128 << 20, 64, bytes);
        Self { unpacked: Budget::new(unpacked), searched: Budget::new(searched) }
    }

    fn unpack(&self, chunk: &[u8]) -> Result<(), Exceeded> {
        let size = size_unpacked(chunk) as u64;
        // A damaged length must not use up the budget of the chunks after it.
        Limit::in_proportion("bytes unpacked from a chunk of its size", 32 << 20, 64, chunk.len() as u64)
            .check(size)?;
        self.unpacked.spend(size)
    }

    pub(super) fn search(&self, bytes: usize) -> Result<(), Exceeded> {
        self.searched.spend(bytes as u64)
    }
}

/// The unpacked records of a chunk, each parsed on demand.
#[derive(Debug, Default)]
pub(super) struct Unpacked {
    bytes: Vec<u8>,
    at: usize,
}

impl Unpacked {
    fn push(&mut self, opcode: u8, data: &[u8]) {
        self.bytes.push(opcode);
        self.bytes.extend((data.len() as u64).to_le_bytes());
        self.bytes.extend(data);
    }
}

impl Iterator for Unpacked {
    type Item = Record<'static>;

    fn next(&mut self) -> Option<Self::Item> {
        let (opcode, data, _) = first_record(self.bytes.get(self.at..)?)?;
        self.at += FRAME + data.len();
        parsed(opcode, data).ok().map(Record::into_owned)
    }
}

/// The records in a chunk: all, or an error if the chunk's checksum is wrong.
pub(super) fn inside(chunk: &[u8], budgets: &Budgets) -> Result<Unpacked, String> {
    let mut found = Unpacked::default();
    let options = LinearReaderOptions::default().with_validate_chunk_crcs(true);
    unpacked(chunk, options, budgets, |opcode, data| found.push(opcode, data))?;
    Ok(found)
}

/// The readable records at the start of a truncated or damaged chunk: enough to name the losses, never enough to save
/// an episode.
pub(super) fn glimpse(chunk: &[u8], budgets: &Budgets) -> Unpacked {
    let mut found = Unpacked::default();
    // It is known to end in a fault.
    let _ = unpacked(chunk, LinearReaderOptions::default(), budgets, |opcode, data| found.push(opcode, data));
    found
}

/// Passes on the schemas, channels and messages of a chunk, one by one.
///
/// The library allocates the stated length before it finds that the data ends earlier. So the limit for a record is the
/// stated unpacked size, and the chunk's own size is not requested at once. Of contradicting lengths the smaller one
/// counts.
fn unpacked(
    chunk: &[u8],
    options: LinearReaderOptions,
    budgets: &Budgets,
    mut give: impl FnMut(u8, &[u8]),
) -> Result<(), String> {
    budgets.unpack(chunk).map_err(|exceeded| exceeded.to_string())?;
    let mut check_and_give = |opcode, data: &[u8]| {
        if matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE) {
            parsed(opcode, data)?;
            give(opcode, data);
        }
        Ok::<_, String>(())
    };
    if let Some(mut whole) = before_overrun(chunk) {
        while let Some((opcode, data, rest)) = first_record(whole) {
            check_and_give(opcode, data)?;
            whole = rest;
        }
        return Err("a record is longer than what is left of its chunk".to_owned());
    }
    let options = options.with_skip_start_magic(true).with_skip_end_magic(true);
    let mut reader = LinearReader::new_with_options(options.with_record_length_limit(size_unpacked(chunk)));
    let mut rest = chunk;
    while let Some(event) = reader.next_event() {
        match event.map_err(|fault| fault_of(&fault))? {
            LinearReadEvent::ReadRequest(wanted) => {
                let (now, later) = rest.split_at(wanted.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            LinearReadEvent::Record { data, opcode } => check_and_give(opcode, data)?,
        }
    }
    Ok(())
}

/// The words of a fault. Refused memory is not damage: it ends the program, as it does in zstd's own library.
fn fault_of(fault: &McapError) -> String {
    let words = fault.to_string();
    assert!(!words.contains("not enough memory"), "{words}");
    words
}

/// The complete records of an uncompressed chunk, if the next record claims more bytes than are left.
///
/// The library subtracts such a length from the rest without comparing them, which panics in builds with overflow
/// checks. Truncated chunks are left to the library.
fn before_overrun(chunk: &[u8]) -> Option<&[u8]> {
    // Two times, a size and a checksum follow the frame; then the name of the compression, empty without one.
    let (length, records) = chunk.get(FRAME + 28..)?.strip_prefix(&[0; 4])?.split_first_chunk::<8>()?;
    let (mut left, mut at) = (u64::from_le_bytes(*length), 0_usize);
    while left > 0 {
        let [_, size @ ..] = *records.get(at..)?.first_chunk::<FRAME>()?;
        let size = u64::from_le_bytes(size).saturating_add(FRAME as u64);
        let Some(fewer) = left.checked_sub(size) else { return records.get(..at) };
        (left, at) = (fewer, at.checked_add(usize::try_from(size).ok()?)?);
    }
    None
}

fn first_record(records: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let ([opcode, length @ ..], behind) = records.split_first_chunk::<FRAME>()?;
    let (data, rest) = behind.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    Some((*opcode, data, rest))
}

fn size_unpacked(chunk: &[u8]) -> usize {
    // Two times of 8 bytes each follow the frame.
    let size = chunk.get(FRAME + 16..FRAME + 24).and_then(|bytes| bytes.try_into().ok()).map(u64::from_le_bytes);
    // The library compares the header of the chunk with the same limit.
    size.and_then(|size| usize::try_from(size).ok()).map_or(LONGEST, |size| size.clamp(1 << 16, LONGEST))
}

pub(super) fn parsed(opcode: u8, body: &[u8]) -> Result<Record<'_>, String> {
    check_texts(opcode, body).ok_or("a text or a map in it is longer than the record")?;
    mcap::parse_record(opcode, body).map_err(|fault| fault.to_string())
}

/// Checks the lengths of the texts of a record; `None` if one of them exceeds the rest.
fn check_texts(opcode: u8, body: &[u8]) -> Option<()> {
    // The number of bytes before each text. The map in a chunk index starts with its length, like a text.
    let gaps: &[usize] = match opcode {
        op::HEADER => &[0, 0],
        op::SCHEMA => &[2, 0],
        op::CHANNEL => &[4, 0],
        op::CHUNK => &[28],
        op::CHUNK_INDEX => &[32, 8],
        op::ATTACHMENT_INDEX => &[40, 0],
        op::METADATA => &[0],
        op::METADATA_INDEX => &[16],
        _ => &[],
    };
    let mut rest = body;
    for gap in gaps {
        (_, rest) = text(rest.get(*gap..)?)?;
    }
    if matches!(opcode, op::CHANNEL | op::METADATA) {
        // A map of consecutive texts.
        let (mut texts, _) = text(rest)?;
        while !texts.is_empty() {
            (_, texts) = text(texts)?;
        }
    }
    Some(())
}

fn text(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)
}

#[cfg(test)]
mod tests {
    use mcap::records::op;

    use super::{Budgets, FRAME, before_overrun, inside};

    fn record(opcode: u8, length: u64, data: &[u8]) -> Vec<u8> {
        [&[opcode][..], &length.to_le_bytes(), data].concat()
    }

    fn chunk(records: &[u8]) -> Vec<u8> {
        let size = (records.len() as u64).to_le_bytes();
        let data = [&[0; 16][..], &size, &[0; 4], &[0; 4], &size, records].concat();
        record(op::CHUNK, data.len() as u64, &data)
    }

    #[test]
    fn a_record_that_is_longer_than_its_chunk_is_refused() {
        let first = record(0x7f, 2, &[1, 2]);
        for length in [4, 5, u64::MAX] {
            let chunk = chunk(&[first.clone(), record(0x7f, length, &[1, 2, 3])].concat());
            assert_eq!(before_overrun(&chunk), Some(&first[..]), "{length}");
            let refused = inside(&chunk, &Budgets::new(chunk.len() as u64)).unwrap_err();
            assert_eq!(refused, "a record is longer than what is left of its chunk");
        }
        let whole = chunk(&[first.clone(), record(0x7f, 3, &[1, 2, 3])].concat());
        assert!((0..=whole.len()).all(|cut| before_overrun(&whole[..cut]).is_none()));
        assert_eq!(whole.len(), FRAME + 40 + first.len() + FRAME + 3);
    }
}
