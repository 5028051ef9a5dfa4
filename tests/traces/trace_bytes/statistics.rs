//! Files without checksums: values compared with the footer's statistics, and copies with checksums.

use std::fs;
use std::num::NonZeroUsize;
use std::path::Path;

use mirrorstats_trace::diagnostic::{Code, Finding, Severity};
use mirrorstats_trace::footers::checksums::Checksums;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceFile;
use mirrorstats_trace::validate::validate;
use parquet::basic::Compression;
use parquet::file::properties::{EnabledStatistics, WriterProperties};

use super::{stored, trace};
use crate::harness::program::run;
use crate::harness::traces::{episodes, rows};

fn plain(folder: &Path, statistics: EnabledStatistics) -> Vec<u8> {
    let properties = WriterProperties::builder().set_dictionary_enabled(false).set_statistics_enabled(statistics);
    stored(folder, properties.set_compression(Compression::UNCOMPRESSED))
}

fn faults(path: &Path) -> Vec<Finding> {
    let found = validate(&[Input::new(path)], None, NonZeroUsize::MIN).unwrap().findings;
    found.into_iter().filter(|finding| finding.severity == Severity::Error).collect()
}

/// The file with the last value of `mirror_px`, which is 6, replaced.
fn with_last(whole: &[u8], value: i32) -> Vec<u8> {
    let bytes = |last: i32| (0..6).chain([last]).flat_map(i32::to_le_bytes).collect::<Vec<_>>();
    let at = whole.windows(28).position(|window| window == bytes(6)).unwrap();
    [&whole[..at], &bytes(value), &whole[at + 28..]].concat()
}

#[test]
fn a_value_that_the_statistics_do_not_allow_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    let whole = plain(folder.path(), EnabledStatistics::Chunk);
    fs::write(&path, with_last(&whole, 6)).unwrap();
    assert_eq!(faults(&path), []);
    // Values outside the range, and one within it that leaves the maximum unused.
    for value in [7, 1 << 20, -1, 4] {
        fs::write(&path, with_last(&whole, value)).unwrap();
        let found = faults(&path);
        let is_told = |finding: &Finding| {
            finding.code == Code::CorruptData
                && finding.column.as_deref() == Some("mirror_px")
                && finding.expected.contains("as in the footer's statistics")
        };
        assert!(found.iter().any(is_told), "{value}: {found:?}");
        // A command that does not read the column still works.
        run(folder.path(), &["score", "a.parquet"]).done();
        run(folder.path(), &["score", "a.parquet", "--where", "any(mirror_px > 100)"]).refused();
    }
    // Without statistics the change is not detected.
    fs::write(&path, with_last(&plain(folder.path(), EnabledStatistics::None), 4)).unwrap();
    assert_eq!(faults(&path), []);
}

#[test]
fn a_sealed_copy_has_the_same_rows_and_checksums() {
    let folder = tempfile::tempdir().unwrap();
    let (at, path) = (folder.path(), folder.path().join("a.parquet"));
    for whole in [plain(at, EnabledStatistics::Chunk), plain(at, EnabledStatistics::None), trace()] {
        fs::write(&path, &whole).unwrap();
        let answer = run(at, &["trace", "seal", "a.parquet", "sealed.parquet", "--json"]).json();
        assert_eq!((&answer["episodes"], &answer["steps"]), (&serde_json::json!(3), &serde_json::json!(18)));
        let sealed = at.join("sealed.parquet");
        assert_eq!(TraceFile::open(&Input::new(&sealed)).unwrap().checksums(), Checksums::Present);
        assert_eq!((rows(&sealed), episodes(&sealed)), (rows(&path), episodes(&path)));
        let scores = |name: &str| run(at, &["score", name]).done();
        assert_eq!(scores("sealed.parquet"), scores("a.parquet"));
        // A change that was not detected before.
        fs::write(&sealed, with_byte_changed(&fs::read(&sealed).unwrap())).unwrap();
        assert!(!faults(&sealed).is_empty());
    }
    let before = fs::read(&path).unwrap();
    assert!(run(at, &["trace", "seal", "a.parquet", "a.parquet"]).refused().contains("the trace itself"));
    assert!(fs::read(&path).unwrap() == before);
    fs::write(&path, with_last(&plain(at, EnabledStatistics::Chunk), 9)).unwrap();
    assert!(run(at, &["trace", "seal", "a.parquet", "new.parquet"]).refused().contains("statistics"));
    assert!(!at.join("new.parquet").exists());
}

fn with_byte_changed(whole: &[u8]) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    bytes[200] ^= 4;
    bytes
}
