//! Copies of what several events of a sample refer to: attachments and pooled messages.
//!
//! Rule: only what a column reads is copied, and copies are counted: one attachment may be named by every event.

use std::ops::Range;

use serde_json::Value;

use crate::error::ImportError;
use crate::rows::LONGEST_LINE;
use crate::rows::Rows;

/// The second is of logs before 2025.
const PROTOCOLS: [&str; 2] = ["attachment://", "tc://"];
/// The memory of a value beside that of its texts.
const VALUE: u64 = 72;

/// The copies for one row. All of them are part of its line, so that they have its limit too.
pub(super) struct Copies<'s, 'm> {
    pub(super) rows: &'s Rows<'m>,
    pub(super) part: &'s str,
    attachments: &'s Value,
    bytes: u64,
}

impl<'s, 'm> Copies<'s, 'm> {
    pub(super) const fn new(attachments: &'s Value, part: &'s str, rows: &'s Rows<'m>) -> Self {
        Self { rows, part, attachments, bytes: 0 }
    }

    pub(super) fn resolve(&mut self, value: &mut Value) -> Result<(), ImportError> {
        match value {
            Value::String(text) => {
                if let Some(found) = attachment(text, self.attachments) {
                    *value = self.copy(found)?;
                }
                Ok(())
            }
            Value::Array(list) => list.iter_mut().try_for_each(|value| self.resolve(value)),
            Value::Object(members) => members.values_mut().try_for_each(|value| self.resolve(value)),
            _ => Ok(()),
        }
    }

    /// Replaces references to attachments in the mapped texts of the value at this path.
    pub(super) fn resolve_mapped(&mut self, value: &mut Value, path: &str) -> Result<(), ImportError> {
        if !self.rows.mapping.reads(path) {
            return Ok(());
        }
        let inner = |key: &str| format!("{path}.{key}");
        match value {
            Value::Array(list) => {
                let mut items = list.iter_mut().enumerate();
                items.try_for_each(|(at, value)| self.resolve_mapped(value, &inner(&at.to_string())))
            }
            Value::Object(members) => {
                members.iter_mut().try_for_each(|(key, value)| self.resolve_mapped(value, &inner(key)))
            }
            value => self.resolve(value),
        }
    }

    /// Replaces references to the message pools in an event by the mapped messages.
    pub(super) fn expand(&mut self, event: &mut Value, pools: &Value) -> Result<(), ImportError> {
        if let Some(input) = self.pooled(&event["input_refs"], &pools["messages"], "event.input")? {
            event["input"] = input;
        }
        let key = event["call"]["call_key"].as_str().unwrap_or("messages").to_owned();
        let path = format!("event.call.request.{key}");
        if let Some(messages) = self.pooled(&event["call"]["call_refs"], &pools["calls"], &path)?
            && event["call"]["request"].is_object()
        {
            event["call"]["request"][key] = messages;
        }
        Ok(())
    }

    /// The messages of these ranges of the pool; null for those that no column reads.
    fn pooled(&mut self, refs: &Value, pool: &Value, path: &str) -> Result<Option<Value>, ImportError> {
        let (Some(refs), Some(pool)) = (refs.as_array(), pool.as_array()) else { return Ok(None) };
        if !self.rows.mapping.reads(path) {
            return Ok(None);
        }
        let mut messages = Vec::new();
        for pair in refs {
            let Some(part) = range(pair).and_then(|range| pool.get(range)) else { return Ok(None) };
            for message in part {
                let is_read = self.rows.mapping.reads(&format!("{path}.{}", messages.len()));
                messages.push(self.copy(if is_read { message } else { &Value::Null })?);
            }
        }
        Ok(Some(Value::Array(messages)))
    }

    fn copy(&mut self, value: &Value) -> Result<Value, ImportError> {
        let bytes = weight(value);
        self.bytes = self.bytes.saturating_add(bytes);
        let counted = LONGEST_LINE.check(self.bytes).and_then(|()| self.rows.budget.spend(bytes));
        counted.map_err(|exceeded| self.rows.over(self.part, &exceeded))?;
        Ok(value.clone())
    }
}

fn attachment<'a>(text: &str, attachments: &'a Value) -> Option<&'a Value> {
    let key = PROTOCOLS.into_iter().find_map(|protocol| text.strip_prefix(protocol))?;
    match attachments {
        Value::Array(list) => list.get(key.parse::<usize>().ok()?),
        attachments => attachments.get(key),
    }
}

fn range(pair: &Value) -> Option<Range<usize>> {
    let position = |at: usize| usize::try_from(pair[at].as_u64()?).ok();
    Some(position(0)?..position(1)?)
}

fn weight(value: &Value) -> u64 {
    let inside = match value {
        Value::String(text) => text.len() as u64,
        Value::Array(list) => list.iter().map(weight).sum(),
        Value::Object(members) => members.iter().map(|(key, value)| key.len() as u64 + weight(value)).sum(),
        _ => 0,
    };
    VALUE + inside
}
