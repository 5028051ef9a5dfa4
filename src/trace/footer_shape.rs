//! The structures of a footer: which field is encoded how.
//!
//! The Parquet library takes a field for what its number says, whatever type the file declares. Here both must agree, so
//! that what is walked within its bounds is what the library decodes. Fields that are not listed are skipped by both.
//!
//! Source: the Parquet format's `parquet.thrift`.

use parquet::file::reader::ChunkReader;

use super::thrift::{Compact, Fault, Wire};

/// The fields of a structure.
type Shape = &'static [(i16, Value)];

/// How a field is encoded.
enum Value {
    Truth,
    One(Wire),
    Struct(Shape),
    List(Wire),
    Structs(Shape),
}

use Value::{List, One, Struct, Structs, Truth};
use Wire::{Binary, Double, I8, I16, I32, I64};

const FILE: Shape = &[
    (1, One(I32)),
    (2, Structs(SCHEMA_ELEMENT)),
    (3, One(I64)),
    (4, Structs(ROW_GROUP)),
    (5, Structs(KEY_VALUE)),
    (6, One(Binary)),
    (7, Structs(EMPTY_UNION)),
    (8, Struct(&[])),
    (9, One(Binary)),
];
const SCHEMA_ELEMENT: Shape = &[
    (1, One(I32)),
    (2, One(I32)),
    (3, One(I32)),
    (4, One(Binary)),
    (5, One(I32)),
    (6, One(I32)),
    (7, One(I32)),
    (8, One(I32)),
    (9, One(I32)),
    (10, Struct(LOGICAL_TYPE)),
];
const LOGICAL_TYPE: Shape = &[
    (1, Struct(&[])),
    (2, Struct(&[])),
    (3, Struct(&[])),
    (4, Struct(&[])),
    (5, Struct(&[(1, One(I32)), (2, One(I32))])),
    (6, Struct(&[])),
    (7, Struct(TIME)),
    (8, Struct(TIME)),
    (10, Struct(&[(1, One(I8)), (2, Truth)])),
    (11, Struct(&[])),
    (12, Struct(&[])),
    (13, Struct(&[])),
    (14, Struct(&[])),
    (15, Struct(&[])),
    (16, Struct(&[(1, One(I8))])),
    (17, Struct(&[(1, One(Binary))])),
    (18, Struct(&[(1, One(Binary)), (2, One(I32))])),
];
const TIME: Shape = &[(1, Truth), (2, Struct(EMPTY_UNION))];
const EMPTY_UNION: Shape = &[(1, Struct(&[])), (2, Struct(&[])), (3, Struct(&[]))];
const ROW_GROUP: Shape = &[
    (1, Structs(COLUMN_CHUNK)),
    (2, One(I64)),
    (3, One(I64)),
    (4, Structs(&[(1, One(I32)), (2, Truth), (3, Truth)])),
    (5, One(I64)),
    (6, One(I64)),
    (7, One(I16)),
];
const COLUMN_CHUNK: Shape = &[
    (1, One(Binary)),
    (2, One(I64)),
    (3, Struct(COLUMN_METADATA)),
    (4, One(I64)),
    (5, One(I32)),
    (6, One(I64)),
    (7, One(I32)),
    (8, Struct(&[])),
    (9, One(Binary)),
];
const COLUMN_METADATA: Shape = &[
    (1, One(I32)),
    (2, List(I32)),
    (3, List(Binary)),
    (4, One(I32)),
    (5, One(I64)),
    (6, One(I64)),
    (7, One(I64)),
    (8, Structs(KEY_VALUE)),
    (9, One(I64)),
    (10, One(I64)),
    (11, One(I64)),
    (12, Struct(STATISTICS)),
    (13, Structs(&[(1, One(I32)), (2, One(I32)), (3, One(I32))])),
    (14, One(I64)),
    (15, One(I32)),
    (16, Struct(&[(1, One(I64)), (2, List(I64)), (3, List(I64))])),
    (17, Struct(&[(1, Struct(BOX)), (2, List(I32))])),
];
const STATISTICS: Shape = &[
    (1, One(Binary)),
    (2, One(Binary)),
    (3, One(I64)),
    (4, One(I64)),
    (5, One(Binary)),
    (6, One(Binary)),
    (7, Truth),
    (8, Truth),
];
const BOX: Shape = &[
    (1, One(Double)),
    (2, One(Double)),
    (3, One(Double)),
    (4, One(Double)),
    (5, One(Double)),
    (6, One(Double)),
    (7, One(Double)),
    (8, One(Double)),
];
const KEY_VALUE: Shape = &[(1, One(Binary)), (2, One(Binary))];

/// Whether the footer of a file keeps within its bytes, before the Parquet library follows it; else what it is. Where there
/// is none, the library has the better words.
pub(crate) fn check_file(file: &impl ChunkReader) -> Result<(), String> {
    let footer = || {
        let end = file.len().checked_sub(8)?;
        let length = u32::from_le_bytes(*file.get_bytes(end, 4).ok()?.first_chunk()?);
        file.get_bytes(end.checked_sub(length.into())?, usize::try_from(length).ok()?).ok()
    };
    footer().map_or(Ok(()), |footer| check(&footer).map_err(|fault| fault.to_string()))
}

/// Whether some bytes are the structure of a footer, within their bounds.
fn check(footer: &[u8]) -> Result<(), Fault> {
    walk(&mut Compact::new(footer), FILE)
}

fn walk(compact: &mut Compact<'_>, shape: Shape) -> Result<(), Fault> {
    let mut last = 0;
    while let Some(field) = compact.field(last)? {
        last = field.id;
        let Some((_, value)) = shape.iter().find(|(id, _)| *id == field.id) else {
            compact.skip(field.wire)?;
            continue;
        };
        match (value, field.wire) {
            (Truth, Wire::True | Wire::False) => {}
            (One(wanted), wire) if *wanted == wire => compact.skip(wire)?,
            (Struct(fields), Wire::Struct) => walk(compact, fields)?,
            (List(wanted), Wire::List) => elements(compact, *wanted, |compact| compact.skip(*wanted))?,
            (Structs(fields), Wire::List) => elements(compact, Wire::Struct, |compact| walk(compact, fields))?,
            _ => return Err(Fault::Invalid("a field of another type")),
        }
    }
    Ok(())
}

fn elements<'a>(
    compact: &mut Compact<'a>,
    wanted: Wire,
    mut walk: impl FnMut(&mut Compact<'a>) -> Result<(), Fault>,
) -> Result<(), Fault> {
    let (element, count) = compact.list()?;
    if count > 0 && element != wanted {
        return Err(Fault::Invalid("a list of another type"));
    }
    (0..count).try_for_each(|_| walk(compact))
}

#[cfg(test)]
mod tests {
    use super::check;
    use crate::trace::thrift::Fault;

    #[test]
    fn a_field_of_another_type_than_its_number_is_refused() {
        // The version, and nothing else; then the same number as a list of 2^31 doubles.
        assert_eq!(check(&[0x15, 2, 0]), Ok(()));
        let huge = [0x19, 0xf7, 0xff, 0xff, 0xff, 0xff, 0x07, 0];
        assert_eq!(check(&huge), Err(Fault::Invalid("a field of another type")));
        // Field 15 is unknown: its list is walked, and is longer than the footer.
        assert_eq!(check(&[&[0xf9], &huge[1..]].concat()), Err(Fault::Ends));
    }
}
