//! Single flipped bits of traces as this program writes them: each is refused, or changes nothing.

use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use mirrorstats::trace::diagnostic::Severity;
use mirrorstats::trace::episode::Episode;
use mirrorstats::trace::inputs::Input;
use mirrorstats::trace::merge;
use mirrorstats::trace::validate::validate;
use mirrorstats::trace::write::{OptionalColumns, TraceEncoder, TraceMetadata};

use super::checksums::{draws, scores};
use super::{encoded, episodes, trace};
use crate::harness::files::fixture;

/// What became of some flips.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    flips: usize,
    /// `score` refused the file.
    refused: usize,
    /// Other scores, and no word of it.
    scores_changed: usize,
    /// Other values, and `validate` found nothing.
    values_changed: usize,
}

/// A trace whose bits are flipped one at a time.
struct Victim {
    whole: Vec<u8>,
    path: PathBuf,
    scores: Vec<u8>,
    values: Vec<Episode>,
    _folder: tempfile::TempDir,
}

impl Victim {
    fn new(whole: Vec<u8>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trace.parquet");
        fs::write(&path, &whole).unwrap();
        let (scores, values) = (scores(&path).unwrap(), values(&path).unwrap());
        assert!(is_valid(&path));
        Self { whole, path, scores, values, _folder: folder }
    }

    fn bits(&self) -> usize {
        self.whole.len() * 8
    }

    fn flip(&self, bits: impl IntoIterator<Item = usize>) -> Counts {
        let mut counts = Counts::default();
        let mut bytes = self.whole.clone();
        for bit in bits {
            bytes[bit / 8] ^= 1 << (bit % 8);
            fs::write(&self.path, &bytes).unwrap();
            counts.flips += 1;
            match scores(&self.path) {
                Err(_) => counts.refused += 1,
                Ok(scores) => counts.scores_changed += usize::from(scores != self.scores),
            }
            let has_changed = || values(&self.path).is_none_or(|values| values != self.values);
            counts.values_changed += usize::from(is_valid(&self.path) && has_changed());
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        counts
    }
}

fn is_valid(path: &Path) -> bool {
    let validation = validate(&[Input::new(path)], None, NonZeroUsize::MIN).unwrap();
    validation.count(Severity::Error) == 0
}

fn values(path: &Path) -> Option<Vec<Episode>> {
    merge::read(path).ok()?.iter().map(|rows| rows.episode().ok()).collect()
}

fn recorded() -> Vec<u8> {
    fs::read(fixture("recorded/E1-guesser.parquet")).unwrap()
}

/// The trace as versions before checksums wrote it.
fn unchecked() -> Vec<u8> {
    let columns = OptionalColumns::used_by(&episodes());
    encoded(
        TraceEncoder::without_checksums(Vec::new(), &TraceMetadata { recording: None, columns }).unwrap(),
        &episodes(),
    )
}

#[test]
fn a_flipped_bit_is_refused_or_changes_nothing() {
    for whole in [trace(), recorded()] {
        let victim = Victim::new(whole);
        let counts = victim.flip(draws(600, victim.bits()));
        assert_eq!((counts.scores_changed, counts.values_changed), (0, 0), "{counts:?}");
        assert!(counts.refused > counts.flips / 2, "{counts:?}");
    }
}

/// The same flips do change scores and values where there are no checksums: the test can fail.
#[test]
fn without_checksums_flipped_bits_pass() {
    let victim = Victim::new(unchecked());
    let counts = victim.flip(draws(600, victim.bits()));
    assert!(counts.scores_changed > 0 && counts.values_changed > 0, "{counts:?}");
}

#[test]
#[ignore = "every bit of two traces; make soak"]
fn soak_every_flipped_bit_is_refused_or_changes_nothing() {
    for whole in [trace(), recorded()] {
        let victim = Victim::new(whole);
        let counts = victim.flip(0..victim.bits());
        println!("{counts:?}");
        assert_eq!((counts.scores_changed, counts.values_changed), (0, 0), "{counts:?}");
    }
}
