//! Files that declare more than their bytes hold are refused soon, in little memory, with the reason.
//!
//! The operating system enforces the limits. A child that exceeds them is killed by a signal or cannot start threads,
//! which changes its exit code.

use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, ListArray, RecordBatch, StructArray};
use arrow::datatypes::Float64Type;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::{WriterProperties, WriterVersion};

use crate::harness::program::limited;
use crate::trace_bytes::pages::{Header, Page, pages, rebuild, told, with_rows};
use crate::trace_bytes::stored;

/// Processor time in seconds, and address space in KiB.
const SECONDS: u32 = 20;
const MEMORY: u32 = 512 << 10;

/// Runs the program on a file within the limits.
fn run(arguments: &[&str], file: &Path) -> (Option<i32>, String) {
    let mut command = limited(file.parent().unwrap(), &format!("ulimit -t {SECONDS} && ulimit -v {MEMORY}"));
    // Otherwise each thread's arena would reserve memory that is never used.
    let output = command.args(arguments).arg(file).env("MALLOC_ARENA_MAX", "1").output().unwrap();
    (output.status.code(), told(&output))
}

/// Checks that every command that reads traces refuses the file with these words.
fn refused(name: &str, bytes: &[u8], said: &str) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hostile.parquet");
    std::fs::write(&path, bytes).unwrap();
    let table = folder.path().join("scores.csv");
    let table = table.to_str().unwrap();
    for arguments in [
        &["trace", "validate", "--threads", "1"][..],
        &["trace", "info", "--threads", "1"],
        &["score", "--threads", "1", "-o", table],
    ] {
        let (code, told) = run(arguments, &path);
        assert!(matches!(code, Some(1 | 2)), "{name}, {}: {code:?}, {told}", arguments[0]);
        assert!(told.contains(said), "{name}, {}: {told}", arguments[0]);
    }
}

fn file(folder: &Path, compression: Compression) -> Vec<u8> {
    let version = WriterVersion::PARQUET_1_0;
    stored(folder, WriterProperties::builder().set_writer_version(version).set_compression(compression))
}

/// Replaces each data page of `t`, or its dictionary.
fn with_page(whole: &[u8], dictionary: bool, make: impl Fn(&Page, &[u8]) -> Vec<u8>) -> Vec<u8> {
    let change = |page: &Page, bytes: &[u8]| {
        if page.column == "t" && page.dictionary == dictionary {
            make(page, &bytes[page.body - page.offset..])
        } else {
            bytes.to_vec()
        }
    };
    rebuild(whole, change, |footer| footer)
}

/// A field unknown to Parquet: a list of 2^31 - 1 elements of a type.
fn huge(element: u8) -> Vec<u8> {
    // The field's type, list, and its full number, 20; then the elements' type and their number.
    vec![0x09, 40, 0xf0 | element, 0xff, 0xff, 0xff, 0xff, 0x07]
}

#[test]
fn a_sound_file_is_read_within_the_limits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sound.parquet");
    let whole = file(folder.path(), Compression::UNCOMPRESSED);
    std::fs::write(
        &path,
        with_page(&whole, false, |_, body| {
            header(body, 8).bytes(&[]).into_iter().chain(body.iter().copied()).collect()
        }),
    )
    .unwrap();
    let table = folder.path().join("scores.csv");
    for arguments in [&["trace", "validate"][..], &["trace", "info"], &["score", "-o", table.to_str().unwrap()]] {
        let (code, told) = run(arguments, &path);
        assert_eq!(code, Some(0), "{}: {told}", arguments[0]);
    }
}

fn header(body: &[u8], encoding: i64) -> Header {
    let size = i64::try_from(body.len()).unwrap();
    Header { kind: 0, whole: size, stored: size, values: 18, encoding }
}

#[test]
fn lists_of_page_headers_are_bounded_by_their_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let whole = file(folder.path(), Compression::UNCOMPRESSED);
    // Truth values, bytes, doubles, texts, lists, structures.
    for element in [1, 2, 3, 7, 8, 9, 12, 13] {
        let bytes = with_page(&whole, false, |_, body| [header(body, 8).bytes(&huge(element)), body.to_vec()].concat());
        refused(&format!("a list of {element}"), &bytes, "corrupt-data");
    }
    let map = [&[0x0b, 40, 0xff, 0xff, 0xff, 0xff, 0x07, 0x77][..]].concat();
    let bytes = with_page(&whole, false, |_, body| [header(body, 8).bytes(&map), body.to_vec()].concat());
    refused("a map", &bytes, "corrupt-data");
}

#[test]
fn lists_of_footers_are_bounded_by_their_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let whole = file(folder.path(), Compression::UNCOMPRESSED);
    let length = usize::try_from(u32::from_le_bytes(whole[whole.len() - 8..][..4].try_into().unwrap())).unwrap();
    for element in [1, 2, 3, 7, 8, 9, 12, 13] {
        let mut bytes = whole[..whole.len() - 9].to_vec();
        for _ in 0..50 {
            bytes.extend(huge(element));
        }
        bytes.push(0);
        bytes.extend(u32::try_from(length + 50 * huge(element).len()).unwrap().to_le_bytes());
        bytes.extend(b"PAR1");
        refused(&format!("a list of {element}"), &bytes, "corrupt-footer");
    }
}

#[test]
fn sizes_that_no_codec_gives_are_refused_before_memory_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let zstd = Compression::ZSTD(ZstdLevel::default());
    for codec in [Compression::UNCOMPRESSED, Compression::SNAPPY, Compression::LZ4_RAW, zstd] {
        let whole = file(folder.path(), codec);
        let data = with_page(&whole, false, |_, body| {
            let header = Header { whole: i64::from(i32::MAX), ..header(body, 8) };
            [header.bytes(&[]), body.to_vec()].concat()
        });
        refused(&format!("{codec:?}, data"), &data, "corrupt-data");
        let dictionary = with_page(&whole, true, |_, body| {
            let header = Header { kind: 2, whole: i64::from(i32::MAX), values: 7, ..header(body, 0) };
            [header.bytes(&[]), body.to_vec()].concat()
        });
        refused(&format!("{codec:?}, dictionary"), &dictionary, "corrupt-data");
    }
}

#[test]
fn counts_larger_than_the_bytes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let whole = file(folder.path(), Compression::UNCOMPRESSED);
    let most = i64::from(i32::MAX);
    let dictionary = with_page(&whole, true, |_, body| {
        let header = Header { kind: 2, values: most, ..header(body, 0) };
        [header.bytes(&[]), body.to_vec()].concat()
    });
    refused("keys", &dictionary, "corrupt-data");
    let values = with_page(&whole, false, |_, body| {
        [Header { values: most, ..header(body, 8) }.bytes(&[]), body.to_vec()].concat()
    });
    refused("values", &values, "corrupt-data");
    for rows in [most, 1 << 40, i64::MAX, -1] {
        let bytes = rebuild(&whole, |_, bytes| bytes.to_vec(), |footer| with_rows(&footer, rows));
        refused(&format!("{rows} rows"), &bytes, "corrupt-footer");
    }
}

/// A few bytes with levels and keys for 2^31 - 1 rows, and a matching footer: consistent, but the rows do not exist.
#[test]
fn runs_of_two_thousand_million_rows_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let whole = file(folder.path(), Compression::UNCOMPRESSED);
    let most = i64::from(i32::MAX);
    let run = |value: u8| vec![0xfe, 0xff, 0xff, 0xff, 0x0f, value];
    let body = [&6_u32.to_le_bytes()[..], &run(1), &[1], &run(0)].concat();
    let all = |page: &Page, bytes: &[u8]| {
        if page.dictionary {
            return bytes.to_vec();
        }
        [Header { values: most, ..header(&body, 8) }.bytes(&[]), body.clone()].concat()
    };
    refused("everywhere", &rebuild(&whole, all, |footer| with_rows(&footer, most)), "corrupt-footer");
    // The footer has the actual 18 rows.
    let one = with_page(&whole, false, |_, _| [header(&body, 8).bytes(&[]), body.clone()].concat());
    refused("in a page of 18", &one, "corrupt-data");
    assert!(pages(&whole).iter().any(|page| page.dictionary), "there are dictionaries");
}

#[test]
fn columns_of_the_same_bytes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let whole = file(folder.path(), Compression::UNCOMPRESSED);
    let bytes = rebuild(
        &whole,
        |_, bytes| bytes.to_vec(),
        |footer| {
            let group = footer.row_group(0).clone();
            let mut chunks = group.columns().to_vec();
            let (run, seed) = (4, 3);
            assert_eq!(
                (chunks[seed].column_path().string(), chunks[run].column_path().string()),
                ("seed".into(), "run".into())
            );
            let (at, length) = (chunks[seed].byte_range().0, chunks[seed].compressed_size());
            let chunk = chunks[run].clone().into_builder().set_total_compressed_size(length);
            let chunk = chunk.set_dictionary_page_offset(Some(i64::try_from(at).unwrap()));
            chunks[run] = chunk.build().unwrap();
            let group = group.into_builder().set_column_metadata(chunks).build().unwrap();
            footer.into_builder().set_row_groups(vec![group]).build()
        },
    );
    refused("two columns", &bytes, "corrupt-footer");
}

#[test]
fn a_trace_with_a_nested_column_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let whole = bytes::Bytes::from(file(folder.path(), Compression::UNCOMPRESSED));
    let rows = ParquetRecordBatchReaderBuilder::try_new(whole).unwrap().build().unwrap().next().unwrap().unwrap();
    let numbers = ListArray::from_iter_primitive::<Float64Type, _, _>((0..rows.num_rows()).map(|_| Some([Some(0.5)])));
    let parts = StructArray::from(rows.slice(0, rows.num_rows()));
    for nested in [Arc::new(numbers) as ArrayRef, Arc::new(parts)] {
        let named = rows.schema().fields().iter().map(|field| field.name().clone()).collect::<Vec<_>>();
        let mut columns: Vec<_> = named.into_iter().zip(rows.columns().iter().cloned()).collect();
        columns.push(("extra".to_owned(), nested));
        let rows =
            RecordBatch::try_from_iter_with_nullable(columns.into_iter().map(|(name, column)| (name, column, true)));
        let rows = rows.unwrap();
        let mut writer = ArrowWriter::try_new(Vec::new(), rows.schema(), None).unwrap();
        writer.write(&rows).unwrap();
        let bytes = writer.into_inner().unwrap();
        refused("nested", &bytes, "column `extra`");
        refused("nested", &bytes, "found a list, a struct or a map");
    }
}
