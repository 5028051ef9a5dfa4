//! The plan as text: one line per step, then the outputs.

use std::fmt;

use super::{Kernel, PhysicalPlan, Shape, StepId};
use mirrorstats_metric::columns::Type;
use mirrorstats_metric::logical_plan::plan::Comparison;

impl fmt::Display for PhysicalPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, step) in self.steps.iter().enumerate() {
            let kind = match (&step.kernel, step.ty) {
                (Kernel::Within(_), _) => "rows",
                (_, Type::Bool) => "bool",
                (_, Type::Int) => "int",
                (_, Type::Float) => "float",
                (_, Type::Text) => "text",
            };
            let shape = match step.shape {
                Shape::One => "constant",
                Shape::Episodes => "per episode",
                Shape::Timesteps => "per timestep",
            };
            writeln!(f, "{:<5}{kind:<6}{shape:<14}{}", StepId(at).to_string(), step.kernel)?;
        }
        for scores in &self.scores {
            if let Some(filter) = scores.filter {
                writeln!(f, "where {filter}")?;
            }
            for metric in &scores.metrics {
                writeln!(f, "{} = {}", metric.name, metric.step)?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for StepId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "%{}", self.0)
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Column(name) => write!(f, "column {name}"),
            Self::Constant(constant) => write!(f, "constant {constant}"),
            Self::KeysEqualText { keys, text, equal } => write!(f, "keys {keys} {} text {text}", sign(*equal)),
            Self::KeysEqualEpisode { keys, texts, equal } => {
                write!(f, "keys {keys} {} text of the episode {texts}", sign(*equal))
            }
            Self::Compare(comparison, x, y) => write!(f, "{x} {comparison} {y}"),
            Self::CompareTexts(comparison, x, y) => write!(f, "texts {x} {comparison} {y}"),
            Self::Window(comparison, moments) => write!(f, "t {comparison} {moments}"),
            Self::Arithmetic(op, x, y) | Self::Divide(op, x, y) => write!(f, "{x} {op} {y}"),
            Self::KeysMatch(x, pattern) => write!(f, "keys {x} match {pattern:?}"),
            Self::SymbolsMatch(x, pattern) => write!(f, "symbols {x} match {pattern:?}"),
            Self::Within(windows) => {
                let window = |(comparison, moments): &(Comparison, StepId)| format!("t {comparison} {moments}");
                let windows: Vec<String> = windows.iter().map(window).collect();
                write!(f, "rows where {}", windows.join(" and "))
            }
            Self::Search { aggregate, condition, within } => {
                write!(f, "{aggregate} {condition}")?;
                within.map_or(Ok(()), |rows| write!(f, " within {rows}"))
            }
            Self::Fold(aggregate, x) => write!(f, "{aggregate} {x}"),
            Self::At { values, moments } => write!(f, "{values} at t = {moments}"),
            Self::NullWhereAbsent { values, moments } => write!(f, "{values} where t = {moments} exists"),
            Self::Case { branches, otherwise } => {
                write!(f, "case")?;
                branches.iter().try_for_each(|(when, then)| write!(f, " when {when} then {then}"))?;
                write!(f, " else {otherwise}")
            }
            other => {
                write!(f, "{}", other.word())?;
                other.operands().iter().try_for_each(|operand| write!(f, " {operand}"))
            }
        }
    }
}

impl Kernel {
    const fn word(&self) -> &'static str {
        match self {
            Self::Times => "timesteps",
            Self::Lengths => "lengths",
            Self::Repeat(_) => "repeat",
            Self::Spread(_) => "spread",
            Self::Symbols(_) => "symbols",
            Self::Not(_) => "not",
            Self::And(..) => "and",
            Self::Or(..) => "or",
            Self::Distinct(..) => "distinct",
            Self::IsNull(_) => "is null",
            Self::IsTrue(_) => "is true",
            Self::IsFalse(_) => "is false",
            Self::Negate(_) => "negate",
            Self::Coalesce(_) => "coalesce",
            Self::IntFromBool(_) => "int",
            Self::FloatFromInt(_) => "float",
            Self::Lag(_) => "lag",
            _ => "",
        }
    }
}

const fn sign(equal: bool) -> &'static str {
    if equal { "=" } else { "<>" }
}
