//! A query as a lazy frame: tables, joins, groups, unions, order. What has no arm here is refused.

use std::collections::BTreeMap;
use std::sync::Arc;

use polars::prelude::{
    Expr, IntoLazy as _, JoinCoalesce, JoinType, LazyFrame, NULL, Series, SortMultipleOptions, UnionArgs,
    UniqueKeepStrategy, col, concat, df, lit,
};
use sqlparser::ast::{
    BinaryOperator, Expr as Ast, Ident, Join, JoinConstraint, JoinOperator, LimitClause, OrderByKind, Query, SetExpr,
    SetOperator, SetQuantifier, Spanned as _, TableAlias, TableFactor, TableWithJoins,
};
use sqlparser::tokenizer::Span;

use super::accepted::Kind;
use super::refused::{QueryError, QueryResult, unsupported, wrong};
use super::relation::{Column, Found, Relation, find};
use super::run::{self, PolarsError};
use super::scope::Scope;
use super::statement::Table;
use super::value::{Value, common};
use super::windows::{Order, integer};
use mirrorstats_metric::syntax::grammar::{bytes_of, shortened};
use mirrorstats_toml_spec::{Fault, Faults, Place, Source};

pub(super) struct Planner<'s> {
    pub(super) source: &'s Arc<Source>,
    pub(super) tables: &'s BTreeMap<Table, Relation>,
    with: Vec<(String, Relation)>,
    names: usize,
}

impl<'s> Planner<'s> {
    pub(super) fn new(source: &'s Arc<Source>, tables: &'s BTreeMap<Table, Relation>) -> Self {
        Self { source, tables, with: Vec::new(), names: 0 }
    }

    pub(super) fn fresh(&mut self) -> String {
        self.names += 1;
        format!("column {}", self.names)
    }

    pub(super) fn unsupported<T>(&self, span: Span, what: impl std::fmt::Display) -> QueryResult<T> {
        Err(unsupported(self.source, span, format!("`{}`", shortened(&what.to_string()))))
    }

    fn wrong<T>(&self, span: Span, message: impl Into<String>, help: &str) -> QueryResult<T> {
        Err(wrong(self.source, span, message, Some(help.to_owned())))
    }

    pub(super) fn wrong_at(&self, span: std::ops::Range<usize>, message: String, help: String) -> QueryError {
        let place = Place { source: Arc::clone(self.source), span };
        QueryError::Faults(Faults(vec![Fault::new(place, message).help(help)]))
    }

    /// The column whose name contains an unknown name, because it is not quoted.
    pub(super) fn unquoted<'c>(&self, span: Span, columns: &[&'c str]) -> Option<(std::ops::Range<usize>, &'c str)> {
        let (text, start) = (&self.source.text, bytes_of(&self.source.text, span).start);
        let is_word = |name: &str| name.chars().all(|c| c.is_alphanumeric() || c == '_');
        columns.iter().filter(|column| !is_word(column)).find_map(|column| {
            let spans = text.match_indices(column).map(|(at, _)| at..at + column.len());
            let span = spans.into_iter().find(|span| span.contains(&start) && !text[..span.start].ends_with('"'))?;
            Some((span, *column))
        })
    }

    /// The value of a subquery's only row; null without a row.
    pub(super) fn scalar(&mut self, query: &Query) -> QueryResult<Value> {
        let (column, found) = self.column(query)?;
        if found.len() > 1 {
            let message = format!("it is in the place of a value and has {} rows", found.len());
            return self.wrong(query.span(), message, "add LIMIT 1 or an aggregate");
        }
        if found.is_empty() {
            return Ok(Value { expr: lit(NULL).cast(column.kind.wide()), ..column });
        }
        let value = found.get(0).map_err(PolarsError::from)?.into_static();
        let scalar = polars::prelude::Scalar::new(found.dtype().clone(), value);
        Ok(Value { expr: lit(scalar), ..column })
    }

    /// The rows of a subquery's only column.
    pub(super) fn column(&mut self, query: &Query) -> QueryResult<(Value, Series)> {
        let relation = self.query(query)?;
        let [column] = relation.columns.as_slice() else {
            let message = format!("it is in the place of a value and has {} columns", relation.columns.len());
            return self.wrong(query.span(), message, "select one column");
        };
        let found = run::collect(relation.frame.select([col(column.inner.as_str())]))?;
        let series = found.columns()[0].as_materialized_series().clone();
        Ok((column.value(), series))
    }

    pub(super) fn exists(&mut self, query: &Query) -> QueryResult<bool> {
        Ok(run::collect(self.query(query)?.frame.limit(1))?.height() > 0)
    }

    pub(super) fn query(&mut self, query: &Query) -> QueryResult<Relation> {
        let bare = Query { with: None, order_by: None, limit_clause: None, ..query.clone() };
        if bare.to_string() != query.body.to_string() {
            return self.unsupported(query.span(), bare);
        }
        let outer = self.with.len();
        for cte in query.with.iter().flat_map(|with| &with.cte_tables) {
            if cte.from.is_some() || query.with.as_ref().is_some_and(|with| with.recursive) {
                return self.unsupported(cte.alias.name.span, cte);
            }
            let relation = self.query(&cte.query)?;
            let name = self.alias(&cte.alias)?;
            self.with.push((name, relation));
        }
        let relation = self.body(query)?;
        self.with.truncate(outer);
        Ok(relation)
    }

    fn body(&mut self, query: &Query) -> QueryResult<Relation> {
        let orders = match query.order_by.as_ref().map(|order| (&order.kind, &order.interpolate)) {
            None => &[][..],
            Some((OrderByKind::Expressions(keys), None)) => keys,
            Some(_) => return self.unsupported(query.span(), "ORDER BY ALL"),
        };
        let relation = if let SetExpr::Select(select) = query.body.as_ref() {
            self.select(select, orders)?
        } else {
            let relation = self.set(&query.body)?;
            let mut sorted = Vec::new();
            for key in orders {
                let scope = Scope::new(self, relation.columns.clone());
                let position = integer(&key.expr).and_then(|at| relation.columns.get(usize::try_from(at).ok()? - 1));
                let column = match (&key.expr, position) {
                    (_, Some(column)) => Some(column),
                    (Ast::Identifier(name), _) => match find(&relation.columns, None, &name.value) {
                        Found::One(column) => Some(column),
                        _ => None,
                    },
                    _ => None,
                };
                let Some(column) = column else { return scope.unsupported(&key.expr) };
                sorted.push(scope.order(key, &col(column.inner.as_str()))?);
            }
            Relation { frame: sort(relation.frame, &sorted), ..relation }
        };
        self.limited(relation, query)
    }

    fn limited(&self, relation: Relation, query: &Query) -> QueryResult<Relation> {
        let (limit, offset) = match &query.limit_clause {
            None => return Ok(relation),
            Some(LimitClause::LimitOffset { limit, offset, limit_by }) if limit_by.is_empty() => (limit, offset),
            Some(other) => return self.unsupported(query.span(), other),
        };
        let number = |ast: &Ast| match integer(ast).and_then(|number| u32::try_from(number).ok()) {
            Some(number) => Ok(number),
            None => self.unsupported(ast.span(), ast),
        };
        let offset = offset.as_ref().map_or(Ok(0), |offset| number(&offset.value))?;
        let limit = limit.as_ref().map_or(Ok(u32::MAX), number)?;
        Ok(Relation { frame: relation.frame.slice(offset.into(), limit), ..relation })
    }

    fn set(&mut self, body: &SetExpr) -> QueryResult<Relation> {
        match body {
            SetExpr::Select(select) => self.select(select, &[]),
            SetExpr::Query(query) => self.query(query),
            SetExpr::SetOperation { op: SetOperator::Union, set_quantifier, left, right } => {
                let all = match set_quantifier {
                    SetQuantifier::All => true,
                    SetQuantifier::None | SetQuantifier::Distinct => false,
                    _ => return self.unsupported(body.span(), body),
                };
                let (left, right) = (self.set(left)?, self.set(right)?);
                let union = self.union(body, &left, &right)?;
                Ok(if all {
                    union
                } else {
                    Relation { frame: union.frame.unique(None, UniqueKeepStrategy::Any), ..union }
                })
            }
            _ => self.unsupported(body.span(), body),
        }
    }

    fn union(&mut self, body: &SetExpr, left: &Relation, right: &Relation) -> QueryResult<Relation> {
        let (found, expected) = (right.columns.len(), left.columns.len());
        if found != expected {
            let message = format!("UNION of {expected} and {found} columns");
            return self.wrong(body.span(), message, "select as many columns on both sides");
        }
        let (mut columns, mut sides) = (Vec::new(), [Vec::new(), Vec::new()]);
        for (a, b) in left.columns.iter().zip(&right.columns) {
            let values = [a.value(), b.value()];
            let kind = common(&values).filter(|_| values.iter().all(Value::is_exact));
            let Some(kind) = kind else {
                let message = format!("UNION of `{}`: {} and {}", a.name, a.kind.sql(), b.kind.sql());
                return Err(unsupported(self.source, body.span(), message));
            };
            let inner = self.fresh();
            for (side, value) in sides.iter_mut().zip(&values) {
                side.push(value.to(kind).alias(inner.as_str()));
            }
            columns.push(Column { inner, kind, bits: a.bits.max(b.bits), hidden: false, ..a.clone() });
        }
        let [a, b] = sides;
        let frames = [left.frame.clone().select(a), right.frame.clone().select(b)];
        Ok(Relation { frame: concat(frames, UnionArgs::default()).map_err(PolarsError::from)?, columns })
    }

    pub(super) fn from(&mut self, tables: &[TableWithJoins]) -> QueryResult<Relation> {
        let Some((table, others)) = tables.split_first() else {
            // One row without a column.
            let frame = df!("" => [0_i64]).map_err(PolarsError::from)?.lazy();
            return Ok(Relation { frame, columns: Vec::new() });
        };
        if let Some(second) = others.first() {
            return self.wrong(second.span(), "several tables without JOIN", "write JOIN ... ON a.x = b.y");
        }
        let first = self.factor(&table.relation)?;
        table.joins.iter().try_fold(first, |left, join| self.join(left, join))
    }

    fn alias(&self, alias: &TableAlias) -> QueryResult<String> {
        if alias.columns.is_empty() && alias.at.is_none() {
            return Ok(alias.name.value.clone());
        }
        self.unsupported(alias.name.span, alias)
    }

    fn factor(&mut self, factor: &TableFactor) -> QueryResult<Relation> {
        let (relation, name, alias) = match factor {
            TableFactor::Table { name, alias, .. } => {
                let written = alias.as_ref().map_or_else(|| name.to_string(), |alias| format!("{name} {alias}"));
                let word = name.0.first().and_then(|part| part.as_ident()).map(|ident| ident.value.as_str());
                let known = word.and_then(|word| self.named(word));
                match known.filter(|_| written == factor.to_string()) {
                    Some(relation) => (relation, word.unwrap_or_default().to_owned(), alias),
                    None => return self.unsupported(factor.span(), factor),
                }
            }
            TableFactor::Derived { lateral: false, subquery, alias, sample: None } => {
                (self.query(subquery)?, String::new(), alias)
            }
            other => return self.unsupported(other.span(), other),
        };
        let table = alias.as_ref().map_or(Ok(name), |alias| self.alias(alias))?;
        Ok(relation.renamed(&table, || self.fresh()))
    }

    fn named(&self, word: &str) -> Option<Relation> {
        let with = self.with.iter().rev().find(|(name, _)| name.eq_ignore_ascii_case(word));
        with.map(|(_, relation)| relation.clone()).or_else(|| self.tables.get(&Table::named(word)?).cloned())
    }

    fn join(&mut self, left: Relation, join: &Join) -> QueryResult<Relation> {
        let right = self.factor(&join.relation)?;
        let clash = right.columns.first().filter(|one| left.columns.iter().any(|other| other.table == one.table));
        if let Some(table) = clash.map(|column| column.table.clone()).filter(|_| !join.global) {
            return self.wrong(join.relation.span(), format!("two tables are named `{table}`"), "give one an alias");
        }
        let (how, constraint) = match &join.join_operator {
            JoinOperator::Join(constraint) | JoinOperator::Inner(constraint) => (JoinType::Inner, constraint),
            JoinOperator::Left(constraint) | JoinOperator::LeftOuter(constraint) => (JoinType::Left, constraint),
            JoinOperator::Right(constraint) | JoinOperator::RightOuter(constraint) => (JoinType::Right, constraint),
            JoinOperator::FullOuter(constraint) => (JoinType::Full, constraint),
            // Polars turns a cross join under a comparison into a range join, on which its streaming engine panics.
            _ => return self.unsupported(join.relation.span(), join),
        };
        match constraint {
            JoinConstraint::On(condition) => self.joined_on(left, right, condition, how),
            JoinConstraint::Using(names) if matches!(how, JoinType::Inner | JoinType::Left) => {
                let one = |name: &sqlparser::ast::ObjectName| name.0.first().and_then(|part| part.as_ident()).cloned();
                let names: Option<Vec<Ident>> = names.iter().map(one).collect();
                let Some(names) = names else { return self.unsupported(join.relation.span(), join) };
                self.joined_using(left, right, &names, how)
            }
            _ => self.unsupported(join.relation.span(), join),
        }
    }

    fn joined_using(
        &mut self,
        left: Relation,
        mut right: Relation,
        names: &[Ident],
        how: JoinType,
    ) -> QueryResult<Relation> {
        let mut pairs = Vec::new();
        for name in names {
            let of = |planner: &mut Self, columns: &[Column]| {
                Scope::new(planner, columns.to_vec()).value(&Ast::Identifier(name.clone()))
            };
            pairs.push([of(self, &left.columns)?, of(self, &right.columns)?]);
            for column in right.columns.iter_mut().filter(|column| column.name.eq_ignore_ascii_case(&name.value)) {
                column.hidden = true;
            }
        }
        self.equal(left, right, &pairs, how)
    }

    /// A join on equalities; an inner join may have further conditions.
    fn joined_on(&mut self, left: Relation, right: Relation, condition: &Ast, how: JoinType) -> QueryResult<Relation> {
        let all = [left.columns.clone(), right.columns.clone()].concat();
        let (mut pairs, mut others) = (Vec::new(), Vec::new());
        for part in conjuncts(condition) {
            let met = Scope::new(self, all.clone()).rows("ON", |scope| scope.truth(part))?;
            match self.pair(&left, &right, part) {
                Some(pair) => pairs.push(pair),
                None => others.push(met),
            }
        }
        if pairs.is_empty() || !(others.is_empty() || how == JoinType::Inner) {
            return self.unsupported(condition.span(), format!("ON {condition}"));
        }
        let joined = self.equal(left, right, &pairs, how)?;
        let frame = others.into_iter().fold(joined.frame, LazyFrame::filter);
        Ok(Relation { frame, ..joined })
    }

    /// The two sides of an equality of the two tables.
    fn pair(&mut self, left: &Relation, right: &Relation, ast: &Ast) -> Option<[Value; 2]> {
        let Ast::BinaryOp { left: a, op: BinaryOperator::Eq, right: b } = ast else { return None };
        let mut of = |relation: &Relation, ast: &Ast| Scope::new(self, relation.columns.clone()).value(ast).ok();
        let straight = of(left, a).zip(of(right, b));
        straight.or_else(|| of(left, b).zip(of(right, a))).map(|(left, right)| [left, right])
    }

    fn equal(&mut self, left: Relation, right: Relation, pairs: &[[Value; 2]], how: JoinType) -> QueryResult<Relation> {
        let (mut sides, mut names) = ([Vec::new(), Vec::new()], [Vec::new(), Vec::new()]);
        for pair in pairs {
            let kind = common(pair).filter(|_| pair.iter().all(Value::is_exact)).filter(|kind| *kind != Kind::Null);
            let Some(kind) = kind else {
                let kinds = format!("a join of {} and {}", pair[0].kind.sql(), pair[1].kind.sql());
                return Err(unsupported(self.source, Span::empty(), kinds));
            };
            for (at, value) in pair.iter().enumerate() {
                let name = self.fresh();
                sides[at].push(value.to(kind).alias(name.as_str()));
                names[at].push(col(name.as_str()));
            }
        }
        let [a, b] = sides;
        let frame = left.frame.with_columns(a).join_builder().with(right.frame.with_columns(b));
        let frame = frame.left_on(&names[0]).right_on(&names[1]).how(how).coalesce(JoinCoalesce::KeepColumns).finish();
        Ok(Relation { frame, columns: [left.columns, right.columns].concat() })
    }
}

pub(super) fn sort(frame: LazyFrame, keys: &[Order]) -> LazyFrame {
    if keys.is_empty() {
        return frame;
    }
    let columns: Vec<Expr> = keys.iter().map(|key| col(key.inner.as_str())).collect();
    let options = SortMultipleOptions::new()
        .with_order_descending_multi(keys.iter().map(|key| key.descending))
        .with_nulls_last_multi(keys.iter().map(|key| key.nulls_last));
    frame.sort_by_exprs(columns, options)
}

fn conjuncts(mut ast: &Ast) -> Vec<&Ast> {
    let mut parts = Vec::new();
    loop {
        match ast {
            Ast::Nested(inner) => ast = inner,
            Ast::BinaryOp { left, op: BinaryOperator::And, right } => {
                parts.push(right.as_ref());
                ast = left;
            }
            _ => {
                parts.push(ast);
                return parts;
            }
        }
    }
}
