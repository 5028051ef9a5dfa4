use std::io::Read as _;
use std::sync::Arc;

use bytes::Bytes;
use memchr::memmem;
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData, RowGroupMetaData};
use parquet::file::reader::ChunkReader;
use schemars::JsonSchema;
use serde::Serialize;

use super::{ALGORITHM, CREATED_BY, FIRST, KEY, Stated, digits, range};
use crate::footer_shape::footer_bytes;

const BLOCK: usize = 256 << 10;

/// The state of a file's checksums.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Checksums {
    /// It has none.
    #[default]
    None,
    /// It carries those of the file that another program made it from.
    Stale,
    /// One per column chunk and one of the footer.
    Present,
}

/// The checksums of the column chunks of a file; empty if none apply.
#[derive(Clone, Debug, Default)]
pub struct ChunkChecksums {
    all: Option<Arc<[u32]>>,
    columns: usize,
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// They cannot be read, or are not those of the file's chunks: what is there.
    #[error("expected checksums under `{KEY}`, found {0}")]
    Malformed(String),
    /// The footer contradicts its own: expected and found.
    #[error("expected a footer with the CRC-32 {0:08x}, found {1:08x}")]
    Footer(u32, u32),
    #[error("{0}")]
    Unreadable(String),
}

impl ChunkChecksums {
    pub fn of(&self, row_group: usize, column: usize) -> Option<u32> {
        self.all.as_ref()?.get(row_group * self.columns + column).copied()
    }
}

/// The checksums of a file, after verifying the footer's; `footer` holds its bytes from `start` on.
pub fn of_file(
    file: &impl ChunkReader,
    (start, footer): (u64, &[u8]),
    metadata: &ParquetMetaData,
) -> Result<(Checksums, ChunkChecksums), Fault> {
    let about = metadata.file_metadata();
    let Some(pair) = about.key_value_metadata().into_iter().flatten().find(|pair| pair.key == KEY) else {
        return if is_hidden(footer) || is_nearly(about.created_by(), CREATED_BY) {
            Err(Fault::Malformed("a footer of mirrorstats without a readable key of that name".to_owned()))
        } else {
            Ok(<_>::default())
        };
    };
    let text = pair.value.as_deref().ok_or_else(|| Fault::Malformed("no value".to_owned()))?;
    let stated = parsed(text)?;
    match of_chunks(file, (start, footer), metadata, &stated, text) {
        Err(Fault::Malformed(_) | Fault::Footer(..)) if is_another_file(file, metadata, &stated) => {
            Ok((Checksums::Stale, ChunkChecksums::default()))
        }
        found => found.map(|chunks| (Checksums::Present, chunks)),
    }
}

fn of_chunks(
    file: &impl ChunkReader,
    (start, footer): (u64, &[u8]),
    metadata: &ParquetMetaData,
    stated: &Stated,
    text: &str,
) -> Result<ChunkChecksums, Fault> {
    let groups = metadata.row_groups();
    let counts = stated.chunks.iter().map(Vec::len);
    if !groups.iter().map(|group| group.columns().len()).eq(counts) {
        return Err(Fault::Malformed("checksums of another number of columns or row groups".to_owned()));
    }
    let chunks = groups.iter().flat_map(RowGroupMetaData::columns);
    let end = chunks.filter_map(range).map(|(_, end)| end).max().unwrap_or(FIRST);
    let found = sum_behind(file, end, (start, footer), text)?;
    if found != stated.footer.0 {
        return Err(Fault::Footer(stated.footer.0, found));
    }
    let columns = metadata.file_metadata().schema_descr().num_columns();
    let all = stated.chunks.iter().flatten().map(|sum| sum.0).collect();
    Ok(ChunkChecksums { all: Some(all), columns })
}

/// Returns true if a file that contradicts its checksums was rewritten: another program wrote it, and at most half the
/// chunks of its first row group have one of the checksums.
fn is_another_file(file: &impl ChunkReader, metadata: &ParquetMetaData, stated: &Stated) -> bool {
    let stated_sums = |sum: u32| stated.chunks.iter().flatten().any(|stated| stated.0 == sum);
    let chunks = metadata.row_groups().first().map_or(&[][..], RowGroupMetaData::columns);
    let is_kept = |chunk: &&ColumnChunkMetaData| {
        let bytes = range(chunk).map(|(start, end)| sum(file, start, end - start));
        bytes.is_some_and(|sum| sum.is_ok_and(stated_sums))
    };
    !is_nearly(metadata.file_metadata().created_by(), &stated.created_by)
        && chunks.iter().filter(is_kept).count() <= chunks.len() / 2
}

fn is_nearly(found: Option<&str>, name: &str) -> bool {
    let equal = found.unwrap_or_default().bytes().zip(name.bytes()).filter(|(found, byte)| found == byte);
    equal.count() * 2 >= name.len()
}

/// Parses the value under the key. Only one spelling is accepted, so that its own digits have a fixed position.
fn parsed(text: &str) -> Result<Stated, Fault> {
    let stated: Stated = serde_json::from_str(text).map_err(|error| Fault::Malformed(error.to_string()))?;
    if stated.algorithm != ALGORITHM {
        return Err(Fault::Malformed("checksums of another algorithm".to_owned()));
    }
    if stated.json() != text {
        return Err(Fault::Malformed("JSON with other spaces or another order".to_owned()));
    }
    Ok(stated)
}

/// The CRC-32 of the bytes from `end` to the end of the footer, with the footer's own digits as zeros.
fn sum_behind(file: &impl ChunkReader, end: u64, (start, footer): (u64, &[u8]), text: &str) -> Result<u32, Fault> {
    let between = start.checked_sub(end);
    let between = between.ok_or_else(|| Fault::Malformed("columns within the footer".to_owned()))?;
    let mut hasher = crc32fast::Hasher::new();
    if sum_into(&mut hasher, file, end, between)? != between {
        return Err(Fault::Unreadable("the file ends before its footer".to_owned()));
    }
    let place = memmem::rfind(footer, text.as_bytes());
    let place = place.ok_or_else(|| Fault::Malformed("another text than its own".to_owned()))?;
    let digits = digits(text.len());
    hasher.update(&footer[..place + digits.start]);
    hasher.update(b"00000000");
    hasher.update(&footer[place + digits.end..]);
    Ok(hasher.finalize())
}

/// Adds this many bytes of a file from `start` on, or fewer if it ends. Returns the number of bytes added.
fn sum_into(hasher: &mut crc32fast::Hasher, file: &impl ChunkReader, start: u64, length: u64) -> Result<u64, Fault> {
    if length == 0 {
        return Ok(0);
    }
    let reader = file.get_read(start).map_err(|error| Fault::Unreadable(error.to_string()))?;
    let (mut reader, mut summed) = (reader.take(length), 0);
    let mut block = vec![0; BLOCK.min(usize::try_from(length).unwrap_or(BLOCK))];
    loop {
        match reader.read(&mut block).map_err(|error| Fault::Unreadable(error.to_string()))? {
            0 => return Ok(summed),
            read => {
                hasher.update(&block[..read]);
                summed += read as u64;
            }
        }
    }
}

/// The CRC-32 of this many bytes of a file from `start` on, or fewer if it ends.
pub(crate) fn sum(file: &impl ChunkReader, start: u64, length: u64) -> Result<u32, Fault> {
    let mut hasher = crc32fast::Hasher::new();
    sum_into(&mut hasher, file, start, length)?;
    Ok(hasher.finalize())
}

/// Returns true if a footer contains the key or its value but no readable pair: a name or a field number is damaged.
fn is_hidden(footer: &[u8]) -> bool {
    // The encoding of a text and the next field's header; texts of other keys or columns do not have these bytes.
    let length = u8::try_from(KEY.len()).expect("the key is short");
    let pair = [&[length][..], KEY.as_bytes(), &[0x18]].concat();
    let value = format!(r#"{{"algorithm":"{ALGORITHM}","created_by":""#);
    [&pair, value.as_bytes()].iter().any(|bytes| memmem::find(footer, bytes).is_some())
}

/// Verifies the checksums of a file that another reader opens; passes if there are none.
pub fn verify_file(file: &impl ChunkReader, metadata: &ParquetMetaData) -> Result<(), String> {
    let (start, footer): (u64, Bytes) = footer_bytes(file).ok_or("the footer cannot be read")?;
    let (_, sums) = of_file(file, (start, &footer), metadata).map_err(|fault| fault.to_string())?;
    for (row_group, group) in metadata.row_groups().iter().enumerate() {
        for (column, chunk) in group.columns().iter().enumerate() {
            let Some((declared, (start, end))) = sums.of(row_group, column).zip(range(chunk)) else { continue };
            let found = sum(file, start, end.saturating_sub(start)).map_err(|fault| fault.to_string())?;
            if found != declared {
                let name = chunk.column_path().string();
                return Err(format!(
                    "row group {row_group}, column `{name}`: expected bytes with the CRC-32 {declared:08x}, found {found:08x}"
                ));
            }
        }
    }
    Ok(())
}
