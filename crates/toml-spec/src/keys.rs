//! The keys of a TOML table, taken one by one, so that every key is either understood or refused.

use std::ops::Range;
use std::sync::Arc;

use indexmap::IndexMap;
use toml::de::{DeTable, DeValue};

use crate::fault::{Fault, Place, Source};
use crate::origin::Written;
use exact::ratio::Ratio;
use exact::suggest::nearest;

type Value<'a> = toml::Spanned<DeValue<'a>>;

/// A text as TOML, and every fault of it; with faults the table is what could be read.
pub fn parse_toml(source: &Arc<Source>) -> (toml::Spanned<DeTable<'_>>, Vec<Fault>) {
    let (table, errors) = DeTable::parse_recoverable(&source.text);
    let fault = |error: toml::de::Error| {
        let place = Place { source: source.clone(), span: error.span().unwrap_or(0..0) };
        Fault::new(place, format!("not TOML: {}", error.message()))
    };
    (table, errors.into_iter().map(fault).collect())
}

/// A text as TOML, for [`At::root`](crate::At::root), and every fault of it.
pub fn parse(source: &Arc<Source>) -> (DeValue<'_>, Vec<Fault>) {
    let (table, faults) = parse_toml(source);
    (DeValue::Table(table.into_inner()), faults)
}

/// How many keys a table and the tables in it have.
pub fn key_count(table: &DeTable<'_>) -> u64 {
    let inside = |value: &DeValue<'_>| value.as_table().map_or(0, key_count);
    table.iter().map(|(_, value)| 1 + inside(value.get_ref())).sum()
}

/// A table whose keys are taken one by one; what is left at the end is unknown.
pub struct Keys<'a> {
    source: &'a Arc<Source>,
    left: Vec<(&'a str, Range<usize>, &'a Value<'a>)>,
    asked: Vec<&'static str>,
    what: &'static str,
}

impl<'a> Keys<'a> {
    /// The keys of `table`; `what` names its kind in messages.
    pub fn new(source: &'a Arc<Source>, table: &'a DeTable<'a>, what: &'static str) -> Self {
        let left = table.iter().map(|(key, value)| (key.get_ref().as_ref(), key.span(), value)).collect();
        Self { source, left, asked: Vec::new(), what }
    }

    fn place(&self, span: Range<usize>) -> Place {
        Place { source: self.source.clone(), span }
    }

    /// Names of the keys not yet taken.
    pub fn names(&self) -> Vec<String> {
        self.left.iter().map(|(name, _, _)| (*name).to_owned()).collect()
    }

    /// Returns true if the key is present and not yet taken.
    pub fn has(&self, name: &str) -> bool {
        self.left.iter().any(|(known, _, _)| *known == name)
    }

    /// Location of a key; the start of the file if absent.
    pub fn key_place(&self, name: &str) -> Place {
        let span = self.left.iter().find(|(known, _, _)| *known == name).map_or(0..0, |(_, span, _)| span.clone());
        self.place(span)
    }

    fn take(&mut self, name: &str) -> Option<&'a Value<'a>> {
        let at = self.left.iter().position(|(known, _, _)| *known == name)?;
        Some(self.left.remove(at).2)
    }

    fn take_known(&mut self, name: &'static str) -> Option<&'a Value<'a>> {
        self.asked.push(name);
        self.take(name)
    }

    fn wrong<T>(&self, value: &Value, expected: &str, faults: &mut Vec<Fault>) -> Option<T> {
        let found = value.get_ref().type_str();
        let fault = Fault::new(self.place(value.span()), format!("expected {expected}, found {found}"));
        faults.push(fault.label(format!("not {expected}")));
        None
    }

    /// Takes a text and its location.
    pub fn text(&mut self, name: &'static str, faults: &mut Vec<Fault>) -> Option<(String, Place)> {
        let value = self.take_known(name)?;
        match value.get_ref().as_str() {
            Some(text) => Some((text.to_owned(), self.place(value.span()))),
            None => self.wrong(value, "a text", faults),
        }
    }

    pub fn expression(&mut self, name: &str, faults: &mut Vec<Fault>) -> Option<Written> {
        if let "when" | "value" = name {
            self.asked.push(if name == "when" { "when" } else { "value" });
        }
        let value = self.take(name)?;
        match value.get_ref().as_str() {
            Some(text) => Some(Written::toml_string(self.source.clone(), text, value.span())),
            None => self.wrong(value, "an expression in quotes", faults),
        }
    }

    pub fn truth(&mut self, name: &'static str, faults: &mut Vec<Fault>) -> Option<bool> {
        let value = self.take_known(name)?;
        value.get_ref().as_bool().or_else(|| self.wrong(value, "true or false", faults))
    }

    pub fn integer(&mut self, name: &'static str, faults: &mut Vec<Fault>) -> Option<i64> {
        let value = self.take_known(name)?;
        match value.get_ref().as_integer().and_then(|i| i64::from_str_radix(i.as_str(), i.radix()).ok()) {
            Some(integer) => Some(integer),
            None => self.wrong(value, "an integer", faults),
        }
    }

    /// A number, of metres or the like; what is no number, such as `nan`, is one here, for the caller's range to refuse.
    pub fn number(&mut self, name: &'static str, faults: &mut Vec<Fault>) -> Option<(f64, Place)> {
        let value = self.take_known(name)?;
        let number = match value.get_ref() {
            DeValue::Float(number) => number.as_str().replace('_', "").parse().ok(),
            DeValue::Integer(number) => i32::from_str_radix(number.as_str(), number.radix()).ok().map(f64::from),
            _ => None,
        };
        match number {
            Some(number) => Some((number, self.place(value.span()))),
            None => self.wrong(value, "a number", faults),
        }
    }

    /// A whole number from `least` to `most`.
    pub fn count(
        &mut self,
        name: &'static str,
        [least, most]: [u32; 2],
        faults: &mut Vec<Fault>,
    ) -> Option<(u32, Place)> {
        let place = self.value_place(name);
        let value = self.integer(name, faults)?;
        let place = place?;
        if let Some(value) = u32::try_from(value).ok().filter(|value| (least..=most).contains(value)) {
            return Some((value, place));
        }
        faults.push(Fault::new(place, format!("`{name}` may be {least} to {most}, but is {value}")));
        None
    }

    /// A length from `least` to `most`, in the unit in which it is written.
    pub fn length(
        &mut self,
        name: &'static str,
        [least, most]: [f64; 2],
        faults: &mut Vec<Fault>,
    ) -> Option<(f64, Place)> {
        let (value, place) = self.number(name, faults)?;
        if value >= least && value <= most {
            return Some((value, place));
        }
        faults.push(Fault::new(place, format!("`{name}` may be {least} to {most}, but is {value}")));
        None
    }

    /// Where a key's value stands.
    pub fn value_place(&self, name: &str) -> Option<Place> {
        let (_, _, value) = self.left.iter().find(|(known, _, _)| *known == name)?;
        Some(self.place(value.span()))
    }

    /// The tables of a list, `[[experiment.A.mirror]]`, at most so many.
    pub fn list(&mut self, name: &'static str, most: usize, faults: &mut Vec<Fault>) -> Option<Vec<(Place, Keys<'a>)>> {
        let value = self.take_known(name)?;
        let Some(items) = value.get_ref().as_array() else {
            return self.wrong(value, "a list of tables", faults);
        };
        if items.len() > most {
            let message = format!("a world holds at most {most} of `{name}`, found {}", items.len());
            faults.push(Fault::new(self.place(value.span()), message));
            return None;
        }
        let table = |item: &'a Value<'a>| match item.get_ref().as_table() {
            Some(table) => Some((self.place(item.span()), Keys::new(self.source, table, name))),
            None => self.wrong(item, "a table", faults),
        };
        items.iter().map(table).collect()
    }

    /// Takes one of several words.
    pub fn choice<T: Copy>(&mut self, name: &'static str, choices: &[(&str, T)], faults: &mut Vec<Fault>) -> Option<T> {
        let (text, place) = self.text(name, faults)?;
        if let Some((_, choice)) = choices.iter().find(|(known, _)| *known == text) {
            return Some(*choice);
        }
        let known: Vec<&str> = choices.iter().map(|(known, _)| *known).collect();
        let near = nearest(&text, known.iter().copied()).map(|near| format!("did you mean `{near}`?"));
        let message = format!("`{name}` is one of {}; found `{text}`", known.join(", "));
        faults.push(Fault::new(place, message).help_if(near));
        None
    }

    pub fn ratio(&mut self, name: &'static str, faults: &mut Vec<Fault>) -> Option<Ratio> {
        let value = self.take_known(name)?;
        self.ratio_of(value, faults)
    }

    fn ratio_of(&self, value: &Value, faults: &mut Vec<Fault>) -> Option<Ratio> {
        let text = match value.get_ref() {
            DeValue::String(text) => text.as_ref(),
            // A decimal is the fraction that it says: `0.25` is 1/4.
            DeValue::Float(number) => number.as_str(),
            DeValue::Integer(number) => number.as_str(),
            _ => return self.wrong(value, "a fraction in quotes such as \"1/3\"", faults),
        };
        match text.parse() {
            Ok(ratio) => Some(ratio),
            Err(message) => {
                faults.push(Fault::new(self.place(value.span()), message));
                None
            }
        }
    }

    /// A chance level, or the word that says that there is none.
    pub fn level(&mut self, name: &str, faults: &mut Vec<Fault>) -> Option<Option<Ratio>> {
        let value = self.take(name)?;
        if value.get_ref().as_str() == Some("none") {
            return Some(None);
        }
        self.ratio_of(value, faults).map(Some)
    }

    /// Takes a list of fractions.
    pub fn ratios(&mut self, name: &str, faults: &mut Vec<Fault>) -> Option<Vec<Ratio>> {
        let value = self.take(name)?;
        match value.get_ref().as_array() {
            Some(items) => items.iter().map(|item| self.ratio_of(item, faults)).collect(),
            None => self.wrong(value, "a list of fractions", faults),
        }
    }

    /// Takes a list of texts with their locations.
    pub fn texts(&mut self, name: &'static str, faults: &mut Vec<Fault>) -> Option<Vec<(String, Place)>> {
        let value = self.take_known(name)?;
        let Some(items) = value.get_ref().as_array() else { return self.wrong(value, "a list of texts", faults) };
        let text = |item: &Value| match item.get_ref().as_str() {
            Some(text) => Some((text.to_owned(), self.place(item.span()))),
            None => self.wrong(item, "a text", faults),
        };
        items.iter().map(text).collect()
    }

    /// Every key with what `read` makes of it and where it stands; unreadable ones are passed over.
    pub fn each<T>(mut self, mut read: impl FnMut(&mut Self, &str) -> Option<T>) -> IndexMap<String, (T, Place)> {
        let mut entries = IndexMap::new();
        for name in self.names() {
            let place = self.key_place(&name);
            if let Some(value) = read(&mut self, &name) {
                entries.insert(name, (value, place));
            }
        }
        entries
    }

    pub fn table(&mut self, name: &'static str, faults: &mut Vec<Fault>) -> Option<Keys<'a>> {
        let value = self.take_known(name)?;
        match value.get_ref().as_table() {
            Some(table) => Some(Keys::new(self.source, table, name)),
            None => self.wrong(value, "a table", faults),
        }
    }

    /// The tables of a table: `[metric.A]`, `[metric.B]`, ...
    pub fn tables(&mut self, name: &'static str, faults: &mut Vec<Fault>) -> Vec<(String, Place, Keys<'a>)> {
        let Some(outer) = self.table(name, faults) else { return Vec::new() };
        let mut tables = Vec::with_capacity(outer.left.len());
        for (key, span, value) in &outer.left {
            match value.get_ref().as_table() {
                Some(table) => {
                    let keys = Keys::new(self.source, table, name);
                    tables.push(((*key).to_owned(), self.place(span.clone()), keys));
                }
                None => self.wrong::<()>(value, "a table", faults).unwrap_or_default(),
            }
        }
        tables
    }

    /// Reports each key that was not taken.
    pub fn refuse_the_rest(self, faults: &mut Vec<Fault>) {
        for (name, span, _) in &self.left {
            let near = nearest(name, self.asked.iter().copied()).map(|near| format!("did you mean `{near}`?"));
            let known = format!("keys of {} are {}", describe(self.what), self.asked.join(", "));
            let fault = Fault::new(self.place(span.clone()), format!("unknown key `{name}`"));
            faults.push(fault.help(near.unwrap_or(known)));
        }
    }
}

fn describe(what: &str) -> String {
    match what {
        "column" | "figure" | "metric" | "mirror" | "mark" | "table" => format!("a {what}"),
        "experiment" => format!("an {what}"),
        other => other.to_owned(),
    }
}
