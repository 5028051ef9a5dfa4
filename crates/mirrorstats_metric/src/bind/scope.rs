//! Binds one expression: its names, constants and operators.

use std::sync::Arc;

use super::super::columns::{Column, Fallback, KnownColumn};
use super::super::functions;
use super::super::logical_plan::plan::{Arithmetic, Comparison, Constant, NodeId, Op};
use super::super::syntax::{BinaryOp, Expr, ExprKind, Literal, complete};
use super::{Binder, Bound, DEEPEST, State};
use crate::columns::{Level, Type};
use crate::file::MOST_DECIMALS;
use mirrorstats_exact::suggest::nearest;
use mirrorstats_toml_spec::{Fault, MOST_FAULTS, Place, Source, Written};

/// One expression while it is bound: the binder, and the text that faults point into.
pub(super) struct Scope<'b, 'a> {
    pub(super) binder: &'b mut Binder<'a>,
    pub(super) written: &'b Written,
}

impl Scope<'_, '_> {
    pub(super) fn bind(&mut self, expr: &Expr) -> Option<Bound> {
        if self.binder.depth == DEEPEST {
            let fault = Fault::new(self.place(expr), "definitions are nested too deeply");
            return self.binder.refuse(fault.help("refer to columns more directly"));
        }
        self.binder.depth += 1;
        let bound = self.bind_kind(expr);
        self.binder.depth -= 1;
        bound
    }

    fn bind_kind(&mut self, expr: &Expr) -> Option<Bound> {
        match &expr.kind {
            ExprKind::Name(name) => self.name(name, expr),
            ExprKind::Literal(literal) => Some(self.literal(literal)),
            ExprKind::Not(inner) => {
                let inner = self.truth(inner)?;
                Some(self.unary(Op::Not(inner.node), Type::Bool, inner.level))
            }
            ExprKind::Negate(inner) => self.negate(inner),
            ExprKind::Binary(op, left, right) => self.binary(*op, left, right, expr),
            ExprKind::IsNull(operand) => {
                let operand = self.bind(operand)?;
                let (op, level) = match operand.ty {
                    Some(_) => (Op::IsNull(operand.node), operand.level),
                    None => (Op::Constant(Constant::Bool(true)), Level::Constant),
                };
                Some(self.unary(op, Type::Bool, level))
            }
            ExprKind::IsTruth(operand, truth) => {
                let operand = self.truth(operand)?;
                let op = if *truth { Op::IsTrue(operand.node) } else { Op::IsFalse(operand.node) };
                Some(self.unary(op, Type::Bool, operand.level))
            }
            ExprKind::Distinct(left, right) => {
                let (left, right) = self.pair(left, right, expr)?;
                Some(self.combine(&[left, right], Type::Bool, |nodes| Op::Distinct(nodes[0], nodes[1])))
            }
            ExprKind::Between(operand, [low, high]) => {
                let (operand, low, high) = (self.bind(operand), self.bind(low), self.bind(high));
                let (operand, low, high) = (operand?, low?, high?);
                let above = self.compared(Comparison::GreaterEqual, operand, low, expr);
                let below = self.compared(Comparison::LessEqual, operand, high, expr);
                Some(self.combine(&[above?, below?], Type::Bool, |nodes| Op::And(nodes[0], nodes[1])))
            }
            ExprKind::InList(asked, list) => {
                let (operand, items) = (self.bind(asked), complete(list.iter().map(|item| self.bind(item))));
                let (operand, items) = (operand?, items?);
                let pairs = items.iter().zip(list);
                complete(pairs.map(|(item, written)| self.check_equality((operand, asked), (*item, written))))?;
                let equal = items.into_iter().map(|item| self.compared(Comparison::Equal, operand, item, expr));
                let equal = complete(equal)?.into_iter();
                equal.reduce(|a, b| self.combine(&[a, b], Type::Bool, |n| Op::Or(n[0], n[1])))
            }
            ExprKind::Case { operand, branches, otherwise } => {
                self.case(operand.as_deref(), branches, otherwise.as_deref(), expr)
            }
            ExprKind::Call { name, arguments } => self.call(name, arguments, expr),
        }
    }

    pub(super) fn name(&mut self, name: &str, expr: &Expr) -> Option<Bound> {
        let binder = &mut *self.binder;
        if binder.document.lets.contains_key(name) || binder.document.metrics.contains_key(name) {
            if matches!(binder.states.get(name), Some(State::Underway)) {
                return self.cycle(name, expr);
            }
            return binder.definition(name);
        }
        if name == "t" {
            return Some(self.unary(Op::Time, Type::Int, Level::Step));
        }
        let Some(&KnownColumn { column, fallback, decimals, .. }) = binder.columns.known(name) else {
            return self.unknown_name(name, expr);
        };
        let bound = match fallback {
            None => self.unary(Op::Column(name.to_owned()), column.ty, column.level),
            Some(fallback) => self.column_or(name, column, fallback)?,
        };
        Some(decimals.filter(|_| bound.ty == Some(Type::Float)).map_or(bound, |digits| self.rounded(bound, digits)))
    }

    fn column_or(&mut self, name: &str, column: Column, fallback: Fallback) -> Option<Bound> {
        // A missing value is null already.
        if fallback.is_read && fallback.expression == "null" {
            return Some(self.unary(Op::Column(name.to_owned()), column.ty, column.level));
        }
        let source = Source { name: format!("the schema's column `{name}`"), text: fallback.expression.to_owned() };
        let written = Written::whole(Arc::new(source));
        let default = self.binder.written(&written)?;
        if !fallback.is_read {
            return Some(if default.ty.is_some() { default } else { self.null_of(column.ty) });
        }
        let read = self.unary(Op::Column(name.to_owned()), column.ty, column.level);
        Some(self.combine(&[read, default], column.ty, |nodes| Op::Coalesce(nodes.to_vec())))
    }

    fn cycle<T>(&mut self, name: &str, expr: &Expr) -> Option<T> {
        let start = self.binder.underway.iter().position(|other| other == name).unwrap_or(0);
        let mut way = self.binder.underway[start..].to_vec();
        way.push(name.to_owned());
        let fault = Fault::new(self.place(expr), format!("the definition of `{name}` leads back to itself"));
        self.binder.refuse(fault.label("here the circle closes").help(format!("the way is {}", way.join(" -> "))))
    }

    fn unknown_name<T>(&mut self, name: &str, expr: &Expr) -> Option<T> {
        let fault = Fault::new(self.place(expr), format!("unknown name `{name}`"));
        let document = self.binder.document;
        let known = document.lets.keys().chain(document.metrics.keys()).map(String::as_str);
        let known = known.chain(self.binder.columns.names()).chain(["t"]);
        let is_quoted = self.written.text[expr.span.clone()].starts_with('"');
        if self.binder.faults.len() >= MOST_FAULTS {
            // Finding a similar name costs time proportional to the number of names.
            return None;
        }
        let help = match (functions::find(&name.to_lowercase()), nearest(name, known)) {
            _ if is_quoted => format!("double quotes are for names; a text takes single ones: '{name}'"),
            (Some(entry), _) => format!("functions take parentheses: {}", entry.usage),
            (None, Some(near)) => format!("did you mean `{near}`?"),
            (None, None) => self.binder.columns.help().to_owned(),
        };
        self.binder.refuse(fault.label("not a column, a `let` or a metric").help(help))
    }

    pub(super) fn negate(&mut self, inner: &Expr) -> Option<Bound> {
        match inner.kind {
            ExprKind::Literal(Literal::Int(value)) => return Some(self.literal(&Literal::Int(-value))),
            ExprKind::Literal(Literal::Float(value)) => return Some(self.literal(&Literal::Float(-value))),
            _ => {}
        }
        let inner = self.number(inner)?;
        let ty = inner.ty?;
        Some(Bound { decimals: inner.decimals, ..self.unary(Op::Negate(inner.node), ty, inner.level) })
    }

    fn binary(&mut self, op: BinaryOp, left: &Expr, right: &Expr, whole: &Expr) -> Option<Bound> {
        match op {
            BinaryOp::And | BinaryOp::Or => {
                let (left, right) = (self.truth(left), self.truth(right));
                let make = |n: &[NodeId]| {
                    if op == BinaryOp::And { Op::And(n[0], n[1]) } else { Op::Or(n[0], n[1]) }
                };
                Some(self.combine(&[left?, right?], Type::Bool, make))
            }
            BinaryOp::Compare(comparison) => self.comparison(comparison, left, right, whole),
            BinaryOp::Arithmetic(op) => self.arithmetic(op, left, right, whole),
        }
    }

    fn comparison(&mut self, comparison: Comparison, left: &Expr, right: &Expr, whole: &Expr) -> Option<Bound> {
        let (a, b) = self.both(left, right)?;
        // Comparisons by order also make sense with other texts.
        if matches!(comparison, Comparison::Equal | Comparison::NotEqual) {
            self.check_equality((a, left), (b, right))?;
        }
        self.compared(comparison, a, b, whole)
    }

    pub(super) fn compared(
        &mut self,
        mut comparison: Comparison,
        left: Bound,
        right: Bound,
        whole: &Expr,
    ) -> Option<Bound> {
        let (both, _) = self.unified(&[left, right], whole, "compared")?;
        let (mut left, mut right) = (both[0], both[1]);
        if let Some(known) = self.known_outcome(comparison, left, right) {
            return Some(known);
        }
        let is_time = |this: &Self, bound: Bound| this.binder.builder.node(bound.node).op == Op::Time;
        // Put the time on the left: the kernels recognise windows by that form.
        if is_time(self, right) && !is_time(self, left) {
            (left, right, comparison) = (right, left, comparison.flipped());
        }
        Some(self.combine(&[left, right], Type::Bool, |n| Op::Compare(comparison, n[0], n[1])))
    }

    /// Reduces a comparison of a two-constant `case` with a constant to its condition. So a column with two possible
    /// values costs nothing if the traces do not have it.
    fn known_outcome(&mut self, comparison: Comparison, left: Bound, right: Bound) -> Option<Bound> {
        let Op::Case { branches, otherwise: Some(otherwise) } = &self.binder.builder.node(left.node).op else {
            return None;
        };
        let (&[(when, then)], otherwise) = (branches.as_slice(), *otherwise) else { return None };
        let text = |node: NodeId| self.binder.literal_text(node);
        let wanted = text(right.node)?;
        let is_met = match (comparison, text(then)? == wanted, text(otherwise)? == wanted) {
            (Comparison::Equal, true, false) | (Comparison::NotEqual, false, true) => true,
            (Comparison::Equal, false, true) | (Comparison::NotEqual, true, false) => false,
            _ => return None,
        };
        let is = self.unary(Op::IsTrue(when), Type::Bool, left.level);
        Some(if is_met { is } else { self.unary(Op::Not(is.node), Type::Bool, is.level) })
    }

    pub(super) fn arithmetic(&mut self, op: Arithmetic, left: &Expr, right: &Expr, whole: &Expr) -> Option<Bound> {
        let (a, b) = (self.number(left), self.number(right));
        let both = [a?, b?];
        // The digits of a product are those of both factors.
        let (both, ty) = if op == Arithmetic::Multiply && both.iter().any(|factor| factor.decimals > 0) {
            (self.as_decimals(&both, whole)?, Type::Int)
        } else {
            self.unified(&both, whole, "combined")?
        };
        if ty == Type::Float && matches!(op, Arithmetic::Quotient | Arithmetic::Remainder) {
            let fault = Fault::new(self.place(whole), "division is for integers");
            return self.binder.refuse(fault.label("a float"));
        }
        let decimals = match op {
            Arithmetic::Multiply => both[0].decimals + both[1].decimals,
            Arithmetic::Quotient => 0,
            _ => both[0].decimals,
        };
        if decimals > MOST_DECIMALS {
            let fault = Fault::new(self.place(whole), format!("the product has {decimals} digits after the point"));
            let help = format!("round its factors: at most {MOST_DECIMALS} digits are exact");
            return self.binder.refuse(fault.help(help));
        }
        Some(Bound { decimals, ..self.combine(&both, ty, |n| Op::Arithmetic(op, n[0], n[1])) })
    }

    pub(super) fn case(
        &mut self,
        operand: Option<&Expr>,
        branches: &[(Expr, Expr)],
        otherwise: Option<&Expr>,
        whole: &Expr,
    ) -> Option<Bound> {
        let operand = operand.map(|operand| (self.bind(operand), operand));
        let whens = complete(branches.iter().map(|(when, _)| match operand {
            Some((operand, asked)) => {
                let bound = self.bind(when);
                let (operand, bound) = (operand?, bound?);
                self.check_equality((operand, asked), (bound, when))?;
                self.compared(Comparison::Equal, operand, bound, when)
            }
            None => self.truth(when),
        }));
        let values = complete(branches.iter().map(|(_, then)| then).chain(otherwise).map(|value| self.bind(value)));
        let (whens, values) = (whens?, values?);
        let all_rates = values.iter().all(|value| value.rate || value.ty.is_none());
        let (values, ty) = self.unified(&values, whole, "results of one `case`")?;
        let operands: Vec<Bound> = whens.iter().chain(&values).copied().collect();
        let branch_count = whens.len();
        let bound = self.combine(&operands, ty, |nodes| {
            let (whens, values) = nodes.split_at(branch_count);
            Op::Case {
                branches: whens.iter().copied().zip(values.iter().copied()).collect(),
                otherwise: values.get(branch_count).copied(),
            }
        });
        Some(Bound { rate: all_rates && ty == Type::Bool, decimals: values[0].decimals, ..bound })
    }

    pub(super) fn place(&self, expr: &Expr) -> Place {
        self.written.place(expr.span.clone())
    }
}
