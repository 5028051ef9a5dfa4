//! Reads Thrift's compact protocol within the bounds of its bytes.
//!
//! The Parquet library skips unknown fields and trusts their declared sizes: a list of 2^31 numbers past the end of the
//! data keeps it busy for minutes. Therefore footers and page headers are walked here first.
//! Rule: no collection has more elements than bytes follow it, so the number of bytes bounds the work.
//!
//! Source: the Thrift project's "Thrift Compact protocol encoding".

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wire {
    True,
    False,
    I8,
    I16,
    I32,
    I64,
    Double,
    Binary,
    List,
    Set,
    Map,
    Struct,
    Uuid,
}

/// The deepest nesting of structures; Parquet's own have fewer than ten levels.
const DEEPEST: u8 = 32;

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum ThriftFault {
    /// The bytes end before the structure does.
    #[error("one that goes on beyond its end")]
    Ends,
    /// The bytes are invalid, whatever follows.
    #[error("{0}")]
    Invalid(&'static str),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Field {
    pub(crate) id: i16,
    pub(crate) wire: Wire,
}

pub(crate) struct Compact<'a> {
    data: &'a [u8],
    at: usize,
}

impl<'a> Compact<'a> {
    pub(crate) fn new(data: &'a [u8]) -> Self {
        Self { data, at: 0 }
    }

    pub(crate) fn position(&self) -> usize {
        self.at
    }

    /// The next field of a structure after the one with the id `last`; `None` at the structure's end.
    pub(crate) fn field(&mut self, last: i16) -> Result<Option<Field>, ThriftFault> {
        let byte = self.byte()?;
        if byte == 0 {
            return Ok(None);
        }
        let wire = wire(byte & 0xf)?;
        let id = match i16::from(byte >> 4) {
            0 => i16::try_from(self.zigzag()?).ok(),
            delta => last.checked_add(delta),
        };
        Ok(Some(Field { id: id.ok_or(ThriftFault::Invalid("a field number out of range"))?, wire }))
    }

    pub(crate) fn int(&mut self, field: Field) -> Result<i32, ThriftFault> {
        if field.wire != Wire::I32 {
            return Err(ThriftFault::Invalid("a field of another type"));
        }
        i32::try_from(self.zigzag()?).map_err(|_| ThriftFault::Invalid("a number out of range"))
    }

    pub(crate) fn list(&mut self) -> Result<(Wire, usize), ThriftFault> {
        let byte = self.byte()?;
        let count = match byte >> 4 {
            15 => self.varint()?,
            few => few.into(),
        };
        if count == 0 {
            // Some writers give an empty list no element type.
            return Ok((Wire::I8, 0));
        }
        Ok((element(byte & 0xf)?, self.within(count)?))
    }

    pub(crate) fn skip(&mut self, wire: Wire) -> Result<(), ThriftFault> {
        self.skip_at(wire, 0)
    }

    fn skip_at(&mut self, wire: Wire, depth: u8) -> Result<(), ThriftFault> {
        if depth > DEEPEST {
            return Err(ThriftFault::Invalid("structures within structures without end"));
        }
        match wire {
            Wire::True | Wire::False => Ok(()),
            Wire::I8 => self.bytes(1),
            Wire::I16 | Wire::I32 | Wire::I64 => self.varint().map(drop),
            Wire::Double => self.bytes(8),
            Wire::Uuid => self.bytes(16),
            Wire::Binary => {
                let length = self.varint()?;
                self.bytes(length)
            }
            Wire::Struct => {
                while let Some(field) = self.field(0)? {
                    self.skip_at(field.wire, depth + 1)?;
                }
                Ok(())
            }
            Wire::List | Wire::Set => {
                let (element, count) = self.list()?;
                (0..count).try_for_each(|_| self.skip_at(element, depth + 1))
            }
            Wire::Map => self.skip_map(depth),
        }
    }

    fn skip_map(&mut self, depth: u8) -> Result<(), ThriftFault> {
        let count = self.varint()?;
        if count == 0 {
            return Ok(());
        }
        let types = self.byte()?;
        let (key, value) = (element(types >> 4)?, element(types & 0xf)?);
        for _ in 0..self.within(count)? {
            self.skip_at(key, depth + 1)?;
            self.skip_at(value, depth + 1)?;
        }
        Ok(())
    }

    fn byte(&mut self) -> Result<u8, ThriftFault> {
        let byte = *self.data.get(self.at).ok_or(ThriftFault::Ends)?;
        self.at += 1;
        Ok(byte)
    }

    fn bytes(&mut self, count: u64) -> Result<(), ThriftFault> {
        self.at += self.within(count)?;
        Ok(())
    }

    fn within(&self, count: u64) -> Result<usize, ThriftFault> {
        usize::try_from(count).ok().filter(|count| *count <= self.data.len() - self.at).ok_or(ThriftFault::Ends)
    }

    fn varint(&mut self) -> Result<u64, ThriftFault> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(ThriftFault::Invalid("a number of too many bytes"))
    }

    fn zigzag(&mut self) -> Result<i64, ThriftFault> {
        let value = self.varint()?;
        Ok((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
    }
}

fn wire(code: u8) -> Result<Wire, ThriftFault> {
    use Wire::{Binary, Double, False, I8, I16, I32, I64, List, Map, Set, Struct, True, Uuid};
    const BY_CODE: [Wire; 13] = [True, False, I8, I16, I32, I64, Double, Binary, List, Set, Map, Struct, Uuid];
    let wire = usize::from(code).checked_sub(1).and_then(|at| BY_CODE.get(at));
    wire.copied().ok_or(ThriftFault::Invalid("a value of an unknown type"))
}

/// The encoding of the elements of a collection. Truth values take a byte each there, which the Parquet library does
/// not skip. The Parquet structures read here have none.
fn element(code: u8) -> Result<Wire, ThriftFault> {
    match wire(code)? {
        Wire::True | Wire::False => Err(ThriftFault::Invalid("a collection of truth values")),
        wire => Ok(wire),
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::{Compact, Field, ThriftFault, Wire};

    #[test]
    fn the_fields_of_a_structure_are_read_or_skipped() {
        // Field 1: i32 -3; field 3: list of two i32; field 20 in the long form: binary of 2 bytes; the end.
        let data = [0x15, 5, 0x29, 0x25, 2, 4, 0x08, 40, 2, 7, 7, 0];
        let mut compact = Compact::new(&data);
        let first = compact.field(0).unwrap().unwrap();
        assert_eq!((first, compact.int(first)), (Field { id: 1, wire: Wire::I32 }, Ok(-3)));
        assert_eq!(compact.field(1), Ok(Some(Field { id: 3, wire: Wire::List })));
        assert_eq!(compact.skip(Wire::List), Ok(()));
        assert_eq!(compact.field(3), Ok(Some(Field { id: 20, wire: Wire::Binary })));
        assert_eq!(compact.skip(Wire::Binary), Ok(()));
        assert_eq!((compact.field(20), compact.position()), (Ok(None), data.len()));
    }

    #[test]
    fn a_collection_larger_than_its_bytes_is_refused_at_once() {
        let huge = [0xff, 0xff, 0xff, 0xff, 0x07];
        let list = |element: u8| [&[0xf0 | element], &huge[..], &[0; 20]].concat();
        for element in [3, 5, 7, 8, 9, 12, 13] {
            assert_eq!(Compact::new(&list(element)).skip(Wire::List), Err(ThriftFault::Ends), "{element}");
        }
        let truths = Compact::new(&list(1)).skip(Wire::List);
        assert_eq!(truths, Err(ThriftFault::Invalid("a collection of truth values")));
        let map = [&huge[..], &[0x77], &[0; 20]].concat();
        assert_eq!(Compact::new(&map).skip(Wire::Map), Err(ThriftFault::Ends));
        assert_eq!(Compact::new(&huge).skip(Wire::Binary), Err(ThriftFault::Ends));
        let deep = vec![0x19; 100_000];
        assert!(Compact::new(&deep).skip(Wire::List).is_err());
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_within_their_bounds(data in vec(any::<u8>(), 0..200)) {
            let mut compact = Compact::new(&data);
            let _ = compact.skip(Wire::Struct);
            prop_assert!(compact.position() <= data.len());
        }
    }
}
