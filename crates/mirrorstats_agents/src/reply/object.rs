//! A JSON object that preserves the order of keys and repeated keys.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, Visitor};
use serde_json::Value;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Object(Vec<(String, Value)>);

impl Object {
    pub(super) fn parse(text: &str) -> serde_json::Result<Self> {
        serde_json::from_str(text)
    }

    pub(super) fn is_call(&self) -> bool {
        let arguments = self.get("arguments").or_else(|| self.get("parameters"));
        self.0.len() == 2 && self.get("name").is_some_and(Value::is_string) && arguments.is_some_and(Value::is_object)
    }

    /// Returns true for one member that is an object.
    pub(super) fn is_wrapper(&self) -> bool {
        matches!(&self.0[..], [(_, Value::Object(_))])
    }

    /// Renames keys that differ from exactly one known key only by letter case and separators. Returns true if one does.
    pub(super) fn rename_keys(&mut self, known: &[&str]) -> bool {
        let mut is_changed = false;
        for (key, _) in &mut self.0 {
            let alike: Vec<_> = known.iter().filter(|known| letters(known) == letters(key)).collect();
            if let [one] = alike[..] {
                is_changed |= *one != key;
                (**one).clone_into(key);
            }
        }
        is_changed
    }

    pub(super) fn keys(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|(key, _)| key.as_str())
    }

    pub(super) fn get(&self, key: &str) -> Option<&Value> {
        self.0.iter().find(|(own, _)| own == key).map(|(_, value)| value)
    }

    pub(super) fn repeated_key(&self) -> Option<&str> {
        let mut keys = self.keys().enumerate();
        keys.find(|(at, key)| self.keys().take(*at).any(|earlier| earlier == *key)).map(|(_, key)| key)
    }
}

/// A key in lower case, without separators: `Selected-Cube` and `selected_cube` are one.
fn letters(key: &str) -> String {
    key.trim().chars().filter(|c| !matches!(c, '_' | '-' | ' ')).flat_map(char::to_lowercase).collect()
}

impl<'de> Deserialize<'de> for Object {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Members;
        impl<'de> Visitor<'de> for Members {
            type Value = Object;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a JSON object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Object, A::Error> {
                let mut members = Vec::new();
                while let Some(member) = map.next_entry()? {
                    members.push(member);
                    if members.len() > MOST_MEMBERS {
                        return Err(A::Error::custom("an object with more than 1000 keys"));
                    }
                }
                Ok(Object(members))
            }
        }
        deserializer.deserialize_map(Members)
    }
}

/// Far more than any reply has; the search for repeated keys is quadratic.
const MOST_MEMBERS: usize = 1000;
