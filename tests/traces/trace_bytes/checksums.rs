//! Traces with page checksums: a flipped bit is refused, or changes no score.

use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use mirrorstats_score::format::{self, Format};
use mirrorstats_score::score_traces::{self, Request};
use mirrorstats_trace::diagnostic::{Code, Finding};
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::read::verify::verify_pages;

use crate::harness::files;
use crate::harness::program::program;
use crate::trace_bytes::pages::{Page, pages, told};

const FILES: [&str; 3] = ["v1-snappy.parquet", "v1-none.parquet", "v2-zstd.parquet"];

fn fixture(name: &str) -> Vec<u8> {
    fs::read(files::fixture("checksums").join(name)).unwrap()
}

/// The episode table of a file as CSV, if the file can be read.
pub(super) fn scores(path: &Path) -> Result<Vec<u8>, String> {
    let traces = TraceSet::open(&[Input::new(path)]).map_err(|error| error.to_string())?;
    let definitions = score_traces::definitions(&traces, &Request::of("paper")).map_err(|error| error.to_string())?;
    let table =
        score_traces::score(&traces, &definitions, &[], NonZeroUsize::MIN).map_err(|error| error.to_string())?;
    let mut bytes = Vec::new();
    format::write(&table, Format::Csv, &mut bytes).unwrap();
    Ok(bytes)
}

/// Verifies all pages of a file.
fn verified(path: &Path) -> Result<(), Box<Finding>> {
    let traces = TraceSet::open(&[Input::new(path)]).unwrap();
    match verify_pages(&traces) {
        Ok(()) => Ok(()),
        Err(TraceError::Finding { first, .. }) => Err(first),
        Err(other) => panic!("{other}"),
    }
}

/// Pseudo-random numbers, the same in every run.
pub(super) fn draws(count: usize, below: usize) -> impl Iterator<Item = usize> {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    (0..count).map(move |_| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(state >> 33).unwrap() % below
    })
}

struct Flipped {
    page: Page,
    path: PathBuf,
}

/// Flips bits in the part of each page that `part` selects, and calls `check` with each file and the sound scores.
fn flip(name: &str, count: usize, part: fn(&Page) -> (usize, usize), mut check: impl FnMut(&Flipped, &[u8])) {
    let folder = tempfile::tempdir().unwrap();
    let (whole, path) = (fixture(name), folder.path().join("flipped.parquet"));
    fs::write(&path, &whole).unwrap();
    verified(&path).unwrap();
    let sound = scores(&path).unwrap();
    let places: Vec<(usize, Page)> =
        pages(&whole).iter().flat_map(|page| (part(page).0..part(page).1).map(|at| (at, page.clone()))).collect();
    for draw in draws(count, places.len() * 8) {
        let (at, page) = places[draw / 8].clone();
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << (draw % 8);
        fs::write(&path, bytes).unwrap();
        check(&Flipped { page, path: path.clone() }, &sound);
    }
}

#[test]
fn a_flipped_bit_of_a_page_is_refused_or_not_read() {
    let mut refused = 0;
    for name in FILES {
        flip(
            name,
            300,
            |page| (page.body, page.end),
            |flipped, sound| {
                let finding = verified(&flipped.path).unwrap_err();
                assert_eq!(finding.code, Code::CorruptData);
                assert_eq!(
                    (finding.row_group, finding.column.as_ref()),
                    (Some(flipped.page.row_group), Some(&flipped.page.column))
                );
                let place = format!("in the page at byte {}", flipped.page.offset);
                assert!(finding.expected.ends_with(&place) && finding.expected.contains("CRC-32"), "{finding}");
                match scores(&flipped.path) {
                    Ok(scores) => assert!(scores == sound, "{name}: other scores, {:?}", flipped.page),
                    Err(error) => {
                        refused += 1;
                        assert!(error.contains("CRC-32") && error.contains(&place), "{error}");
                    }
                }
            },
        );
    }
    assert!(refused > 300, "{refused}");
}

/// The checksum does not cover headers; their contents are checked against the footer and the page.
#[test]
fn a_flipped_bit_of_a_header_is_refused_or_changes_no_score() {
    let mut refused = 0;
    for name in FILES {
        flip(
            name,
            400,
            |page| (page.offset, page.body),
            |flipped, sound| match scores(&flipped.path) {
                Ok(scores) => assert!(scores == sound, "{name}: other scores, {:?}", flipped.page),
                Err(_) => refused += 1,
            },
        );
    }
    assert!(refused > 100, "{refused}");
}

#[test]
fn every_reader_finds_every_page_with_a_wrong_checksum() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flipped.parquet");
    for name in FILES {
        let whole = fixture(name);
        // The dictionary of a column without values is empty.
        for page in pages(&whole).into_iter().filter(|page| page.body < page.end) {
            let mut bytes = whole.clone();
            bytes[page.body] ^= 1;
            fs::write(&path, bytes).unwrap();
            let finding = verified(&path).unwrap_err();
            assert_eq!(finding.column.as_ref(), Some(&page.column));
            let merged = episode_rows::read(&path).unwrap_err().to_string();
            assert!(merged.contains("CRC-32") && merged.contains(&page.column), "{name}, {page:?}: {merged}");
            if mirrorstats_trace::schema::column(&page.column).is_none() {
                // A column outside the schema, which `validate` does not read.
                assert_eq!(page.column, "description");
                continue;
            }
            let output = program(folder.path()).args(["trace", "validate"]).arg(&path).output().unwrap();
            let told = told(&output);
            assert_eq!(output.status.code(), Some(1), "{name}, {page:?}: {told}");
            assert!(told.contains("CRC-32") && told.contains(&format!("byte {}", page.offset)), "{told}");
        }
    }
}

#[cfg(feature = "polars")]
#[test]
fn polars_is_given_verified_pages() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flipped.parquet");
    let mut bytes = fixture(FILES[0]);
    let page = pages(&bytes).into_iter().find(|page| page.column == "cost_usd").unwrap();
    let query = |path: &Path| {
        program(folder.path()).args(["query", "SELECT sum(cost_usd) FROM steps"]).arg(path).output().unwrap()
    };
    fs::write(&path, &bytes).unwrap();
    assert!(query(&path).status.success());
    bytes[page.end - 1] ^= 0x10;
    fs::write(&path, &bytes).unwrap();
    let output = query(&path);
    assert!(!output.status.success() && told(&output).contains("CRC-32"), "{}", told(&output));
}
