//! The structures of a footer: the encoding of each field.
//!
//! The Parquet library reads a field by its number, whatever its declared type. Here both must agree, so that the
//! checked bytes are those that the library decodes. Both skip unlisted fields.
//!
//! Source: the Parquet format's `parquet.thrift`.

use bytes::Bytes;
use parquet::file::reader::ChunkReader;

use crate::thrift::{Compact, ThriftFault, Wire};

/// The fields of a structure, from number 1.
type Shape = &'static [Value];

enum Value {
    /// Not listed in the format: both skip it.
    Other,
    Truth,
    One(Wire),
    Struct(Shape),
    List(Wire),
    Structs(Shape),
}

use Value::{List, Other, Struct, Structs, Truth};

const TEXT: Value = Value::One(Wire::Binary);
const BYTE: Value = Value::One(Wire::I8);
const SHORT: Value = Value::One(Wire::I16);
const INT: Value = Value::One(Wire::I32);
const LONG: Value = Value::One(Wire::I64);
const DOUBLE: Value = Value::One(Wire::Double);
const EMPTY: Value = Struct(&[]);

const FILE: Shape = &[
    INT,
    Structs(SCHEMA_ELEMENT),
    LONG,
    Structs(ROW_GROUP),
    Structs(KEY_VALUE),
    TEXT,
    Structs(EMPTY_UNION),
    EMPTY,
    TEXT,
];
const SCHEMA_ELEMENT: Shape = &[INT, INT, INT, TEXT, INT, INT, INT, INT, INT, Struct(LOGICAL_TYPE)];
const LOGICAL_TYPE: Shape = &[
    EMPTY,
    EMPTY,
    EMPTY,
    EMPTY,
    Struct(&[INT, INT]),
    EMPTY,
    Struct(TIME),
    Struct(TIME),
    Other,
    Struct(&[BYTE, Truth]),
    EMPTY,
    EMPTY,
    EMPTY,
    EMPTY,
    EMPTY,
    Struct(&[BYTE]),
    Struct(&[TEXT]),
    Struct(&[TEXT, INT]),
];
const TIME: Shape = &[Truth, Struct(EMPTY_UNION)];
const EMPTY_UNION: Shape = &[EMPTY, EMPTY, EMPTY];
const ROW_GROUP: Shape = &[Structs(COLUMN_CHUNK), LONG, LONG, Structs(&[INT, Truth, Truth]), LONG, LONG, SHORT];
const COLUMN_CHUNK: Shape = &[TEXT, LONG, Struct(COLUMN_METADATA), LONG, INT, LONG, INT, EMPTY, TEXT];
const COLUMN_METADATA: Shape = &[
    INT,
    List(Wire::I32),
    List(Wire::Binary),
    INT,
    LONG,
    LONG,
    LONG,
    Structs(KEY_VALUE),
    LONG,
    LONG,
    LONG,
    Struct(STATISTICS),
    Structs(&[INT, INT, INT]),
    LONG,
    INT,
    Struct(&[LONG, List(Wire::I64), List(Wire::I64)]),
    Struct(&[Struct(BOX), List(Wire::I32)]),
];
const STATISTICS: Shape = &[TEXT, TEXT, LONG, LONG, TEXT, TEXT, Truth, Truth];
const BOX: Shape = &[DOUBLE, DOUBLE, DOUBLE, DOUBLE, DOUBLE, DOUBLE, DOUBLE, DOUBLE];
const KEY_VALUE: Shape = &[TEXT, TEXT];

const GOES_ON: &str = "one that ends before its stated length";

/// Checks that a footer has exactly the length that the file states, before the Parquet library follows it. Passes
/// without a footer, which the library reports better.
pub fn check_footer(file: &impl ChunkReader) -> Result<(), String> {
    footer_bytes(file).map_or(Ok(()), |(_, footer)| check(&footer).map_err(|fault| fault.to_string()))
}

/// The offset of a file's footer and its bytes, without the length; `None` without a footer.
pub fn footer_bytes(file: &impl ChunkReader) -> Option<(u64, Bytes)> {
    let end = file.len().checked_sub(8)?;
    let length = u32::from_le_bytes(*file.get_bytes(end, 4).ok()?.first_chunk()?);
    let start = end.checked_sub(length.into())?;
    file.get_bytes(start, usize::try_from(length).ok()?).ok().map(|bytes| (start, bytes))
}

fn check(footer: &[u8]) -> Result<(), ThriftFault> {
    let mut compact = Compact::new(footer);
    walk(&mut compact, FILE)?;
    // A zero in place of a field ends the structure: every later key vanishes, and the file looks like one without it.
    if compact.position() == footer.len() { Ok(()) } else { Err(ThriftFault::Invalid(GOES_ON)) }
}

fn walk(compact: &mut Compact<'_>, shape: Shape) -> Result<(), ThriftFault> {
    let mut last = 0;
    while let Some(field) = compact.field(last)? {
        last = field.id;
        let place = usize::try_from(field.id).ok().and_then(|id| id.checked_sub(1));
        match (place.and_then(|place| shape.get(place)).unwrap_or(&Other), field.wire) {
            (Other, wire) => compact.skip(wire)?,
            (Truth, Wire::True | Wire::False) => {}
            (Value::One(wanted), wire) if *wanted == wire => compact.skip(wire)?,
            (Struct(fields), Wire::Struct) => walk(compact, fields)?,
            (List(wanted), Wire::List) => elements(compact, *wanted, |compact| compact.skip(*wanted))?,
            (Structs(fields), Wire::List) => elements(compact, Wire::Struct, |compact| walk(compact, fields))?,
            _ => return Err(ThriftFault::Invalid("a field of another type")),
        }
    }
    Ok(())
}

fn elements<'a>(
    compact: &mut Compact<'a>,
    wanted: Wire,
    mut walk: impl FnMut(&mut Compact<'a>) -> Result<(), ThriftFault>,
) -> Result<(), ThriftFault> {
    let (element, count) = compact.list()?;
    if count > 0 && element != wanted {
        return Err(ThriftFault::Invalid("a list of another type"));
    }
    (0..count).try_for_each(|_| walk(compact))
}

#[cfg(test)]
mod tests {
    use super::{GOES_ON, check};
    use crate::thrift::ThriftFault;

    #[test]
    fn a_field_of_another_type_than_its_number_is_refused() {
        // Only the version; then the same number as a list of 2^31 doubles.
        assert_eq!(check(&[0x15, 2, 0]), Ok(()));
        assert_eq!(check(&[0x15, 2, 0, 0]), Err(ThriftFault::Invalid(GOES_ON)));
        let huge = [0x19, 0xf7, 0xff, 0xff, 0xff, 0xff, 0x07, 0];
        assert_eq!(check(&huge), Err(ThriftFault::Invalid("a field of another type")));
        // Field 15 is unknown: its list is walked, and exceeds the footer.
        assert_eq!(check(&[&[0xf9], &huge[1..]].concat()), Err(ThriftFault::Ends));
    }
}
