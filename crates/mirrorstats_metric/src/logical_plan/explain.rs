//! A metric's plan in words, for readers who do not know SQL.

use std::fmt;

use schemars::JsonSchema;
use serde::Serialize;

use crate::catalogs::catalog::{Better, Kind, StandardError};
use crate::columns::{Level, Type};
use crate::definitions::Definitions;
use crate::logical_plan::plan::{Arithmetic, Comparison};
use crate::names::mentioned;
use crate::syntax::{self, BinaryOp, Expr, ExprKind, Literal};
use mirrorstats_toml_spec::Written;

/// A metric in words, from its title down to the columns that it reads.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Explanation {
    /// The metric's name.
    pub metric: String,
    /// Its full name.
    pub title: String,
    /// Rate or quantity.
    pub kind: Kind,
    /// The unit.
    pub unit: String,
    /// The better direction.
    pub better: Better,
    /// The section of the paper; may be empty.
    pub section: String,
    /// For a reader of the table; may be empty.
    pub help: String,
    /// The standard error of its mean.
    pub se: StandardError,
    /// The expression as written.
    pub value: String,
    /// The condition for it to be defined, as written; defined everywhere if absent.
    pub when: Option<String>,
    /// The same in words.
    pub words: String,
    /// The names that it builds on, in the order of their first use.
    pub names: Vec<NamedExpression>,
    /// The columns of the trace that it reads, in the order of the plan.
    pub columns: Vec<String>,
}

/// A `let` or another metric that a metric builds on.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NamedExpression {
    /// Its name.
    pub name: String,
    /// True if it has one value per step; else it has one per episode.
    pub(crate) every_step: bool,
    /// The expression as written.
    pub expression: String,
    /// The same in words.
    pub words: String,
}

impl Definitions {
    pub fn explain(&self, metric: &str) -> Option<Explanation> {
        let entry = self.catalog.metric.get(metric)?;
        let written = self.document().metrics.get(metric)?;
        let mut names = Vec::new();
        for text in std::iter::once(&written.value).chain(&written.when) {
            self.collect_names(text, &mut names);
        }
        let node = self.plan.outputs.iter().find(|output| output.name == metric)?.node;
        let columns = self.plan.columns(&self.plan.needed_by([node]));
        Some(Explanation {
            metric: metric.to_owned(),
            title: entry.title.clone(),
            kind: entry.kind,
            unit: entry.unit.clone(),
            better: entry.better,
            section: entry.section.clone(),
            help: entry.help.clone(),
            se: entry.se,
            value: entry.value.clone(),
            when: entry.when.clone(),
            words: sentence(&written.value, written.when.as_ref(), entry.kind),
            names,
            columns: columns.into_iter().map(|(name, _)| name.to_owned()).collect(),
        })
    }

    /// Adds the names that `written` refers to, directly or not, in the order of first use.
    fn collect_names(&self, written: &Written, found: &mut Vec<NamedExpression>) {
        for name in mentioned(&written.text) {
            if found.iter().any(|known| known.name == name) {
                continue;
            }
            let Some((texts, named)) = self.named(&name) else { continue };
            found.push(named);
            for text in texts {
                self.collect_names(text, found);
            }
        }
    }

    fn named(&self, name: &str) -> Option<(Vec<&Written>, NamedExpression)> {
        let document = self.document();
        if let Some((written, _)) = document.lets.get(name) {
            let node = self.plan.lets.iter().find(|(known, _)| known == name).map(|(_, node)| *node)?;
            let node = self.plan.node(node);
            let expr = syntax::parse(&written.text).ok()?;
            let words = if node.ty == Type::Bool { condition(&expr) } else { value(&expr) };
            let every_step = node.level == Level::Step;
            let named = NamedExpression { name: name.to_owned(), every_step, expression: written.text.clone(), words };
            return Some((vec![written], named));
        }
        let entry = document.metrics.get(name)?;
        let kind = self.catalog.metric.get(name)?.kind;
        let words = sentence(&entry.value, entry.when.as_ref(), kind);
        let expression = entry.value.text.clone();
        let named = NamedExpression { name: name.to_owned(), every_step: false, expression, words };
        Some((std::iter::once(&entry.value).chain(&entry.when).collect(), named))
    }
}

fn sentence(written: &Written, when: Option<&Written>, kind: Kind) -> String {
    let Ok(expr) = syntax::parse(&written.text) else { return String::new() };
    let what = match (&expr.kind, kind) {
        (ExprKind::Name(name), _) => name.clone(),
        (_, Kind::Rate) => format!("1 if {}, else 0", condition(&expr)),
        (_, Kind::Quantity) => value(&expr),
    };
    match when.map(|when| syntax::parse(&when.text)) {
        Some(Ok(when)) => format!("{what}; defined where {}", condition(&when)),
        _ => what,
    }
}

fn condition(expr: &Expr) -> String {
    match &expr.kind {
        ExprKind::Name(name) => format!("{name} holds"),
        ExprKind::Literal(Literal::Bool(true)) => "always".to_owned(),
        ExprKind::Literal(Literal::Bool(false)) => "never".to_owned(),
        ExprKind::Not(x) => tested(x, true).unwrap_or_else(|| format!("not ({})", condition(x))),
        ExprKind::Binary(BinaryOp::And, x, y) => format!("{} and {}", part(x), part(y)),
        ExprKind::Binary(BinaryOp::Or, x, y) => format!("{} or {}", part(x), part(y)),
        ExprKind::Binary(op, x, y) => format!("{} {} {}", value(x), relation(*op, x), value(y)),
        ExprKind::Call { name, arguments } => match (name.as_str(), arguments.as_slice()) {
            ("any", [p]) => format!("at some step {}", part(p)),
            ("all", [p]) => format!("at every step {}", part(p)),
            ("coalesce", [p, Expr { kind: ExprKind::Literal(Literal::Bool(false)), .. }]) => {
                format!("{} (null counts as not)", condition(p))
            }
            ("coalesce", [p, rest @ ..]) => {
                let rest: Vec<String> =
                    rest.iter().map(|x| format!(", or where that is null, {}", condition(x))).collect();
                format!("{}{}", condition(p), rest.concat())
            }
            ("regexp_like", [text, pattern]) => format!("{} has a match of {}", value(text), value(pattern)),
            _ => value(expr),
        },
        _ => tested(expr, false).unwrap_or_else(|| value(expr)),
    }
}

/// The tests that have words of their own with `not`.
fn tested(expr: &Expr, negated: bool) -> Option<String> {
    let either = |positive: &'static str, negative: &'static str| if negated { negative } else { positive };
    let not = either("", "not ");
    Some(match &expr.kind {
        ExprKind::IsNull(x) => format!("there is {} {}", either("no", "a"), value(x)),
        ExprKind::IsTruth(x, truth) => format!("it is {not}{truth} that {}", part(x)),
        ExprKind::Distinct(x, y) => {
            format!("{} {} {} (nulls alike)", value(x), either("is another than", "is the same as"), value(y))
        }
        ExprKind::Between(x, [low, high]) => format!("{} is {not}from {} to {}", value(x), value(low), value(high)),
        ExprKind::InList(x, list) => {
            let list: Vec<String> = list.iter().map(value).collect();
            format!("{} {} {}", value(x), either("is one of", "is none of"), list.join(", "))
        }
        _ => return None,
    })
}

/// A condition within another, in parentheses if it would be misread without.
fn part(expr: &Expr) -> String {
    let compound = matches!(expr.kind, ExprKind::Binary(BinaryOp::Or, ..))
        || matches!(&expr.kind, ExprKind::Call { name, .. } if matches!(name.as_str(), "any" | "all" | "coalesce"));
    if compound { format!("({})", condition(expr)) } else { condition(expr) }
}

fn relation(op: BinaryOp, left: &Expr) -> String {
    let BinaryOp::Compare(comparison) = op else { return op.to_string() };
    let [of_number, of_time] = match comparison {
        Comparison::Equal => ["is"; 2],
        Comparison::NotEqual => ["is not"; 2],
        Comparison::Less => ["is less than", "is before"],
        Comparison::LessEqual => ["is at most", "is not after"],
        Comparison::Greater => ["is more than", "is after"],
        Comparison::GreaterEqual => ["is at least", "is not before"],
    };
    let is_time = matches!(&left.kind, ExprKind::Name(name) if name == "t");
    if is_time { of_time } else { of_number }.to_owned()
}

fn value(expr: &Expr) -> String {
    match &expr.kind {
        ExprKind::Name(name) => name.clone(),
        ExprKind::Literal(literal) => match literal {
            Literal::Null => "null".to_owned(),
            Literal::Bool(value) => value.to_string(),
            Literal::Int(value) => value.to_string(),
            Literal::Float(value) => value.to_string(),
            Literal::Text(value) => format!("'{value}'"),
        },
        ExprKind::Negate(x) => format!("minus {}", value(x)),
        ExprKind::Binary(BinaryOp::Arithmetic(op), x, y) => arithmetic(*op, &value(x), &value(y)),
        ExprKind::Case { operand, branches, otherwise } => {
            let test = |at: usize, when: &Expr| match (operand, at) {
                (Some(operand), 0) => format!("{} is {}", value(operand), value(when)),
                // Named only once, so that nested operands do not multiply.
                (Some(_), _) => format!("it is {}", value(when)),
                (None, _) => condition(when),
            };
            let branches = branches.iter().enumerate();
            let branches = branches.map(|(at, (when, then))| format!("{} if {}", value(then), test(at, when)));
            let otherwise = otherwise.as_ref().map_or_else(|| "else null".to_owned(), |x| format!("else {}", value(x)));
            branches.chain([otherwise]).collect::<Vec<_>>().join(", ")
        }
        ExprKind::Call { name, arguments } => call(name, arguments, expr),
        _ => format!("whether {}", condition(expr)),
    }
}

fn arithmetic(op: Arithmetic, x: &str, y: &str) -> String {
    match op {
        Arithmetic::Add => format!("{x} plus {y}"),
        Arithmetic::Subtract => format!("{x} minus {y}"),
        Arithmetic::Multiply => format!("{x} times {y}"),
        Arithmetic::Quotient => format!("({x}) divided by ({y}), the fraction dropped"),
        Arithmetic::Remainder => format!("the remainder of {x} by {y}"),
    }
}

fn call(name: &str, arguments: &[Expr], expr: &Expr) -> String {
    match (name, arguments) {
        ("first", [p]) => format!("the first step where {}", condition(p)),
        ("last", [p]) => format!("the last step where {}", condition(p)),
        ("count", [p]) => format!("the number of steps where {}", condition(p)),
        ("length", []) => "the number of steps".to_owned(),
        ("min", [x]) => format!("the smallest {} of the steps", value(x)),
        ("max", [x]) => format!("the largest {} of the steps", value(x)),
        ("mean", [x]) => format!("the mean of {} over the steps", value(x)),
        ("round", [x, digits]) => format!("{} rounded to {} digits after the point", value(x), value(digits)),
        ("sum", [x]) => format!("the sum of {} over the steps", value(x)),
        ("at", [x, moment]) => format!("{} at step {}", value(x), value(moment)),
        ("lag", [x]) => format!("{} at the step before", value(x)),
        ("coalesce", values) => values.iter().map(value).collect::<Vec<_>>().join(", or else "),
        ("nullif", [x, y]) => format!("{} unless it is {}", value(x), value(y)),
        ("div", [x, y]) => arithmetic(Arithmetic::Quotient, &value(x), &value(y)),
        _ => format!("whether {}", condition(expr)),
    }
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.kind {
            Kind::Rate => "a rate, 0 or 1 for each episode".to_owned(),
            Kind::Quantity => format!("a number of {} an episode", self.unit),
        };
        let better = match self.better {
            Better::Higher => "higher is better",
            Better::Lower => "lower is better",
            Better::Neither => "neither direction is better",
        };
        let se = match self.se {
            StandardError::Sample => "sample standard error (ddof = 1)",
            StandardError::Population => "population standard error (ddof = 0)",
        };
        writeln!(f, "{}: {}", self.metric, self.title)?;
        writeln!(f, "  {kind}; {better}; {se}")?;
        if !self.section.is_empty() {
            writeln!(f, "  defined in section {} of the paper", self.section)?;
        }
        if !self.help.is_empty() {
            writeln!(f, "  {}", self.help)?;
        }
        writeln!(f, "\n  value  {}", self.value)?;
        if let Some(when) = &self.when {
            writeln!(f, "  when   {when}")?;
        }
        writeln!(f, "\nIn words\n  {} is {}.", self.metric, self.words)?;
        for named in &self.names {
            let level = if named.every_step { "at each step" } else { "once per episode" };
            writeln!(f, "  {} ({level}): {}.", named.name, named.words)?;
        }
        write!(f, "\nReads {}", self.columns.join(", "))
    }
}
