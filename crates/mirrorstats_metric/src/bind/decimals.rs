//! Decimals: numbers with digits after the point as scaled integers, so that sums and moments stay exact.
//!
//! A float with `decimals = 3` is an integer of thousandths from its first use on. Operands of one operation are
//! brought to the same number of digits; a literal has the digits that it is written with.

use super::super::logical_plan::plan::{Aggregate, Arithmetic, Comparison, Constant, NodeId, Op};
use super::super::syntax::{Expr, ExprKind, Literal};
use super::Bound;
use super::scope::Scope;
use crate::columns::Type;
use crate::file::MOST_DECIMALS;
use mirrorstats_exact::number::Decimal;
use mirrorstats_toml_spec::Fault;

pub(super) const WITHOUT_DECIMALS: &str =
    "give the column `decimals` under [column.NAME], or write `round(x, 3)`: decimals are exact in any order";

impl Scope<'_, '_> {
    /// The nearest number with this many digits.
    pub(super) fn rounded(&mut self, bound: Bound, decimals: u8) -> Bound {
        match (bound.ty, bound.decimals) {
            (Some(Type::Float), _) => {
                let scaled = self.unary(Op::Scale(bound.node, decimals), Type::Int, bound.level);
                Bound { decimals, ..scaled }
            }
            (_, own) if own <= decimals => self.scaled_up(bound, decimals - own),
            (_, own) => {
                let divisor = self.power_of_ten(own - decimals);
                Bound { decimals, ..self.rounded_quotient(bound, divisor) }
            }
        }
    }

    pub(super) fn round(&mut self, value: &Expr, digits: &Expr) -> Option<Bound> {
        let bound = self.number(value);
        let decimals = match digits.kind {
            ExprKind::Literal(Literal::Int(digits)) => u8::try_from(digits).ok(),
            _ => None,
        };
        let Some(decimals) = decimals.filter(|decimals| *decimals <= MOST_DECIMALS) else {
            let message = format!("the digits of `round` are a constant from 0 to {MOST_DECIMALS}");
            return self.binder.refuse(Fault::new(self.place(digits), message).help("round(x, 3)"));
        };
        Some(self.rounded(bound?, decimals))
    }

    /// The sum of the values divided by their number, rounded to the digits of the values.
    pub(super) fn mean(&mut self, value: &Expr) -> Option<Bound> {
        let bound = self.number(value)?;
        if bound.ty == Some(Type::Float) {
            return self.without_decimals(value);
        }
        let sum = self.aggregate(Aggregate::Sum, Type::Int, bound);
        let is_null = self.unary(Op::IsNull(bound.node), Type::Bool, bound.level);
        let is_value = self.unary(Op::Not(is_null.node), Type::Bool, is_null.level);
        let count = self.aggregate(Aggregate::Count, Type::Int, is_value);
        Some(Bound { decimals: bound.decimals, ..self.rounded_quotient(sum, count) })
    }

    pub(super) fn without_decimals<T>(&mut self, value: &Expr) -> Option<T> {
        let fault = Fault::new(self.place(value), "expected a number with decimals, found a float");
        self.binder.refuse(fault.label("a float").help(WITHOUT_DECIMALS))
    }

    /// `above / below`, halves away from zero, as [`Op::Scale`] rounds; `below` is not negative.
    fn rounded_quotient(&mut self, above: Bound, below: Bound) -> Bound {
        let two = self.literal(&Literal::Int(2));
        let [doubled, divisor] = [above, below].map(|it| self.int(Arithmetic::Multiply, it, two));
        let [more, less] = [Arithmetic::Add, Arithmetic::Subtract].map(|op| {
            let shifted = self.int(op, doubled, below);
            self.int(Arithmetic::Quotient, shifted, divisor)
        });
        let zero = self.literal(&Literal::Int(0));
        let is_negative = self.combine(&[above, zero], Type::Bool, |n| Op::Compare(Comparison::Less, n[0], n[1]));
        let case = |n: &[NodeId]| Op::Case { branches: vec![(n[0], n[1])], otherwise: Some(n[2]) };
        self.combine(&[is_negative, less, more], Type::Int, case)
    }

    fn int(&mut self, op: Arithmetic, left: Bound, right: Bound) -> Bound {
        self.combine(&[left, right], Type::Int, |n| Op::Arithmetic(op, n[0], n[1]))
    }

    fn power_of_ten(&mut self, exponent: u8) -> Bound {
        self.literal(&Literal::Int(10_i64.saturating_pow(exponent.into())))
    }

    /// The same number with more digits.
    fn scaled_up(&mut self, bound: Bound, digits: u8) -> Bound {
        let decimals = bound.decimals + digits;
        let factor = 10_i64.saturating_pow(digits.into());
        let scaled = match self.binder.builder.node(bound.node).op {
            _ if digits == 0 => bound,
            Op::Constant(Constant::Null) => bound,
            Op::Constant(Constant::Int(value)) if value.checked_mul(factor).is_some() => {
                self.literal(&Literal::Int(value * factor))
            }
            _ => {
                let factor = self.power_of_ten(digits);
                self.int(Arithmetic::Multiply, bound, factor)
            }
        };
        Bound { decimals, rate: false, ..scaled }
    }

    /// Numbers beside a number with decimals as integers with their own digits; other operands as they are.
    pub(super) fn as_decimals(&mut self, bounds: &[Bound], expr: &Expr) -> Option<Vec<Bound>> {
        let has_decimals = bounds.iter().any(|bound| bound.decimals > 0);
        let numbers = bounds.iter().map(|bound| match (bound.ty, &self.binder.builder.node(bound.node).op) {
            (Some(Type::Float), Op::Constant(Constant::Float(bits))) if has_decimals => {
                let decimal: Decimal = f64::from_bits(*bits).to_string().parse().ok()?;
                let units = i64::try_from(decimal.units()).ok()?;
                let decimals = u8::try_from(decimal.places()).ok().filter(|places| *places <= 2 * MOST_DECIMALS)?;
                Some(Bound { decimals, ..self.literal(&Literal::Int(units)) })
            }
            (Some(Type::Float), _) if has_decimals => None,
            _ => Some(*bound),
        });
        let numbers: Option<Vec<Bound>> = numbers.collect();
        if numbers.is_none() {
            return self.without_decimals(expr);
        }
        numbers
    }

    /// The operands with the digits of the one that has most.
    pub(super) fn aligned(&mut self, bounds: &[Bound], expr: &Expr) -> Option<Vec<Bound>> {
        let bounds = self.as_decimals(bounds, expr)?;
        let decimals = bounds.iter().map(|bound| bound.decimals).max().unwrap_or(0);
        let is_number = |bound: &Bound| matches!(bound.ty, Some(Type::Int)) || bound.ty.is_none();
        let aligned = bounds.into_iter().map(|bound| match decimals - bound.decimals {
            0 => bound,
            digits if is_number(&bound) => self.scaled_up(bound, digits),
            digits if bound.rate => {
                let int = self.as_int(bound);
                self.scaled_up(int, digits)
            }
            _ => bound,
        });
        Some(aligned.collect())
    }
}
