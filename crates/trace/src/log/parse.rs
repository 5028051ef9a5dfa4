//! A record out of its bytes.
//!
//! Rule: every length is compared with what is left of the record first. The library makes room for a text before it knows
//! that the text is there.

use mcap::records::{Record, op};

/// No record of a log is longer, chunks included; a longer one is damage.
pub(super) const LONGEST: usize = 1 << 30;

/// Of an opcode and a length.
pub(super) const FRAME: usize = 9;

pub(super) fn parsed(opcode: u8, body: &[u8]) -> Result<Record<'_>, String> {
    check_texts(opcode, body).ok_or("a text or a map in it is longer than the record")?;
    mcap::parse_record(opcode, body).map_err(|fault| fault.to_string())
}

/// Goes along the texts of a record; `None` if one of them is longer than what is left.
fn check_texts(opcode: u8, body: &[u8]) -> Option<()> {
    // The bytes in front of each text. The map of a chunk's index has its length in front as a text has.
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
        // A map of texts, which are one behind the other.
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
