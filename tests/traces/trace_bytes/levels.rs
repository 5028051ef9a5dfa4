//! Levels, keys and counts that contradict each other are refused by both the short cut and the library.

use std::path::Path;

use parquet::basic::Compression;
use parquet::file::properties::{WriterProperties, WriterVersion};

use crate::trace_bytes::pages::{Header, Page, pages, patched, rebuild, with_rows};
use crate::trace_bytes::{read, stored};

/// The form of a file: its page version, and whether it has dictionaries.
#[derive(Clone, Copy, Debug)]
struct Form {
    version: WriterVersion,
    dictionaries: bool,
}

const FORMS: [Form; 4] = [
    Form { version: WriterVersion::PARQUET_1_0, dictionaries: true },
    Form { version: WriterVersion::PARQUET_1_0, dictionaries: false },
    Form { version: WriterVersion::PARQUET_2_0, dictionaries: true },
    Form { version: WriterVersion::PARQUET_2_0, dictionaries: false },
];

fn file(folder: &Path, form: Form) -> Vec<u8> {
    let properties = WriterProperties::builder()
        .set_writer_version(form.version)
        .set_dictionary_enabled(form.dictionaries)
        .set_compression(Compression::UNCOMPRESSED);
    stored(folder, properties)
}

/// The data page of a column.
fn page(file: &[u8], column: &str) -> Page {
    pages(file).into_iter().find(|page| page.column == column && !page.dictionary).unwrap()
}

/// The start of a page's levels; in a page of version 1 they follow their length.
fn levels(form: Form, page: &Page) -> usize {
    page.body + if form.version == WriterVersion::PARQUET_1_0 { 4 } else { 0 }
}

#[test]
fn a_level_above_its_maximum_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for form in FORMS {
        let whole = file(folder.path(), form);
        assert_eq!(read(folder.path(), &whole), Some(18), "{form:?}");
        // Columns without nulls have one run of ones.
        for column in ["episode_id", "t", "action", "mirror_visible", "mirror_px", "cost_usd"] {
            let at = levels(form, &page(&whole, column));
            assert_eq!(whole[at..at + 2], [18 << 1, 1], "{form:?}, {column}");
            for level in [0, 2, 3, 0x80, 192, 255] {
                let refused = read(folder.path(), &patched(&whole, at + 1, level)).is_none();
                assert!(refused, "{form:?}, {column}: a level of {level}");
            }
        }
    }
}

#[test]
fn levels_for_fewer_or_more_rows_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for form in FORMS {
        let whole = file(folder.path(), form);
        for column in ["episode_id", "t", "action", "mirror_visible", "mirror_px", "cost_usd"] {
            let at = levels(form, &page(&whole, column));
            for count in [0, 1, 17, 19, 63] {
                let refused = read(folder.path(), &patched(&whole, at, count << 1)).is_none();
                assert!(refused, "{form:?}, {column}: levels for {count} rows");
            }
        }
    }
}

#[test]
fn keys_beyond_the_dictionary_and_wide_ones_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for form in FORMS.into_iter().filter(|form| form.dictionaries) {
        let whole = file(folder.path(), form);
        for column in ["episode_id", "model", "t", "action"] {
            let width = levels(form, &page(&whole, column)) + 2;
            for other in [33, 40, 255] {
                let refused = read(folder.path(), &patched(&whole, width, other)).is_none();
                assert!(refused, "{form:?}, {column}: keys of {other} bits");
            }
        }
        // `model` has one text, so its keys are one run of zeros, of no or one bit.
        let keys = levels(form, &page(&whole, "model")) + 2;
        let run = whole[keys + 1..].iter().position(|byte| *byte == 18 << 1).unwrap() + keys + 1;
        for (at, byte) in [(run, 17 << 1), (run, 19 << 1), (run, 0x7e)] {
            assert!(read(folder.path(), &patched(&whole, at, byte)).is_none(), "{form:?}: a run of {}", byte >> 1);
        }
        if whole[keys] == 1 {
            for key in [1, 2, 255] {
                assert!(read(folder.path(), &patched(&whole, run + 1, key)).is_none(), "{form:?}: the key {key}");
            }
        }
    }
}

/// A page of version 2 may have repetition levels in a flat column; they must be 0.
#[test]
fn repetition_levels_of_flat_columns_are_zeros() {
    let folder = tempfile::tempdir().unwrap();
    let whole = file(folder.path(), FORMS[2]);
    let with = |levels: &[u8]| {
        rebuild(
            &whole,
            |page, bytes| {
                let (header, body) = bytes.split_at(page.body - page.offset);
                if page.column != "t" || page.dictionary {
                    return bytes.to_vec();
                }
                repeated(header, body, levels)
            },
            |footer| footer,
        )
    };
    assert_eq!(read(folder.path(), &with(&[])), Some(18));
    // A run of 18 numbers of no bits, as some writers wrote it.
    assert_eq!(read(folder.path(), &with(&[18 << 1])), Some(18));
    assert_eq!(read(folder.path(), &with(&[18 << 1, 0])), Some(18));
    for wrong in [&[17 << 1][..], &[19 << 1], &[18 << 1, 1], &[18 << 1, 192], &[255, 255]] {
        assert_eq!(read(folder.path(), &with(wrong)), None, "{wrong:?}");
    }
}

/// An uncompressed page of version 2 with 18 rows, and with repetition levels before its own levels.
fn repeated(header: &[u8], body: &[u8], levels: &[u8]) -> Vec<u8> {
    assert_eq!(header[0], 0x15, "a header starts with its kind");
    let size = body.len() + levels.len();
    let numbers = [3, size, size];
    let mut out = Vec::new();
    for number in numbers {
        int(&mut out, number);
    }
    // Field 8: values, nulls, rows, the encoding of keys, the lengths of definition and repetition levels.
    out.push(0x5c);
    for number in [18, 0, 18, 8, 2, levels.len()] {
        int(&mut out, number);
    }
    // The page is not compressed.
    out.extend([0x12, 0, 0]);
    out.extend(levels);
    out.extend(body);
    out
}

fn int(out: &mut Vec<u8>, number: usize) {
    let zigzag = number * 2;
    out.push(0x15);
    if zigzag >= 0x80 {
        out.push(u8::try_from(zigzag & 0x7f).unwrap() | 0x80);
    }
    out.push(u8::try_from(if zigzag >= 0x80 { zigzag >> 7 } else { zigzag }).unwrap());
}

#[test]
fn counts_in_headers_that_contradict_their_pages_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (form, column) in [(FORMS[0], "t"), (FORMS[0], "action"), (FORMS[1], "t"), (FORMS[1], "episode_id")] {
        let whole = file(folder.path(), form);
        let encoding = if form.dictionaries { 8 } else { 0 };
        let with = |change: &dyn Fn(&mut Header)| {
            rebuild(
                &whole,
                |page, bytes| {
                    let body = &bytes[page.body - page.offset..];
                    if page.column != column || page.dictionary {
                        return bytes.to_vec();
                    }
                    let size = i64::try_from(body.len()).unwrap();
                    let mut header = Header { kind: 0, whole: size, stored: size, values: 18, encoding };
                    change(&mut header);
                    [header.bytes(&[]), body.to_vec()].concat()
                },
                |footer| footer,
            )
        };
        assert_eq!(read(folder.path(), &with(&|_| ())), Some(18), "{form:?}, {column}");
        for number in [0, 1, 17, 19, 1 << 20, i64::from(i32::MAX), -1, i64::from(i32::MIN), 1 << 40] {
            let refused = |change: &dyn Fn(&mut Header), what: &str| {
                assert_eq!(read(folder.path(), &with(change)), None, "{form:?}, {column}: {number} {what}");
            };
            refused(&|header| header.values = number, "values");
            let page = page(&whole, column);
            if usize::try_from(number) != Ok(page.end - page.body) {
                refused(&|header| header.whole = number, "bytes");
                refused(&|header| header.stored = number, "stored bytes");
            }
        }
    }
}

#[test]
fn counts_in_the_footer_that_contradict_the_pages_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for form in FORMS {
        let whole = file(folder.path(), form);
        let with = |rows: i64| rebuild(&whole, |_, bytes| bytes.to_vec(), |footer| with_rows(&footer, rows));
        assert_eq!(read(folder.path(), &with(18)), Some(18), "{form:?}");
        for rows in [0, 1, 17, 19, 1 << 20, 1 << 40, i64::MAX, -1, i64::MIN] {
            assert_eq!(read(folder.path(), &with(rows)), None, "{form:?}: {rows} rows");
        }
    }
}
