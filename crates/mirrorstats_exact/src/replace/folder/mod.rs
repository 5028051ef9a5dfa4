//! Replaces the files of a folder together: after a crash either all files are old or all are new.
//!
//! The new folder is completed beside the old one, with hard links to all unchanged files. Then the two exchange names
//! in one step of the file system. If that is impossible (see [`exchange`]), files are replaced one by one. A note
//! marks the folder until all are replaced. The index is removed first and written last. So a folder without a note, or
//! with an index, is complete.

#[cfg(target_os = "linux")]
mod exchange;
mod in_place;
mod stage;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::leftover;
use super::place::{folder_of, make_folder, sync_folder};
pub use stage::{Content, FolderError, FolderFiles, is_unfinished};
use stage::{stage, step, write};

/// Replaces the files of the folder `out`, creating it and its parents if needed. Leftovers of killed processes that
/// worked on this folder are removed.
pub fn replace_folder(out: &Path, files: &FolderFiles<'_>) -> Result<(), FolderError> {
    // Without the final slash of `link/`, which would follow the link.
    let out: &Path = &out.components().collect::<PathBuf>();
    let parent = folder_of(out);
    make_folder(parent).map_err(FolderError::at(parent))?;
    leftover::sweep(parent);
    if !out.exists() {
        match create(out, files) {
            Err(FolderError { source, .. })
                if matches!(source.kind(), io::ErrorKind::AlreadyExists | io::ErrorKind::DirectoryNotEmpty) => {}
            result => return result,
        }
    }
    check_room(out, files)?;
    leftover::sweep(out);
    #[cfg(target_os = "linux")]
    if let Ok(synced) = exchange::replace(out, files) {
        return synced.map_err(FolderError::at(out));
    }
    // Nothing has changed yet. If the same obstacle stops the replacement in place, that error is reported.
    in_place::replace(out, files)
}

fn create(out: &Path, files: &FolderFiles<'_>) -> Result<(), FolderError> {
    let stage = stage(folder_of(out), out).map_err(FolderError::at(folder_of(out)))?;
    write(stage.path(), files, out)?;
    step();
    fs::rename(stage.path(), out).map_err(FolderError::at(out))?;
    stage.keep();
    sync_folder(folder_of(out)).map_err(FolderError::at(out))
}

fn check_room(out: &Path, files: &FolderFiles<'_>) -> Result<(), FolderError> {
    for (path, _) in files.new {
        if out.join(path).is_dir() {
            return Err(FolderError::at(&out.join(path))(io::ErrorKind::IsADirectory.into()));
        }
        let mut above = path.ancestors().skip(1).map(|inside| out.join(inside));
        if let Some(folder) = above.find(|folder| !folder.is_dir() && fs::symlink_metadata(folder).is_ok()) {
            return Err(FolderError::at(&folder)(io::ErrorKind::NotADirectory.into()));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    //! Ends the process before every step of the file system; the steps are the same in a separate process.

    use std::collections::BTreeMap;
    use std::fs;
    use std::path::{Path, PathBuf};
    use std::process::{Command, exit};
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::{Content, FolderFiles, replace_folder};

    /// Names the step at which the process ends.
    const LAST_STEP: &str = "MIRRORSTATS_TEST_LAST_STEP";
    /// Names the folder in which the process replaces files.
    const FOLDER: &str = "MIRRORSTATS_TEST_FOLDER";
    /// The exit code of an ended process.
    const ENDED: i32 = 42;

    static STEPS: AtomicUsize = AtomicUsize::new(0);

    /// Ends the process before the given step, without running destructors.
    pub(super) fn step() {
        let Ok(last) = std::env::var(LAST_STEP) else { return };
        if STEPS.fetch_add(1, Ordering::Relaxed).to_string() == last {
            exit(ENDED);
        }
    }

    type Contents = BTreeMap<PathBuf, Option<String>>;

    const INDEX: &str = "index.txt";
    const OLD: [(&str, &str); 4] = [
        ("a.txt", "old a"),
        ("figures/x.svg", "old x"),
        ("tables/t.csv", "old t"),
        (INDEX, "a.txt\nfigures/x.svg\ntables/t.csv"),
    ];
    const NEW: [(&str, &str); 3] = [("a.txt", "new a"), ("tables/u.csv", "new u"), (INDEX, "a.txt\ntables/u.csv")];
    const FOREIGN: [(&str, &str); 3] = [("notes.txt", "mine"), ("mine/deep/b.txt", "mine"), ("tables/own.csv", "mine")];

    /// The files that a folder's index lists.
    fn listed(folder: &Path) -> Vec<PathBuf> {
        let index = fs::read_to_string(folder.join(INDEX)).unwrap_or_default();
        index.lines().chain([INDEX]).map(PathBuf::from).collect()
    }

    fn replace(out: &Path, files: &[(&str, &str)]) {
        let new: Vec<_> = files.iter().map(|(path, text)| (Path::new(path), Content::Bytes(text.as_bytes()))).collect();
        replace_folder(out, &FolderFiles { new: &new, index: Some(Path::new(INDEX)), old: &listed }).unwrap();
    }

    fn write(out: &Path, files: &[(&str, &str)]) {
        for (path, text) in files {
            fs::create_dir_all(out.join(path).parent().unwrap()).unwrap();
            fs::write(out.join(path), text).unwrap();
        }
    }

    /// A folder with old and foreign files.
    fn old_folder(out: &Path) {
        write(out, &OLD);
        write(out, &FOREIGN);
        fs::create_dir(out.join("empty")).unwrap();
    }

    /// All files and empty folders below a folder, without those of killed processes.
    fn contents(root: &Path) -> Contents {
        fn walk(root: &Path, inside: &Path, found: &mut Contents) {
            let mut is_empty = true;
            for entry in fs::read_dir(root.join(inside)).unwrap() {
                let entry = entry.unwrap();
                is_empty = false;
                let inside = inside.join(entry.file_name());
                if entry.file_name().to_string_lossy().starts_with(".mirrorstats-") {
                } else if entry.path().is_dir() {
                    walk(root, &inside, found);
                } else {
                    found.insert(inside, Some(fs::read_to_string(entry.path()).unwrap()));
                }
            }
            if is_empty {
                found.insert(inside.to_owned(), None);
            }
        }
        let mut found = Contents::new();
        walk(root, Path::new(""), &mut found);
        found
    }

    /// The contents of a folder with these files and the foreign ones.
    fn with_foreign(files: &[(&str, &str)]) -> Contents {
        let files = files.iter().chain(&FOREIGN).map(|(path, text)| (PathBuf::from(path), Some((*text).to_owned())));
        files.chain([(PathBuf::from("empty"), None)]).collect()
    }

    fn has_leftovers(folder: &Path) -> bool {
        let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
        names.into_iter().any(|name| name.to_string_lossy().starts_with(".mirrorstats-"))
    }

    /// Replaces the files of `out` in a process that ends before `step`; returns true if it completed before that.
    fn replaced_before(out: &Path, step: usize) -> bool {
        let mut child = Command::new(std::env::current_exe().unwrap());
        child.args(["--exact", concat!(module_path!(), "::replaces_in_a_process_of_its_own")].map(without_crate));
        child.args(["--ignored", "--quiet"]).env(LAST_STEP, step.to_string()).env(FOLDER, out);
        let output = child.output().unwrap();
        match output.status.code() {
            Some(0) => true,
            Some(ENDED) => false,
            _ => panic!("{}", String::from_utf8_lossy(&output.stdout)),
        }
    }

    /// Test names start after the crate's name.
    fn without_crate(name: &str) -> &str {
        name.split_once("::").filter(|_| name.contains("tests::")).map_or(name, |(_, name)| name)
    }

    #[test]
    #[ignore = "the tests below start it in a process of its own"]
    fn replaces_in_a_process_of_its_own() {
        let out = std::env::var(FOLDER).expect("the folder is told by the test that starts this one");
        replace(Path::new(&out), &NEW);
    }

    /// Ends a process before each step, then checks the folder with `is_right`. A run to completion cleans up. Returns the
    /// number of steps.
    fn end_at_every_step(out_of: impl Fn(&Path) -> PathBuf, is_right: impl Fn(&Contents) -> bool) -> usize {
        for step in 0.. {
            let home = tempfile::tempdir().unwrap();
            let out = out_of(home.path());
            let is_done = replaced_before(&out, step);
            let found = contents(&out);
            assert!(is_right(&found), "ended before step {step}: {found:#?}");
            replace(&out, &NEW);
            assert_eq!(contents(&out), with_foreign(&NEW), "after step {step}");
            assert!(!has_leftovers(home.path()) && !has_leftovers(&out), "after step {step}");
            if is_done {
                assert_eq!(found, with_foreign(&NEW));
                return step;
            }
        }
        unreachable!("some process comes to its end")
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_is_the_old_or_the_new_one_before_every_step_of_an_exchange() {
        let plain = |home: &Path| {
            old_folder(&home.join("out"));
            home.join("out")
        };
        let steps = end_at_every_step(plain, |found| *found == with_foreign(&OLD) || *found == with_foreign(&NEW));
        assert!(steps >= 12, "{steps}");
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_with_an_index_is_complete_before_every_step_in_place() {
        let linked = |home: &Path| {
            old_folder(&home.join("there"));
            std::os::unix::fs::symlink("there", home.join("out")).unwrap();
            home.join("out")
        };
        let steps = end_at_every_step(linked, |found| {
            let keeps_foreign =
                FOREIGN.iter().all(|(path, text)| found.get(Path::new(path)) == Some(&Some((*text).to_owned())));
            let has_index = found.contains_key(Path::new(INDEX));
            keeps_foreign && (!has_index || *found == with_foreign(&OLD) || *found == with_foreign(&NEW))
        });
        assert!(steps >= 12, "{steps}");
    }

    #[test]
    fn a_new_folder_appears_complete() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("above/out/");
        replace(&out, &OLD);
        assert_eq!(contents(&out).len(), OLD.len());
        assert_eq!(fs::read_dir(home.path().join("above")).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn links_and_permissions_stay_and_folders_of_old_files_go() {
        use std::os::unix::fs::PermissionsExt as _;
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        old_folder(&out);
        fs::set_permissions(&out, fs::Permissions::from_mode(0o750)).unwrap();
        fs::set_permissions(out.join("mine"), fs::Permissions::from_mode(0o705)).unwrap();
        std::os::unix::fs::symlink("nowhere", out.join("link")).unwrap();
        replace(&out, &NEW);
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!((mode(&out), mode(&out.join("mine"))), (0o750, 0o705));
        assert_eq!(fs::read_link(out.join("link")).unwrap(), Path::new("nowhere"));
        assert!(!out.join("figures").exists());
    }

    #[test]
    fn a_full_disk_changes_nothing() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        old_folder(&out);
        fs::create_dir(out.join("tables/u.csv")).unwrap();
        let before = contents(home.path());
        let new: Vec<_> = NEW.iter().map(|(path, text)| (Path::new(path), Content::Bytes(text.as_bytes()))).collect();
        let files = FolderFiles { new: &new, index: Some(Path::new(INDEX)), old: &listed };
        let error = replace_folder(&out, &files).unwrap_err();
        assert_eq!(error.path, out.join("tables/u.csv"));
        assert_eq!(contents(home.path()), before);
    }
}
