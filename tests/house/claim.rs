//! Detecting other processes that record into a folder. This must not run beside tests that start programs: a child
//! briefly holds its parent's locks, so no process is alone there.

use std::fs;

use world::record::lock::FolderLock;

#[test]
fn the_last_process_removes_the_shared_files() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("runs");
    let (first, second) = (FolderLock::stake(&folder).unwrap(), FolderLock::stake(&folder).unwrap());
    drop(second);
    assert!(first.parts().is_dir());
    drop(first);
    assert!(!folder.exists(), "it was made for the recording, and nothing was recorded");

    let (first, second) = (FolderLock::stake(&folder).unwrap(), FolderLock::stake(&folder).unwrap());
    drop(first);
    drop(second);
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 0, "the second cannot know that the folder was made for it");
}

#[test]
fn a_process_removes_files_of_a_killed_one_only_when_alone() {
    let folder = tempfile::tempdir().unwrap();
    let first = FolderLock::stake(folder.path()).unwrap();
    let parts = first.parts();
    let (left, part) = (parts.join(".mirrorstats-x"), parts.join("E1-x-s1-r1.parquet"));
    fs::write(&left, "").unwrap();
    fs::write(&part, "").unwrap();
    let second = FolderLock::stake(folder.path()).unwrap();
    assert!(left.exists(), "it may be what the first is writing");
    drop((first, second));
    assert!(!left.exists());
    assert!(part.exists(), "a part is an episode");
    for name in [".mirrorstats-x", "E1-x-s1-r2.mcap.unfinished", "E1-x-s1-r2.mcap", "E1-x-s1-r1.mcap"] {
        fs::write(parts.join(name), "").unwrap();
    }
    let third = FolderLock::stake(folder.path()).unwrap();
    drop(third);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "the folder of parts");
    let mut names: Vec<_> = fs::read_dir(parts).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["E1-x-s1-r1.mcap", "E1-x-s1-r1.parquet"]);
}

#[test]
fn the_lock_is_held_by_one_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let claims: Vec<FolderLock> = (0..4).map(|_| FolderLock::stake(folder.path()).unwrap()).collect();
    let counter = folder.path().join("counter");
    fs::write(&counter, "0").unwrap();
    std::thread::scope(|scope| {
        for claim in &claims {
            scope.spawn(|| {
                for _ in 0..25 {
                    let _lock = claim.lock().unwrap();
                    let count: u32 = fs::read_to_string(&counter).unwrap().parse().unwrap();
                    fs::write(&counter, (count + 1).to_string()).unwrap();
                }
            });
        }
    });
    assert_eq!(fs::read_to_string(&counter).unwrap(), "100");
}
