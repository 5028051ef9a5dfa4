//! Answers: keys of a reply that an experiment declares, each with its true value.

use std::collections::BTreeMap;

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Decision, Spec};
use mirrorstats_exact::names;
use mirrorstats_trace::episodes::answers::{Answered, columns_of};
use mirrorstats_trace::episodes::episode::Extra;
use mirrorstats_trace::schema::colors::Color;
use mirrorstats_trace::schema::colors::spelling;

/// The answer that states a lack of evidence.
pub const UNKNOWN: &str = "unknown";

/// A key of a reply that an experiment declares. Exactly one of `truth`, `constant` and `conditions` says what the answer should be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Answer {
    /// Its name in a reply: 1 to 24 lower-case letters, digits and `_`, a letter first. Traces have the columns `answer_KEY` and
    /// `truth_KEY`.
    pub key: String,
    /// Its type.
    #[serde(rename = "type")]
    pub kind: AnswerType,
    /// The texts of which it is one, where the type is `one_of`; 2 to 12 in lower case.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("uniqueItems" = true))]
    pub options: Vec<String>,
    /// True if it may be `unknown`: that there is no evidence.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub unknown: bool,
    /// A fact of the world that it should name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<Fact>,
    /// What it should be in every episode, as text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub constant: Option<String>,
    /// What it should be by condition of the recording, as text; an episode of another condition has no truth.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub conditions: IndexMap<String, String>,
    /// What it is, in the words of the prompt.
    pub words: String,
}

/// The type of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AnswerType {
    /// A colour of the palette.
    Color,
    /// One of the texts in `options`.
    OneOf,
    /// A number.
    Number,
    /// `yes` or `no`.
    YesNo,
}

names!(AnswerType { Color: "color", OneOf: "one_of", Number: "number", YesNo: "yes_no" });

/// A fact of the world, at every step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fact {
    /// The colour of the own body.
    BodyColor,
    /// The colour of the mark on the own body; `unknown` where there is none.
    MarkColor,
    /// The place of the own body among those that the first mirror shows, from left to right: the first option is the
    /// leftmost. `unknown` where it does not show the own body. Needs as many options as there are bodies.
    MirrorPlace,
    /// Whether the own body is in view by way of a mirror.
    MirrorVisible,
    /// The number of others in the room.
    Others,
    /// Of the own pose, m.
    PoseX,
    /// Of the own pose, m.
    PoseY,
    /// Of the own pose, degrees counter-clockwise from +x.
    PoseYaw,
}

names!(Fact {
    BodyColor: "body_color",
    MarkColor: "mark_color",
    MirrorPlace: "mirror_place",
    MirrorVisible: "mirror_visible",
    Others: "others",
    PoseX: "pose_x",
    PoseY: "pose_y",
    PoseYaw: "pose_yaw",
});

impl Fact {
    pub const fn kind(self) -> AnswerType {
        match self {
            Self::BodyColor | Self::MarkColor => AnswerType::Color,
            Self::MirrorPlace => AnswerType::OneOf,
            Self::MirrorVisible => AnswerType::YesNo,
            Self::Others | Self::PoseX | Self::PoseY | Self::PoseYaw => AnswerType::Number,
        }
    }
}

impl Answer {
    /// The accepted texts, including `unknown`; empty if it may be any number or any colour.
    pub fn words(&self) -> Vec<&str> {
        let own: Vec<&str> = match self.kind {
            AnswerType::OneOf => self.options.iter().map(String::as_str).collect(),
            AnswerType::YesNo => vec!["yes", "no"],
            AnswerType::Color | AnswerType::Number => return Vec::new(),
        };
        own.into_iter().chain(self.unknown.then_some(UNKNOWN)).collect()
    }

    /// Parses a text as an answer; letter case and white space do not matter.
    pub fn read(&self, text: &str) -> Option<Answered> {
        let normal = spelling::normal(text);
        let is_one = |normal: &String| match self.kind {
            _ if *normal == UNKNOWN => self.unknown,
            AnswerType::Color => Color::named(normal).is_some(),
            AnswerType::OneOf | AnswerType::YesNo => self.words().contains(&normal.as_str()),
            AnswerType::Number => false,
        };
        let number = || normal.parse().ok().filter(|number: &f64| number.is_finite()).map(Answered::Number);
        if is_one(&normal) {
            return Some(Answered::Text(normal));
        }
        if self.kind == AnswerType::Number { number() } else { None }
    }

    pub fn expected(&self) -> String {
        let own = match self.kind {
            AnswerType::Color => "a colour of the palette".to_owned(),
            AnswerType::Number => "a number".to_owned(),
            AnswerType::OneOf | AnswerType::YesNo => return format!("one of {}", self.words().join(", ")),
        };
        if self.unknown { format!("{own} or {UNKNOWN}") } else { own }
    }

    /// The value of its columns; null for an `unknown` number.
    fn cell(&self, answered: &Answered) -> Option<Answered> {
        let is_number = matches!(answered, Answered::Number(_));
        (is_number == (self.kind == AnswerType::Number)).then(|| answered.clone())
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Answer,
    Truth,
}

impl Spec {
    /// Stores answers or their true values in the columns of a step, by key.
    pub fn put(&self, side: Side, answers: &BTreeMap<String, Answered>, extra: &mut Extra) {
        for answer in &self.answers {
            let column = columns_of(&answer.key)[side as usize].clone();
            extra.answers.remove(&column);
            let cell = answers.get(&answer.key).and_then(|answered| answer.cell(answered));
            extra.answers.extend(cell.map(|cell| (column, cell)));
        }
        let first = self.answers.first().filter(|_| self.decision == Decision::Answer);
        let text = first.and_then(|first| answers.get(&first.key)).map(Answered::text);
        match side {
            Side::Answer => extra.answer = text,
            Side::Truth => extra.answer_truth = text,
        }
    }
}
