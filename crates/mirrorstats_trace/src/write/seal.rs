//! Copies a trace with checksums, to protect the files of writers without them.
//!
//! Rule: columns are copied as bytes, so their types, encodings and codecs stay. So do the row groups and the footer's
//! own keys. Data that only speeds up reading (page indexes, bloom filters) is dropped.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::slice;

use parquet::column::writer::ColumnCloseResult;
use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, RowGroupMetaData};
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use schemars::JsonSchema;
use serde::Serialize;

use crate::catch_panic::contained;
use crate::diagnostic::{Code, Finding};
use crate::error::TraceError;
use crate::inputs::Input;
use crate::read::footer::Extent;
use crate::read::open::{TraceFile, TraceSet};
use crate::read::verify::verify_pages;
use crate::validate::validate;
use mirrorstats_exact::replace::{NewFile, TargetIsInput, check_target};
use mirrorstats_exact::{hash, input};
use mirrorstats_parquet_pages::checksums::{self, CREATED_BY, Checksums, Held};
use mirrorstats_parquet_pages::rows_of;

/// A sealed copy.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct SealAnswer {
    /// The trace that was read.
    pub name: String,
    /// The copy.
    pub out: String,
    /// Its episodes.
    pub episodes: u64,
    /// Its rows.
    pub steps: u64,
    /// What the trace had before: `present`, `none` or `stale`.
    pub(crate) checksums_before: Checksums,
    /// The SHA-256 of the copy.
    pub sha256: String,
}

#[derive(Debug, thiserror::Error)]
pub enum SealError {
    #[error(transparent)]
    Trace(#[from] TraceError),
    #[error(transparent)]
    Target(#[from] TargetIsInput),
    #[error("cannot write `{}`: {source}", path.display())]
    Unwritable { path: PathBuf, source: io::Error },
}

/// Copies a trace to `out` with checksums. Before the copy is put in place, two things are checked: the trace keeps
/// every rule of the schema, and each column of the copy has the same bytes.
pub fn seal(trace: &Input, out: &Path, threads: NonZeroUsize) -> Result<SealAnswer, SealError> {
    check_target(out, [&trace.path], "the trace itself")?;
    let unwritable = |source| SealError::Unwritable { path: out.to_owned(), source };
    let set = TraceSet::open(slice::from_ref(trace))?;
    sound(trace, threads)?;
    let new = NewFile::create(out).map_err(unwritable)?;
    let new = copy_with_checksums(&set, new, out)?;
    let copy = Input { name: Input::new(out).name, path: new.temporary_path().to_owned() };
    let (episodes, steps) = sound(&copy, threads)?;
    compare(&set.files()[0], &TraceSet::open(slice::from_ref(&copy))?.files()[0])?;
    let sha256 = input::open(&copy.path).and_then(hash::of_reader).map_err(unwritable)?;
    new.commit().map_err(unwritable)?;
    let checksums_before = set.files()[0].checksums();
    Ok(SealAnswer { name: trace.name.clone(), out: copy.name, episodes, steps, checksums_before, sha256 })
}

fn sound(input: &Input, threads: NonZeroUsize) -> Result<(u64, u64), TraceError> {
    let checked = validate(slice::from_ref(input), None, threads)?;
    let counts = checked.files.first().map_or((0, 0), |file| (file.episodes, file.steps));
    checked.errors().map(|()| counts)
}

/// Writes the trace of a set's only file to `out` with checksums; `target` is its name in errors.
fn copy_with_checksums<W: Write + Send>(set: &TraceSet, out: W, target: &Path) -> Result<W, TraceError> {
    let file = &set.files()[0];
    // Copied columns get new checksums, which must not hide damaged bytes.
    verify_pages(set)?;
    let failed = |error: ParquetError| TraceError::write(target, error);
    let metadata = file.footer_again(Extent::Whole)?.metadata;
    let properties = WriterProperties::builder()
        .set_key_value_metadata(Some(file.pairs.clone()))
        .set_created_by(CREATED_BY.to_owned())
        // Copied chunks have no page index here, and a file has one for all columns or for none.
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_offset_index_disabled(true);
    let schema = metadata.file_metadata().schema_descr().root_schema_ptr();
    let mut writer = SerializedFileWriter::new(Held::new(out), schema, properties.build().into()).map_err(failed)?;
    let input = file.reader().map_err(|source| TraceError::Read { what: file.name().to_owned(), source })?;
    for row_group in metadata.row_groups() {
        let mut group = writer.next_row_group().map_err(failed)?;
        for chunk in row_group.columns() {
            copy(&mut group, chunk, rows_of(row_group), &input).map_err(failed)?;
        }
        group.close().map_err(failed)?;
        checksums::pass_on(&mut writer).map_err(failed)?;
    }
    checksums::finish(writer).map_err(failed)
}

fn copy<W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    chunk: &ColumnChunkMetaData,
    rows: usize,
    input: &File,
) -> parquet::errors::Result<()> {
    let close = ColumnCloseResult {
        bytes_written: u64::try_from(chunk.compressed_size()).unwrap_or_default(),
        rows_written: rows as u64,
        metadata: chunk.clone(),
        bloom_filter: None,
        column_index: None,
        offset_index: None,
    };
    contained(|| group.append_column(input, close)).map_err(ParquetError::General)?
}

fn compare(old: &TraceFile, new: &TraceFile) -> Result<(), TraceError> {
    let chunks = |file: &TraceFile| {
        let footer = file.footer_again(Extent::Whole)?;
        let groups = footer.metadata.row_groups().iter().flat_map(RowGroupMetaData::columns);
        groups.map(|chunk| hashed(file, chunk.byte_range())).collect::<Result<Vec<_>, _>>()
    };
    if chunks(old)? == chunks(new)? {
        return Ok(());
    }
    let finding = Finding::new(Code::CorruptData, new.name(), "the columns of the trace, byte for byte", "others");
    Err(finding.with_help("the trace changed meanwhile, or the disk is faulty: try again").into())
}

fn hashed(file: &TraceFile, (start, length): (u64, u64)) -> Result<String, TraceError> {
    let read = || {
        let mut reader = file.reader()?;
        reader.seek(SeekFrom::Start(start))?;
        hash::of_reader(reader.take(length))
    };
    read().map_err(|source| TraceError::Read { what: file.name().to_owned(), source })
}
