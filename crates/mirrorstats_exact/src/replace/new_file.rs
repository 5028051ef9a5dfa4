//! Replaces one file by another.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::leftover;
use super::place::{folder_of, is_stream, prefix_for, sync_folder};
use super::temporary::TemporaryFile;

/// The new content of a file. [`commit`](Self::commit) moves it to its target; dropping it first discards it.
#[derive(Debug)]
pub struct NewFile {
    file: TemporaryFile,
    target: PathBuf,
    is_stream: bool,
}

impl NewFile {
    /// Starts the new content of `target`, whose folder must exist. Leftovers of killed processes there are removed.
    pub fn create(target: &Path) -> io::Result<Self> {
        Self::create_in(folder_of(target), target)
    }

    /// Like [`create`](Self::create), with the temporary file in `scratch`, a folder of the same file system.
    pub fn create_in(scratch: &Path, target: &Path) -> io::Result<Self> {
        if target.is_dir() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        let is_stream = is_stream(target);
        let temporary = if is_stream { std::env::temp_dir() } else { scratch.to_owned() };
        leftover::sweep(&temporary);
        let file = TemporaryFile::create(&temporary, &prefix_for(target))?;
        Ok(Self { file, target: target.to_owned(), is_stream })
    }

    pub fn temporary_path(&self) -> &Path {
        self.file.path()
    }

    pub const fn as_file(&self) -> &File {
        &self.file.file
    }

    pub const fn as_file_mut(&mut self) -> &mut File {
        &mut self.file.file
    }

    /// Replaces the target. Afterwards not even a loss of power restores the old content.
    pub fn commit(self) -> io::Result<()> {
        self.commit_by(TemporaryFile::rename)
    }

    /// Like [`commit`](Self::commit), but leaves the target unchanged if it exists by now.
    pub fn commit_new(self) -> io::Result<()> {
        self.commit_by(TemporaryFile::rename_new)
    }

    fn commit_by(self, rename: fn(TemporaryFile, &Path) -> io::Result<()>) -> io::Result<()> {
        if self.is_stream {
            return self.copy_into_target();
        }
        self.as_file().sync_all()?;
        rename(self.file, &self.target)?;
        sync_folder(folder_of(&self.target))
    }

    fn copy_into_target(mut self) -> io::Result<()> {
        // A standard stream may be a file with output of others: append to it.
        let mut target = OpenOptions::new().append(true).open(&self.target)?;
        let content = &mut self.file.file;
        content.seek(SeekFrom::Start(0))?;
        io::copy(content, &mut target).map(drop)
    }
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.as_file_mut().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.as_file_mut().flush()
    }
}

impl Read for NewFile {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.as_file_mut().read(bytes)
    }
}

impl Seek for NewFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.as_file_mut().seek(to)
    }
}

pub fn replace(target: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = NewFile::create(target)?;
    file.write_all(bytes)?;
    file.commit()
}
