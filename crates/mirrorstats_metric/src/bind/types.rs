//! Types and levels: constants, lossless conversions, and operands of a common type.

use super::super::logical_plan::plan::{Constant, NodeId, Op};
use super::super::syntax::{Expr, Literal};
use super::Bound;
use super::scope::Scope;
use crate::columns::{Level, Type};
use mirrorstats_toml_spec::Fault;

impl Scope<'_, '_> {
    pub(super) fn literal(&mut self, literal: &Literal) -> Bound {
        let (constant, ty) = match literal {
            Literal::Null => (Constant::Null, None),
            Literal::Bool(value) => (Constant::Bool(*value), Some(Type::Bool)),
            Literal::Int(value) => (Constant::Int(*value), Some(Type::Int)),
            Literal::Float(value) => (Constant::Float(value.to_bits()), Some(Type::Float)),
            Literal::Text(value) => (Constant::Text(value.clone()), Some(Type::Text)),
        };
        let node = self.binder.builder.add(Op::Constant(constant), ty.unwrap_or(Type::Bool), Level::Constant);
        Bound { node, ty, level: Level::Constant, rate: false, decimals: 0 }
    }

    pub(super) fn unary(&mut self, op: Op, ty: Type, level: Level) -> Bound {
        // An operation on constants alone runs once per episode.
        let (op, level) = match (level, op) {
            (Level::Constant, op @ Op::Constant(_)) => (op, level),
            (Level::Constant, op) => {
                let op = op.map(|operand| {
                    let ty = self.binder.builder.node(operand).ty;
                    self.binder.spread(operand, ty, Level::Constant, Level::Episode)
                });
                (op, Level::Episode)
            }
            (level, op) => (op, level),
        };
        Bound { node: self.binder.builder.add(op, ty, level), ty: Some(ty), level, rate: false, decimals: 0 }
    }

    pub(super) fn combine(&mut self, operands: &[Bound], ty: Type, op: impl FnOnce(&[NodeId]) -> Op) -> Bound {
        let level = operands.iter().map(|operand| operand.level).max().unwrap_or(Level::Constant);
        let all_constant = level == Level::Constant;
        let level = level.max(Level::Episode);
        let nodes: Vec<NodeId> = operands
            .iter()
            .map(|operand| match operand.level {
                Level::Constant if !all_constant => operand.node,
                from => {
                    let ty = self.binder.builder.node(operand.node).ty;
                    self.binder.spread(operand.node, ty, from, level)
                }
            })
            .collect();
        Bound { node: self.binder.builder.add(op(&nodes), ty, level), ty: Some(ty), level, rate: false, decimals: 0 }
    }

    pub(super) fn truth(&mut self, expr: &Expr) -> Option<Bound> {
        let bound = self.bind(expr)?;
        match bound.ty {
            Some(Type::Bool) => Some(bound),
            None => Some(self.null_of(Type::Bool)),
            Some(ty) => {
                let fault = Fault::new(self.place(expr), format!("expected true or false, found {}", ty.name()));
                self.binder.refuse(fault.label(ty.name()).help("compare it: `x = 1`, `x is not null`, ..."))
            }
        }
    }

    pub(super) fn number(&mut self, expr: &Expr) -> Option<Bound> {
        let bound = self.bind(expr)?;
        self.as_number(bound, expr)
    }

    pub(super) fn as_number(&mut self, bound: Bound, expr: &Expr) -> Option<Bound> {
        match bound.ty {
            Some(Type::Int | Type::Float) => Some(bound),
            Some(Type::Bool) if bound.rate => Some(self.as_int(bound)),
            None => Some(self.null_of(Type::Int)),
            Some(ty) => {
                let fault = Fault::new(self.place(expr), format!("expected a number, found {}", ty.name()));
                let help = (ty == Type::Bool).then(|| "write `case when p then 1 else 0 end`".to_owned());
                self.binder.refuse(fault.label(ty.name()).help_if(help))
            }
        }
    }

    pub(super) fn null_of(&mut self, ty: Type) -> Bound {
        let node = self.binder.builder.add(Op::Constant(Constant::Null), ty, Level::Constant);
        Bound { node, ty: Some(ty), level: Level::Constant, rate: false, decimals: 0 }
    }

    pub(super) fn as_int(&mut self, bound: Bound) -> Bound {
        self.unary(Op::IntFromBool(bound.node), Type::Int, bound.level)
    }

    fn converted(&mut self, bound: Bound, ty: Type) -> Option<Bound> {
        match (bound.ty, ty) {
            (None, ty) => Some(Bound { decimals: bound.decimals, ..self.null_of(ty) }),
            (Some(from), to) if from == to => Some(bound),
            (Some(Type::Bool), Type::Int) if bound.rate => Some(self.as_int(bound)),
            (Some(Type::Bool), Type::Float) if bound.rate => {
                let int = self.as_int(bound);
                self.converted(int, Type::Float)
            }
            (Some(Type::Int), Type::Float) => Some(match self.binder.builder.node(bound.node).op {
                #[expect(clippy::cast_precision_loss, reason = "an integer literal beside a float is a float")]
                Op::Constant(Constant::Int(value)) => self.literal(&Literal::Float(value as f64)),
                _ => self.unary(Op::FloatFromInt(bound.node), Type::Float, bound.level),
            }),
            _ => None,
        }
    }

    /// The common type of these operands: equal types, widened numbers, and rates as 0 and 1 beside numbers.
    fn common_type(bounds: &[Bound]) -> Option<Type> {
        let typed = || bounds.iter().filter_map(|bound| Some((bound.ty?, bound.rate)));
        let first = typed().next().map_or(Type::Bool, |(ty, _)| ty);
        if typed().all(|(ty, _)| ty == first) {
            return Some(first);
        }
        let numeric = |(ty, rate): (Type, bool)| matches!(ty, Type::Int | Type::Float) || rate;
        if !typed().all(numeric) {
            return None;
        }
        Some(if typed().any(|(ty, _)| ty == Type::Float) { Type::Float } else { Type::Int })
    }

    /// Converts operands to one type; `what` describes the operation in the message.
    pub(super) fn unified(&mut self, bounds: &[Bound], expr: &Expr, what: &str) -> Option<(Vec<Bound>, Type)> {
        let bounds = &self.aligned(bounds, expr)?;
        let Some(ty) = Self::common_type(bounds) else {
            let mut names: Vec<&str> = bounds.iter().filter_map(|bound| bound.ty.map(Type::name)).collect();
            names.dedup();
            let fault = Fault::new(self.place(expr), format!("{} cannot be {what}", names.join(" and ")));
            let truth = bounds.iter().any(|bound| bound.ty == Some(Type::Bool));
            let help = truth.then(|| "a condition needs no comparison: write `p` or `not p`".to_owned());
            return self.binder.refuse(fault.label("different types").help_if(help));
        };
        let bounds: Option<Vec<Bound>> = bounds.iter().map(|bound| self.converted(*bound, ty)).collect();
        Some((bounds?, ty))
    }

    /// Binds both operands, so that the faults of both are reported.
    pub(super) fn both(&mut self, left: &Expr, right: &Expr) -> Option<(Bound, Bound)> {
        let (left, right) = (self.bind(left), self.bind(right));
        Some((left?, right?))
    }

    pub(super) fn pair(&mut self, left: &Expr, right: &Expr, whole: &Expr) -> Option<(Bound, Bound)> {
        let (a, b) = self.both(left, right)?;
        self.check_equality((a, left), (b, right))?;
        let (both, _) = self.unified(&[a, b], whole, "compared")?;
        Some((both[0], both[1]))
    }
}
