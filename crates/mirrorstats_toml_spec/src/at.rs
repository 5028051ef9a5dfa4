//! Values of a TOML text with their locations.

use std::ops::Range;
use std::str::FromStr;
use std::sync::Arc;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::fault::{Fault, Place, Source};
use crate::origin::Written;

/// Parses TOML and reports every fault; if there are faults, the table holds the readable part.
pub fn parse_toml(source: &Arc<Source>) -> (Spanned<DeTable<'_>>, Vec<Fault>) {
    let (table, errors) = DeTable::parse_recoverable(&source.text);
    let fault = |error: toml::de::Error| {
        let place = Place { source: source.clone(), span: error.span().unwrap_or(0..0) };
        Fault::new(place, format!("not TOML: {}", error.message()))
    };
    (table, errors.into_iter().map(fault).collect())
}

/// Parses TOML for [`At::root`] and reports every fault.
pub fn parse(source: &Arc<Source>) -> (DeValue<'_>, Vec<Fault>) {
    let (table, faults) = parse_toml(source);
    (DeValue::Table(table.into_inner()), faults)
}

#[derive(Clone, Debug)]
pub struct At<'a> {
    source: &'a Arc<Source>,
    pub(crate) name: &'a str,
    name_span: Range<usize>,
    span: Range<usize>,
    pub(crate) value: &'a DeValue<'a>,
}

impl<'a> At<'a> {
    pub fn root(source: &'a Arc<Source>, value: &'a DeValue<'a>) -> Self {
        Self { source, name: "", name_span: 0..0, span: 0..0, value }
    }

    /// The entries of a table, in the order of the text; empty if it is not a table.
    pub fn entries(&self) -> impl Iterator<Item = (&'a str, Self)> {
        let entries = self.value.as_table().into_iter().flat_map(|table| table.iter());
        let source = self.source;
        entries.map(move |(key, value)| {
            let name = key.get_ref().as_ref();
            (name, Self { source, name, name_span: key.span(), span: value.span(), value: value.get_ref() })
        })
    }

    /// The entries of the table at a key; empty if it is absent.
    pub fn within(&self, key: &str) -> impl Iterator<Item = (&'a str, Self)> + use<'a> {
        self.get(key).map(|inner| inner.entries().collect::<Vec<_>>()).unwrap_or_default().into_iter()
    }

    /// The items of a list; empty if it is not a list.
    pub fn items(&self) -> impl Iterator<Item = Self> {
        let items = self.value.as_array().into_iter().flat_map(|array| array.iter());
        let (source, name) = (self.source, self.name);
        items.map(move |item: &'a Spanned<DeValue<'a>>| Self {
            source,
            name,
            name_span: item.span(),
            span: item.span(),
            value: item.get_ref(),
        })
    }

    pub fn get(&self, key: &str) -> Option<Self> {
        self.entries().find(|(name, _)| *name == key).map(|(_, value)| value)
    }

    /// The value of a key; the table itself if the key is absent.
    #[must_use]
    pub fn key(&self, key: &str) -> Self {
        self.get(key).unwrap_or_else(|| self.clone())
    }

    /// An item of a list; the list itself if it is too short.
    #[must_use]
    pub fn item(&self, n: usize) -> Self {
        self.items().nth(n).unwrap_or_else(|| self.clone())
    }

    /// The text as written, without quotes; empty for tables and lists.
    pub fn written(&self) -> &'a str {
        match self.value {
            DeValue::String(text) => text,
            DeValue::Float(number) => number.as_str(),
            DeValue::Integer(number) => number.as_str(),
            _ => "",
        }
    }

    pub fn is_text(&self) -> bool {
        self.value.is_str()
    }

    /// The text with the location of each of its bytes.
    pub fn expression(&self) -> Written {
        Written::toml_string(self.source.clone(), self.written(), self.span.clone())
    }

    /// The text or number as another type; `None` for other values, which their shape refuses.
    pub fn parse<T: FromStr<Err: Into<String>>>(&self, faults: &mut Vec<Fault>) -> Option<T> {
        if !matches!(self.value, DeValue::String(_) | DeValue::Float(_) | DeValue::Integer(_)) {
            return None;
        }
        self.written().parse().map_err(|error: T::Err| faults.push(self.fault(error))).ok()
    }

    pub fn place(&self) -> Place {
        Place { source: self.source.clone(), span: self.span.clone() }
    }

    pub fn name_place(&self) -> Place {
        Place { source: self.source.clone(), span: self.name_span.clone() }
    }

    /// A fault of the value. A table is underlined at its name, as its own bytes may be many lines.
    pub fn fault(&self, message: impl Into<String>) -> Fault {
        let place = if self.value.is_table() { self.name_place() } else { self.place() };
        Fault::new(place, message)
    }
}
