//! Converts the parser's tree to expressions of the calculus, and reports the faults of all parts.

use std::ops::Range;

use sqlparser::ast::{self, Spanned as _};

use super::grammar::{SyntaxFault, bytes_of, shortened};
use super::{BinaryOp, Expr, ExprKind, Literal, complete};
use crate::logical_plan::plan::{Arithmetic, Comparison};

/// The deepest nesting of one expression.
const DEEPEST: usize = 120;

/// Walks the parser's tree and keeps the constructs of the calculus.
pub(super) struct Reader<'a> {
    text: &'a str,
    faults: Vec<SyntaxFault>,
}

impl<'a> Reader<'a> {
    pub(super) const fn new(text: &'a str) -> Self {
        Self { text, faults: Vec::new() }
    }

    pub(super) fn expression(mut self, parsed: &ast::Expr) -> Result<Expr, Vec<SyntaxFault>> {
        match self.read(parsed, 0) {
            Some(expr) if self.faults.is_empty() => Ok(expr),
            _ => Err(self.faults),
        }
    }

    fn read(&mut self, expr: &ast::Expr, depth: usize) -> Option<Expr> {
        let span = self.span(expr);
        if depth > DEEPEST {
            return self.refuse(span, "the expression is nested too deeply", Some("name its parts in [let]"));
        }
        let kind = self.read_kind(expr, &span, depth + 1)?;
        Some(Expr { kind, span })
    }

    fn read_kind(&mut self, expr: &ast::Expr, span: &Range<usize>, depth: usize) -> Option<ExprKind> {
        use ast::Expr as Sql;
        let not_if = |negated: bool, kind: ExprKind| {
            if negated { ExprKind::Not(Box::new(Expr { kind, span: span.clone() })) } else { kind }
        };
        Some(match expr {
            Sql::Nested(inner) => self.read(inner, depth)?.kind,
            Sql::Identifier(name) => ExprKind::Name(name.value.clone()),
            Sql::Value(value) => ExprKind::Literal(self.literal(&value.value, span)?),
            Sql::UnaryOp { op, expr } => return self.unary(*op, expr, span, depth),
            Sql::BinaryOp { left, op, right } => {
                let op = self.operator(op, span);
                let (left, right) = (self.boxed(left, depth), self.boxed(right, depth));
                ExprKind::Binary(op?, left?, right?)
            }
            Sql::IsNull(inner) | Sql::IsUnknown(inner) => ExprKind::IsNull(self.boxed(inner, depth)?),
            Sql::IsNotNull(inner) | Sql::IsNotUnknown(inner) => {
                not_if(true, ExprKind::IsNull(self.boxed(inner, depth)?))
            }
            Sql::IsTrue(inner) => ExprKind::IsTruth(self.boxed(inner, depth)?, true),
            Sql::IsNotTrue(inner) => not_if(true, ExprKind::IsTruth(self.boxed(inner, depth)?, true)),
            Sql::IsFalse(inner) => ExprKind::IsTruth(self.boxed(inner, depth)?, false),
            Sql::IsNotFalse(inner) => not_if(true, ExprKind::IsTruth(self.boxed(inner, depth)?, false)),
            Sql::IsDistinctFrom(left, right) | Sql::IsNotDistinctFrom(left, right) => {
                let (left, right) = (self.boxed(left, depth), self.boxed(right, depth));
                not_if(matches!(expr, Sql::IsNotDistinctFrom(..)), ExprKind::Distinct(left?, right?))
            }
            Sql::Between { expr, negated, low, high } => {
                let (operand, low, high) = (self.boxed(expr, depth), self.boxed(low, depth), self.boxed(high, depth));
                not_if(*negated, ExprKind::Between(operand?, [low?, high?]))
            }
            Sql::InList { expr, list, negated } => {
                let (operand, list) = (self.boxed(expr, depth), self.all(list.iter(), depth));
                not_if(*negated, ExprKind::InList(operand?, list?))
            }
            Sql::Case { operand, conditions, else_result, .. } => {
                return self.case(operand.as_deref(), conditions, else_result.as_deref(), depth);
            }
            Sql::Function(function) => return self.call(function, span, depth),
            other => return self.unsupported(other, span.clone()),
        })
    }

    fn boxed(&mut self, expr: &ast::Expr, depth: usize) -> Option<Box<Expr>> {
        self.read(expr, depth).map(Box::new)
    }

    fn all<'e>(&mut self, list: impl Iterator<Item = &'e ast::Expr>, depth: usize) -> Option<Vec<Expr>> {
        complete(list.map(|item| self.read(item, depth)))
    }

    fn unary(
        &mut self,
        op: ast::UnaryOperator,
        inner: &ast::Expr,
        span: &Range<usize>,
        depth: usize,
    ) -> Option<ExprKind> {
        match op {
            ast::UnaryOperator::Not => Some(ExprKind::Not(self.boxed(inner, depth)?)),
            ast::UnaryOperator::Minus => Some(ExprKind::Negate(self.boxed(inner, depth)?)),
            ast::UnaryOperator::Plus => Some(self.read(inner, depth)?.kind),
            other => self.refuse(span.clone(), format!("the operator `{other}` is not supported"), None),
        }
    }

    fn operator(&mut self, op: &ast::BinaryOperator, span: &Range<usize>) -> Option<BinaryOp> {
        match op {
            ast::BinaryOperator::And => return Some(BinaryOp::And),
            ast::BinaryOperator::Or => return Some(BinaryOp::Or),
            _ => {}
        }
        let sign = op.to_string();
        let comparison = Comparison::named(&sign).map(BinaryOp::Compare);
        comparison.or_else(|| Arithmetic::named(&sign).map(BinaryOp::Arithmetic)).or_else(|| {
            let help = "an episode's value is an integer: write `div(a, b)`, which drops the fraction";
            let help = (sign == "/").then_some(help);
            self.refuse(span.clone(), format!("the operator `{sign}` is not supported"), help)
        })
    }

    fn literal(&mut self, value: &ast::Value, span: &Range<usize>) -> Option<Literal> {
        match value {
            ast::Value::Null => Some(Literal::Null),
            ast::Value::Boolean(value) => Some(Literal::Bool(*value)),
            ast::Value::SingleQuotedString(text) => Some(Literal::Text(text.clone())),
            ast::Value::Number(digits, _) => self.number(digits, span),
            other => self.refuse(
                span.clone(),
                format!("the constant `{other}` is not supported"),
                Some("constants are numbers, 'text', true, false and null; names take double quotes"),
            ),
        }
    }

    fn number(&mut self, digits: &str, span: &Range<usize>) -> Option<Literal> {
        if digits.bytes().all(|b| b.is_ascii_digit()) {
            return match digits.parse() {
                Ok(value) => Some(Literal::Int(value)),
                Err(_) => self.refuse(span.clone(), format!("the number {digits} exceeds 64 bits"), None),
            };
        }
        match digits.parse::<f64>() {
            Ok(value) if value.is_finite() => Some(Literal::Float(value)),
            _ => self.refuse(span.clone(), format!("`{digits}` is not a number"), None),
        }
    }

    fn case(
        &mut self,
        operand: Option<&ast::Expr>,
        conditions: &[ast::CaseWhen],
        otherwise: Option<&ast::Expr>,
        depth: usize,
    ) -> Option<ExprKind> {
        let operand = operand.map(|operand| self.boxed(operand, depth));
        let whens = self.all(conditions.iter().map(|when| &when.condition), depth);
        let thens = self.all(conditions.iter().map(|when| &when.result), depth);
        let otherwise = otherwise.map(|otherwise| self.boxed(otherwise, depth));
        let branches = whens?.into_iter().zip(thens?).collect();
        let present = |part: Option<Option<Box<Expr>>>| part.map_or(Some(None), |part| part.map(Some));
        Some(ExprKind::Case { operand: present(operand)?, branches, otherwise: present(otherwise)? })
    }

    fn call(&mut self, function: &ast::Function, span: &Range<usize>, depth: usize) -> Option<ExprKind> {
        let name = function.name.to_string().to_lowercase();
        let plain = function.filter.is_none()
            && function.over.is_none()
            && function.null_treatment.is_none()
            && function.within_group.is_empty()
            && matches!(function.parameters, ast::FunctionArguments::None)
            && !function.uses_odbc_syntax;
        let ast::FunctionArguments::List(list) = &function.args else {
            return self.refuse(span.clone(), format!("`{name}` needs arguments in parentheses"), None);
        };
        if !plain || list.duplicate_treatment.is_some() || !list.clauses.is_empty() {
            let message = format!("`{name}` takes plain arguments: no DISTINCT, FILTER, OVER or ORDER BY");
            return self.refuse(span.clone(), message, Some("put the condition inside: `count(a and b)`"));
        }
        let mut arguments = Vec::with_capacity(list.args.len());
        for argument in &list.args {
            match argument {
                ast::FunctionArg::Unnamed(ast::FunctionArgExpr::Expr(expr)) => arguments.push(expr),
                _ if name == "count" => {
                    return self.refuse(span.clone(), "`count(*)` is not supported", Some("write `length()`"));
                }
                other => return self.refuse(span.clone(), format!("the argument `{other}` is not supported"), None),
            }
        }
        Some(ExprKind::Call { name, arguments: self.all(arguments.into_iter(), depth)? })
    }

    fn unsupported(&mut self, expr: &ast::Expr, span: Range<usize>) -> Option<ExprKind> {
        use ast::Expr as Sql;
        let (what, help) = match expr {
            Sql::CompoundIdentifier(_) => ("a name with a dot", Some("there is one table: write the column alone")),
            Sql::Subquery(_) | Sql::Exists { .. } | Sql::InSubquery { .. } => ("a subquery", None),
            Sql::Cast { .. } | Sql::Convert { .. } => ("a cast", Some("types follow from the columns")),
            Sql::Like { .. } | Sql::ILike { .. } | Sql::SimilarTo { .. } | Sql::RLike { .. } => {
                ("pattern matching with LIKE", Some("write `regexp_like(text, 'pattern')`"))
            }
            Sql::Tuple(_) => ("a list of values", Some("lists stand after `in`")),
            Sql::AnyOp { .. } | Sql::AllOp { .. } => ("a quantified comparison", Some("write `any(p)` or `all(p)`")),
            _ => ("this construct", None),
        };
        self.refuse(span, format!("{what} is not supported: `{}`", shortened(&expr.to_string())), help)
    }

    fn refuse<T>(&mut self, span: Range<usize>, message: impl Into<String>, help: Option<&str>) -> Option<T> {
        self.faults.push(SyntaxFault { message: message.into(), span, help: help.map(str::to_owned) });
        None
    }

    fn span(&self, expr: &ast::Expr) -> Range<usize> {
        let span = bytes_of(self.text, expr.span());
        match expr {
            ast::Expr::Function(_) => span.start..end_of_call(self.text, span.start).unwrap_or(span.end),
            _ => span,
        }
    }
}

/// The position after the parenthesis that closes the call at `start`.
fn end_of_call(text: &str, start: usize) -> Option<usize> {
    let mut depth = 0usize;
    let mut quote = None;
    for (at, c) in text[start..].char_indices() {
        match (quote, c) {
            (Some(open), c) => quote = if c == open { None } else { quote },
            (None, '\'' | '"') => quote = Some(c),
            (None, '(') => depth += 1,
            (None, ')') if depth == 1 => return Some(start + at + 1),
            (None, ')') => depth = depth.checked_sub(1)?,
            (None, _) => {}
        }
    }
    None
}
