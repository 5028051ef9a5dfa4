//! The checksums in the footer of a file: one per column chunk, and one of everything after the chunks.
//!
//! The footer's checksum covers the bytes from the end of the last chunk to the end of the footer, with its own eight
//! digits as zeros. So it covers page indexes, schema, offsets, statistics and every key.
//!
//! Rule: a file with the key is refused unless its checksums match. But other programs copy the key when they rewrite a
//! file. Such a file is read without checksums, and every verb says so. It is recognised as a whole: `created_by` names
//! another program, and most chunks differ. Damage leaves most of either unchanged.

mod read;
mod write;

use parquet::file::metadata::ColumnChunkMetaData;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

pub(crate) use read::sum;
pub use read::{Checksums, ChunkChecksums, Fault, of_file, verify_file};
pub use write::{Held, finish, pass_on};

pub const KEY: &str = "mirrorstats.checksums";

pub const CREATED_BY: &str = concat!("mirrorstats version ", env!("CARGO_PKG_VERSION"));

/// The only algorithm so far.
const ALGORITHM: &str = "CRC-32";

/// The smallest offset of a file's first chunk, after the magic number.
const FIRST: u64 = 4;

/// The JSON value under the key.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stated {
    algorithm: String,
    created_by: String,
    chunks: Vec<Vec<Checksum>>,
    /// Comes last, so that the position of its digits is known.
    footer: Checksum,
}

/// A CRC-32, eight lower-case hexadecimal digits as JSON.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Checksum(u32);

impl Serialize for Checksum {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{:08x}", self.0))
    }
}

impl<'de> Deserialize<'de> for Checksum {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let is_hexadecimal = text.len() == 8 && text.bytes().all(|digit| matches!(digit, b'0'..=b'9' | b'a'..=b'f'));
        let number = is_hexadecimal.then(|| u32::from_str_radix(&text, 16).ok()).flatten();
        number.map(Self).ok_or_else(|| de::Error::custom("a checksum is eight lower-case hexadecimal digits"))
    }
}

impl Stated {
    fn json(&self) -> String {
        serde_json::to_string(self).expect("texts and lists of them are JSON")
    }
}

fn digits(length: usize) -> std::ops::Range<usize> {
    length - 10..length - 2
}

/// The byte range of a column chunk, end excluded.
pub fn range(chunk: &ColumnChunkMetaData) -> Option<(u64, u64)> {
    let start = chunk.dictionary_page_offset().unwrap_or(chunk.data_page_offset());
    let (start, length) = u64::try_from(start).ok().zip(u64::try_from(chunk.compressed_size()).ok())?;
    start.checked_add(length).map(|end| (start, end))
}
