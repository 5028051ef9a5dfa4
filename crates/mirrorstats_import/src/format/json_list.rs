//! A list of objects in one JSON file: one row per object.

use std::fmt;
use std::fs::File;
use std::io::{BufRead as _, BufReader};

use serde::de::{DeserializeSeed, Deserializer, Error as _, SeqAccess, Visitor};

use super::RowSink;
use crate::error::ImportError;
use crate::line::{BYTE_ORDER_MARK, Pairs};

pub(super) fn read(file: File, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    let mut reader = BufReader::new(file);
    if reader.fill_buf().map_err(ImportError::read(&rows.file))?.starts_with(BYTE_ORDER_MARK) {
        reader.consume(BYTE_ORDER_MARK.len());
    }
    let mut list = List { rows, failed: None };
    let mut json = serde_json::Deserializer::from_reader(reader);
    let read = (&mut list).deserialize(&mut json).and_then(|()| json.end());
    let List { rows, failed } = list;
    match (failed, read) {
        (Some(error), _) => Err(error),
        (None, Ok(())) => Ok(()),
        (None, Err(error)) => {
            let help =
                "correct the file, or write one object a line, as `jq -c '.[]'` does; NaN and infinities are no JSON";
            Err(rows.fault("", "a list of objects in strict JSON, one per step", error.to_string(), help))
        }
    }
}

struct List<'r, 'm> {
    rows: &'r mut RowSink<'m>,
    failed: Option<ImportError>,
}

impl<'de> DeserializeSeed<'de> for &mut List<'_, '_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for &mut List<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of objects")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        while let Some(object) = list.next_element::<Pairs>()? {
            if let Some(key) = object.repeated() {
                return Err(A::Error::custom(format_args!("the key {key:?} twice")));
            }
            if let Err(error) = self.rows.add(&object.row()) {
                self.failed = Some(error);
                return Err(A::Error::custom("a row failed"));
            }
        }
        Ok(())
    }
}
