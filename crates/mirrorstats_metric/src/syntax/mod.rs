//! Parses SQL text into the expressions of the calculus.
//!
//! The grammar is SQL's own, read by `sqlparser`. `reader` keeps the constructs of the calculus, refuses all others by
//! name, and remembers the position of each.

mod expression;
pub mod grammar;
mod reader;

use std::fmt;
use std::ops::Range;

use crate::logical_plan::plan::{Arithmetic, Comparison};

pub use self::expression::parse;

/// An expression as written. Equality ignores positions.
#[derive(Clone, Debug)]
pub struct Expr {
    pub kind: ExprKind,
    /// Its byte range in the text of the expression.
    pub span: Range<usize>,
}

impl PartialEq for Expr {
    fn eq(&self, other: &Self) -> bool {
        self.kind == other.kind
    }
}

#[derive(Clone, Debug, PartialEq)]
pub enum ExprKind {
    /// A column, a `let` or a metric.
    Name(String),
    Literal(Literal),
    /// `not x`; also the `not` of `x is not null`, `x not in (...)` and the like.
    Not(Box<Expr>),
    /// `-x`
    Negate(Box<Expr>),
    /// `x op y`
    Binary(BinaryOp, Box<Expr>, Box<Expr>),
    IsNull(Box<Expr>),
    /// `x is true`, `x is false`
    IsTruth(Box<Expr>, bool),
    /// `x is distinct from y`
    Distinct(Box<Expr>, Box<Expr>),
    /// `x between low and high`
    Between(Box<Expr>, [Box<Expr>; 2]),
    /// `x in (a, b, ...)`
    InList(Box<Expr>, Vec<Expr>),
    /// `case [x] when a then b ... [else c] end`
    Case {
        operand: Option<Box<Expr>>,
        branches: Vec<(Expr, Expr)>,
        otherwise: Option<Box<Expr>>,
    },
    /// `name(a, b, ...)`, the name in lowercase
    Call {
        name: String,
        arguments: Vec<Expr>,
    },
}

#[derive(Clone, Debug, PartialEq)]
pub enum Literal {
    Null,
    /// `true`, `false`
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BinaryOp {
    And,
    Or,
    Compare(Comparison),
    /// Any except the quotient, which is a function.
    Arithmetic(Arithmetic),
}

/// All items; `None` if one is absent. Reads every item, so that the faults of all are found.
pub(crate) fn complete<T>(items: impl Iterator<Item = Option<T>>) -> Option<Vec<T>> {
    let items: Vec<Option<T>> = items.collect();
    items.into_iter().collect()
}

impl fmt::Display for BinaryOp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::And => f.write_str("and"),
            Self::Or => f.write_str("or"),
            Self::Compare(comparison) => f.write_str(comparison.name()),
            Self::Arithmetic(op) => f.write_str(op.name()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::grammar::SyntaxFault;
    use super::*;

    fn shape(expr: &Expr) -> String {
        let list = |items: &[Expr]| items.iter().map(shape).collect::<Vec<_>>().join(", ");
        let tested = |expr: &Expr, not: &str| {
            Some(match &expr.kind {
                ExprKind::IsNull(x) => format!("({} is {not}null)", shape(x)),
                ExprKind::IsTruth(x, truth) => format!("({} is {not}{truth})", shape(x)),
                ExprKind::Distinct(x, y) => format!("({} is {not}distinct from {})", shape(x), shape(y)),
                ExprKind::Between(x, [low, high]) => {
                    format!("({} {not}between {} and {})", shape(x), shape(low), shape(high))
                }
                ExprKind::InList(x, items) => format!("({} {not}in [{}])", shape(x), list(items)),
                _ => return None,
            })
        };
        match &expr.kind {
            ExprKind::Name(name) => name.clone(),
            ExprKind::Literal(literal) => format!("{literal:?}"),
            ExprKind::Not(x) => tested(x, "not ").unwrap_or_else(|| format!("(not {})", shape(x))),
            ExprKind::Negate(x) => format!("(- {})", shape(x)),
            ExprKind::Binary(op, x, y) => format!("({} {op} {})", shape(x), shape(y)),
            ExprKind::Case { operand, branches, otherwise } => {
                let operand = operand.as_ref().map_or_else(String::new, |x| format!(" {}", shape(x)));
                let branches: Vec<_> = branches.iter().map(|(a, b)| format!(" {}: {}", shape(a), shape(b))).collect();
                let otherwise = otherwise.as_ref().map_or_else(String::new, |x| format!(" else {}", shape(x)));
                format!("(case{operand}{}{otherwise})", branches.concat())
            }
            ExprKind::Call { name, arguments } => format!("{name}({})", list(arguments)),
            _ => tested(expr, "").unwrap(),
        }
    }

    #[test]
    fn precedence_is_that_of_sql() {
        for (text, expected) in [
            ("a or b and not c", "(a or (b and (not c)))"),
            ("a = 1 and t < 2 + 3 * 4", "((a = Int(1)) and (t < (Int(2) + (Int(3) * Int(4)))))"),
            ("not a = b", "(not (a = b))"),
            ("a is not null and b <> 'x'", "((a is not null) and (b <> Text(\"x\")))"),
            ("t between 1 and 2 or c", "((t between Int(1) and Int(2)) or c)"),
            ("-1 - -a", "((- Int(1)) - (- a))"),
            ("\"TSA-C\" = 1", "(TSA-C = Int(1))"),
            ("case when a then b else c end", "(case a: b else c)"),
            ("case x when 1 then 2 end", "(case x Int(1): Int(2))"),
            ("a not in ('it''s', null)", "(a not in [Text(\"it's\"), Null])"),
            ("a is not distinct from 1.5", "(a is not distinct from Float(1.5))"),
        ] {
            assert_eq!(parse(text).map(|expr| shape(&expr)), Ok(expected.to_owned()), "{text}");
        }
    }

    #[test]
    fn quantifier_names_are_functions_at_any_position() {
        for (text, expected) in [
            ("any(p)", "any(p)"),
            ("any(all(p))", "any(all(p))"),
            ("x = any(p)", "(x = any(p))"),
            ("not ALL(p) and q", "((not all(p)) and q)"),
            ("coalesce(all(p), any (q))", "coalesce(all(p), any(q))"),
        ] {
            assert_eq!(parse(text).map(|expr| shape(&expr)), Ok(expected.to_owned()), "{text}");
        }
    }

    #[test]
    fn every_refusal_names_its_problem_and_location() {
        let mut told = String::new();
        for text in [
            "",
            "a +",
            "a b",
            "(a",
            "a / b",
            "a || b",
            "a like 'x%'",
            "a::int",
            "(select 1)",
            "a.b",
            "count(*)",
            "count(distinct a)",
            "sum(a) over ()",
            "x'00'",
            "99999999999999999999",
            "a = = b",
            "'open",
            "case a end",
            "first(a) from x",
            "exists (select 1)",
            "a in (select 1)",
            "é = 'b' /",
        ] {
            let faults = parse(text).expect_err(text);
            for SyntaxFault { message, span, help } in faults {
                let help = help.map_or_else(String::new, |help| format!("  [{help}]"));
                let span = format!("`{}`", &text[span]);
                writeln!(told, "{text:24} {span:14} {message}{help}").unwrap();
            }
        }
        insta::assert_snapshot!(told);
    }

    #[test]
    fn depth_and_length_are_limited() {
        let deep = format!("{}a{}", "(".repeat(5000), ")".repeat(5000));
        let long = vec!["a"; 4000].join(" or ");
        let longer = "a".repeat(super::expression::EXPRESSION.longest + 1);
        for text in [deep, long, longer] {
            assert!(parse(&text).is_err());
        }
    }

    #[test]
    fn a_long_chain_does_not_overflow_a_small_stack() {
        for chain in [vec!["a"; 1999].join("+"), format!("count({})", vec!["a > 1"; 990].join(" and "))] {
            let parsed = std::thread::Builder::new().stack_size(256 << 10).spawn(move || parse(&chain)).unwrap();
            let faults = parsed.join().unwrap().unwrap_err();
            assert_eq!(faults[0].message, "the expression is nested too deeply");
        }
    }
}
