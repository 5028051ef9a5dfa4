//! Texts that are valid UTF-8 together but not individually.

use mirrorstats_trace::episodes::episode::{Episode, Extra, Step};
use parquet::basic::{Compression, Encoding};
use parquet::file::properties::{WriterProperties, WriterVersion};

use crate::harness::traces;
use crate::trace_bytes::{read, stored_as, trace_of};

/// A character split between two texts. The Parquet library checks all bytes of a page at once and accepts them.
#[test]
fn a_character_in_two_halves_is_refused() {
    let step =
        |text: &str| Step { extra: Extra { reasoning: Some(text.to_owned()), ..Extra::default() }, ..Step::default() };
    let episode = Episode { steps: vec![step("these are"), step("two texts")], ..traces::episode("e", Vec::new()) };
    let (trace, folder) = (trace_of(&[episode]), tempfile::tempdir().unwrap());
    for version in [WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0] {
        for encoding in
            [None, Some(Encoding::PLAIN), Some(Encoding::DELTA_LENGTH_BYTE_ARRAY), Some(Encoding::DELTA_BYTE_ARRAY)]
        {
            let properties = WriterProperties::builder()
                .set_writer_version(version)
                .set_compression(Compression::UNCOMPRESSED)
                .set_dictionary_enabled(encoding.is_none())
                .set_column_encoding("reasoning".into(), encoding.unwrap_or(Encoding::PLAIN));
            let whole = stored_as(folder.path(), &trace, properties);
            assert_eq!(read(folder.path(), &whole), Some(2), "{version:?}, {encoding:?}");
            let place = |text: &[u8]| whole.windows(text.len()).position(|bytes| bytes == text).unwrap();
            let mut halves = whole.clone();
            halves[place(b"these are") + 8] = 0xc3;
            halves[place(b"two texts")] = 0xa9;
            assert_eq!(read(folder.path(), &halves), None, "{version:?}, {encoding:?}");
        }
    }
}
