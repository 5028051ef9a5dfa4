//! Compression and its reverse, with the codecs' own crates.

use std::io::{Read as _, Write as _};

use parquet::basic::Compression;

/// The most bytes that one of our pages has.
const MOST: u64 = 1 << 20;

/// Compresses the bytes.
pub fn compress(codec: Compression, data: &[u8]) -> Vec<u8> {
    match codec {
        Compression::SNAPPY => snap::raw::Encoder::new().compress_vec(data).expect("a page is small"),
        Compression::ZSTD(_) => zstd::bulk::compress(data, 1).expect("zstd takes any bytes"),
        Compression::GZIP(_) => {
            let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
            out.write_all(data).and_then(|()| out.finish()).expect("memory takes any bytes")
        }
        _ => data.to_vec(),
    }
}

/// Decompresses a page from a sound writer.
pub fn decompress(codec: Compression, data: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    match codec {
        Compression::SNAPPY => out = snap::raw::Decoder::new().decompress_vec(data).expect("a sound page"),
        Compression::ZSTD(_) => {
            zstd::Decoder::new(data)
                .and_then(|of| of.take(MOST).read_to_end(&mut out))
                .map(drop)
                .expect("a sound page");
        }
        Compression::GZIP(_) => {
            flate2::read::GzDecoder::new(data).take(MOST).read_to_end(&mut out).map(drop).expect("a sound page");
        }
        _ => out.extend(data),
    }
    out
}
