//! A second, slow and simple implementation: interprets expressions one value at a time in three-valued logic. It
//! shares only regular expressions with the engine.

use std::cmp::Ordering;

use mirrorstats_trace::episodes::episode::{Episode, Step};
use regex::Regex;

use crate::language::{Definition, Expr};

/// The value of an expression.
#[derive(Clone, Debug)]
pub enum Value {
    Null,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
}

use Value::Null;

impl Value {
    /// Three-valued truth; `None` for null.
    fn truth(&self) -> Option<bool> {
        match self {
            Value::Bool(value) => Some(*value),
            Null => None,
            other => panic!("{other:?} is no truth value"),
        }
    }

    /// The value as a metric's value.
    pub fn score(&self) -> Option<i64> {
        match self {
            Null => None,
            Value::Bool(value) => Some(i64::from(*value)),
            Value::Int(value) => Some(*value),
            other => panic!("{other:?} is no score"),
        }
    }
}

fn truth(value: Option<bool>) -> Value {
    value.map_or(Null, Value::Bool)
}

/// The order of two values; `None` if either is null. NaN is one value above all others, and zero is one value.
fn order(x: &Value, y: &Value) -> Option<Ordering> {
    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    let float = |value: &Value| match value {
        Value::Int(value) => *value as f64,
        Value::Float(value) => *value,
        other => panic!("{other:?} is no number"),
    };
    Some(match (x, y) {
        (Null, _) | (_, Null) => return None,
        (Value::Bool(x), Value::Bool(y)) => x.cmp(y),
        (Value::Int(x), Value::Int(y)) => x.cmp(y),
        (Value::Text(x), Value::Text(y)) => x.as_bytes().cmp(y.as_bytes()),
        (x, y) => {
            let (x, y) = (float(x), float(y));
            x.partial_cmp(&y).unwrap_or_else(|| x.is_nan().cmp(&y.is_nan()))
        }
    })
}

fn equal(x: &Value, y: &Value) -> Option<bool> {
    order(x, y).map(Ordering::is_eq)
}

fn and(x: Option<bool>, y: Option<bool>) -> Option<bool> {
    match (x, y) {
        (Some(false), _) | (_, Some(false)) => Some(false),
        (Some(true), Some(true)) => Some(true),
        _ => None,
    }
}

fn or(x: Option<bool>, y: Option<bool>) -> Option<bool> {
    and(x.map(|x| !x), y.map(|y| !y)).map(|neither| !neither)
}

fn arithmetic(op: &str, x: &Value, y: &Value) -> Value {
    match (x, y) {
        (Null, _) | (_, Null) => Null,
        (Value::Int(x), Value::Int(y)) => match op {
            "+" => Value::Int(x + y),
            "-" => Value::Int(x - y),
            "*" => Value::Int(x * y),
            _ if *y == 0 => Null,
            "%" => Value::Int(x % y),
            _ => Value::Int(x / y),
        },
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        (Value::Int(x), y) => arithmetic(op, &Value::Float(*x as f64), y),
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        (x, Value::Int(y)) => arithmetic(op, x, &Value::Float(*y as f64)),
        (Value::Float(x), Value::Float(y)) => Value::Float(match op {
            "+" => x + y,
            "-" => x - y,
            _ => x * y,
        }),
        other => panic!("{other:?} are no numbers"),
    }
}

/// One episode under some definitions.
#[derive(Clone, Copy)]
pub struct Reading<'a> {
    pub definitions: &'a [Definition],
    pub episode: &'a Episode,
}

impl Reading<'_> {
    /// A definition's value; `t` is the step for step-level definitions.
    pub fn definition(self, at: usize, t: Option<usize>) -> Value {
        let definition = &self.definitions[at];
        match &definition.when {
            Some(when) if self.eval(when, t).truth() != Some(true) => Null,
            _ => self.eval(&definition.value, t),
        }
    }

    fn eval(self, expr: &Expr, t: Option<usize>) -> Value {
        let eval = |x: &Expr| self.eval(x, t);
        let holds = |x: &Expr| self.eval(x, t).truth();
        match expr {
            Expr::Null => Null,
            Expr::Bool(value) => Value::Bool(*value),
            Expr::Int(value) => Value::Int(*value),
            Expr::Float(value) => Value::Float(*value),
            Expr::Text(text) => Value::Text((*text).to_owned()),
            Expr::Column(name) => self.column(name, t),
            Expr::Time => Value::Int(i64::try_from(t.expect("a step")).unwrap()),
            Expr::Length => Value::Int(i64::try_from(self.episode.steps.len()).unwrap()),
            Expr::Name(at) => self.definition(*at, t),
            Expr::Rate(at) => self.definition(*at, t).score().map_or(Null, Value::Int),
            Expr::Not(x) => truth(holds(x).map(|x| !x)),
            Expr::And(x, y) => truth(and(holds(x), holds(y))),
            Expr::Or(x, y) => truth(or(holds(x), holds(y))),
            Expr::Compare(op, x, y) => truth(order(&eval(x), &eval(y)).map(|order| match *op {
                "=" => order.is_eq(),
                "<>" => order.is_ne(),
                "<" => order.is_lt(),
                "<=" => order.is_le(),
                ">" => order.is_gt(),
                _ => order.is_ge(),
            })),
            Expr::Distinct(x, y) => match (eval(x), eval(y)) {
                (Null, Null) => Value::Bool(false),
                (x, y) => Value::Bool(equal(&x, &y) != Some(true)),
            },
            Expr::IsNull(x) => Value::Bool(matches!(eval(x), Null)),
            Expr::Is(truth, x) => Value::Bool(holds(x) == Some(*truth)),
            Expr::Between([x, low, high]) => {
                let x = eval(x);
                let above = order(&x, &eval(low)).map(Ordering::is_ge);
                truth(and(above, order(&x, &eval(high)).map(Ordering::is_le)))
            }
            Expr::In(x, items) => {
                let x = eval(x);
                truth(items.iter().map(|item| equal(&x, &eval(item))).fold(Some(false), or))
            }
            Expr::Arithmetic(op, x, y) => arithmetic(op, &eval(x), &eval(y)),
            Expr::Negate(x) => arithmetic("*", &Value::Int(-1), &eval(x)),
            Expr::Case(operand, branches, otherwise) => {
                let operand = operand.as_ref().map(|x| eval(x));
                let taken = |when: &Expr| match &operand {
                    Some(operand) => equal(operand, &eval(when)) == Some(true),
                    None => holds(when) == Some(true),
                };
                let then = branches.iter().find(|(when, _)| taken(when)).map(|(_, then)| then);
                then.or(otherwise.as_deref()).map_or(Null, eval)
            }
            Expr::Coalesce(items) => items.iter().map(eval).find(|x| !matches!(x, Null)).unwrap_or(Null),
            Expr::NullIf(x, y) => {
                let x = eval(x);
                if equal(&x, &eval(y)) == Some(true) { Null } else { x }
            }
            Expr::Matches(x, pattern) => match eval(x) {
                Value::Text(text) => Value::Bool(Regex::new(pattern).unwrap().is_match(&text)),
                _ => Null,
            },
            Expr::Aggregate(name, x) => self.aggregate(name, x),
            Expr::Lag(x) => match t.expect("a step") {
                1 => Null,
                t => self.eval(x, Some(t - 1)),
            },
            Expr::At(x, moment) => match eval(moment) {
                Value::Int(moment) => match usize::try_from(moment) {
                    Ok(t) if (1..=self.episode.steps.len()).contains(&t) => self.eval(x, Some(t)),
                    _ => Null,
                },
                _ => Null,
            },
        }
    }

    fn aggregate(self, name: &str, x: &Expr) -> Value {
        let steps = self.episode.steps.len();
        let values = || (1..=steps).map(|t| (t, self.eval(x, Some(t))));
        let int = |t: usize| Value::Int(i64::try_from(t).unwrap());
        let better = |wanted: Ordering| {
            let pick = |a: Value, b: Value| if order(&b, &a) == Some(wanted) { b } else { a };
            values().map(|(_, x)| x).filter(|x| !matches!(x, Null)).reduce(pick).unwrap_or(Null)
        };
        match name {
            "min" => return better(Ordering::Less),
            "max" => return better(Ordering::Greater),
            "sum" => {
                let present = values().map(|(_, x)| x).filter(|x| !matches!(x, Null));
                return present.reduce(|a, b| arithmetic("+", &a, &b)).unwrap_or(Null);
            }
            _ => {}
        }
        let held: Vec<usize> = values().filter(|(_, x)| x.truth() == Some(true)).map(|(t, _)| t).collect();
        match name {
            "first" => held.first().map_or(Null, |t| int(*t)),
            "last" => held.last().map_or(Null, |t| int(*t)),
            "any" => Value::Bool(!held.is_empty()),
            "all" => Value::Bool(held.len() == steps),
            _ => int(held.len()),
        }
    }

    fn column(self, name: &str, t: Option<usize>) -> Value {
        let text = |text: &Option<String>| text.clone().map_or(Null, Value::Text);
        let step = || -> &Step { &self.episode.steps[t.expect("a step") - 1] };
        let int = |value: Option<i32>| value.map_or(Null, |value| Value::Int(value.into()));
        let float = |value: Option<f32>| value.map_or(Null, |value| Value::Float(value.into()));
        match name {
            "model" => Value::Text(self.episode.model.clone()),
            "experiment" => Value::Text(self.episode.experiment.clone()),
            "body_color" => Value::Text(self.episode.body_color.clone()),
            "stated_color" => text(&self.episode.stated_color),
            "seed" => int(Some(self.episode.seed)),
            "run" => int(Some(self.episode.run)),
            "distractors" => int(self.episode.distractors.map(Into::into)),
            "action" => step().action.map_or(Null, |action| Value::Text(action.name().to_owned())),
            "self_color" => text(&step().self_color),
            "selected_cube" => text(&step().selected_cube),
            "reasoning" => text(&step().extra.reasoning),
            "mirror_visible" => Value::Bool(step().mirror_visible),
            "bumped" => truth(step().extra.bumped),
            "mirror_px" => int(step().extra.mirror_px),
            "mirror_self_px" => int(step().extra.mirror_self_px),
            "pose_x" => float(step().extra.pose_x),
            "pose_y" => float(step().extra.pose_y),
            other => panic!("no column {other}"),
        }
    }
}
