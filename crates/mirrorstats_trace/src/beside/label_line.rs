//! One line of a list of labels.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::escape::visible;

/// A note takes at most six bytes per character in JSON, and names are short.
pub const LONGEST_LINE: Limit = Limit::new("bytes in a line of a list of labels", 64 << 10);

const LONGEST_WORD: usize = 40;
const LONGEST_CODER: usize = 64;
const LONGEST_NOTE: usize = 2000;

/// A label or a note that a coder puts on an episode or a step.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LabelLine {
    /// The coder's name: 1 to 64 visible characters.
    pub coder: String,
    /// The episode's id.
    pub episode_id: String,
    /// The timestep, from 1; absent for the whole episode.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<u32>,
    /// Lowercase letters, digits and `_`, beginning with a letter, at most 40. Absent if the coder looked and puts no label.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub label: Option<String>,
    /// At most 2000 characters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    /// True if the line takes back what the coder said before of this episode, step and label.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub removed: bool,
}

impl LabelLine {
    pub fn check(&self) -> Result<(), InvalidLabel> {
        check_coder(&self.coder)?;
        let is_empty = self.episode_id.is_empty().then(|| InvalidLabel::new("the id of an episode", "no text"));
        let is_zero = (self.step == Some(0)).then(|| InvalidLabel::new("a step from 1", "0"));
        let word = self.label.as_deref().filter(|word| !is_word(word)).map(|word| {
            let expected = "a label of at most 40 lowercase letters, digits and `_` that begins with a letter";
            InvalidLabel::new(expected, format!("`{}`", visible(word)))
        });
        let length = self.note.as_deref().map_or(0, |note| note.chars().count());
        let note = (length > LONGEST_NOTE)
            .then(|| InvalidLabel::new("a note of at most 2000 characters", format!("{length} characters")));
        is_empty.or(is_zero).or(word).or(note).map_or(Ok(()), Err)
    }
}

pub fn check_coder(name: &str) -> Result<(), InvalidLabel> {
    let length = name.chars().count();
    if length == 0 || length > LONGEST_CODER || name.trim() != name || name.chars().any(char::is_control) {
        let expected = "a coder's name of 1 to 64 visible characters, without spaces around it";
        return Err(InvalidLabel::new(expected, format!("`{}`", visible(name))));
    }
    Ok(())
}

fn is_word(text: &str) -> bool {
    let is_letter = |byte: u8| byte.is_ascii_lowercase();
    text.len() <= LONGEST_WORD
        && text.bytes().next().is_some_and(is_letter)
        && text.bytes().all(|byte| is_letter(byte) || byte.is_ascii_digit() || byte == b'_')
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected {expected}, found {found}")]
pub struct InvalidLabel {
    expected: &'static str,
    found: String,
}

impl InvalidLabel {
    fn new(expected: &'static str, found: impl Into<String>) -> Self {
        Self { expected, found: found.into() }
    }
}
