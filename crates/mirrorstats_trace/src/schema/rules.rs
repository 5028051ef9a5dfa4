//! The rules about column values, defined once: the rules of a column, their order and their requirements.
//!
//! `validate::rules` checks them on columns of complete episodes, the check on Spark as aggregates over rows. Both take
//! codes, order and messages from here.

use super::colors::ColorColumn;
use super::colors::palette::Palette;
use super::{Column, Kind, Stored, Value};
use crate::diagnostic::Code;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rule<'a> {
    pub code: Code,
    pub asks: Requirement<'a>,
}

/// A rule's requirement. Only [`Present`](Self::Present) and [`Constant`](Self::Constant) are about nulls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Requirement<'a> {
    Present,
    Name,
    OneOf(&'static [&'static str]),
    Among(&'a [String]),
    Color(ColorColumn, Option<&'a Palette>),
    Within(i64, i64, &'static str),
    Count,
    Constant,
    /// A known experiment; another rule requires a name.
    Experiment(&'a [String]),
    FromOne,
    Once,
    WithoutGap,
}

#[derive(Clone, Copy, Debug, Default)]
pub struct Known<'a> {
    pub palette: Option<&'a Palette>,
    pub experiments: Option<&'a [String]>,
}

impl Column {
    /// Returns true if the column's text is a name, so that an empty one is a fault.
    pub fn names(&self) -> bool {
        self.stored == Stored::String && (self.required || self.constant || self.color.is_some())
    }
}

/// The rules of a column of the schema, in reporting order.
pub fn rules_of<'a>(column: &Column, known: Known<'a>) -> Vec<Rule<'a>> {
    let mut rules = Vec::new();
    let mut rule = |code, asks| rules.push(Rule { code, asks });
    if !column.nullable {
        rule(Code::NullInRequired, Requirement::Present);
    }
    match column.rule {
        Some(code) => rule(code, Requirement::OneOf(column.values)),
        None if column.names() => rule(Code::EmptyString, Requirement::Name),
        None => {}
    }
    if let Some(color) = column.color {
        rule(Code::InvalidColor, Requirement::Color(color, known.palette));
    }
    // The rule that t counts from 1 is stricter than any range, and every integer fits the widest one.
    if let Some((lowest, highest)) = column.stored.range().filter(|(lowest, _)| *lowest > i64::MIN)
        && column.name != "t"
    {
        rule(Code::OutOfRange, Requirement::Within(lowest, highest, column.stored.name()));
    }
    if column.counts && matches!(column.stored.kind(), Kind::Int | Kind::Float) {
        rule(Code::NegativeCount, Requirement::Count);
    }
    if column.constant && column.name != "episode_id" {
        rule(Code::InconsistentConstant, Requirement::Constant);
    }
    match (column.name, known.experiments) {
        ("experiment", Some(experiments)) => {
            rule(Code::UnknownExperiment, Requirement::Experiment(experiments));
        }
        ("t", _) => {
            rule(Code::TStart, Requirement::FromOne);
            rule(Code::TDuplicate, Requirement::Once);
            rule(Code::TGap, Requirement::WithoutGap);
        }
        _ => {}
    }
    rules
}

impl Rule<'_> {
    /// The expected values, for a message. Callers that see single rows may add details about constants and steps.
    pub fn expected(&self) -> String {
        match self.asks {
            Requirement::Present => "a value".to_owned(),
            Requirement::Name => "a name".to_owned(),
            Requirement::OneOf(values) => values.join(", "),
            Requirement::Among(values) => values.join(", "),
            Requirement::Color(column, palette) => column.expected(palette),
            Requirement::Within(lowest, highest, stored) => format!("{lowest} to {highest}, an {stored}"),
            Requirement::Count => "0 or more".to_owned(),
            Requirement::Constant => "one value in all rows of the episode".to_owned(),
            Requirement::Experiment(known) => format!("one of {}", known.join(", ")),
            Requirement::FromOne => "t = 1 in the episode's first row".to_owned(),
            Requirement::Once => "every t once, in one file".to_owned(),
            Requirement::WithoutGap => "every t up to the last".to_owned(),
        }
    }

    pub(crate) fn allows_value(&self, value: Value<'_>) -> bool {
        match value {
            Value::Bool(_) => true,
            Value::Int(number) => self.allows_int(number),
            Value::Float(number) => self.allows_float(number),
            Value::Text(text) => self.allows(text),
        }
    }

    pub fn allows(&self, text: &str) -> bool {
        match self.asks {
            Requirement::Name => !text.is_empty(),
            Requirement::OneOf(values) => values.contains(&text),
            Requirement::Among(values) => values.iter().any(|value| value == text),
            Requirement::Color(column, palette) => column.may_hold(text, palette),
            Requirement::Experiment(known) => text.is_empty() || known.iter().any(|name| name == text),
            _ => true,
        }
    }

    pub(crate) fn allows_int(&self, value: i64) -> bool {
        match self.asks {
            Requirement::Within(lowest, highest, _) => lowest <= value && value <= highest,
            Requirement::Count => value >= 0,
            _ => true,
        }
    }

    pub(crate) fn allows_float(&self, value: f64) -> bool {
        self.asks != Requirement::Count || value >= 0.0
    }
}
