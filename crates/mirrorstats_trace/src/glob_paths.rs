//! Expands globs that the shell did not, over names of any bytes.
//!
//! Patterns are matched against text: in a name that is not UTF-8, U+FFFD replaces the other bytes, and `*` and `?`
//! match it. The crate `glob` would skip such a file silently.

use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use glob::{Pattern, PatternError};

#[derive(Debug)]
pub(crate) enum GlobError {
    Pattern(PatternError),
    Folder(PathBuf, io::Error),
}

pub(crate) fn is_glob(text: &str) -> bool {
    text.contains(['*', '?', '['])
}

/// The files and folders that a glob matches, in any order.
///
/// `**` matches any number of folders, without following links to folders.
pub(crate) fn matches(pattern: &str) -> Result<Vec<PathBuf>, GlobError> {
    Pattern::new(pattern).map_err(GlobError::Pattern)?;
    let mut found = vec![PathBuf::new()];
    for part in Path::new(pattern).components() {
        let text = part.as_os_str().to_str().unwrap_or_default();
        found = match part {
            Component::Normal(_) if text == "**" => each(&found, below)?,
            Component::Normal(_) if is_glob(text) => {
                let pattern = Pattern::new(text).map_err(GlobError::Pattern)?;
                let fits =
                    |path: &PathBuf| path.file_name().is_some_and(|name| pattern.matches(&name.to_string_lossy()));
                each(&found, |folder| Ok(entries(folder)?.into_iter().filter(fits).collect()))?
            }
            _ => found.into_iter().map(|path| path.join(text)).filter(|path| path.symlink_metadata().is_ok()).collect(),
        };
    }
    Ok(found)
}

fn each(
    folders: &[PathBuf],
    find: impl Fn(&Path) -> Result<Vec<PathBuf>, GlobError>,
) -> Result<Vec<PathBuf>, GlobError> {
    Ok(folders.iter().map(|folder| find(folder)).collect::<Result<Vec<_>, _>>()?.concat())
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, GlobError> {
    let place = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    if !place.is_dir() {
        return Ok(Vec::new());
    }
    let failed = |error| GlobError::Folder(place.to_owned(), error);
    let names = fs::read_dir(place).map_err(failed)?.map(|entry| entry.map(|entry| folder.join(entry.file_name())));
    names.collect::<Result<_, _>>().map_err(failed)
}

fn below(folder: &Path) -> Result<Vec<PathBuf>, GlobError> {
    let mut all = vec![folder.to_owned()];
    let mut at = 0;
    while let Some(folder) = all.get(at).cloned() {
        let is_folder = |path: &PathBuf| path.symlink_metadata().is_ok_and(|about| about.is_dir());
        all.extend(entries(&folder)?.into_iter().filter(is_folder));
        at += 1;
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::{GlobError, matches};

    fn names(folder: &std::path::Path, pattern: &str) -> Vec<String> {
        let found = matches(&format!("{}/{pattern}", folder.display())).unwrap();
        let mut names: Vec<String> =
            found.iter().map(|path| path.strip_prefix(folder).unwrap().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn globs_match_names_and_folders() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        std::fs::create_dir_all(at.join("one/two")).unwrap();
        for name in ["a.parquet", "b.txt", "one/c.parquet", "one/two/d.parquet", "one/two/.e.parquet"] {
            std::fs::write(at.join(name), "").unwrap();
        }
        assert_eq!(names(at, "*.parquet"), ["a.parquet"]);
        assert_eq!(names(at, "[ab].*"), ["a.parquet", "b.txt"]);
        assert_eq!(names(at, "*/*.parquet"), ["one/c.parquet"]);
        assert_eq!(names(at, "o?e/two/d*"), ["one/two/d.parquet"]);
        assert_eq!(names(at, "one/../?.txt"), ["one/../b.txt"]);
        let all = ["a.parquet", "one/c.parquet", "one/two/.e.parquet", "one/two/d.parquet"];
        assert_eq!(names(at, "**/*.parquet"), all);
        assert_eq!(names(at, "b.txt/*"), [] as [&str; 0]);
        assert_eq!(names(at, "no*/such"), [] as [&str; 0]);
        assert!(matches!(matches("a[b"), Err(GlobError::Pattern(_))));
    }

    #[cfg(unix)]
    #[test]
    fn a_name_that_is_not_utf8_is_matched() {
        use std::os::unix::ffi::OsStrExt as _;
        let folder = tempfile::tempdir().unwrap();
        let name = std::ffi::OsStr::from_bytes(b"b\xff.parquet");
        std::fs::write(folder.path().join(name), "").unwrap();
        let found = matches(&format!("{}/b?.par*", folder.path().display())).unwrap();
        assert_eq!(found, [folder.path().join(name)]);
    }
}
