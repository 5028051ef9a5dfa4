//! The `.json` log of Inspect, sample by sample.

use std::fmt;
use std::io::Read;

use serde::de::{DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};

use super::RowSink;
use super::inspect::Log;
use crate::error::ImportError;

pub(super) fn read(json: impl Read, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    let mut log = JsonLog { log: None, status: Value::Null, rows, failed: None };
    let mut json = serde_json::Deserializer::from_reader(json);
    let read = (&mut log).deserialize(&mut json).and_then(|()| json.end());
    let JsonLog { log, status, rows, failed } = log;
    match (failed, read) {
        (Some(error), _) => Err(error),
        (None, Err(error)) if error.is_io() => Err(ImportError::read(&rows.file)(error.into())),
        (None, Err(error)) => {
            let help = "copy the log again, or export it with `inspect log convert --to eval`";
            Err(rows.fault("", "a log of Inspect, an object with `eval` and `samples`", error.to_string(), help))
        }
        (None, Ok(())) => {
            if let Some(log) = log {
                log.finish(&status, rows);
            }
            Ok(())
        }
    }
}

struct JsonLog<'r, 'm> {
    log: Option<Log>,
    status: Value,
    rows: &'r mut RowSink<'m>,
    failed: Option<ImportError>,
}

impl<'de> DeserializeSeed<'de> for &mut JsonLog<'_, '_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for &mut JsonLog<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.log.is_some() { "a list of samples" } else { "the object of a log" })
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(key) = map.next_key::<String>()? {
            match (key.as_str(), &self.log) {
                ("eval", _) => self.log = Some(Log::new(map.next_value()?)),
                ("status", _) => self.status = map.next_value()?,
                ("samples", Some(_)) => map.next_value_seed(&mut *self)?,
                ("samples", None) => return Err(A::Error::custom("`samples` before `eval`")),
                _ => drop(map.next_value::<IgnoredAny>()?),
            }
        }
        if self.log.is_some() { Ok(()) } else { Err(A::Error::custom("no `eval`")) }
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let Some(log) = &mut self.log else { return Err(A::Error::custom("a list")) };
        let mut number = 0_u64;
        while let Some(sample) = list.next_element::<Map<String, Value>>()? {
            number += 1;
            if let Err(error) = log.add(sample, &format!("sample {number}"), self.rows) {
                self.failed = Some(error);
                return Err(A::Error::custom("a sample failed"));
            }
        }
        Ok(())
    }
}
