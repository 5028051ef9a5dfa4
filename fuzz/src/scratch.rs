//! Files for targets whose library functions take a path; in memory where the system supports it.

use std::cell::RefCell;
use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

thread_local! {
    static FOLDER: RefCell<Option<TempDir>> = const { RefCell::new(None) };
}

/// The path of this name in the thread's folder.
pub fn path(name: &str) -> PathBuf {
    FOLDER.with_borrow_mut(|folder| {
        let memory = Path::new("/dev/shm");
        let of = || {
            let place = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
            tempfile::Builder::new()
                .prefix("mirrorstats-fuzz-")
                .tempdir_in(place)
                .expect("a folder for temporary files")
        };
        folder.get_or_insert_with(of).path().join(name)
    })
}

/// Writes a file with this name and these bytes.
pub fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = path(name);
    fs::write(&path, bytes).expect("a folder for temporary files");
    path
}
