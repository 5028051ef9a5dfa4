//! Copies a trace with checksums, to protect the files of writers without them.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::slice;

use parquet::file::metadata::RowGroupMetaData;
use schemars::JsonSchema;
use serde::Serialize;

use super::diagnostic::{Code, Finding};
use super::error::TraceError;
use super::inputs::Input;
use super::open::{TraceFile, TraceSet};
use super::read::footer::Extent;
use super::validate::validate;
use super::write::rewrite::with_checksums;
use exact::hash;
use exact::replace::{NewFile, TargetIsInput, TemporaryFolder, check_target, folder_of};
use parquet_pages::checksums::Checksums;

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
pub fn seal(input: &Input, out: &Path, threads: NonZeroUsize) -> Result<SealAnswer, SealError> {
    check_target(out, [&input.path], "the trace itself")?;
    let unwritable = |source| SealError::Unwritable { path: out.to_owned(), source };
    let set = TraceSet::open(slice::from_ref(input))?;
    sound(input, threads)?;
    let name = out.file_name().unwrap_or_default().to_string_lossy();
    let stage = TemporaryFolder::create(folder_of(out), &name).map_err(unwritable)?;
    let staged = stage.path().join("copy.parquet");
    let file = File::create(&staged).map_err(unwritable)?;
    with_checksums(&set, file).map_err(|error| error.writing(out))?;
    let copy = Input { name: Input::new(out).name, path: staged };
    let (episodes, steps) = sound(&copy, threads)?;
    compare(&set.files()[0], &TraceSet::open(slice::from_ref(&copy))?.files()[0])?;
    let mut new = NewFile::create(out).map_err(unwritable)?;
    let mut reader = File::open(&copy.path).map_err(unwritable)?;
    io::copy(&mut reader, new.as_file_mut()).map_err(unwritable)?;
    let sha256 = reader.rewind().and_then(|()| hash::of_reader(reader)).map_err(unwritable)?;
    new.commit().map_err(unwritable)?;
    let checksums_before = set.files()[0].checksums();
    Ok(SealAnswer { name: input.name.clone(), out: copy.name, episodes, steps, checksums_before, sha256 })
}

/// Checks every rule of the schema; returns the numbers of episodes and steps.
fn sound(input: &Input, threads: NonZeroUsize) -> Result<(u64, u64), TraceError> {
    let checked = validate(slice::from_ref(input), None, threads)?;
    let counts = checked.files.first().map_or((0, 0), |file| (file.episodes, file.steps));
    checked.errors().map(|()| counts)
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
