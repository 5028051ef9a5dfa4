//! Converts the free text of `identification` to an attribution: what it says about its author.
//!
//! ```text
//! text ──► sentences of words ──► noun phrases, verbs, links ──► clauses ──► claims about oneself ──► Reading
//! ```
//!
//! The rule is in `docs/explanation/self-attribution.md`, the words are in `assets/trace/identification.toml`. A colour
//! is a claim only if the grammar finds that its bearer is the author. [`VERSION`] changes with every change of meaning.
//! Recordings contain it, and the column can be derived from the texts again at any time.

mod chunks;
mod claims;
mod clauses;
mod entities;
mod fragments;
mod lexicon;
mod moods;
mod nouns;
mod predicates;
mod tokens;

use serde_json::{Map, Value};

use claims::Reader;
use entities::Claim;
use lexicon::Hue;
use mirrorstats_trace::schema::colors::Color;

pub const VERSION: &str = "3";

const VERSION_KEY: &str = "identification_version";

pub const UNKNOWN: &str = "unknown";

/// The beginning of `reply_fault` for a text that no rule reads.
pub const UNREADABLE: &str = "unreadable identification: ";

/// What a text says about its author.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    Color(Color),
    /// English without a claim to a colour.
    Unknown,
    /// Another language.
    Unreadable,
    /// No words, or a colour outside the palette.
    Nothing,
}

impl Reading {
    /// ```
    /// use mirrorstats_identification::Reading;
    ///
    /// assert_eq!(Reading::of("I am the crimson robot.").self_color(), Some("red"));
    /// assert_eq!(Reading::of("The robot ahead is red.").self_color(), Some("unknown"));
    /// assert_eq!(Reading::of("Ich bin rot."), Reading::Unreadable);
    /// ```
    pub fn of(text: &str) -> Self {
        let sentences = tokens::sentences(text);
        let mut reader = Reader::default();
        sentences.iter().filter(|sentence| sentence.is_english).for_each(|sentence| reader.add(sentence));
        match reader.claim() {
            Claim::One(Hue::Palette(color)) => Self::Color(color),
            Claim::One(Hue::Outside) => Self::Nothing,
            Claim::Nothing if sentences.is_empty() => Self::Nothing,
            Claim::Nothing if sentences.iter().any(|sentence| sentence.is_foreign) => Self::Unreadable,
            Claim::Nothing if !sentences.iter().any(|sentence| sentence.is_english) => Self::Unreadable,
            Claim::Several | Claim::Nothing => Self::Unknown,
        }
    }

    /// The value of the column.
    pub fn self_color(self) -> Option<&'static str> {
        match self {
            Self::Color(color) => Some(color.name()),
            Self::Unknown => Some(UNKNOWN),
            Self::Unreadable | Self::Nothing => None,
        }
    }
}

/// Sets the version of the rule where a recording has it, else beside its other keys; returns the previous version.
pub fn put_version(recording: &mut Value) -> Option<String> {
    let text = |value: Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    if let Some(place) = find(recording) {
        return Some(text(std::mem::replace(place, VERSION.into())));
    }
    recording[VERSION_KEY] = VERSION.into();
    None
}

fn find(value: &mut Value) -> Option<&mut Value> {
    let members: &mut Map<String, Value> = value.as_object_mut()?;
    if members.contains_key(VERSION_KEY) {
        return members.get_mut(VERSION_KEY);
    }
    members.iter_mut().find_map(|(_, inner)| find(inner))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::{VERSION, put_version};

    #[test]
    fn the_version_is_replaced_where_it_stands() {
        let mut recording = json!({ "version": 1, "agent": { "vlm": { "id": "x", "identification_version": "0" } } });
        assert_eq!(put_version(&mut recording), Some("0".to_owned()));
        assert_eq!(recording["agent"]["vlm"]["identification_version"], VERSION);
        assert_eq!(recording.as_object().unwrap().len(), 2);
    }

    #[test]
    fn a_recording_without_a_version_gets_one() {
        let mut recording = json!({ "kind": "import" });
        assert_eq!(put_version(&mut recording), None);
        assert_eq!(recording, json!({ "kind": "import", "identification_version": VERSION }));
        assert_eq!(put_version(&mut recording), Some(VERSION.to_owned()));
    }
}
