//! Reads and decompresses the pages of columns of traces and does nothing with them: what any reader pays at least.
//!
//! `cargo run --release --example pages -- FOLDER` takes the columns of the paper's definitions, row groups on all
//! cores, and prints the number of values in their pages. A column of a row group is read in one piece.

use std::error::Error;
use std::fs::{self, File};
use std::hint::black_box;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use bytes::Bytes;
use bytes::buf::{Buf as _, Reader};
use clap::Parser;
use parquet::column::page::{Page, PageReader as _};
use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData, ParquetMetaDataReader};
use parquet::file::reader::{ChunkReader, Length};
use parquet::file::serialized_reader::SerializedPageReader;

/// Read and decompress the pages of columns of traces and do nothing with them
#[derive(Debug, Parser)]
struct Arguments {
    /// Row groups at a time [default: one per core].
    #[arg(long)]
    threads: Option<usize>,
    /// The columns.
    #[arg(long, value_delimiter = ',', default_value = COLUMNS)]
    columns: Vec<String>,
    /// A folder of traces.
    folder: PathBuf,
}

/// What `score` reads for the paper's definitions.
const COLUMNS: &str =
    "episode_id,model,experiment,seed,run,body_color,t,action,self_color,selected_cube,mirror_visible";

type Failure = Box<dyn Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let arguments = Arguments::parse();
    let files = open(&arguments.folder)?;
    let groups = |at: usize| (0..files[at].1.num_row_groups()).map(move |group| (at, group));
    let jobs: Vec<(usize, usize)> = (0..files.len()).flat_map(groups).collect();
    let threads = arguments.threads.or_else(|| thread::available_parallelism().ok().map(Into::into)).unwrap_or(1);
    let next = AtomicUsize::new(0);
    let values = thread::scope(|scope| {
        let worker = || {
            let mut values = 0;
            while let Some(&(file, group)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                let (path, footer) = &files[file];
                values += read_row_group(path, footer, group, &arguments.columns)?;
            }
            Ok::<_, Failure>(values)
        };
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(worker)).collect();
        let read = workers.into_iter().map(|worker| worker.join().unwrap_or_else(|_| Err("a reader panicked".into())));
        read.sum::<Result<u64, Failure>>()
    })?;
    println!("{values} values");
    Ok(())
}

/// The Parquet files of a folder, with their footers.
fn open(folder: &Path) -> Result<Vec<(PathBuf, ParquetMetaData)>, Failure> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == "parquet") {
            let footer = ParquetMetaDataReader::new().parse_and_finish(&File::open(&path)?)?;
            files.push((path, footer));
        }
    }
    Ok(files)
}

/// The number of values in the data pages of some columns of a row group.
fn read_row_group(path: &Path, footer: &ParquetMetaData, group: usize, columns: &[String]) -> Result<u64, Failure> {
    // A handle of its own: threads would share the position of one handle.
    let mut file = File::open(path)?;
    let group = footer.row_group(group);
    let rows = usize::try_from(group.num_rows())?;
    let mut values = 0;
    for column in group.columns() {
        if columns.iter().any(|name| name == column.column_path().string().as_str()) {
            values += read_column(&mut file, column, rows)?;
        }
    }
    Ok(values)
}

fn read_column(file: &mut File, column: &ColumnChunkMetaData, rows: usize) -> Result<u64, Failure> {
    let (start, length) = column.byte_range();
    let mut bytes = Vec::with_capacity(usize::try_from(length)?);
    file.seek(SeekFrom::Start(start))?;
    file.take(length).read_to_end(&mut bytes)?;
    let piece = Arc::new(Piece { start, bytes: bytes.into() });
    let mut pages = SerializedPageReader::new(piece, column, rows, None)?;
    let mut values = 0;
    while let Some(page) = pages.get_next_page()? {
        if !matches!(page, Page::DictionaryPage { .. }) {
            values += u64::from(page.num_values());
        }
        black_box(page.buffer());
    }
    Ok(values)
}

/// Part of a file in memory, with the addresses of the file.
struct Piece {
    start: u64,
    bytes: Bytes,
}

impl Piece {
    fn from(&self, address: u64) -> Result<Bytes, ParquetError> {
        let from = address.checked_sub(self.start).and_then(|from| usize::try_from(from).ok());
        let from = from.filter(|from| *from <= self.bytes.len()).ok_or(ParquetError::EOF("a page's address".into()))?;
        Ok(self.bytes.slice(from..))
    }
}

impl Length for Piece {
    fn len(&self) -> u64 {
        self.start + self.bytes.len() as u64
    }
}

impl ChunkReader for Piece {
    type T = Reader<Bytes>;

    fn get_read(&self, start: u64) -> Result<Self::T, ParquetError> {
        Ok(self.from(start)?.reader())
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        let mut rest = self.from(start)?;
        if length > rest.len() {
            return Err(ParquetError::EOF("a page's length".into()));
        }
        Ok(rest.split_to(length))
    }
}
