//! Members of a zip archive: stored, deflated, or method 93 (zstd with any number of frames). The last of several
//! members with one name counts.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, BufReader};

use serde::de::DeserializeOwned;
use zip::{CompressionMethod, ZipArchive};

use super::json;
use exact::budget::Limit;
use exact::input;

/// A sample with all its events.
const LARGEST: Limit = Limit::new("bytes of a member of a log", 2 << 30);

pub(super) struct EvalArchive {
    zip: ZipArchive<BufReader<File>>,
    names: BTreeSet<String>,
}

impl EvalArchive {
    pub(super) fn open(file: File) -> Result<Self, String> {
        let zip = ZipArchive::new(BufReader::new(file)).map_err(|error| error.to_string())?;
        let names = zip.file_names().map(str::to_owned).collect();
        Ok(Self { zip, names })
    }

    pub(super) const fn names(&self) -> &BTreeSet<String> {
        &self.names
    }

    /// Parses a member; the error says why it cannot be read.
    pub(super) fn json<T: DeserializeOwned>(&mut self, name: &str) -> Result<T, String> {
        let bytes = self.bytes(name).map_err(|error| error.to_string())?;
        json::from_slice(&bytes).map_err(|error| error.to_string())
    }

    fn bytes(&mut self, name: &str) -> io::Result<Vec<u8>> {
        let index = self.zip.index_for_name(name).ok_or(io::ErrorKind::NotFound)?;
        let raw = self.zip.by_index_raw(index)?;
        if raw.compression() != CompressionMethod::ZSTD {
            drop(raw);
            return input::bytes_of(self.zip.by_index(index)?, LARGEST);
        }
        let crc = raw.crc32();
        let bytes = input::bytes_of(zstd::Decoder::new(raw)?, LARGEST)?;
        let found = crc32fast::hash(&bytes);
        if found == crc {
            Ok(bytes)
        } else {
            Err(io::Error::other(format!("checksum {found:08x} instead of {crc:08x}")))
        }
    }
}
