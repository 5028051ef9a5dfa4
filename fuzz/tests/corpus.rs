//! Runs the committed corpora and their seeds through the functions that libFuzzer calls.

use std::fs;
use std::path::Path;

use mirrorstats_fuzz::{TARGETS, seeds};

fn corpus() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus")
}

#[test]
fn every_input_of_every_corpus_keeps_its_properties() {
    for (name, run) in TARGETS {
        let mut count = 0;
        for file in fs::read_dir(corpus().join(name)).unwrap_or_else(|error| panic!("{name}: {error}")) {
            let path = file.unwrap().path();
            let bytes = fs::read(&path).unwrap();
            let result = std::panic::catch_unwind(|| run(&bytes));
            assert!(result.is_ok(), "replay: cargo run -p mirrorstats-fuzz -- run {name} {}", path.display());
            count += 1;
        }
        assert!(count > 0, "{name} has no corpus");
    }
}

#[test]
fn every_seed_keeps_its_properties() {
    let folder = tempfile::tempdir().unwrap();
    seeds::write(folder.path()).unwrap();
}

#[test]
fn corpora_are_small_and_of_targets() {
    let mut sum = 0;
    for folder in fs::read_dir(corpus()).unwrap() {
        let folder = folder.unwrap();
        let name = folder.file_name();
        assert!(TARGETS.iter().any(|(known, _)| name == *known), "no target {}", name.display());
        for file in fs::read_dir(folder.path()).unwrap() {
            let bytes = file.unwrap().metadata().unwrap().len();
            assert!(bytes <= 100_000, "an input of {} has {bytes} bytes", name.display());
            sum += bytes;
        }
    }
    assert!(sum < 2_000_000, "the corpora have {sum} bytes");
}
