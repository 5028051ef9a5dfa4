//! Single changes of a bundle: `verify` names the changed file each time, also if the manifest was rewritten to match.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use arrow::array::{Array as _, ArrayRef, AsArray as _, BinaryArray, RecordBatch, StringArray, StructArray};
use arrow::compute::cast;
use arrow::datatypes::DataType;
use std::sync::Arc;
use tempfile::TempDir;

use crate::harness::files::{Contents, contents};
use crate::harness::traces::{rows, write_rows};
use crate::publish::{named, published, rewrite_manifest};

/// Numbers that depend on a seed alone.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: usize) -> usize {
        // SplitMix64.
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        usize::try_from((z ^ (z >> 31)) % end as u64).unwrap()
    }

    fn one_of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }
}

/// Changes one digit of a text file.
fn change_a_digit(path: &Path, numbers: &mut Numbers) {
    let mut bytes = fs::read(path).unwrap();
    let digits: Vec<usize> = (0..bytes.len()).filter(|at| bytes[*at].is_ascii_digit()).collect();
    let at = if digits.is_empty() { numbers.below(bytes.len()) } else { *numbers.one_of(&digits) };
    bytes[at] = if bytes[at] == b'7' { b'3' } else { b'7' };
    fs::write(path, bytes).unwrap();
}

fn change_a_byte(path: &Path, numbers: &mut Numbers) {
    let mut bytes = fs::read(path).unwrap();
    let at = numbers.below(bytes.len());
    bytes[at] ^= u8::try_from(1 + numbers.below(255)).unwrap();
    fs::write(path, bytes).unwrap();
}

/// Writes a Parquet file anew with another column, so that no checksum of the file shows it.
fn replace_column(path: &Path, name: &str, change: impl Fn(&ArrayRef) -> ArrayRef) {
    let batch = rows(path);
    let at = batch.schema().index_of(name).unwrap();
    let mut columns = batch.columns().to_vec();
    columns[at] = change(&columns[at]);
    write_rows(path, &[RecordBatch::try_new(batch.schema(), columns).unwrap()], None);
}

/// Replaces a frame by another one, or its picture by one without a pixel.
fn change_a_frame(path: &Path, numbers: &mut Numbers) {
    let row = numbers.below(rows(path).num_rows());
    replace_column(path, "image", |images| {
        let images = images.as_struct();
        let bytes = images.column_by_name("bytes").unwrap().as_binary::<i32>();
        let mut all: Vec<Vec<u8>> = bytes.iter().map(|one| one.unwrap().to_vec()).collect();
        let next = all[(row + 1) % all.len()].clone();
        all[row] = if next == all[row] { next[..next.len() - 1].to_vec() } else { next };
        let bytes: BinaryArray = all.iter().map(|one| Some(one.as_slice())).collect();
        let parts: Vec<ArrayRef> = vec![Arc::new(bytes), images.column(1).clone()];
        Arc::new(StructArray::try_new(images.fields().clone(), parts, None).unwrap())
    });
}

/// Changes an action in a trace.
fn change_an_action(path: &Path, numbers: &mut Numbers) {
    let row = numbers.below(rows(path).num_rows());
    replace_column(path, "action", |actions| {
        let texts = cast(actions, &DataType::Utf8).unwrap();
        let mut all: Vec<Option<String>> = texts.as_string::<i32>().iter().map(|one| one.map(str::to_owned)).collect();
        let is_left = all[row].as_deref() == Some("turn_left");
        all[row] = Some(if is_left { "turn_right" } else { "turn_left" }.to_owned());
        let changed: ArrayRef = Arc::new(StringArray::from(all));
        cast(&changed, actions.data_type()).unwrap()
    });
}

/// Makes one change of a kind; returns the changed file.
fn change(bundle: &Path, original: &Contents, kind: usize, numbers: &mut Numbers) -> String {
    let with = |ending: &str| -> Vec<&String> { original.keys().filter(|name| name.contains(ending)).collect() };
    let all: Vec<&String> = original.keys().filter(|name| *name != "manifest.json").collect();
    let (name, is_rewritten): (String, bool) = match kind {
        0 => ((*numbers.one_of(&all)).clone(), false),
        2 => ((*numbers.one_of(&with(".csv"))).clone(), true),
        3 => ("definitions/mine.toml".to_owned(), true),
        4 => ("frames/E1-guesser.parquet".to_owned(), true),
        5 => ((*numbers.one_of(&with("traces/E"))).clone(), true),
        6 => ((*numbers.one_of(&[with("prompts/"), with("experiments/"), with("world/")].concat())).clone(), true),
        7 => ((*numbers.one_of(&[with("figures/"), with("viewer/data")].concat())).clone(), true),
        8 => ("manifest.json".to_owned(), false),
        _ => ((*numbers.one_of(&all)).clone(), true),
    };
    let path = bundle.join(&name);
    match kind {
        5 if name.contains(".parquet") => change_an_action(&path, numbers),
        0 | 1 | 5 | 8 => change_a_byte(&path, numbers),
        4 => change_a_frame(&path, numbers),
        9 => fs::remove_file(&path).unwrap(),
        _ => change_a_digit(&path, numbers),
    }
    if is_rewritten {
        rewrite_manifest(bundle);
    }
    name
}

const KINDS: usize = 10;

/// Makes changes one by one, each to the original bundle.
fn every_change_is_named(count: u64, frames: &[&str]) {
    let originals: Vec<(TempDir, Contents)> = frames
        .iter()
        .map(|frames| {
            let folder = published(frames);
            let files = contents(&folder.path().join("out"));
            (folder, files)
        })
        .collect();
    let (next, missed) = (AtomicU64::new(0), Mutex::new(BTreeMap::new()));
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= count {
                        break;
                    }
                    let mut numbers = Numbers(seed);
                    let kind = usize::try_from(seed).unwrap() % KINDS;
                    let (_, files) = numbers.one_of(&originals);
                    let folder = tempfile::tempdir().unwrap();
                    let bundle = folder.path().join("out");
                    for (name, bytes) in files {
                        fs::create_dir_all(bundle.join(name).parent().unwrap()).unwrap();
                        fs::write(bundle.join(name), bytes).unwrap();
                    }
                    let name = change(&bundle, files, kind, &mut numbers);
                    if fs::read(bundle.join(&name)).is_ok_and(|bytes| bytes == files[&name]) {
                        continue;
                    }
                    let (code, named) = named(folder.path());
                    if code != 1 || !named.contains(&name) {
                        let told = crate::harness::program::run(folder.path(), &["verify", "out"]);
                        missed.lock().unwrap().insert(seed, (kind, name, code, named, told.stdout));
                    }
                }
            });
        }
    });
    let missed = missed.into_inner().unwrap();
    assert!(missed.is_empty(), "{} of {count} changes were not named: {missed:#?}", missed.len());
}

#[test]
fn single_changes_are_named() {
    every_change_is_named(60, &["all"]);
}

#[test]
#[ignore = "takes minutes: make soak"]
fn soak_a_thousand_single_changes_are_named() {
    every_change_is_named(1000, &["all", "decisive"]);
}

/// A hostile bundle: its settings name files elsewhere.
#[test]
fn no_setting_leads_out_of_the_folder() {
    let folder = published("none");
    let at = folder.path();
    let path = at.join("out/manifest.json");
    let sound = fs::read_to_string(&path).unwrap();
    for (from, to) in [
        ("\"definitions/mine.toml\"", "\"../mine.toml\""),
        ("\"definitions/mine.toml\"", "\"mine.toml\""),
        ("\"style\": \"default\"", "\"style\": \"/etc/passwd\""),
    ] {
        assert!(sound.contains(from), "{sound}");
        fs::write(&path, sound.replacen(from, to, 1)).unwrap();
        rewrite_manifest(&at.join("out"));
        let told = crate::harness::program::run(at, &["verify", "out"]).ends(1).stdout;
        assert!(told.contains("manifest.json: changed") && told.contains("a file of the bundle, found"), "{told}");
    }
}

#[test]
fn a_difference_says_which_cell_it_is_in() {
    let folder = published("all");
    let at = folder.path();
    let path = at.join("out/report/cells.csv");
    let cells = fs::read_to_string(&path).unwrap();
    assert!(cells.contains("E1,guesser,TSA,2,1,1,"), "{cells}");
    fs::write(&path, cells.replace("E1,guesser,TSA,2,1,1,", "E1,guesser,TSA,2,2,1,")).unwrap();
    rewrite_manifest(&at.join("out"));
    let told = crate::harness::program::run(at, &["verify", "out"]).ends(1).stdout;
    let expected = "report/cells.csv: line 2, column `sum` (E1, guesser, TSA): expected 1, published 2\n";
    assert!(told.starts_with(expected), "{told}");
}
