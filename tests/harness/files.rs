//! The files of the repository, and the contents of folders.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Every file of a folder: path and bytes.
pub type Contents = BTreeMap<String, Vec<u8>>;

/// The folder of the repository.
pub fn repository() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// A file or a folder of `fixtures`.
pub fn fixture(name: &str) -> PathBuf {
    repository().join("fixtures").join(name)
}

/// Every file in a folder and below it, hidden ones too.
pub fn contents(folder: &Path) -> Contents {
    let (mut found, mut open) = (BTreeMap::new(), vec![folder.to_owned()]);
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().path()));
        } else {
            let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
            found.insert(name, fs::read(&path).unwrap());
        }
    }
    found
}

/// Checks that two folders hold the same, and names the file that differs instead of printing its bytes.
#[track_caller]
pub fn assert_same(found: &Contents, expected: &Contents) {
    assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>());
    for (name, bytes) in expected {
        assert!(found[name] == *bytes, "{name} has other bytes");
    }
}

/// Writes `small.toml`, a configuration of the world with a smaller eye, so that there is less to count and draw.
pub fn write_small_world(folder: &Path, more: &str) {
    fs::write(folder.join("small.toml"), format!("{SMALL}{more}")).unwrap();
}

/// The changes that `small.toml` makes to the world.
pub const SMALL: &str = "eye.width = 64\neye.height_px = 48\neye.samples = 0\n";
