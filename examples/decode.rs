//! Reads columns of traces and does nothing with them: the minimum cost of any reader on this Parquet library.
//!
//! `cargo run --release --example decode -- FOLDER` takes the columns of the paper's definitions, row groups on all
//! cores. It decodes them with `parquet` and `arrow`, text as dictionaries, and prints the number of rows. With
//! `--pages` it only reads and decompresses pages, a column of a row group at a time, and counts values.

use std::error::Error;
use std::fs::{self, File};
use std::hint::black_box;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use arrow::datatypes::{DataType, Field, Schema};
use bytes::Bytes;
use bytes::buf::{Buf as _, Reader};
use clap::Parser;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use parquet::column::page::{Page, PageReader as _};
use parquet::errors::ParquetError;
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::reader::{ChunkReader, Length};
use parquet::file::serialized_reader::SerializedPageReader;

/// Read columns of traces and do nothing with them
#[derive(Debug, Parser)]
struct Arguments {
    /// Read and decompress their pages alone.
    #[arg(long)]
    pages: bool,
    /// Row groups at a time [default: one per core].
    #[arg(long)]
    threads: Option<usize>,
    /// The columns.
    #[arg(long, value_delimiter = ',', default_value = COLUMNS)]
    columns: Vec<String>,
    /// A folder of traces.
    folder: PathBuf,
}

/// The columns that `score` reads for the paper's definitions.
const COLUMNS: &str =
    "episode_id,model,experiment,seed,run,body_color,t,action,self_color,selected_cube,mirror_visible";
const BATCH_ROWS: usize = 64 * 1024;

type Failure = Box<dyn Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let arguments = Arguments::parse();
    let mut files = Vec::new();
    for entry in fs::read_dir(&arguments.folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == "parquet") {
            files.push((footer(&path)?, path));
        }
    }
    let groups = |at: usize| (0..files[at].0.metadata().num_row_groups()).map(move |group| (at, group));
    let jobs: Vec<(usize, usize)> = (0..files.len()).flat_map(groups).collect();
    let threads = arguments.threads.or_else(|| thread::available_parallelism().ok().map(Into::into)).unwrap_or(1);
    let next = AtomicUsize::new(0);
    let read = if arguments.pages { pages } else { rows };
    let total = thread::scope(|scope| {
        let worker = || {
            let mut total = 0;
            while let Some(&(file, group)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                let (footer, path) = &files[file];
                total += read(footer, path, group, &arguments.columns)?;
            }
            Ok::<_, Failure>(total)
        };
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(worker)).collect();
        let totals =
            workers.into_iter().map(|worker| worker.join().unwrap_or_else(|_| Err("a reader panicked".into())));
        totals.sum::<Result<usize, Failure>>()
    })?;
    println!("{total} {}", if arguments.pages { "values" } else { "rows" });
    Ok(())
}

/// The footer; every text column will be read as a dictionary.
fn footer(path: &Path) -> Result<ArrowReaderMetadata, Failure> {
    let stored = ArrowReaderMetadata::load(&File::open(path)?, ArrowReaderOptions::new())?;
    let text = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
    let fields = stored.schema().fields().iter().map(|field| match field.data_type() {
        DataType::Utf8 => Arc::new(field.as_ref().clone().with_data_type(text.clone())),
        _ => Arc::clone(field),
    });
    let schema = Arc::new(Schema::new(fields.collect::<Vec<Arc<Field>>>()));
    Ok(ArrowReaderMetadata::try_new(Arc::clone(stored.metadata()), ArrowReaderOptions::new().with_schema(schema))?)
}

/// Decodes a row group and returns the number of rows.
fn rows(footer: &ArrowReaderMetadata, path: &Path, group: usize, columns: &[String]) -> Result<usize, Failure> {
    let mask = ProjectionMask::columns(footer.parquet_schema(), columns.iter().map(String::as_str));
    let reader = ParquetRecordBatchReaderBuilder::new_with_metadata(File::open(path)?, footer.clone())
        .with_row_groups(vec![group])
        .with_projection(mask)
        .with_batch_size(BATCH_ROWS)
        .build()?;
    let mut rows = 0;
    for batch in reader {
        rows += black_box(batch?).num_rows();
    }
    Ok(rows)
}

/// The number of values in the data pages of some columns of a row group.
fn pages(footer: &ArrowReaderMetadata, path: &Path, group: usize, columns: &[String]) -> Result<usize, Failure> {
    // Each call opens the file, because threads would share the position of one handle.
    let mut file = File::open(path)?;
    let group = footer.metadata().row_group(group);
    let rows = usize::try_from(group.num_rows())?;
    let mut values = 0;
    for column in group.columns() {
        if columns.iter().any(|name| name == column.column_path().string().as_str()) {
            values += column_pages(&mut file, column, rows)?;
        }
    }
    Ok(values)
}

fn column_pages(file: &mut File, column: &ColumnChunkMetaData, rows: usize) -> Result<usize, Failure> {
    let (start, length) = column.byte_range();
    let mut bytes = Vec::with_capacity(usize::try_from(length)?);
    file.seek(SeekFrom::Start(start))?;
    file.take(length).read_to_end(&mut bytes)?;
    let piece = Arc::new(Piece { start, bytes: bytes.into() });
    let mut pages = SerializedPageReader::new(piece, column, rows, None)?;
    let mut values = 0;
    while let Some(page) = pages.get_next_page()? {
        if !matches!(page, Page::DictionaryPage { .. }) {
            values += usize::try_from(page.num_values())?;
        }
        black_box(page.buffer());
    }
    Ok(values)
}

/// A part of a file in memory, at the file's offsets.
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
