//! Replaces files: after a crash, a full disk or a loss of power a file has its complete old or complete new content.
//!
//! A new file is written under a temporary name in its target's folder, synchronised, and renamed to the target; then
//! the folder is synchronised. Every file that the program replaces goes through [`NewFile`].
//!
//! Temporary names end in six random characters and a checksum of the name, so other programs do not use them. Their
//! process locks the files. The next process that writes into the folder removes the files of killed processes.
//!
//! A target that is a device, a pipe or a standard stream (`/dev/null`, `/dev/stdout`) cannot be replaced by renaming.
//! The complete content is copied into it instead.

mod folder;
mod leftover;
mod new_file;
mod place;
mod same_file;
mod temporary;

pub use folder::{Content, FolderError, FolderFiles, is_unfinished, replace_folder};
pub use leftover::sweep;
pub use new_file::{NewFile, replace};
pub use place::{folder_of, is_stream, make_folder, sync_folder};
pub use same_file::{FolderHoldsInput, TargetIsInput, check_folder, check_target, is_same_file};
pub use temporary::TemporaryFolder;

#[cfg(test)]
mod tests {
    use std::fs::{self, File};
    use std::io::Write as _;
    use std::path::Path;

    use super::place::prefix_for;
    use super::{NewFile, TemporaryFolder, check_target, is_same_file, make_folder, replace};

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// The temporary name of a process that was killed before it was done.
    fn temporary_name(target: &str) -> String {
        super::temporary::name(&prefix_for(Path::new(target))).into_string().unwrap()
    }

    #[test]
    fn only_a_commit_replaces_the_target() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.txt");
        fs::write(&target, "old").unwrap();
        let mut dropped = NewFile::create(&target).unwrap();
        dropped.write_all(b"new").unwrap();
        drop(dropped);
        assert_eq!(fs::read(&target).unwrap(), b"old");
        replace(&target, b"new").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["a.txt"]);
    }

    #[test]
    fn a_new_target_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.txt");
        let [first, second] = ["first", "second"].map(|text| {
            let mut file = NewFile::create(&target).unwrap();
            file.write_all(text.as_bytes()).unwrap();
            file
        });
        first.commit_new().unwrap();
        assert_eq!(second.commit_new().unwrap_err().kind(), std::io::ErrorKind::AlreadyExists);
        assert_eq!(fs::read(&target).unwrap(), b"first");
        assert_eq!(names(folder.path()), ["a.txt"]);
    }

    #[test]
    fn a_folder_is_refused_as_a_target() {
        let folder = tempfile::tempdir().unwrap();
        let error = NewFile::create(folder.path()).unwrap_err();
        assert_eq!(error.kind(), std::io::ErrorKind::IsADirectory);
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn two_attempts_at_one_target_do_not_disturb_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.txt");
        let [mut first, mut second] = [(); 2].map(|()| NewFile::create(&target).unwrap());
        assert_ne!(first.temporary_path(), second.temporary_path());
        first.write_all(b"first").unwrap();
        second.write_all(b"second").unwrap();
        second.commit().unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"second");
        first.commit().unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"first");
        assert_eq!(names(folder.path()), ["a.txt"]);
    }

    #[cfg(unix)]
    #[test]
    fn leftovers_of_dead_processes_go_and_all_else_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        // Leftovers for any target.
        let dead = ["a.txt", "b.txt", "frames"].map(temporary_name);
        fs::create_dir(path(&dead[2])).unwrap();
        for name in ["001.png", "002.png"] {
            fs::write(path(&dead[2]).join(name), "").unwrap();
        }
        // A user's own file, though it looks like ours.
        let mine = path(".mirrorstats-notes.backup");
        fs::create_dir(&mine).unwrap();
        fs::write(mine.join("thesis.txt"), "mine").unwrap();
        let nearly = dead[0].replacen("a.txt", "b.txt", 1);
        let stay = [".mirrorstats-a.txt.abc123", ".mirrorstats-unfinished", "mine.abc123", nearly.as_str()];
        for name in dead[..2].iter().map(String::as_str).chain(stay) {
            fs::write(path(name), "half").unwrap();
        }
        let (alive, link) = (path(&temporary_name("a.txt")), path(&temporary_name("a.txt")));
        let owner = File::create(&alive).unwrap();
        owner.lock().unwrap();
        std::os::unix::fs::symlink("mine.abc123", &link).unwrap();
        replace(&path("a.txt"), b"new").unwrap();
        assert!(dead.iter().all(|name| !path(name).exists()));
        assert!(alive.exists() && link.exists() && stay.iter().all(|name| path(name).exists()));
        assert_eq!(fs::read(mine.join("thesis.txt")).unwrap(), b"mine");
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_is_swept_once_however_many_files_are_written() {
        let folder = tempfile::tempdir().unwrap();
        replace(&folder.path().join("a.txt"), b"new").unwrap();
        let later = folder.path().join(temporary_name("a.txt"));
        fs::write(&later, "half").unwrap();
        replace(&folder.path().join("b.txt"), b"new").unwrap();
        assert!(later.exists(), "the next process sweeps it");
    }

    #[test]
    fn a_temporary_folder_goes_with_all_that_is_in_it() {
        let home = tempfile::tempdir().unwrap();
        let folder = TemporaryFolder::create(home.path(), "frames").unwrap();
        fs::create_dir(folder.path().join("deep")).unwrap();
        fs::write(folder.path().join("deep/a"), "").unwrap();
        assert_eq!(names(home.path()).len(), 1);
        drop(folder);
        assert!(names(home.path()).is_empty());
    }

    #[test]
    fn a_folder_is_made_with_those_above_it() {
        let home = tempfile::tempdir().unwrap();
        let deep = home.path().join("a/b/c");
        make_folder(&deep).unwrap();
        make_folder(&deep).unwrap();
        assert!(deep.is_dir());
        fs::write(home.path().join("file"), "").unwrap();
        assert!(make_folder(&home.path().join("file/x")).is_err());
    }

    #[test]
    fn a_file_with_a_long_name_can_be_replaced() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["x".repeat(255), "é".repeat(127)] {
            let target = folder.path().join(name);
            replace(&target, b"new").unwrap();
            assert_eq!(fs::read(&target).unwrap(), b"new");
            assert!(prefix_for(&target).len() < 240);
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_written_into() {
        use std::os::unix::fs::FileTypeExt as _;
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("null.csv");
        std::os::unix::fs::symlink("/dev/null", &link).unwrap();
        for target in [Path::new("/dev/null"), &link] {
            replace(target, b"gone").unwrap();
            assert!(fs::metadata(target).unwrap().file_type().is_char_device());
        }
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        let error = replace(Path::new("/dev/full"), b"lost");
        assert!(!cfg!(target_os = "linux") || error.unwrap_err().kind() == std::io::ErrorKind::StorageFull);
    }

    #[cfg(unix)]
    #[test]
    fn an_input_is_recognised_under_every_name() {
        let folder = tempfile::tempdir().unwrap();
        let place = |name: &str| folder.path().join(name);
        fs::create_dir(place("sub")).unwrap();
        for name in ["a", "b"] {
            fs::write(place(name), "same").unwrap();
        }
        fs::hard_link(place("a"), place("hard")).unwrap();
        std::os::unix::fs::symlink("a", place("soft")).unwrap();
        std::os::unix::fs::symlink("nothing", place("dangling")).unwrap();
        for (target, is_input) in [
            ("a", true),
            ("sub/../a", true),
            ("hard", true),
            ("soft", true),
            ("b", false),
            ("dangling", false),
            ("c", false),
        ] {
            assert_eq!(is_same_file(&place(target), &place("a")), is_input, "{target}");
            let checked = check_target(&place(target), [place("nothing"), place("a")], "a trace that is read");
            assert_eq!(checked.is_err(), is_input, "{target}");
            if let Err(error) = checked {
                let words =
                    "expected another file to write, found a trace that is read\n  help: give the output another name";
                assert!(error.to_string().ends_with(words), "{error}");
            }
        }
        assert!(check_target(Path::new("/dev/null"), ["/dev/null"], "a device").is_ok());
    }
}
