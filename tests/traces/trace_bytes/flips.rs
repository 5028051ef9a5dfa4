//! Traces as this program writes them, with single flipped bits: each flip is refused or changes nothing.

use std::fs;
use std::num::NonZeroUsize;
use std::ops::Range;
use std::path::{Path, PathBuf};

use mirrorstats_trace::diagnostic::Severity;
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows;
use mirrorstats_trace::validate::validate;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_writer::ArrowWriterOptions;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;

use super::checksums::{draws, scores};
use super::trace;
use crate::harness::files::fixture;
use crate::harness::traces;

/// The outcomes of some flips.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    flips: usize,
    /// `score` refused the file.
    refused: usize,
    /// Other scores without an error.
    scores_changed: usize,
    /// Other values although `validate` found nothing.
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
        self.flip_beside(None, bits)
    }

    /// Flips bits one at a time while bit `first` stays flipped.
    fn flip_beside(&self, first: Option<usize>, bits: impl IntoIterator<Item = usize>) -> Counts {
        let mut counts = Counts::default();
        let mut bytes = self.whole.clone();
        if let Some(bit) = first {
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        for bit in bits {
            bytes[bit / 8] ^= 1 << (bit % 8);
            self.read(&bytes, &mut counts);
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        counts
    }

    /// Zeros ranges of bytes, one at a time.
    fn zero(&self, ranges: impl IntoIterator<Item = Range<usize>>) -> Counts {
        let mut counts = Counts::default();
        for range in ranges {
            let mut bytes = self.whole.clone();
            bytes[range].fill(0);
            if bytes != self.whole {
                self.read(&bytes, &mut counts);
            }
        }
        counts
    }

    fn read(&self, bytes: &[u8], counts: &mut Counts) {
        fs::write(&self.path, bytes).unwrap();
        counts.flips += 1;
        match scores(&self.path) {
            Err(_) => counts.refused += 1,
            Ok(scores) => counts.scores_changed += usize::from(scores != self.scores),
        }
        let has_changed = || values(&self.path).is_none_or(|values| values != self.values);
        counts.values_changed += usize::from(is_valid(&self.path) && has_changed());
    }

    /// The footer's range, without its length.
    fn footer(&self) -> Range<usize> {
        let end = self.whole.len() - 8;
        end - u32::from_le_bytes(*self.whole[end..].first_chunk().unwrap()) as usize..end
    }
}

fn is_valid(path: &Path) -> bool {
    let validation = validate(&[Input::new(path)], None, NonZeroUsize::MIN).unwrap();
    validation.count(Severity::Error) == 0
}

fn values(path: &Path) -> Option<Vec<Episode>> {
    episode_rows::read(path).ok()?.iter().map(|rows| rows.episode().ok()).collect()
}

fn recorded() -> Vec<u8> {
    fs::read(fixture("recorded/E1-guesser.parquet")).unwrap()
}

/// The trace as written by a program without checksums.
fn unchecked() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("trace.parquet");
    fs::write(&path, trace()).unwrap();
    let rows = traces::rows(&path);
    let pair = |key: &str, value: &str| KeyValue::new(key.to_owned(), value.to_owned());
    let pairs = vec![pair("mirrorstats.schema_version", "2"), pair("mirrorstats.writer", "mirrorstats 0.1.0")];
    let properties = WriterProperties::builder()
        .set_key_value_metadata(Some(pairs))
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .build();
    let options = ArrowWriterOptions::new().with_properties(properties).with_skip_arrow_metadata(true);
    let mut writer = ArrowWriter::try_new_with_options(Vec::new(), rows.schema(), options).unwrap();
    writer.write(&rows).unwrap();
    writer.into_inner().unwrap()
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

/// The position of some bytes in a file's footer.
fn place(whole: &[u8], bytes: &[u8]) -> usize {
    whole.windows(bytes.len()).rposition(|window| window == bytes).unwrap()
}

#[test]
fn a_flipped_bit_of_each_byte_of_the_footer_is_refused_or_changes_nothing() {
    let victim = Victim::new(trace());
    let first = victim.footer().start;
    let counts = victim.flip((first..victim.whole.len()).map(|byte| byte * 8 + byte % 8));
    assert_eq!((counts.scores_changed, counts.values_changed), (0, 0), "{counts:?}");
    assert_eq!(counts.refused, counts.flips, "{counts:?}");
}

/// Zeros end the footer where a field begins, and would hide all later keys: checksums, design, palette, origin.
#[test]
fn a_footer_with_zeros_up_to_its_end_is_refused() {
    for whole in [trace(), recorded()] {
        let victim = Victim::new(whole);
        let Range { start, end } = victim.footer();
        // Every place behind the row groups; before it, some.
        let keys = place(&victim.whole, b"mirrorstats.schema_version") - 8;
        let counts = victim.zero((start..keys).step_by(29).chain(keys..end - 1).map(|from| from..end));
        assert_eq!((counts.refused, counts.scores_changed), (counts.flips, 0), "{counts:?}");
        let places: Vec<usize> = draws(400, end - start).map(|place| start + place).collect();
        let counts = victim.zero(places.chunks(2).map(|pair| pair[0].min(pair[1])..pair[0].max(pair[1])));
        assert_eq!((counts.refused, counts.scores_changed), (counts.flips, 0), "{counts:?}");
    }
}

/// A file without checksums is refused too if its footer ends early: a design must not vanish from it.
#[test]
fn an_unsealed_footer_ends_at_its_stated_length() {
    let victim = Victim::new(unchecked());
    let Range { start, end } = victim.footer();
    let counts = victim.zero((start..end - 1).map(|from| from..end));
    assert_eq!((counts.refused, counts.scores_changed), (counts.flips, 0), "{counts:?}");
}

/// The program's name alone decides nothing: if it is damaged, the file is refused, whatever else is damaged.
#[test]
fn a_flipped_bit_of_the_name_of_the_program_switches_no_checksum_off() {
    let victim = Victim::new(trace());
    let by = place(&victim.whole, b"mirrorstats version ");
    let key = place(&victim.whole, b"mirrorstats.checksums");
    // A letter of either, and the type and length of the field before it.
    for byte in [by - 2, by - 1, by, by + 7, by + 19, key, key + 15] {
        let first = byte * 8 + byte % 8;
        let others = draws(60, victim.bits()).filter(|bit| *bit != first).chain([by * 8 + 70, key * 8 + 90]);
        let counts = victim.flip_beside(Some(first), others);
        assert_eq!((counts.scores_changed, counts.values_changed), (0, 0), "byte {byte}: {counts:?}");
        assert_eq!(counts.refused, counts.flips, "byte {byte}: {counts:?}");
    }
}

/// Without checksums the same flips do change scores and values, so the test can fail.
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
