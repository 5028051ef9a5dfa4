//! The expressions of one SELECT: names, kinds, aggregates and windows. What has no arm here is refused.

use std::ops::Range;

use polars::prelude::{Expr, NULL, Scalar, Series, lit, when};
use sqlparser::ast::{
    BinaryOperator, CaseWhen, CastKind, CeilFloorKind, DataType, Expr as Ast, Ident, Query, Spanned as _,
    UnaryOperator, Value as Literal, ValueWithSpan,
};
use sqlparser::tokenizer::Span;

use super::accepted::{CASTS, Kind};
use super::names::reference;
use super::refused::{QueryError, QueryResult, Text};
use super::relation::{Column, Names, Order, Relation, find};
use super::run::{self, PolarsError};
use super::value::{Value, arithmetic, balanced, common, compare, one_of};
use mirrorstats_exact::suggest::did_you_mean;

/// Polars plans by recursion.
const DEEPEST: usize = 100;

/// A key of GROUP BY.
#[derive(Clone)]
pub(super) struct Key {
    pub(super) ast: Ast,
    /// The key before grouping.
    pub(super) row: Value,
    pub(super) grouped: Value,
}

pub(super) struct Window {
    pub(super) prepared: Vec<Expr>,
    pub(super) order: Vec<Order>,
    /// New columns. A step may read the columns of the step before it.
    pub(super) steps: Vec<Vec<Expr>>,
}

type Subquery<'p> = Box<dyn FnMut(&Query) -> QueryResult<Relation> + 'p>;

pub(super) struct Scope<'p, 's> {
    pub(super) text: Text<'s>,
    pub(super) names: &'s Names,
    subquery: Subquery<'p>,
    pub(super) columns: Vec<Column>,
    /// Columns of a select by their aliases.
    pub(super) aliases: Vec<(String, Ast)>,
    pub(super) keys: Option<Vec<Key>>,
    /// The place where rows are meant and aggregates are not: WHERE, the argument of an aggregate.
    pub(super) rows_of: Option<&'static str>,
    /// Columns of rows that aggregates read.
    pub(super) prepared: Vec<Expr>,
    pub(super) aggregates: Vec<Expr>,
    pub(super) windows: Vec<Window>,
    depth: usize,
}

impl<'p, 's> Scope<'p, 's> {
    pub(super) fn new(text: Text<'s>, names: &'s Names, columns: Vec<Column>, subquery: Subquery<'p>) -> Self {
        let (aliases, prepared, aggregates, windows) = Default::default();
        let (keys, rows_of) = (None, None);
        Self { text, names, subquery, columns, aliases, keys, rows_of, prepared, aggregates, windows, depth: 0 }
    }

    /// Runs work in which aggregates are refused.
    pub(super) fn rows<T>(
        &mut self,
        place: &'static str,
        work: impl FnOnce(&mut Self) -> QueryResult<T>,
    ) -> QueryResult<T> {
        let before = self.rows_of.replace(place);
        let result = work(self);
        self.rows_of = before;
        result
    }

    pub(super) fn value(&mut self, ast: &Ast) -> QueryResult<Value> {
        self.depth += 1;
        if self.depth > DEEPEST {
            let fault = self.text.fault(ast.span(), "the query is nested too deeply");
            return Err(fault.help("name parts of it with WITH").into());
        }
        let value = self.key(ast).map_or_else(|| self.expression(ast), Ok);
        self.depth -= 1;
        value
    }

    fn key(&self, ast: &Ast) -> Option<Value> {
        let keys = self.keys.as_ref().filter(|_| self.rows_of.is_none())?;
        let row = reference(ast).and_then(|(table, name)| match find(&self.columns, table, name)[..] {
            [column] => Some(&column.value),
            _ => None,
        });
        let same = |key: &&Key| &key.ast == ast || row.is_some_and(|row| row.expr == key.row.expr);
        keys.iter().find(same).map(|key| key.grouped.clone())
    }

    fn expression(&mut self, ast: &Ast) -> QueryResult<Value> {
        match ast {
            Ast::Nested(inner) => self.value(inner),
            Ast::Identifier(_) | Ast::CompoundIdentifier(_) => self.name(ast),
            Ast::Value(literal) => self.literal(ast, literal),
            Ast::BinaryOp { left, op: op @ (BinaryOperator::And | BinaryOperator::Or), right } => {
                self.chain(left, op, right)
            }
            Ast::BinaryOp { left, op, right } => self.binary(ast, left, op, right),
            Ast::UnaryOp { op, expr } => self.unary(ast, *op, expr),
            Ast::IsNull(inner) => Ok(Value::bool(self.value(inner)?.expr.is_null())),
            Ast::IsNotNull(inner) => Ok(Value::bool(self.value(inner)?.expr.is_not_null())),
            Ast::IsTrue(inner) => self.is(inner, true, false),
            Ast::IsNotTrue(inner) => self.is(inner, true, true),
            Ast::IsFalse(inner) => self.is(inner, false, false),
            Ast::IsNotFalse(inner) => self.is(inner, false, true),
            Ast::IsUnknown(inner) => Ok(Value::bool(self.truth(inner)?.is_null())),
            Ast::IsNotUnknown(inner) => Ok(Value::bool(self.truth(inner)?.is_not_null())),
            Ast::IsDistinctFrom(left, right) => self.distinct(ast, left, right, true),
            Ast::IsNotDistinctFrom(left, right) => self.distinct(ast, left, right, false),
            Ast::Between { expr, negated, low, high } => self.between(ast, expr, *negated, [low, high]),
            Ast::InList { expr, list, negated } => self.in_list(ast, expr, list, *negated),
            Ast::InSubquery { expr, subquery, negated } => self.in_subquery(ast, expr, subquery, *negated),
            Ast::Like { negated, any: false, expr, pattern, escape_char: None } => {
                self.like(ast, expr, pattern, *negated)
            }
            Ast::Case { operand, conditions, else_result, .. } => {
                self.case(ast, operand.as_deref(), conditions, else_result.as_deref())
            }
            Ast::Cast { kind: CastKind::Cast | CastKind::DoubleColon, expr, data_type, array: false, format: None } => {
                self.cast(ast, expr, data_type)
            }
            Ast::Ceil { expr, field: CeilFloorKind::DateTimeField(sqlparser::ast::DateTimeField::NoDateTime) } => {
                self.call(ast, "ceil", &[expr])
            }
            Ast::Floor { expr, field: CeilFloorKind::DateTimeField(sqlparser::ast::DateTimeField::NoDateTime) } => {
                self.call(ast, "floor", &[expr])
            }
            Ast::Substring { expr, substring_from: Some(from), substring_for, .. } => {
                let args: Vec<&Ast> =
                    [expr.as_ref(), from.as_ref()].into_iter().chain(substring_for.as_deref()).collect();
                self.call(ast, "substring", &args)
            }
            Ast::Trim { trim_where: None, trim_what: None, expr, trim_characters: None } => {
                self.call(ast, "trim", &[expr])
            }
            Ast::Function(function) => self.function(ast, function),
            Ast::Subquery(query) => self.alone(query, Self::scalar),
            Ast::Exists { subquery, negated } => {
                let has_rows =
                    |_: &Self, _: &Query, found: Relation| Ok(run::collect(found.frame.limit(1))?.height() > 0);
                Ok(Value::bool(lit(self.alone(subquery, has_rows)? != *negated)))
            }
            _ => self.text.refuse(ast),
        }
    }

    /// A subquery in an expression, which runs before the query around it.
    fn alone<T>(
        &mut self,
        query: &Query,
        read: impl FnOnce(&Self, &Query, Relation) -> QueryResult<T>,
    ) -> QueryResult<T> {
        let remedy = "ask with a JOIN or a table of WITH";
        let found = (self.subquery)(query).and_then(|relation| read(self, query, relation));
        found.map_err(|error| match error {
            QueryError::Faults(mut faults) => {
                let Some(mut fault) = faults.0.pop() else { return QueryError::Faults(faults) };
                fault.message = format!("a subquery runs by itself first: {}", fault.message);
                let named = fault.help.take().map(|help| format!("{help}; or ")).unwrap_or_default();
                QueryError::Unsupported(Box::new(fault.help(format!("{named}{remedy}"))))
            }
            other => other,
        })
    }

    /// The value of a subquery's only row; null without a row.
    fn scalar(&self, query: &Query, relation: Relation) -> QueryResult<Value> {
        let (column, found) = self.column(query, relation)?;
        if found.len() > 1 {
            let message = format!("it is in the place of a value and has {} rows", found.len());
            return Err(self.text.fault(query.span(), message).help("add LIMIT 1 or an aggregate").into());
        }
        if found.is_empty() {
            return Ok(Value { expr: lit(NULL).cast(column.kind.wide()), ..column });
        }
        let value = found.get(0).map_err(PolarsError::from)?.into_static();
        Ok(Value { expr: lit(Scalar::new(found.dtype().clone(), value)), ..column })
    }

    /// The rows of a subquery's only column.
    fn column(&self, query: &Query, relation: Relation) -> QueryResult<(Value, Series)> {
        let [column] = relation.columns.as_slice() else {
            let message = format!("it is in the place of a value and has {} columns", relation.columns.len());
            return Err(self.text.fault(query.span(), message).help("select one column").into());
        };
        let value = column.value.clone();
        let found = run::collect(relation.frame.select([value.expr.clone()]))?;
        Ok((value, found.columns()[0].as_materialized_series().clone()))
    }

    fn name(&mut self, ast: &Ast) -> QueryResult<Value> {
        let Some((table, name)) = reference(ast) else { return self.text.refuse(ast) };
        let has = |table: &Ident| self.columns.iter().any(|column| column.table.eq_ignore_ascii_case(&table.value));
        match (find(&self.columns, table, name).as_slice(), table) {
            ([column], _) => self.ungrouped(name, column.value.clone()),
            ([], Some(table)) if !has(table) => {
                Err(self.text.fault(table.span, format!("unknown table `{}`", table.value)).into())
            }
            ([], None) => match self.alias(name) {
                Some(meant) if &meant != ast => self.value(&meant),
                _ => self.unknown(name),
            },
            ([], Some(_)) => self.unknown(name),
            _ => self.ambiguous(name),
        }
    }

    /// The selected expression of an alias.
    pub(super) fn alias(&self, name: &Ident) -> Option<Ast> {
        let alias = self.aliases.iter().find(|(alias, _)| alias.eq_ignore_ascii_case(&name.value));
        alias.map(|(_, meant)| meant.clone())
    }

    fn ambiguous<T>(&self, name: &Ident) -> QueryResult<T> {
        let tables = self.columns.iter().filter(|column| column.name.eq_ignore_ascii_case(&name.value));
        let one = |column: &Column| format!("{}.{}", column.table, column.name);
        let help = format!("write one of {}", tables.map(one).collect::<Vec<_>>().join(", "));
        Err(self.text.fault(name.span, format!("several tables have a column `{}`", name.value)).help(help).into())
    }

    fn unknown<T>(&self, name: &Ident) -> QueryResult<T> {
        let columns: Vec<&str> = self.columns.iter().map(|column| column.name.as_str()).collect();
        let (mut span, mut help) = (self.text.bytes(name.span), None);
        if let Some((whole, quoted)) = self.unquoted(span.start, &columns) {
            help = Some(format!("write \"{quoted}\" in double quotes: its name is more than letters, digits and `_`"));
            span = whole;
        }
        let near = || did_you_mean(&name.value, columns.iter().copied());
        let help = help.or_else(near).unwrap_or_else(|| format!("columns are {}", columns.join(", ")));
        Err(self.text.fault_at(span, format!("unknown column `{}`", name.value)).help(help).into())
    }

    /// The column whose name contains an unknown name, because it is not quoted.
    fn unquoted<'c>(&self, start: usize, columns: &[&'c str]) -> Option<(Range<usize>, &'c str)> {
        let text = &self.text.0.text;
        let is_word = |name: &str| name.chars().all(|c| c.is_alphanumeric() || c == '_');
        columns.iter().filter(|column| !is_word(column)).find_map(|column| {
            let mut spans = text.match_indices(column).map(|(at, _)| at..at + column.len());
            let span = spans.find(|span| span.contains(&start) && !text[..span.start].ends_with('"'))?;
            Some((span, *column))
        })
    }

    /// Refuses a column whose type queries do not read.
    pub(super) fn check_type(&self, span: Span, name: &str, kind: Kind) -> QueryResult<()> {
        if kind != Kind::Other {
            return Ok(());
        }
        let expected = "expected true or false, a number or a text, found another type";
        self.text.unsupported(span, format!("the column `{name}`: {expected}"))
    }

    /// Refuses the column of a row where groups are meant.
    fn ungrouped(&self, name: &Ident, value: Value) -> QueryResult<Value> {
        self.check_type(name.span, &name.value, value.kind)?;
        match &self.keys {
            Some(keys) if self.rows_of.is_none() => {
                let (name, span) = (&name.value, name.span);
                let without = if keys.is_empty() { "without GROUP BY" } else { "and not in GROUP BY" };
                let message = format!("the column `{name}` is used beside an aggregate {without}");
                Err(self.text.fault(span, message).help(format!("add it to GROUP BY, or write max({name})")).into())
            }
            _ => Ok(value),
        }
    }

    fn literal(&self, ast: &Ast, literal: &ValueWithSpan) -> QueryResult<Value> {
        match &literal.value {
            Literal::Null => Ok(Value::null()),
            Literal::Boolean(value) => Ok(Value::bool(lit(*value))),
            Literal::SingleQuotedString(text) => Ok(Value::new(lit(text.clone()), Kind::Text)),
            Literal::Number(text, false) => self.number(ast, text),
            _ => self.text.refuse(ast),
        }
    }

    fn number(&self, ast: &Ast, text: &str) -> QueryResult<Value> {
        if let Ok(number) = text.parse::<i64>() {
            return Ok(Value::int(lit(number), 64 - number.leading_zeros()));
        }
        let digits = text.chars().filter(char::is_ascii_digit).count();
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() && text.contains(['e', 'E']) => Ok(Value::new(lit(number), Kind::Float)),
            Ok(number) if text.contains('.') && digits <= 15 => {
                let inexact = (number * 1024.0).fract() != 0.0;
                Ok(Value { expr: lit(number), kind: Kind::Decimal, bits: inexact.into() })
            }
            _ => self.text.refuse(ast),
        }
    }

    /// A chain of one operator nests once per operand.
    fn chain(&mut self, left: &Ast, op: &BinaryOperator, right: &Ast) -> QueryResult<Value> {
        let (mut parts, mut rest) = (vec![self.truth(right)?], left);
        while let Ast::BinaryOp { left, op: other, right } = rest {
            if other != op {
                break;
            }
            parts.push(self.truth(right)?);
            rest = left;
        }
        parts.push(self.truth(rest)?);
        parts.reverse();
        let join = if *op == BinaryOperator::And { Expr::and } else { Expr::or };
        balanced(parts, join).map_or_else(|| self.text.refuse(left), |expr| Ok(Value::bool(expr)))
    }

    pub(super) fn truth(&mut self, ast: &Ast) -> QueryResult<Expr> {
        let value = self.value(ast)?;
        if matches!(value.kind, Kind::Bool | Kind::Null) {
            Ok(value.to(Kind::Bool))
        } else {
            self.text.unfit(ast, &[value])
        }
    }

    fn binary(&mut self, ast: &Ast, left: &Ast, op: &BinaryOperator, right: &Ast) -> QueryResult<Value> {
        use BinaryOperator::{Divide, Eq, Gt, GtEq, Lt, LtEq, Minus, Modulo, Multiply, NotEq, Plus, StringConcat};
        let [left, right] = [self.value(left)?, self.value(right)?];
        let value = match op {
            Plus | Minus | Multiply | Divide | Modulo => arithmetic(&left, op, &right),
            Eq | NotEq | Lt | LtEq | Gt | GtEq => compare(&left, op, &right),
            StringConcat if left.kind == Kind::Text && right.kind == Kind::Text => {
                Some(Value::new(left.expr.clone() + right.expr.clone(), Kind::Text))
            }
            _ => None,
        };
        value.map_or_else(|| self.text.unfit(ast, &[left, right]), Ok)
    }

    fn unary(&mut self, ast: &Ast, op: UnaryOperator, inner: &Ast) -> QueryResult<Value> {
        if op == UnaryOperator::Not {
            return Ok(Value::bool(self.truth(inner)?.not()));
        }
        let value = self.value(inner)?;
        match (op, value.kind, &value.expr) {
            (UnaryOperator::Minus, Kind::Int, _) => {
                let zero = Value::int(lit(0_i64), 0);
                arithmetic(&zero, &BinaryOperator::Minus, &value).map_or_else(|| self.text.refuse(ast), Ok)
            }
            (UnaryOperator::Minus, Kind::Decimal | Kind::Float, _) => {
                let negated = value.number().map_or_else(|| value.float() * lit(-1.0), |number| lit(-number));
                Ok(Value { expr: negated, ..value })
            }
            _ => self.text.unfit(ast, &[value]),
        }
    }

    fn is(&mut self, inner: &Ast, wanted: bool, negated: bool) -> QueryResult<Value> {
        let truth = self.truth(inner)?;
        let met = if wanted { truth } else { truth.not() }.fill_null(lit(false));
        Ok(Value::bool(if negated { met.not() } else { met }))
    }

    fn distinct(&mut self, ast: &Ast, left: &Ast, right: &Ast, wanted: bool) -> QueryResult<Value> {
        let values = [self.value(left)?, self.value(right)?];
        let kind = common(&values).filter(|_| compare(&values[0], &BinaryOperator::Eq, &values[1]).is_some());
        let Some(kind) = kind else { return self.text.unfit(ast, &values) };
        let same = values[0].to(kind).eq_missing(values[1].to(kind));
        Ok(Value::bool(if wanted { same.not() } else { same }))
    }

    fn compared(&self, ast: &Ast, left: &Value, op: &BinaryOperator, right: &Value) -> QueryResult<Expr> {
        let result = compare(left, op, right).map(|value| value.expr);
        result.map_or_else(|| self.text.unfit(ast, &[left.clone(), right.clone()]), Ok)
    }

    fn between(&mut self, ast: &Ast, expr: &Ast, negated: bool, ends: [&Ast; 2]) -> QueryResult<Value> {
        let (value, low, high) = (self.value(expr)?, self.value(ends[0])?, self.value(ends[1])?);
        let from = self.compared(ast, &value, &BinaryOperator::GtEq, &low)?;
        let inside = from.and(self.compared(ast, &value, &BinaryOperator::LtEq, &high)?);
        Ok(Value::bool(if negated { inside.not() } else { inside }))
    }

    fn in_list(&mut self, ast: &Ast, expr: &Ast, list: &[Ast], negated: bool) -> QueryResult<Value> {
        let value = self.value(expr)?;
        let mut equal = Vec::new();
        for item in list {
            let item = self.value(item)?;
            equal.push(self.compared(ast, &value, &BinaryOperator::Eq, &item)?);
        }
        let any = balanced(equal, Expr::or).unwrap_or_else(|| lit(false));
        Ok(Value::bool(if negated { any.not() } else { any }))
    }

    fn in_subquery(&mut self, ast: &Ast, expr: &Ast, query: &Query, negated: bool) -> QueryResult<Value> {
        let value = self.value(expr)?;
        let (items, found) = self.alone(query, Self::column)?;
        let kind = common([&value, &items]).filter(|_| compare(&value, &BinaryOperator::Eq, &items).is_some());
        let Some(kind) = kind else { return self.text.unfit(ast, &[value, items]) };
        if found.is_empty() {
            return Ok(Value::bool(lit(negated)));
        }
        let has_null = found.null_count() > 0;
        let known = found.drop_nulls().strict_cast(&kind.wide()).map_err(PolarsError::from)?;
        let inside = value.to(kind).is_in(lit(known).implode(false), false);
        // Beside a null, a value that is not in the list is unknown.
        let inside = if has_null { when(inside).then(lit(true)).otherwise(lit(NULL)) } else { inside };
        Ok(Value::bool(if negated { inside.not() } else { inside }))
    }

    fn like(&mut self, ast: &Ast, expr: &Ast, pattern: &Ast, negated: bool) -> QueryResult<Value> {
        let value = self.value(expr)?;
        let Ast::Value(ValueWithSpan { value: Literal::SingleQuotedString(pattern), .. }) = pattern else {
            return self.text.refuse(ast);
        };
        if value.kind != Kind::Text {
            return self.text.unfit(ast, &[value]);
        }
        let part = |character: char| match character {
            '%' => ".*".to_owned(),
            '_' => ".".to_owned(),
            // Every sign may stand escaped in a class of one.
            '^' | '\\' => format!("\\{character}"),
            _ if character.is_ascii_punctuation() => format!("[\\{character}]"),
            other => other.to_string(),
        };
        let regex = format!("(?s)^{}$", pattern.chars().map(part).collect::<String>());
        let met = value.expr.str().contains(lit(regex), true);
        Ok(Value::bool(if negated { met.not() } else { met }))
    }

    fn case(
        &mut self,
        ast: &Ast,
        operand: Option<&Ast>,
        whens: &[CaseWhen],
        otherwise: Option<&Ast>,
    ) -> QueryResult<Value> {
        let operand = operand.map(|operand| self.value(operand)).transpose()?;
        let (mut conditions, mut results) = (Vec::new(), Vec::new());
        for one in whens {
            conditions.push(match &operand {
                None => self.truth(&one.condition)?,
                Some(operand) => {
                    let value = self.value(&one.condition)?;
                    self.compared(ast, operand, &BinaryOperator::Eq, &value)?
                }
            });
            results.push(self.value(&one.result)?);
        }
        results.push(otherwise.map_or_else(|| Ok(Value::null()), |value| self.value(value))?);
        let Some(kind) = common(&results) else { return self.text.unfit(ast, &results) };
        let last = results.last().map_or_else(|| lit(NULL), |value| value.to(kind));
        let chain = conditions.into_iter().zip(&results).rev();
        let expr = chain.fold(last, |rest, (met, value)| {
            // A null condition is not met.
            when(met.fill_null(lit(false))).then(value.to(kind)).otherwise(rest)
        });
        Ok(one_of(expr, kind, &results))
    }

    fn cast(&mut self, ast: &Ast, inner: &Ast, ty: &DataType) -> QueryResult<Value> {
        let value = self.value(inner)?;
        let target = match ty {
            DataType::Boolean | DataType::Bool => "BOOLEAN",
            DataType::Int(None) | DataType::Integer(None) | DataType::Int4(None) => "INTEGER",
            DataType::BigInt(None) | DataType::Int8(None) => "BIGINT",
            DataType::Double(_) | DataType::DoublePrecision | DataType::Float8 => "DOUBLE",
            DataType::Text | DataType::Varchar(None) | DataType::String(None) => "VARCHAR",
            _ => return self.text.unfit(ast, &[value]),
        };
        let accepted = CASTS.iter().any(|(kind, targets)| *kind == value.kind && targets.contains(&target));
        let small = value.kind == Kind::Int && target == "INTEGER" && value.bits <= 31;
        if !accepted && !small {
            return self.text.unfit(ast, &[value]);
        }
        let bits = if value.kind == Kind::Bool { 1 } else { value.bits };
        Ok(match target {
            "INTEGER" | "BIGINT" => Value::int(value.to(Kind::Int), bits),
            "DOUBLE" => Value::new(value.float(), Kind::Float),
            "BOOLEAN" => value,
            _ => Value::new(value.to(Kind::Text), Kind::Text),
        })
    }
}
