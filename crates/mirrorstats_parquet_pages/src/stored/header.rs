//! Page headers, and their checks against the column.
//!
//! Source: the Parquet format's `parquet.thrift`. A page's checksum does not cover its header, so the header is checked
//! as far as possible.

use parquet::basic::{Compression, Type as Physical};

use crate::thrift::{Compact, Field, ThriftFault, Wire};

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Header {
    pub(crate) length: usize,
    pub(crate) stored: usize,
    pub(crate) whole: usize,
    /// The CRC-32 of the stored bytes.
    pub(crate) checksum: Option<u32>,
    pub(crate) kind: Kind,
    /// Values including nulls; keys of a dictionary.
    pub(crate) values: usize,
    /// Only in version 2 pages; the levels, in bytes, are not compressed.
    nulls: usize,
    rows: usize,
    pub(crate) levels: usize,
    is_plain: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Kind {
    #[default]
    Data,
    Index,
    Dictionary,
    DataV2,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct About {
    pub(crate) codec: Compression,
    pub(crate) physical: Physical,
    /// The size of a `FIXED_LEN_BYTE_ARRAY` value, in bytes.
    pub(crate) width: usize,
    pub(crate) optional: bool,
    pub(crate) rows: usize,
}

impl Header {
    pub(crate) fn parse(data: &[u8]) -> Result<Self, ThriftFault> {
        let mut compact = Compact::new(data);
        let (mut header, mut code, mut seen, mut last) = (Self::default(), 0, 0_u16, 0);
        while let Some(field) = compact.field(last)? {
            once(&mut seen, field)?;
            match field.id {
                1 => code = compact.int(field)?,
                2 => header.whole = size(compact.int(field)?)?,
                3 => header.stored = size(compact.int(field)?)?,
                4 => header.checksum = Some(compact.int(field)?.cast_unsigned()),
                5 | 7 | 8 if field.wire == Wire::Struct => header.fields(&mut compact, field.id)?,
                5..=8 if field.wire != Wire::Struct => return Err(ThriftFault::Invalid("a field of another type")),
                _ => compact.skip(field.wire)?,
            }
            last = field.id;
        }
        let (kind, own) = match code {
            0 => (Kind::Data, 5),
            1 => (Kind::Index, 6),
            2 => (Kind::Dictionary, 7),
            3 => (Kind::DataV2, 8),
            _ => return Err(ThriftFault::Invalid("a page of an unknown kind")),
        };
        // Type, both sizes, and only the header of this kind.
        if seen & 0b1110 != 0b1110 || seen & 0b1_1110_0000 != 1 << own {
            return Err(ThriftFault::Invalid("fields that are missing, or of another kind of page"));
        }
        Ok(Self { kind, length: compact.position(), ..header })
    }

    fn fields(&mut self, compact: &mut Compact<'_>, kind: i16) -> Result<(), ThriftFault> {
        let (mut seen, mut last) = (0, 0);
        while let Some(field) = compact.field(last)? {
            once(&mut seen, field)?;
            match (kind, field.id) {
                (_, 1) => self.values = size(compact.int(field)?)?,
                (8, 2) => self.nulls = size(compact.int(field)?)?,
                (8, 3) => self.rows = size(compact.int(field)?)?,
                (8, 5 | 6) => self.levels += size(compact.int(field)?)?,
                (8, 7) if matches!(field.wire, Wire::True | Wire::False) => {
                    self.is_plain = field.wire == Wire::False;
                }
                (8, 7) => return Err(ThriftFault::Invalid("a field of another type")),
                (5, 2..=4) | (7, 2) | (8, 4) => drop(compact.int(field)?),
                _ => compact.skip(field.wire)?,
            }
            last = field.id;
        }
        let required = match kind {
            5 => 0b1_1110,
            7 => 0b110,
            _ => 0b111_1110,
        };
        if seen & required == required { Ok(()) } else { Err(ThriftFault::Invalid("fields that are missing")) }
    }

    pub(crate) fn fault(&self, about: &About, read: usize) -> Option<(String, String)> {
        let fault = |expected: String, found: String| Some((expected, found));
        if self.whole > most(about.codec, self.stored) || (self.is_stored_plain(about) && self.whole != self.stored) {
            return fault(format!("a size that {} bytes can hold", self.stored), format!("{} bytes", self.whole));
        }
        if self.kind == Kind::Dictionary {
            return self.dictionary_fault(about);
        }
        let left = about.rows.saturating_sub(read);
        if self.values > left {
            return fault(format!("at most {left} values"), self.values.to_string());
        }
        let Self { nulls, rows, levels, .. } = *self;
        match self.kind {
            Kind::DataV2 if rows != self.values => fault(format!("{} rows", self.values), rows.to_string()),
            Kind::DataV2 if nulls > if about.optional { self.values } else { 0 } => {
                fault("no more nulls than there can be".into(), nulls.to_string())
            }
            Kind::DataV2 if levels > self.whole.min(self.stored) => {
                fault(format!("levels of at most {} bytes", self.whole.min(self.stored)), levels.to_string())
            }
            _ => None,
        }
    }

    fn is_stored_plain(&self, about: &About) -> bool {
        about.codec == Compression::UNCOMPRESSED || (self.kind == Kind::DataV2 && self.is_plain)
    }

    pub(crate) fn is_zstd(&self, about: &About) -> bool {
        matches!(about.codec, Compression::ZSTD(_)) && !self.is_stored_plain(about)
    }

    fn dictionary_fault(&self, about: &About) -> Option<(String, String)> {
        // A text takes at least its length field.
        let least = match about.physical {
            Physical::BYTE_ARRAY => self.values.saturating_mul(4),
            physical => self.values.saturating_mul(width(physical, about.width)),
        };
        let found = || (format!("keys for {} bytes of values", self.whole), self.values.to_string());
        (least > self.whole).then(found)
    }
}

pub(crate) fn width(physical: Physical, declared: usize) -> usize {
    match physical {
        Physical::INT32 | Physical::FLOAT => 4,
        Physical::INT64 | Physical::DOUBLE => 8,
        Physical::INT96 => 12,
        Physical::FIXED_LEN_BYTE_ARRAY => declared,
        Physical::BOOLEAN | Physical::BYTE_ARRAY => 0,
    }
}

/// The most bytes that a codec can make of `stored` ones. A page's memory is allocated before it is decompressed.
fn most(codec: Compression, stored: usize) -> usize {
    let (ratio, free) = match codec {
        Compression::UNCOMPRESSED => (1, 0),
        // Three bytes encode a copy of 64 bytes.
        Compression::SNAPPY => (22, 64),
        Compression::LZ4 | Compression::LZ4_RAW => (256, 64),
        Compression::GZIP(_) => (1033, 1024),
        // Four bytes encode a block of 128 KiB of one byte.
        Compression::ZSTD(_) => (1 << 15, 1 << 17),
        // A few bytes encode 16 MiB; larger pages are not expected.
        _ => (1 << 15, 1 << 24),
    };
    stored.saturating_mul(ratio).saturating_add(free)
}

fn once(seen: &mut u16, field: Field) -> Result<(), ThriftFault> {
    let bit = u32::try_from(field.id).ok().and_then(|id| 1_u16.checked_shl(id)).unwrap_or(0);
    if *seen & bit != 0 {
        return Err(ThriftFault::Invalid("a field that is there twice"));
    }
    *seen |= bit;
    Ok(())
}

fn size(number: i32) -> Result<usize, ThriftFault> {
    usize::try_from(number).map_err(|_| ThriftFault::Invalid("a number below zero"))
}
