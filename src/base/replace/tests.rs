use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;

use super::place::prefix_for;
use super::{NewFile, check_target, is_same_file, replace};

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_target_is_replaced_by_a_commit_alone() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("a.txt");
    fs::write(&target, "old").unwrap();
    let mut dropped = NewFile::create(&target).unwrap();
    dropped.write_all(b"new").unwrap();
    drop(dropped);
    assert_eq!(fs::read(&target).unwrap(), b"old");
    replace(&target, b"new").unwrap();
    assert_eq!(fs::read(&target).unwrap(), b"new");
    let mut unsynced = NewFile::create(&target).unwrap();
    unsynced.write_all(b"newer").unwrap();
    unsynced.commit_unsynced().unwrap();
    assert_eq!(fs::read(&target).unwrap(), b"newer");
    assert_eq!(names(folder.path()), ["a.txt"]);
}

#[test]
fn a_folder_is_no_target() {
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
    let [target, other] = ["a.txt", "b.txt"].map(|name| folder.path().join(name));
    let dead = folder.path().join(".mirrorstats-a.txt.abc123");
    fs::write(&dead, "half").unwrap();
    let stay = [".mirrorstats-a.txt.abc12", ".mirrorstats-abc123", ".mirrorstats-b.txt.abc123", "mine.abc123"];
    for name in stay {
        fs::write(folder.path().join(name), "").unwrap();
    }
    let alive = folder.path().join(".mirrorstats-a.txt.abc124");
    let owner = File::create(&alive).unwrap();
    owner.lock().unwrap();
    replace(&target, b"new").unwrap();
    assert!(!dead.exists());
    assert!(alive.exists() && stay.iter().all(|name| folder.path().join(name).exists()));
    drop(owner);
    replace(&other, b"new").unwrap();
    assert!(alive.exists(), "it is another target's");
    replace(&target, b"new").unwrap();
    assert!(!alive.exists());
}

#[test]
fn a_long_name_has_a_temporary_one() {
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
