//! Calls of functions: arities, arguments, aggregates.

use super::super::functions::{self, Entry, FUNCTIONS, Function};
use super::super::logical_plan::plan::{Aggregate, Arithmetic, Comparison, NodeId, Op};
use super::super::syntax::{Expr, ExprKind, Literal, complete};
use super::Bound;
use super::decimals::WITHOUT_DECIMALS;
use super::scope::Scope;
use crate::columns::{Level, Type};
use mirrorstats_exact::suggest::did_you_mean;
use mirrorstats_toml_spec::Fault;

/// The deepest `lag`, in steps; in SQL each step back is a join.
const DEEPEST_LAG: u8 = 8;

impl Scope<'_, '_> {
    pub(super) fn call(&mut self, name: &str, arguments: &[Expr], whole: &Expr) -> Option<Bound> {
        let Some(entry) = functions::find(name) else {
            let fault = Fault::new(self.place(whole), format!("unknown function `{name}`"));
            let all = FUNCTIONS.each_ref().map(|entry| entry.name);
            let help = did_you_mean(name, all).unwrap_or_else(|| format!("functions are {}", all.join(", ")));
            return self.binder.refuse(fault.label("not a function of definitions").help(help));
        };
        let (least, most) = entry.arity;
        if arguments.len() < least || arguments.len() > most {
            let message = format!("`{name}` takes {}, found {}", arguments_wanted(entry), arguments.len());
            return self.binder.refuse(Fault::new(self.place(whole), message).help(entry.usage));
        }
        let bound = self.apply(entry, arguments, whole)?;
        if matches!(self.binder.builder.node(bound.node).op, Op::Aggregate(..) | Op::At(..)) {
            self.binder.builder.remember(bound.node, &self.written.text[whole.span.clone()]);
        }
        Some(bound)
    }

    fn apply(&mut self, entry: &Entry, arguments: &[Expr], whole: &Expr) -> Option<Bound> {
        match entry.function {
            Function::Of(aggregate @ (Aggregate::Min | Aggregate::Max)) => {
                let bound = self.number(&arguments[0])?;
                Some(Bound { decimals: bound.decimals, ..self.aggregate(aggregate, bound.ty?, bound) })
            }
            Function::Of(Aggregate::Sum) => self.sum(&arguments[0]),
            Function::Of(aggregate) => self.predicate(aggregate, &arguments[0], entry),
            Function::Mean => self.mean(&arguments[0]),
            Function::Round => self.round(&arguments[0], &arguments[1]),
            Function::At => self.at(&arguments[0], &arguments[1]),
            Function::Lag => self.lag(&arguments[0], whole),
            Function::Length => Some(self.unary(Op::Length, Type::Int, Level::Episode)),
            Function::Coalesce => self.coalesce(arguments, whole),
            Function::NullIf => self.null_if(&arguments[0], &arguments[1], whole),
            Function::Div => self.arithmetic(Arithmetic::Quotient, &arguments[0], &arguments[1], whole),
            Function::RegexpLike => self.regexp_like(&arguments[0], &arguments[1]),
        }
    }

    fn predicate(&mut self, aggregate: Aggregate, argument: &Expr, entry: &Entry) -> Option<Bound> {
        let bound = self.bind(argument)?;
        let condition = match bound.ty {
            Some(Type::Bool) => bound,
            None => self.null_of(Type::Bool),
            Some(found) => {
                let message = format!("`{}` takes a condition, found {}", entry.name, found.name());
                let help = match aggregate {
                    Aggregate::Count => "count(p) counts the steps where p holds: write `count(x is not null)`",
                    _ => entry.usage,
                };
                return self.binder.refuse(Fault::new(self.place(argument), message).label(found.name()).help(help));
            }
        };
        let ty = if matches!(aggregate, Aggregate::Any | Aggregate::All) { Type::Bool } else { Type::Int };
        Some(self.aggregate(aggregate, ty, condition))
    }

    pub(super) fn aggregate(&mut self, aggregate: Aggregate, ty: Type, argument: Bound) -> Bound {
        let argument_ty = self.binder.builder.node(argument.node).ty;
        let node = self.binder.spread(argument.node, argument_ty, argument.level, Level::Step);
        self.unary(Op::Aggregate(aggregate, node), ty, Level::Episode)
    }

    fn sum(&mut self, argument: &Expr) -> Option<Bound> {
        let bound = self.bind(argument)?;
        let fault = match bound.ty {
            Some(Type::Bool) if !bound.rate => {
                Fault::new(self.place(argument), "`sum` takes integers, found true or false").help("write `count(p)`")
            }
            Some(Type::Float) => {
                Fault::new(self.place(argument), "`sum` takes integers, found a float").help(WITHOUT_DECIMALS)
            }
            _ => {
                let number = self.as_number(bound, argument)?;
                let sum = self.aggregate(Aggregate::Sum, Type::Int, number);
                return Some(Bound { decimals: number.decimals, ..sum });
            }
        };
        self.binder.refuse(fault)
    }

    fn at(&mut self, value: &Expr, time: &Expr) -> Option<Bound> {
        let (value, moment) = (self.bind(value), self.number(time));
        let (value, moment) = (value?, moment?);
        if moment.level == Level::Step || moment.ty != Some(Type::Int) || moment.decimals > 0 {
            let fault = Fault::new(self.place(time), "the timestep of `at` is one integer an episode");
            let help = "at(x, t0): t0 is a constant or comes from first(), last(), length(), ...";
            return self.binder.refuse(fault.help(help));
        }
        let ty = value.ty.unwrap_or(Type::Bool);
        let steps = self.binder.spread(value.node, ty, value.level, Level::Step);
        let moment = self.binder.spread(moment.node, Type::Int, moment.level, Level::Episode);
        let bound = self.unary(Op::At(steps, moment), ty, Level::Episode);
        Some(Bound { rate: value.rate, decimals: value.decimals, ..bound })
    }

    /// The value at the previous step: at t the value of `x` at t - 1; null at the first step.
    fn lag(&mut self, value: &Expr, whole: &Expr) -> Option<Bound> {
        let value = self.bind(value)?;
        // The literal null is null at every step.
        let Some(ty) = value.ty else { return Some(value) };
        if self.binder.builder.lags(value.node) == DEEPEST_LAG {
            let message = format!("`lag` looks back by {DEEPEST_LAG} steps at most");
            let fault = Fault::new(self.place(whole), message).label("one step more");
            return self.binder.refuse(fault.help("at(x, t0) is the value at any one step"));
        }
        let steps = self.binder.spread(value.node, ty, value.level, Level::Step);
        let bound = self.unary(Op::Lag(steps), ty, Level::Step);
        Some(Bound { rate: value.rate, decimals: value.decimals, ..bound })
    }

    fn coalesce(&mut self, arguments: &[Expr], whole: &Expr) -> Option<Bound> {
        let values = complete(arguments.iter().map(|argument| self.bind(argument)))?;
        let rate = values.iter().all(|value| value.rate || value.ty.is_none());
        let (values, ty) = self.unified(&values, whole, "alternatives of one `coalesce`")?;
        let bound = self.combine(&values, ty, |nodes| Op::Coalesce(nodes.to_vec()));
        Some(Bound { rate: rate && ty == Type::Bool, decimals: values[0].decimals, ..bound })
    }

    fn null_if(&mut self, value: &Expr, other: &Expr, whole: &Expr) -> Option<Bound> {
        let (a, b) = self.both(value, other)?;
        self.check_equality((a, value), (b, other))?;
        let equal = self.compared(Comparison::Equal, a, b, whole)?;
        let ty = a.ty.unwrap_or(Type::Bool);
        let null = self.null_of(ty);
        let case = |n: &[NodeId]| Op::Case { branches: vec![(n[0], n[1])], otherwise: Some(n[2]) };
        Some(Bound { decimals: a.decimals, ..self.combine(&[equal, null, a], ty, case) })
    }

    fn regexp_like(&mut self, text: &Expr, pattern: &Expr) -> Option<Bound> {
        let mut bound = self.bind(text)?;
        match bound.ty {
            Some(Type::Text) => {}
            None => bound = self.null_of(Type::Text),
            Some(ty) => {
                let fault = Fault::new(self.place(text), format!("`regexp_like` searches text, found {}", ty.name()));
                return self.binder.refuse(fault.label(ty.name()));
            }
        }
        let ExprKind::Literal(Literal::Text(pattern_text)) = &pattern.kind else {
            let fault = Fault::new(self.place(pattern), "the pattern of `regexp_like` must be a constant text");
            return self.binder.refuse(fault.help("regexp_like(text, 'pattern')"));
        };
        if let Err(error) = regex::Regex::new(pattern_text) {
            let words = error.to_string();
            let last = words.lines().last().unwrap_or_default().trim_start_matches("error: ").to_owned();
            let fault = Fault::new(self.place(pattern), "not a regular expression");
            return self.binder.refuse(fault.label(last).help("the syntax is that of the Rust `regex` crate"));
        }
        Some(self.unary(Op::Matches(bound.node, pattern_text.clone()), Type::Bool, bound.level))
    }
}

fn arguments_wanted(entry: &Entry) -> String {
    match entry.arity {
        (0, 0) => "no argument".to_owned(),
        (1, 1) => "1 argument".to_owned(),
        (least, most) if least == most => format!("{least} arguments"),
        (1, _) => "at least 1 argument".to_owned(),
        (least, _) => format!("at least {least} arguments"),
    }
}
