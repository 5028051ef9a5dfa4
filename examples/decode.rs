//! Decodes columns of traces and does nothing with them: what any engine on this Parquet library pays at least.
//!
//! `cargo run --release --example decode -- FOLDER` reads the columns of the paper's definitions with `parquet` and
//! `arrow`, text as dictionaries, row groups on all cores, and prints the number of rows.

use std::error::Error;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use arrow::datatypes::{DataType, Field, Schema};
use clap::Parser;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReaderBuilder};

/// Decode columns of traces and do nothing with them
#[derive(Debug, Parser)]
struct Arguments {
    /// Row groups at a time [default: one a core].
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
    let rows = thread::scope(|scope| {
        let worker = || {
            let mut rows = 0;
            while let Some(&(file, group)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                let (metadata, path) = &files[file];
                rows += decode(metadata, path, group, &arguments.columns)?;
            }
            Ok::<_, Failure>(rows)
        };
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(worker)).collect();
        let decoded =
            workers.into_iter().map(|worker| worker.join().unwrap_or_else(|_| Err("a reader panicked".into())));
        decoded.sum::<Result<usize, Failure>>()
    })?;
    println!("{rows} rows");
    Ok(())
}

/// The footer, every text column to be read as a dictionary.
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

fn decode(metadata: &ArrowReaderMetadata, path: &Path, group: usize, columns: &[String]) -> Result<usize, Failure> {
    let mask = ProjectionMask::columns(metadata.parquet_schema(), columns.iter().map(String::as_str));
    let reader = ParquetRecordBatchReaderBuilder::new_with_metadata(File::open(path)?, metadata.clone())
        .with_row_groups(vec![group])
        .with_projection(mask)
        .with_batch_size(BATCH_ROWS)
        .build()?;
    let mut rows = 0;
    for batch in reader {
        rows += std::hint::black_box(batch?).num_rows();
    }
    Ok(rows)
}
