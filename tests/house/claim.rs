//! The lock of a recording's folder. This must not run beside tests that start programs: a child briefly holds its
//! parent's locks.

use std::fs;

use mirrorstats_record::lock::FolderLock;

#[test]
fn a_folder_has_one_owner_and_is_left_as_it_was() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("runs");
    let first = FolderLock::take(&folder).unwrap();
    let refused = FolderLock::take(&folder).unwrap_err().to_string();
    assert!(refused.contains("another process records into `"), "{refused}");
    assert!(refused.contains("--out") && refused.contains("--shard"), "{refused}");
    assert!(first.parts().is_dir());
    drop(first);
    assert!(!folder.exists(), "it was made for the recording, and nothing was recorded");
    fs::create_dir(&folder).unwrap();
    drop(FolderLock::take(&folder).unwrap());
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 0, "only the lock's own files go");
}

#[test]
fn the_next_owner_removes_the_files_of_a_killed_one() {
    let folder = tempfile::tempdir().unwrap();
    // A killed process leaves the file of its lock, and the system has released it.
    fs::write(folder.path().join(".lock"), "").unwrap();
    let parts = folder.path().join(".parts");
    fs::create_dir(&parts).unwrap();
    for name in [".mirrorstats-x", "E1-x-s1-r1.mcap", "E1-x-s1-r1.parquet", "E1-x-s1-r2.mcap"] {
        fs::write(parts.join(name), "").unwrap();
    }
    let names = || {
        let mut names: Vec<_> = fs::read_dir(&parts).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let next = FolderLock::take(folder.path()).unwrap();
    assert_eq!(names(), ["E1-x-s1-r1.mcap", "E1-x-s1-r1.parquet"], "a part is an episode");
    drop(next);
    assert_eq!(names().len(), 2);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "the folder of parts");
}
