//! Converts the parser's tree to expressions of the calculus, and reports the faults of all parts.

use std::ops::Range;

use sqlparser::ast::{self, Spanned as _};

use super::grammar::{SyntaxFault, bytes_of, shortened};
use super::{BinaryOp, Expr, ExprKind, Literal};
use crate::logical_plan::plan::{Arithmetic, Comparison};

/// The deepest nesting of one expression.
const DEEPEST: usize = 120;

/// The fault is reported already.
struct Reported;

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
            Sql::IsNull(inner) | Sql::IsUnknown(inner) => {
                ExprKind::IsNull { operand: self.boxed(inner, depth)?, negated: false }
            }
            Sql::IsNotNull(inner) | Sql::IsNotUnknown(inner) => {
                ExprKind::IsNull { operand: self.boxed(inner, depth)?, negated: true }
            }
            Sql::IsTrue(inner) => self.truth(inner, true, false, depth)?,
            Sql::IsNotTrue(inner) => self.truth(inner, true, true, depth)?,
            Sql::IsFalse(inner) => self.truth(inner, false, false, depth)?,
            Sql::IsNotFalse(inner) => self.truth(inner, false, true, depth)?,
            Sql::IsDistinctFrom(left, right) => self.distinct(left, right, false, depth)?,
            Sql::IsNotDistinctFrom(left, right) => self.distinct(left, right, true, depth)?,
            Sql::Between { expr, negated, low, high } => {
                let (operand, low, high) = (self.boxed(expr, depth), self.boxed(low, depth), self.boxed(high, depth));
                ExprKind::Between { operand: operand?, low: low?, high: high?, negated: *negated }
            }
            Sql::InList { expr, list, negated } => {
                let operand = self.boxed(expr, depth);
                ExprKind::InList { operand: operand?, list: self.all(list.iter(), depth)?, negated: *negated }
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
        // Collected in two steps so that the faults of every item are found.
        let items: Vec<Option<Expr>> = list.map(|item| self.read(item, depth)).collect();
        items.into_iter().collect()
    }

    fn optional(&mut self, expr: Option<&ast::Expr>, depth: usize) -> Result<Option<Box<Expr>>, Reported> {
        expr.map(|expr| self.boxed(expr, depth).ok_or(Reported)).transpose()
    }

    fn truth(&mut self, inner: &ast::Expr, truth: bool, negated: bool, depth: usize) -> Option<ExprKind> {
        Some(ExprKind::IsTruth { operand: self.boxed(inner, depth)?, truth, negated })
    }

    fn distinct(&mut self, left: &ast::Expr, right: &ast::Expr, negated: bool, depth: usize) -> Option<ExprKind> {
        let (left, right) = (self.boxed(left, depth), self.boxed(right, depth));
        Some(ExprKind::Distinct { left: left?, right: right?, negated })
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
        use ast::BinaryOperator as Sql;
        Some(match op {
            Sql::And => BinaryOp::And,
            Sql::Or => BinaryOp::Or,
            Sql::Eq => BinaryOp::Compare(Comparison::Equal),
            Sql::NotEq => BinaryOp::Compare(Comparison::NotEqual),
            Sql::Lt => BinaryOp::Compare(Comparison::Less),
            Sql::LtEq => BinaryOp::Compare(Comparison::LessEqual),
            Sql::Gt => BinaryOp::Compare(Comparison::Greater),
            Sql::GtEq => BinaryOp::Compare(Comparison::GreaterEqual),
            Sql::Plus => BinaryOp::Arithmetic(Arithmetic::Add),
            Sql::Minus => BinaryOp::Arithmetic(Arithmetic::Subtract),
            Sql::Multiply => BinaryOp::Arithmetic(Arithmetic::Multiply),
            Sql::Modulo => BinaryOp::Arithmetic(Arithmetic::Remainder),
            Sql::Divide => {
                let help = "an episode's value is an integer: write `div(a, b)`, which drops the fraction";
                return self.refuse(span.clone(), "the operator `/` is not supported", Some(help));
            }
            other => return self.refuse(span.clone(), format!("the operator `{other}` is not supported"), None),
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
        let operand = self.optional(operand, depth);
        let whens = self.all(conditions.iter().map(|when| &when.condition), depth);
        let thens = self.all(conditions.iter().map(|when| &when.result), depth);
        let otherwise = self.optional(otherwise, depth);
        Some(ExprKind::Case {
            operand: operand.ok()?,
            branches: whens?.into_iter().zip(thens?).collect(),
            otherwise: otherwise.ok()?,
        })
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
