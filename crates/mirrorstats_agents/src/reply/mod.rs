//! From the text of a reply to a decision.
//!
//! ```text
//! raw text ──► object (strict JSON, then named repairs) ──► the keys of the prompt ──► Reply
//! ```
//!
//! Rule: the form of a reply is repaired, each repair has a name, and the meaning is never guessed. A reply is accepted
//! unchanged, accepted after named repairs, or is no decision: then action, cube and attribution are absent, and only
//! the raw text remains.
//!
//! Form is the text around the object, its container, the spelling of keys and values, and the prompt's own words for an
//! action. `docs/how-to/models.md` lists both sides.
//!
//! A `selected_cube` other than `none` with an action other than `done` breaks a rule of the prompt, but the object is
//! well-formed. It is kept as replied, and the metrics use only the cube of the `done` step.

mod object;
mod repair;
mod surrogates;
mod thoughts;
mod value;

use serde_json::{Value, json};

use object::Object;
use repair::NoObject;
pub use repair::Repair;
#[cfg(feature = "play")]
pub use surrogates::without_lone_surrogates;
#[cfg(feature = "play")]
pub use thoughts::has_object;

use super::{Answers, Reply, Status, Usage, Words, prompt};
use mirrorstats_experiment::Spec;
use mirrorstats_experiment::spec::{Actions, Answer, AnswerType, ReplyKey, Side};
use mirrorstats_identification::{Reading, UNREADABLE};
use mirrorstats_trace::episodes::episode::Step;
use mirrorstats_trace::schema::colors::Color;

/// The end of a reply, as reported by the provider.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Ending {
    #[default]
    Whole,
    /// Cut off by the token limit: no decision, unless only white space follows a whole object.
    Truncated,
    /// Declined by the model or a filter around it.
    Refused,
}

impl Reply {
    pub fn without_decision(status: Status, fault: Option<String>) -> Self {
        Self { status, fault, ..Self::default() }
    }

    /// Prepends the repairs of the text's container.
    #[must_use]
    pub fn after(mut self, carried: &[Repair]) -> Self {
        let is_new = |repair: &Repair| !self.repairs.contains(repair);
        let new: Vec<_> = carried.iter().copied().filter(is_new).collect();
        if matches!(self.status, Status::Ok | Status::Repaired) && !new.is_empty() {
            self.repairs.splice(..0, new);
            self.status = Status::Repaired;
        }
        self
    }

    /// Stores what was read in the columns of a step; its action, text and cost are left out.
    pub fn put(self, experiment: &Spec, step: &mut Step) {
        let extra = &mut step.extra;
        experiment.put(Side::Answer, &self.answers, extra);
        (step.self_color, step.selected_cube) = (self.self_color, self.selected_cube);
        extra.mark_report = self.mark_report;
        extra.reply_status = Some(self.status.name().to_owned());
        extra.reply_repair = Repair::joined(&self.repairs);
        extra.reply_fault = self.fault;
        extra.view_description = self.words.view_description;
        extra.reasoning = self.words.reasoning;
        extra.summary = self.words.summary;
        extra.identification = self.words.identification;
    }

    /// Adds the text that was read, and its cost.
    #[must_use]
    pub fn with_text(self, raw: String, usage: Usage) -> Self {
        Self { raw: Some(raw), usage, ..self }
    }
}

/// Parses a reply's text by the keys and actions of an experiment. Its text and its cost are left out.
pub fn read(raw: &str, experiment: &Spec, ending: Ending) -> Reply {
    let is_truncated = ending == Ending::Truncated;
    // Some models fill the rest of their limit with white space: then the object is whole.
    let has_cut_words = !raw.trim_end_matches(|c: char| c.is_whitespace() || c == '`').ends_with('}');
    match ending {
        Ending::Refused => return Reply::without_decision(Status::Refusal, None),
        Ending::Truncated if has_cut_words => return Reply::without_decision(Status::Truncated, None),
        _ if raw.trim().is_empty() => return Reply::without_decision(Status::Empty, None),
        _ => {}
    }
    let (object, mut repairs) = match repair::object(raw) {
        Ok(found) => found,
        Err(_) if is_truncated => return Reply::without_decision(Status::Truncated, None),
        Err(fault) => return without_object(fault),
    };
    match decision(object, experiment) {
        Ok(reply) => {
            repairs.extend(reply.repairs);
            repairs.dedup();
            let status = if repairs.is_empty() { Status::Ok } else { Status::Repaired };
            Reply { status, repairs, ..reply }
        }
        Err(fault) => Reply::without_decision(Status::SchemaInvalid, Some(fault)),
    }
}

/// The fault of an answer whose only text is the model's reasoning.
pub const REASONING_ALONE: &str = "the answer has reasoning, but no text after it";

fn without_object(fault: NoObject) -> Reply {
    let (status, fault) = match fault {
        NoObject::Unreadable(fault) => (Status::ParseFailed, Some(fault)),
        NoObject::OpenThoughts => (Status::Truncated, Some("the reply ends within its thoughts".to_owned())),
        NoObject::ThoughtsAlone => (Status::Empty, Some(REASONING_ALONE.to_owned())),
    };
    Reply::without_decision(status, fault)
}

fn decision(mut object: Object, experiment: &Spec) -> Result<Reply, String> {
    let keys = experiment.keys();
    let mut repairs = if object.rename_keys(&keys) { vec![Repair::KeySpelling] } else { Vec::new() };
    if let Some(key) = object.repeated_key() {
        return Err(format!("the key \"{key}\" occurs twice"));
    }
    if let Some(key) = object.keys().find(|key| !keys.contains(key)) {
        return Err(format!("the key \"{key}\" is not one of {}", listed(&keys)));
    }
    let text = |key: ReplyKey| match object.get(key.name()) {
        _ if !experiment.reply.contains(&key) => Ok(None),
        None => Err(format!("the key \"{}\" is missing", key.name())),
        Some(Value::String(text)) => Ok(Some(text.clone())),
        Some(other) => Err(format!("\"{}\" is {}, expected a string", key.name(), value::kind(other))),
    };
    let action = value::action(&text(ReplyKey::Action)?.unwrap_or_default(), experiment.actions, &mut repairs)?;
    let mut color = |key| text(key)?.map(|name| value::color_or_none(key, &name, &mut repairs)).transpose();
    let selected_cube = color(ReplyKey::SelectedCube)?;
    let mark_report = color(ReplyKey::Mark)?;
    let identification = text(ReplyKey::Identification)?;
    let reading = identification.as_deref().map(Reading::of);
    let is_unreadable = reading == Some(Reading::Unreadable);
    let mut answers = Answers::new();
    for declared in &experiment.answers {
        let answered = value::answer(&object, declared, &mut repairs)?;
        answers.extend(answered.map(|answered| (declared.key.clone(), answered)));
    }
    Ok(Reply {
        repairs,
        action: Some(action),
        selected_cube,
        mark_report,
        answers,
        self_color: reading.and_then(Reading::self_color).map(str::to_owned),
        fault: identification.as_ref().filter(|_| is_unreadable).map(|text| format!("{UNREADABLE}{text}")),
        words: Words {
            view_description: text(ReplyKey::ViewDescription)?,
            reasoning: text(ReplyKey::Reasoning)?,
            summary: text(ReplyKey::Summary)?,
            identification,
        },
        ..Reply::default()
    })
}

fn listed(keys: &[&str]) -> String {
    keys.iter().map(|key| format!("\"{key}\"")).collect::<Vec<_>>().join(", ")
}

/// The JSON Schema of a reply, as sent to agents and enforced by providers where possible.
///
/// It contains only keys and types, also for the answers that an experiment declares. A provider may show the schema to
/// its model, which must learn nothing beyond the prompt: descriptions, titles or colour lists would reveal what E5
/// leaves the model to find out.
pub fn structure(experiment: &Spec) -> Value {
    let plain = experiment.reply.iter().map(|key| (key.name().to_owned(), json!({ "type": "string" })));
    let own = experiment.answers.iter().map(|answer| (answer.key.clone(), property(answer)));
    json!({
        "type": "object",
        "properties": plain.chain(own).collect::<serde_json::Map<_, _>>(),
        "required": experiment.keys(),
        "additionalProperties": false,
    })
}

/// The type of an answer. Not every provider supports unions, so a number that may be `unknown` is a text.
fn property(answer: &Answer) -> Value {
    let is_number = answer.kind == AnswerType::Number && !answer.unknown;
    json!({ "type": if is_number { "number" } else { "string" } })
}

/// SHA-256 of the structure and of its own answers' words, if any; 64 hexadecimal digits, for recordings.
pub fn structure_hash(experiment: &Spec) -> String {
    let words: String = experiment.answers.iter().flat_map(|answer| ["\n", answer.words.as_str()]).collect();
    mirrorstats_exact::hash::of_bytes(format!("{}{words}", structure(experiment)).as_bytes())
}

/// The JSON Schema of a reply for people, with descriptions and the accepted values. Agents do not get it; see
/// [`structure`].
pub fn schema(title: &str, experiment: &Spec) -> Value {
    let actions = experiment.actions;
    let description = |key: ReplyKey| match key {
        ReplyKey::ViewDescription => "What the image shows.",
        ReplyKey::Reasoning => "Why this action.",
        ReplyKey::Action if actions == Actions::Hand => {
            "The hand: 1 = up, 2 = down, 3 = left, 4 = right, 5 = away from the camera, 6 = towards the camera."
        }
        ReplyKey::Action => {
            "w = forward, s = backward, a = left by 30 degrees, d = right by 30 degrees, done = task complete."
        }
        ReplyKey::Summary => "The thought that comes back as the history of the next step.",
        ReplyKey::SelectedCube => "A colour when the action is done, otherwise none.",
        ReplyKey::Mark => "The colour of the mark on one's own body, or none.",
        ReplyKey::Identification => "The colour of one's own body as far as it is known.",
    };
    let mut schema = json!({ "$schema": "https://json-schema.org/draft/2020-12/schema", "title": title });
    if let (Value::Object(schema), Value::Object(structure)) = (&mut schema, structure(experiment)) {
        schema.extend(structure);
    }
    for key in &experiment.reply {
        let property = &mut schema["properties"][key.name()];
        property["description"] = description(*key).into();
        match key {
            ReplyKey::Action => {
                property["enum"] = prompt::actions(actions).iter().map(|action| prompt::letter(*action)).collect();
            }
            ReplyKey::SelectedCube | ReplyKey::Mark => {
                property["enum"] = Color::ALL.map(Color::name).into_iter().chain(["none"]).collect();
            }
            _ => {}
        }
    }
    for answer in &experiment.answers {
        let property = &mut schema["properties"][answer.key.as_str()];
        let words = answer.words();
        if !words.is_empty() {
            property["enum"] = words.into();
        }
        property["description"] = answer.words.clone().into();
    }
    schema
}
