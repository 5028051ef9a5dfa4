//! A query as a lazy frame: tables, joins, unions, order. What has no arm here is refused.

use std::collections::BTreeMap;
use std::sync::Arc;

use polars::prelude::{
    IntoLazy as _, JoinCoalesce, JoinType, LazyFrame, UnionArgs, UniqueKeepStrategy, col, concat, df,
};
use sqlparser::ast::{
    BinaryOperator, Expr as Ast, Join, JoinConstraint, JoinOperator, LimitClause, ObjectName, OrderByKind, Query,
    SetExpr, SetOperator, SetQuantifier, Spanned as _, TableAlias, TableFactor, TableWithJoins,
};
use sqlparser::tokenizer::Span;

use super::accepted::Kind;
use super::names::integer;
use super::refused::{QueryResult, Text};
use super::relation::{Column, Names, Relation, sort};
use super::run::PolarsError;
use super::scope::Scope;
use super::select::Item;
use super::statement::Table;
use super::value::{Value, common};
use mirrorstats_toml_spec::Source;

pub(super) struct Planner<'s> {
    pub(super) text: Text<'s>,
    tables: &'s BTreeMap<Table, Relation>,
    names: &'s Names,
    with: Vec<(String, Relation)>,
}

impl<'s> Planner<'s> {
    pub(super) fn new(source: &'s Arc<Source>, tables: &'s BTreeMap<Table, Relation>, names: &'s Names) -> Self {
        Self { text: Text(source), tables, names, with: Vec::new() }
    }

    /// The expressions over some columns. Their subqueries are planned here.
    pub(super) fn scope(&mut self, columns: Vec<Column>) -> Scope<'_, 's> {
        Scope::new(self.text, self.names, columns, Box::new(move |query| self.query(query)))
    }

    pub(super) fn query(&mut self, query: &Query) -> QueryResult<Relation> {
        let bare = Query { with: None, order_by: None, limit_clause: None, ..query.clone() };
        if bare.to_string() != query.body.to_string() {
            return self.text.refuse_at(query.span(), bare);
        }
        let outer = self.with.len();
        for cte in query.with.iter().flat_map(|with| &with.cte_tables) {
            if cte.from.is_some() || query.with.as_ref().is_some_and(|with| with.recursive) {
                return self.text.refuse_at(cte.alias.name.span, cte);
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
            Some(_) => return self.text.refuse_at(query.span(), "ORDER BY ALL"),
        };
        let relation = match query.body.as_ref() {
            SetExpr::Select(select) => self.select(select, orders)?,
            body => {
                let Relation { frame, columns } = self.set(body)?;
                let items: Vec<Item> = columns.iter().map(Item::of).collect();
                let (_, keys) = self.scope(columns.clone()).orders(orders, &items, &columns, true)?;
                Relation { frame: sort(frame, &keys), columns }
            }
        };
        self.limited(relation, query)
    }

    fn limited(&self, relation: Relation, query: &Query) -> QueryResult<Relation> {
        let (limit, offset) = match &query.limit_clause {
            None => return Ok(relation),
            Some(LimitClause::LimitOffset { limit, offset, limit_by }) if limit_by.is_empty() => (limit, offset),
            Some(other) => return self.text.refuse_at(query.span(), other),
        };
        let number = |ast: &Ast| match integer(ast).and_then(|number| u32::try_from(number).ok()) {
            Some(number) => Ok(number),
            None => self.text.refuse(ast),
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
                    _ => return self.text.refuse(body),
                };
                let (left, right) = (self.set(left)?, self.set(right)?);
                let union = self.union(body, &left, &right)?;
                Ok(if all {
                    union
                } else {
                    Relation { frame: union.frame.unique(None, UniqueKeepStrategy::Any), ..union }
                })
            }
            _ => self.text.refuse(body),
        }
    }

    fn union(&mut self, body: &SetExpr, left: &Relation, right: &Relation) -> QueryResult<Relation> {
        let (found, expected) = (right.columns.len(), left.columns.len());
        if found != expected {
            let message = format!("UNION of {expected} and {found} columns");
            return Err(self.text.fault(body.span(), message).help("select as many columns on both sides").into());
        }
        let (mut columns, mut sides) = (Vec::new(), [Vec::new(), Vec::new()]);
        for (a, b) in left.columns.iter().zip(&right.columns) {
            let values = [a.value.clone(), b.value.clone()];
            let kind = common(&values).filter(|_| values.iter().all(Value::is_exact));
            let Some(kind) = kind else {
                let message = format!("UNION of `{}`: {} and {}", a.name, a.value.kind.sql(), b.value.kind.sql());
                return self.text.unsupported(body.span(), message);
            };
            let inner = self.names.fresh();
            for (side, value) in sides.iter_mut().zip(&values) {
                side.push(value.to(kind).alias(inner.as_str()));
            }
            let value = Value { expr: col(inner.as_str()), kind, bits: a.value.bits.max(b.value.bits) };
            columns.push(Column { value, hidden: false, ..a.clone() });
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
            let fault = self.text.fault(second.span(), "several tables without JOIN");
            return Err(fault.help("write JOIN ... ON a.x = b.y").into());
        }
        let first = self.factor(&table.relation)?;
        table.joins.iter().try_fold(first, |left, join| self.join(left, join))
    }

    fn alias(&self, alias: &TableAlias) -> QueryResult<String> {
        if alias.columns.is_empty() && alias.at.is_none() {
            return Ok(alias.name.value.clone());
        }
        self.text.refuse_at(alias.name.span, alias)
    }

    fn factor(&mut self, factor: &TableFactor) -> QueryResult<Relation> {
        let (relation, name, alias) = match factor {
            TableFactor::Table { name, alias, .. } => {
                let written = alias.as_ref().map_or_else(|| name.to_string(), |alias| format!("{name} {alias}"));
                let word = name.0.first().and_then(|part| part.as_ident()).map(|ident| ident.value.as_str());
                let known = word.and_then(|word| self.named(word));
                match known.filter(|_| written == factor.to_string()) {
                    Some(relation) => (relation, word.unwrap_or_default().to_owned(), alias),
                    None => return self.text.refuse(factor),
                }
            }
            TableFactor::Derived { lateral: false, subquery, alias, sample: None } => {
                (self.query(subquery)?, String::new(), alias)
            }
            other => return self.text.refuse(other),
        };
        let table = alias.as_ref().map_or(Ok(name), |alias| self.alias(alias))?;
        Ok(relation.renamed(&table, self.names))
    }

    fn named(&self, word: &str) -> Option<Relation> {
        let with = self.with.iter().rev().find(|(name, _)| name.eq_ignore_ascii_case(word));
        with.map(|(_, relation)| relation.clone()).or_else(|| self.tables.get(&Table::named(word)?).cloned())
    }

    fn join(&mut self, left: Relation, join: &Join) -> QueryResult<Relation> {
        let right = self.factor(&join.relation)?;
        let clash = right.columns.first().filter(|one| left.columns.iter().any(|other| other.table == one.table));
        if let Some(Column { table, .. }) = clash {
            let fault = self.text.fault(join.relation.span(), format!("two tables are named `{table}`"));
            return Err(fault.help("give one an alias").into());
        }
        let (how, constraint) = match &join.join_operator {
            JoinOperator::Join(constraint) | JoinOperator::Inner(constraint) => (JoinType::Inner, constraint),
            JoinOperator::Left(constraint) | JoinOperator::LeftOuter(constraint) => (JoinType::Left, constraint),
            JoinOperator::Right(constraint) | JoinOperator::RightOuter(constraint) => (JoinType::Right, constraint),
            JoinOperator::FullOuter(constraint) => (JoinType::Full, constraint),
            // Polars turns a cross join under a comparison into a range join, on which its streaming engine panics.
            _ => return self.text.refuse_at(join.relation.span(), join),
        };
        match constraint {
            JoinConstraint::On(condition) => self.joined_on(left, right, condition, how),
            JoinConstraint::Using(names) if matches!(how, JoinType::Inner | JoinType::Left) => {
                self.joined_using(left, right, names, how)
            }
            _ => self.text.refuse_at(join.relation.span(), join),
        }
    }

    fn joined_using(
        &mut self,
        left: Relation,
        mut right: Relation,
        names: &[ObjectName],
        how: JoinType,
    ) -> QueryResult<Relation> {
        let mut pairs = Vec::new();
        for name in names {
            let [Some(ident)] = name.0.iter().map(|part| part.as_ident()).collect::<Vec<_>>()[..] else {
                return self.text.refuse(name);
            };
            let ast = Ast::Identifier(ident.clone());
            let mut of = |columns: &[Column]| self.scope(columns.to_vec()).value(&ast);
            pairs.push([of(&left.columns)?, of(&right.columns)?]);
            for column in right.columns.iter_mut().filter(|column| column.name.eq_ignore_ascii_case(&ident.value)) {
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
            let met = self.scope(all.clone()).rows("ON", |scope| scope.truth(part))?;
            match self.pair(&left, &right, part) {
                Some(pair) => pairs.push(pair),
                None => others.push(met),
            }
        }
        if pairs.is_empty() || !(others.is_empty() || how == JoinType::Inner) {
            return self.text.refuse_at(condition.span(), format!("ON {condition}"));
        }
        let joined = self.equal(left, right, &pairs, how)?;
        let frame = others.into_iter().fold(joined.frame, LazyFrame::filter);
        Ok(Relation { frame, ..joined })
    }

    /// The two sides of an equality of the two tables.
    fn pair(&mut self, left: &Relation, right: &Relation, ast: &Ast) -> Option<[Value; 2]> {
        let Ast::BinaryOp { left: a, op: BinaryOperator::Eq, right: b } = ast else { return None };
        let mut of = |relation: &Relation, ast: &Ast| self.scope(relation.columns.clone()).value(ast).ok();
        let straight = of(left, a).zip(of(right, b));
        straight.or_else(|| of(left, b).zip(of(right, a))).map(|(left, right)| [left, right])
    }

    fn equal(&mut self, left: Relation, right: Relation, pairs: &[[Value; 2]], how: JoinType) -> QueryResult<Relation> {
        let (mut sides, mut names) = ([Vec::new(), Vec::new()], [Vec::new(), Vec::new()]);
        for pair in pairs {
            let kind = common(pair).filter(|_| pair.iter().all(Value::is_exact)).filter(|kind| *kind != Kind::Null);
            let Some(kind) = kind else {
                let kinds = format!("a join of {} and {}", pair[0].kind.sql(), pair[1].kind.sql());
                return self.text.unsupported(Span::empty(), kinds);
            };
            for (at, value) in pair.iter().enumerate() {
                names[at].push(self.names.keep(&mut sides[at], value.to(kind)));
            }
        }
        let [a, b] = sides;
        let frame = left.frame.with_columns(a).join_builder().with(right.frame.with_columns(b));
        let frame = frame.left_on(&names[0]).right_on(&names[1]).how(how).coalesce(JoinCoalesce::KeepColumns).finish();
        Ok(Relation { frame, columns: [left.columns, right.columns].concat() })
    }
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
