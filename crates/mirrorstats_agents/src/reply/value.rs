//! The values of a reply: actions, colours and declared answers.
//!
//! Rule: letter case, white space, surrounding punctuation and the prompt's words for an action are form. Synonyms, several
//! values, numbers in place of texts, and letters of other alphabets are refused.

use mirrorstats_experiment::spec::{Actions, Answer, AnswerType, ReplyKey};
use mirrorstats_trace::episodes::answers::Answered;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::schema::colors::{Color, spelling};
use serde_json::Value;

use super::Repair;
use super::object::Object;
use crate::prompt;

pub(super) fn action(text: &str, actions: Actions, repairs: &mut Vec<Repair>) -> Result<Action, String> {
    let known = prompt::actions(actions);
    let named = |name: &str| prompt::action(name).filter(|action| known.contains(action));
    if let Some(action) = spelled(text, named, repairs) {
        return Ok(action);
    }
    if let Some(action) = by_words(&plain(text), known) {
        repairs.push(Repair::ActionWords);
        return Ok(action);
    }
    let letters: Vec<&str> = known.iter().map(|action| prompt::letter(*action)).collect();
    Err(format!("\"action\" is {}, expected one of {}", shown(text), letters.join(", ")))
}

/// The action of `turn right`, `turn right by 30 degrees` or `d = turn right by 30 degrees`.
fn by_words(plain: &str, known: &[Action]) -> Option<Action> {
    let text = plain.replace('_', " ");
    let is_named = |action: &&Action| {
        let after_letter = text.strip_prefix(prompt::letter(**action)).map(str::trim_start);
        let words = after_letter.and_then(|rest| rest.strip_prefix(['=', ':', '-', '('])).unwrap_or(&text);
        let rest = prompt::words(**action).strip_prefix(words.trim_start());
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(',') || rest.starts_with(" by "))
    };
    known.iter().find(is_named).copied()
}

pub(super) fn color_or_none(key: ReplyKey, text: &str, repairs: &mut Vec<Repair>) -> Result<String, String> {
    let named = |name: &str| (name == "none" || Color::named(name).is_some()).then(|| name.to_owned());
    let fault = || format!("\"{}\" is {}, expected a colour of the palette or none", key.name(), shown(text));
    spelled(text, named, repairs).ok_or_else(fault)
}

/// An answer that an experiment declares; `None` for an empty text.
pub(super) fn answer(
    object: &Object,
    declared: &Answer,
    repairs: &mut Vec<Repair>,
) -> Result<Option<Answered>, String> {
    let Answer { key, kind, .. } = declared;
    let text = match object.get(key) {
        None => return Err(format!("the key \"{key}\" is missing")),
        Some(Value::String(text)) if text.is_empty() => return Ok(None),
        Some(Value::String(text)) => text.clone(),
        Some(Value::Number(number)) if *kind == AnswerType::Number => number.to_string(),
        Some(other) => return Err(format!("\"{key}\" is {}, expected {}", self::kind(other), declared.expected())),
    };
    let fault = || format!("\"{key}\" is {}, expected {}", shown(&text), declared.expected());
    spelled(&text, |text| declared.read(text), repairs).map(Some).ok_or_else(fault)
}

/// The value of a text, else of its plain form, which is a repair.
fn spelled<T>(text: &str, read: impl Fn(&str) -> Option<T>, repairs: &mut Vec<Repair>) -> Option<T> {
    let is_plain = spelling::normal(text) == text;
    is_plain.then(|| read(text)).flatten().or_else(|| {
        let value = read(&plain(text))?;
        repairs.push(Repair::ValueSpelling);
        Some(value)
    })
}

/// A text in lower case, without surrounding white space and punctuation. A dot or a minus before a number stays.
fn plain(text: &str) -> String {
    const AROUND: &str = " \"'`*_“”‘’«»()[]<>";
    let normal = spelling::normal(text);
    let end = normal.trim_end_matches(|c: char| AROUND.contains(c) || ".,;:!".contains(c));
    end.trim_start_matches(|c: char| AROUND.contains(c)).to_owned()
}

/// A quoted text, cut so that messages keep what was expected.
fn shown(text: &str) -> String {
    const LONGEST: usize = 80;
    let cut = text.char_indices().nth(LONGEST).map(|(end, _)| format!("\"{}...\"", &text[..end]));
    cut.unwrap_or_else(|| format!("\"{text}\""))
}

pub(super) fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "a boolean",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "an array",
        Value::Object(_) => "an object",
    }
}
