use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::Path;
use std::time::{Duration, SystemTime};

use serde::Serialize;
use serde::de::DeserializeOwned;

use exact::replace::{folder_of, make_folder};

/// A small file that all processes of a folder read and write under its lock. Without file locks, each process is on
/// its own.
#[derive(Debug)]
pub(crate) struct SharedFile(pub(super) File);

impl SharedFile {
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        make_folder(folder_of(path))?;
        OpenOptions::new().create(true).truncate(false).read(true).write(true).open(path).map(Self)
    }

    pub(crate) fn locked<T>(&self, work: impl FnOnce() -> T) -> T {
        let _ = self.0.lock();
        let done = work();
        let _ = self.0.unlock();
        done
    }

    pub(crate) fn read<T: DeserializeOwned>(&self) -> io::Result<T> {
        let mut text = String::new();
        let mut file = &self.0;
        file.rewind()?;
        file.read_to_string(&mut text)?;
        Ok(serde_json::from_str(&text)?)
    }

    pub(crate) fn write(&self, content: &impl Serialize) -> io::Result<()> {
        let mut text = serde_json::to_vec(content)?;
        let before = usize::try_from(self.0.metadata()?.len()).unwrap_or_default();
        text.resize(text.len().max(before), b' ');
        let mut file = &self.0;
        file.rewind()?;
        file.write_all(&text)
    }
}

/// The time since 1970, which processes share.
pub(crate) fn now() -> Duration {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default()
}
