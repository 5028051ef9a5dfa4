//! Parses a record from its bytes.
//!
//! Rule: every length is first compared with the rest of the record, since the library allocates memory for a text
//! before it knows that the text is there.

use mcap::records::{Record, op};

/// The longest record of a log, chunks included; longer ones are damage.
pub(super) const LONGEST: usize = 1 << 30;

/// The size of an opcode and a length.
pub(super) const FRAME: usize = 9;

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
