//! Reads footers: the positions of a file's columns, and its key-value metadata.

pub(crate) mod bounds;
pub(crate) mod columns;
pub(crate) mod trace_file;

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};

use parquet::errors::ParquetError;
use parquet::file::metadata::{
    ParquetMetaData, ParquetMetaDataOptions, ParquetMetaDataReader, ParquetStatisticsPolicy, RowGroupMetaData,
};

use crate::catch_panic::contained;
use crate::diagnostic::{Code, Finding};
use crate::inputs::Input;
use crate::schema::CHECKSUMS_KEY;
use mirrorstats_exact::input;
use mirrorstats_parquet_pages::checksums::{self, Checksums, ChunkChecksums, Fault};
use mirrorstats_parquet_pages::{check_footer, footer_bytes};

const MAGIC: [u8; 4] = *b"PAR1";
const ENCRYPTED_MAGIC: [u8; 4] = *b"PARE";
const SMALLEST: u64 = 12;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    Pages,
    Whole,
}

impl Extent {
    fn options(self) -> ParquetMetaDataOptions {
        match self {
            Self::Whole => ParquetMetaDataOptions::new(),
            Self::Pages => ParquetMetaDataOptions::new()
                .with_column_stats_policy(ParquetStatisticsPolicy::SkipAll)
                .with_encoding_stats_policy(ParquetStatisticsPolicy::SkipAll)
                .with_size_stats_policy(ParquetStatisticsPolicy::SkipAll),
        }
    }
}

pub struct Footer {
    pub bytes: u64,
    pub metadata: ParquetMetaData,
    pub(crate) checksums: Checksums,
    pub chunks: ChunkChecksums,
}

pub(crate) fn footer(input: &Input, extent: Extent) -> Result<Footer, Box<Finding>> {
    let mut file = input::open(&input.path).map_err(|error| Finding::unreadable(&input.name, &error))?;
    footer_of(&input.name, &mut file, extent)
}

pub fn footer_of(name: &str, file: &mut File, extent: Extent) -> Result<Footer, Box<Finding>> {
    let finding = |code, expected: &str, found: String| Box::new(Finding::new(code, name, expected, found));
    let unreadable = |error: io::Error| Finding::unreadable(name, &error);
    let about = file.metadata().map_err(unreadable)?;
    if about.is_dir() {
        return Err(finding(Code::NotParquet, "a Parquet file", "a folder".into()));
    }
    let bytes = about.len();
    if bytes == 0 {
        return Err(finding(Code::EmptyFile, "a Parquet file", "0 bytes".into()));
    }
    match magic(file, SeekFrom::Start(0)).map_err(unreadable)? {
        Some(MAGIC) => {}
        Some(ENCRYPTED_MAGIC) => {
            return Err(finding(Code::NotParquet, "a Parquet file that is not encrypted", "an encrypted one".into()));
        }
        _ => return Err(finding(Code::NotParquet, "a Parquet file, which starts with `PAR1`", "another start".into())),
    }
    let end = magic(file, SeekFrom::End(-4)).map_err(unreadable)?;
    if bytes < SMALLEST || end != Some(MAGIC) {
        let found = format!("{bytes} bytes that end without it");
        return Err(finding(Code::Truncated, "a footer at the end, closed with `PAR1`", found));
    }
    check_footer(&*file).map_err(|found| finding(Code::CorruptFooter, "a readable footer", found))?;
    let reader = || ParquetMetaDataReader::new().with_metadata_options(Some(extent.options()));
    let metadata = contained(|| reader().parse_and_finish(&*file))
        .and_then(|metadata| metadata.map_err(|error| plain(&error)))
        .map_err(|found| finding(Code::CorruptFooter, "a readable footer", found))?;
    let (checksums, chunks) = verified(name, file, &metadata)?;
    Ok(Footer { bytes, metadata, checksums, chunks })
}

fn verified(name: &str, file: &File, metadata: &ParquetMetaData) -> Result<(Checksums, ChunkChecksums), Box<Finding>> {
    let Some((start, footer)) = footer_bytes(file) else { return Ok(<_>::default()) };
    let mut chunks = metadata.row_groups().iter().flat_map(RowGroupMetaData::columns);
    if chunks.any(|chunk| checksums::range(chunk).is_none_or(|(_, end)| end > start)) {
        let (expected, found) = ("columns that lie before the footer", "one that lies behind its start");
        return Err(Box::new(Finding::new(Code::CorruptFooter, name, expected, found)));
    }
    checksums::of_file(file, (start, &footer), metadata).map_err(|fault| {
        let finding = |code, expected: String, found| Box::new(Finding::new(code, name, expected, found));
        match fault {
            Fault::Malformed(found) => {
                let expected = format!("`{CHECKSUMS_KEY}` to hold a CRC-32 of each column chunk and of the footer");
                let help =
                    "the file is damaged: restore it from its source; where a program changed that key, write the rows \
                     again with another one, such as pyarrow";
                Box::new(finding(Code::InvalidMetadata, expected, found).with_help(help))
            }
            Fault::Footer(expected, found) => {
                let expected = format!("a footer with the CRC-32 {expected:08x}");
                finding(Code::CorruptFooter, expected, format!("{found:08x}"))
            }
            Fault::Unreadable(why) => Finding::unreadable(name, &why),
        }
    })
}

fn magic(file: &mut File, at: SeekFrom) -> io::Result<Option<[u8; 4]>> {
    let mut found = [0; 4];
    let read = file.seek(at).and_then(|_| file.read_exact(&mut found));
    match read {
        Ok(()) => Ok(Some(found)),
        // The file is shorter than four bytes.
        Err(error) if matches!(error.kind(), io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidInput) => Ok(None),
        Err(error) => Err(error),
    }
}

pub(crate) fn plain(error: &ParquetError) -> String {
    let text = match error {
        ParquetError::General(text) | ParquetError::EOF(text) | ParquetError::ArrowError(text) => text.clone(),
        other => other.to_string(),
    };
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
