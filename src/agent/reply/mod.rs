//! From the text of a reply to a decision.
//!
//! ```text
//! raw text ──► object (strict JSON, then named repairs) ──► the keys of the prompt ──► Reading
//! ```
//!
//! Rule: nothing is made up. A reply is taken as it is, or after a repair that has a name, or it is no decision: then
//! action, cube and attribution are absent, and the raw text is all there is. The raw text keeps how `selected_cube` and
//! `identification` were written: letter case and white space mean nothing in either, and are no repair.
//!
//! A `selected_cube` other than `none` beside another action than `done` breaks a rule of the prompt, but not the
//! shape of the object: it is kept as replied, and the metrics look at the cube of the `done` step alone.

mod object;
mod repair;
mod surrogates;
mod thoughts;

use serde_json::{Value, json};

use repair::NoObject;
pub use repair::Repair;
#[cfg(feature = "sim")]
pub(in crate::agent) use surrogates::without_lone_surrogates;

use super::{Family, Reply, Status, Usage, Words, prompt};
use crate::base::palette::Color;
use crate::trace::colors::spelling;
use crate::trace::episode::Action;
use crate::trace::identification;

/// How a provider says that a reply ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Ending {
    /// The model was done.
    Whole,
    /// The limit of tokens cut it off.
    Truncated,
    /// The model, or a filter around it, declined.
    Refused,
}

/// What a reply's text says.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// The outcome; `Ok` or `Repaired` where there is a decision.
    pub status: Status,
    /// What had to be repaired, in order; empty unless `Repaired`.
    pub repairs: Vec<Repair>,
    /// Why there is no decision, for people; `None` where there is one.
    pub fault: Option<String>,
    /// The action.
    pub action: Option<Action>,
    /// The cube of the cube-selection family: a colour or `none`.
    pub selected_cube: Option<String>,
    /// The attribution: the normal form of the identification.
    pub self_color: Option<String>,
    /// The free text.
    pub words: Words,
}

impl Reading {
    fn without_decision(status: Status, fault: Option<String>) -> Self {
        Self {
            status,
            repairs: Vec::new(),
            fault,
            action: None,
            selected_cube: None,
            self_color: None,
            words: Words::default(),
        }
    }

    /// The same where what carried the text had a lone surrogate in it, which is part of the reply's repairs.
    #[cfg(feature = "sim")]
    #[must_use]
    pub(in crate::agent) fn with_surrogate_repaired(mut self) -> Self {
        if matches!(self.status, Status::Ok | Status::Repaired) && !self.repairs.contains(&Repair::Surrogate) {
            self.repairs.insert(0, Repair::Surrogate);
            self.status = Status::Repaired;
        }
        self
    }

    /// The reply of an agent: this reading, the text it was read from, and what that cost.
    pub fn into_reply(self, raw: String, usage: Usage) -> Reply {
        Reply {
            status: self.status,
            repairs: self.repairs,
            action: self.action,
            self_color: self.self_color,
            selected_cube: self.selected_cube,
            words: self.words,
            raw: Some(raw),
            usage,
            model: None,
        }
    }
}

/// Reads the text of a reply.
pub fn read(raw: &str, family: Family, ending: Ending) -> Reading {
    match ending {
        Ending::Refused => return Reading::without_decision(Status::Refusal, None),
        Ending::Truncated => return Reading::without_decision(Status::Truncated, None),
        Ending::Whole if raw.trim().is_empty() => return Reading::without_decision(Status::Empty, None),
        Ending::Whole => {}
    }
    let (object, repairs) = match repair::object(raw) {
        Ok(found) => found,
        Err(fault) => return without_object(fault),
    };
    match decision(&object, family) {
        Ok(reading) if repairs.is_empty() => reading,
        Ok(reading) => Reading { status: Status::Repaired, repairs, ..reading },
        Err(fault) => Reading::without_decision(Status::SchemaInvalid, Some(fault)),
    }
}

/// The reading of a reply without an object.
fn without_object(fault: NoObject) -> Reading {
    let (status, fault) = match fault {
        NoObject::Unreadable(fault) => (Status::ParseFailed, Some(fault)),
        NoObject::OpenThoughts => (Status::Truncated, Some("the reply ends within <think>".to_owned())),
        NoObject::ThoughtsAlone => (Status::Empty, None),
    };
    Reading::without_decision(status, fault)
}

/// The keys of a family, in the order of the prompt.
fn keys(family: Family) -> &'static [&'static str] {
    match family {
        Family::CubeSelection => {
            &["view-description", "reasoning", "action", "summary", "selected_cube", "identification"]
        }
        Family::Exploration => &["view-description", "reasoning", "action", "summary", "identification"],
    }
}

/// The decision in an object that has exactly the keys of its family.
fn decision(object: &object::Object, family: Family) -> Result<Reading, String> {
    let expected = keys(family);
    if let Some(key) = object.repeated_key() {
        return Err(format!("the key \"{key}\" stands twice"));
    }
    if let Some(key) = object.keys().find(|key| !expected.contains(key)) {
        return Err(format!("the key \"{key}\" is none of {}", listed(expected)));
    }
    let text = |key: &str| match object.get(key) {
        None => Err(format!("the key \"{key}\" is missing")),
        Some(Value::String(text)) => Ok(text.clone()),
        Some(other) => Err(format!("\"{key}\" is {}, expected a string", kind(other))),
    };
    let action = text("action")?;
    let action = prompt::action(&action)
        .ok_or_else(|| format!("\"action\" is \"{action}\", expected one of w, s, a, d, done"))?;
    let selected_cube = match family {
        Family::CubeSelection => Some(cube(&text("selected_cube")?)?),
        Family::Exploration => None,
    };
    let identification = text("identification")?;
    Ok(Reading {
        status: Status::Ok,
        repairs: Vec::new(),
        fault: None,
        action: Some(action),
        selected_cube,
        self_color: identification::normal_form(&identification).map(str::to_owned),
        words: Words {
            view_description: Some(text("view-description")?),
            reasoning: Some(text("reasoning")?),
            summary: Some(text("summary")?),
            identification: Some(identification),
        },
    })
}

/// The cube that a reply names. Letter case and white space do not matter, as in an identification.
fn cube(name: &str) -> Result<String, String> {
    let cube = spelling::normal(name);
    if cube == "none" || Color::named(&cube).is_some() {
        return Ok(cube);
    }
    Err(format!("\"selected_cube\" is \"{name}\", expected a colour of the palette or none"))
}

fn listed(names: &[&str]) -> String {
    names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ")
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "a boolean",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "an array",
        Value::Object(_) => "an object",
    }
}

/// The structure of a family's reply as JSON Schema: what agents are sent, and what providers enforce where they can.
///
/// It has keys and types alone. A provider may show the schema to its model, and the prompt is all that a model may be
/// told: a description, a title or a list of colours would say what E5 leaves for the model to find out.
pub fn structure(family: Family) -> Value {
    let property = |key: &&str| ((*key).to_owned(), json!({ "type": "string" }));
    json!({
        "type": "object",
        "properties": keys(family).iter().map(property).collect::<serde_json::Map<_, _>>(),
        "required": keys(family),
        "additionalProperties": false,
    })
}

/// The SHA-256 of both structures, for recordings.
#[cfg(feature = "sim")]
pub(super) fn structure_hashes() -> Value {
    let hash = |family| crate::base::hash::of_bytes(structure(family).to_string().as_bytes());
    json!({ "cube_selection": hash(Family::CubeSelection), "exploration": hash(Family::Exploration) })
}

/// The JSON Schema of a family's reply for people, with descriptions and the values that are read. No agent gets it; see
/// [`structure`].
pub fn schema(family: Family) -> Value {
    let description = |key: &str| match key {
        "view-description" => "What the image shows.",
        "reasoning" => "Why this action.",
        "action" => "w = forward, s = backward, a = left by 30 degrees, d = right by 30 degrees, done = task complete.",
        "summary" => "The thought that comes back as the history of the next step.",
        "selected_cube" => "A colour when the action is done, otherwise none.",
        _ => "The colour of one's own body as far as it is known.",
    };
    let mut properties = serde_json::Map::new();
    for key in keys(family) {
        let mut property = json!({ "type": "string", "description": description(key) });
        match *key {
            "action" => property["enum"] = json!(["w", "s", "a", "d", "done"]),
            "selected_cube" => {
                let colors = Color::ALL.iter().map(|color| color.name());
                property["enum"] = colors.chain(["none"]).collect();
            }
            _ => {}
        }
        properties.insert((*key).to_owned(), property);
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": match family {
            Family::CubeSelection => "Reply in E1 to E4",
            Family::Exploration => "Reply in E5",
        },
        "type": "object",
        "properties": properties,
        "required": keys(family),
        "additionalProperties": false,
    })
}
