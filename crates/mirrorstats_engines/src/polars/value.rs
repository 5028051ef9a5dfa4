//! Values of a query as Polars expressions with the kinds and the rules of SQL.

use polars::prelude::{Expr, NULL, lit, when};
use sqlparser::ast::BinaryOperator;

use super::accepted::Kind;

#[derive(Clone, Debug)]
pub(super) struct Value {
    pub(super) expr: Expr,
    pub(super) kind: Kind,
    /// For an integer, the bits of its largest value; for a decimal, 0 if binary fractions hold it exactly.
    pub(super) bits: u32,
}

/// Sums of up to 2^31 rows are known to fit.
const ROWS: u32 = 31;
const MOST_BITS: u32 = 62;

impl Value {
    pub(super) fn new(expr: Expr, kind: Kind) -> Self {
        Self { expr, kind, bits: if kind == Kind::Int { 63 } else { 0 } }
    }

    pub(super) fn int(expr: Expr, bits: u32) -> Self {
        Self { expr, kind: Kind::Int, bits }
    }

    pub(super) fn null() -> Self {
        Self::new(lit(NULL), Kind::Null)
    }

    pub(super) fn bool(expr: Expr) -> Self {
        Self::new(expr, Kind::Bool)
    }

    /// True for kinds and values that Polars compares as DuckDB does.
    pub(super) fn is_exact(&self) -> bool {
        self.kind != Kind::Real && (self.kind != Kind::Decimal || self.bits == 0)
    }

    pub(super) fn to(&self, kind: Kind) -> Expr {
        if self.kind == kind && kind != Kind::Int {
            return self.expr.clone();
        }
        self.expr.clone().strict_cast(kind.wide())
    }

    pub(super) fn float(&self) -> Expr {
        self.to(Kind::Float)
    }
}

/// The one kind of several values; `None` if they have no common kind.
pub(super) fn common<'v>(values: impl IntoIterator<Item = &'v Value>) -> Option<Kind> {
    values.into_iter().map(|value| value.kind).try_fold(Kind::Null, |kind, other| match (kind, other) {
        (kind, other) if kind == other => Some(kind),
        (Kind::Null, kind) | (kind, Kind::Null) => Some(kind),
        (Kind::Int | Kind::Decimal | Kind::Float, Kind::Float) | (Kind::Float, Kind::Int | Kind::Decimal) => {
            Some(Kind::Float)
        }
        (Kind::Int, Kind::Decimal) | (Kind::Decimal, Kind::Int) => Some(Kind::Decimal),
        _ => None,
    })
}

/// A value of a common kind, chosen among several.
pub(super) fn one_of(expr: Expr, kind: Kind, values: &[Value]) -> Value {
    Value {
        expr,
        kind,
        bits: values.iter().filter(|value| value.kind == kind).map(|value| value.bits).max().unwrap_or(0),
    }
}

/// Polars wraps integers that leave 64 bits. The same number as a float makes its cast fail instead.
pub(super) fn guarded(value: Expr, float: Expr, bits: u32) -> Value {
    if bits <= MOST_BITS {
        return Value::int(value, bits);
    }
    let fits = (float * lit(1.001)).strict_cast(Kind::Int.wide()) * lit(0_i64);
    Value::int(value + fits.fill_null(lit(0_i64)), 63)
}

pub(super) fn sum_bits(bits: u32) -> u32 {
    bits + ROWS
}

/// `left op right`; `None` for kinds that do not fit.
pub(super) fn arithmetic(left: &Value, op: &BinaryOperator, right: &Value) -> Option<Value> {
    let kind = common([left, right]).filter(|kind| kind.is_number())?;
    let apply = |a: Expr, b: Expr| match op {
        BinaryOperator::Plus => a + b,
        BinaryOperator::Minus => a - b,
        BinaryOperator::Multiply => a * b,
        _ => a / b,
    };
    Some(match (op, kind) {
        (BinaryOperator::Divide, _) => Value::new(apply(left.float(), right.float()), Kind::Float),
        (BinaryOperator::Modulo, Kind::Int) if right.is_positive_literal() => {
            Value::int(remainder(left, right), left.bits)
        }
        (BinaryOperator::Modulo, _) | (_, Kind::Null) => return None,
        (_, Kind::Int) => {
            let bits = match op {
                BinaryOperator::Multiply => left.bits + right.bits,
                _ => left.bits.max(right.bits) + 1,
            };
            guarded(apply(left.to(Kind::Int), right.to(Kind::Int)), apply(left.float(), right.float()), bits)
        }
        (_, Kind::Decimal) => {
            let inexact = !(left.is_exact() && right.is_exact());
            Value { expr: apply(left.float(), right.float()), kind, bits: inexact.into() }
        }
        _ => Value::new(apply(left.float(), right.float()), Kind::Float),
    })
}

/// The remainder by a positive number has the sign of the dividend; that of Polars is never negative.
fn remainder(left: &Value, right: &Value) -> Expr {
    let (a, b) = (left.to(Kind::Int), right.to(Kind::Int));
    let floored = a.clone() % b.clone();
    let differs = floored.clone().neq(lit(0_i64)).and(a.lt(lit(0_i64)));
    when(differs).then(floored.clone() - b).otherwise(floored)
}

/// `left op right` of one kind; `None` for kinds that do not fit.
pub(super) fn compare(left: &Value, op: &BinaryOperator, right: &Value) -> Option<Value> {
    let wide = || {
        let is_real = [left, right].iter().any(|value| value.kind == Kind::Real);
        (is_real && left.widens() && right.widens()).then_some(Kind::Float)
    };
    let exact = common([left, right]).filter(|_| left.is_exact_beside(right) && right.is_exact_beside(left));
    let kind = exact.or_else(wide)?;
    let (a, b) = (left.to(kind), right.to(kind));
    Some(Value::bool(match op {
        BinaryOperator::Eq => a.eq(b),
        BinaryOperator::NotEq => a.neq(b),
        BinaryOperator::Lt => a.lt(b),
        BinaryOperator::LtEq => a.lt_eq(b),
        BinaryOperator::Gt => a.gt(b),
        _ => a.gt_eq(b),
    }))
}

impl Value {
    /// DuckDB stops at a remainder by zero.
    fn is_positive_literal(&self) -> bool {
        matches!(self.expr, Expr::Literal(_)) && self.kind == Kind::Int && self.bits > 0
    }

    pub(super) fn number(&self) -> Option<f64> {
        let Expr::Literal(literal) = &self.expr else { return None };
        literal.to_any_value()?.extract()
    }

    /// True for floats and for numbers that 32 bits hold: beside a FLOAT, 64 bits give the answer of DuckDB's 32.
    fn widens(&self) -> bool {
        #[expect(clippy::cast_possible_truncation, clippy::float_cmp, reason = "32 bits hold the number or do not")]
        let is_single = |number: f64| f64::from(number as f32) == number;
        match self.kind {
            Kind::Real | Kind::Float => true,
            Kind::Int => self.bits <= f32::MANTISSA_DIGITS,
            Kind::Decimal => self.is_exact() && self.number().is_some_and(is_single),
            _ => false,
        }
    }

    /// A decimal beside a float is a float in DuckDB too; a literal beside an integer is compared exactly.
    fn is_exact_beside(&self, other: &Self) -> bool {
        self.is_exact()
            || (self.kind == Kind::Decimal
                && (other.kind == Kind::Float || (other.kind == Kind::Int && matches!(self.expr, Expr::Literal(_)))))
    }
}

/// Joins parts with a balanced tree: the depth of a chain would be the depth of Polars' recursion.
pub(super) fn balanced(mut parts: Vec<Expr>, join: fn(Expr, Expr) -> Expr) -> Option<Expr> {
    while parts.len() > 1 {
        let mut pairs = parts.into_iter();
        let mut joined = Vec::new();
        while let Some(first) = pairs.next() {
            joined.push(match pairs.next() {
                Some(second) => join(first, second),
                None => first,
            });
        }
        parts = joined;
    }
    parts.pop()
}
