//! A file that Polars writes, which keeps write errors: Polars drops its writers without reporting them.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::sync::{Arc, Mutex, PoisonError};

use polars::prelude::LazyFrame;

use super::answer::{Format, write};
use super::run::PolarsError;

#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    #[error(transparent)]
    Output(io::Error),
    #[error(transparent)]
    Polars(PolarsError),
}

pub fn write_file(frame: LazyFrame, format: Format, file: File) -> Result<(), WriteError> {
    let out = SharedFile::new(file);
    let written = write(frame, format, out.clone());
    out.finish().map_err(WriteError::Output)?;
    written.map_err(WriteError::Polars)
}

pub fn in_memory(frame: LazyFrame, format: Format) -> Result<Vec<u8>, PolarsError> {
    let out = SharedFile::new(Vec::new());
    write(frame, format, out.clone())?;
    let mut shared = out.0.lock().unwrap_or_else(PoisonError::into_inner);
    shared.out.flush().map_err(|error| PolarsError::Failed(error.to_string()))?;
    Ok(std::mem::take(shared.out.get_mut()))
}

/// A file with several writers that keeps the first error.
struct SharedFile<W: Write>(Arc<Mutex<Shared<W>>>);

struct Shared<W: Write> {
    out: BufWriter<W>,
    fault: Option<io::Error>,
}

impl<W: Write> Clone for SharedFile<W> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<W: Write> SharedFile<W> {
    fn new(file: W) -> Self {
        Self(Arc::new(Mutex::new(Shared { out: BufWriter::new(file), fault: None })))
    }

    fn finish(&self) -> io::Result<()> {
        let mut shared = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        shared.fault.take().map_or_else(|| shared.out.flush(), Err)
    }

    fn with<T>(&self, work: impl FnOnce(&mut BufWriter<W>) -> io::Result<T>) -> io::Result<T> {
        let mut shared = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        work(&mut shared.out).map_err(|error| {
            let kind = error.kind();
            shared.fault.get_or_insert(error);
            kind.into()
        })
    }
}

impl<W: Write> Write for SharedFile<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.with(|out| out.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.with(Write::flush)
    }
}
