//! One SELECT: WHERE, groups, HAVING, windows, columns, DISTINCT, ORDER BY.

use std::collections::HashSet;
use std::ops::ControlFlow;

use polars::prelude::{Expr, LazyFrame, NULL, UnionArgs, UniqueKeepStrategy, col, concat, len, lit};
use sqlparser::ast::{
    Distinct, ExcludeSelectItem, Expr as Ast, GroupByExpr, GroupByWithModifier, ObjectName, OrderByExpr, Query, Select,
    SelectItem, SelectItemQualifiedWildcardKind, Spanned as _, Visit, Visitor, WildcardAdditionalOptions,
};

use super::accepted::Kind;
use super::names::column_name;
use super::plan::{Planner, sort};
use super::refused::QueryResult;
use super::relation::{Column, Found, Relation, find};
use super::run::PolarsError;
use super::scope::{Key, Scope};
use super::value::Value;
use super::windows::{Order, integer, is_aggregate_call};

const MOST_SETS: usize = 64;

/// A column of the result.
struct Item {
    name: String,
    ast: Option<Ast>,
    value: Value,
}

impl Planner<'_> {
    pub(super) fn select(&mut self, select: &Select, orders: &[OrderByExpr]) -> QueryResult<Relation> {
        self.only_known_clauses(select)?;
        let from = self.from(&select.from)?;
        let mut scope = Scope::new(self, from.columns);
        scope.aliases = select.projection.iter().filter_map(aliased).collect();
        let mut frame = from.frame;
        if let Some(condition) = &select.selection {
            frame = frame.filter(scope.rows("WHERE", |scope| scope.truth(condition))?);
        }
        let sets = scope.groups(select, orders)?;
        let items = scope.items(&select.projection)?;
        let before = scope.windows.len();
        let having = select.having.as_ref().map(|having| scope.truth(having)).transpose()?;
        if let Some(having) = select.having.as_ref().filter(|_| scope.windows.len() > before) {
            return scope.unsupported(having);
        }
        let (distinct, columns) = (select.distinct == Some(Distinct::Distinct), scope.columns_of(&items));
        let (extra, keys) = scope.orders(orders, &items, &columns, distinct)?;
        frame = frame.with_columns(&scope.prepared);
        if let Some(sets) = sets {
            frame = grouped(&frame, &scope, &sets)?;
        }
        frame = having.into_iter().fold(frame, LazyFrame::filter);
        for window in &scope.windows {
            frame = sort(frame.with_columns(&window.prepared), &window.order);
            frame = window.steps.iter().fold(frame, LazyFrame::with_columns);
        }
        let results =
            items.iter().zip(&columns).map(|(item, column)| item.value.expr.clone().alias(column.inner.as_str()));
        frame = frame.with_columns(results.chain(extra).collect::<Vec<_>>());
        let chosen: Vec<Expr> = columns.iter().map(|column| col(column.inner.as_str())).collect();
        if distinct {
            frame = frame.select(&chosen).unique(None, UniqueKeepStrategy::Any);
        }
        Ok(Relation { frame: sort(frame, &keys).select(chosen), columns })
    }

    fn only_known_clauses(&self, select: &Select) -> QueryResult<()> {
        let known = Select {
            distinct: None,
            projection: Vec::new(),
            from: Vec::new(),
            selection: None,
            group_by: GroupByExpr::Expressions(Vec::new(), Vec::new()),
            having: None,
            ..select.clone()
        };
        let rest = known.to_string();
        if rest.trim() != "SELECT" {
            return self.unsupported(select.span(), rest.trim().trim_start_matches("SELECT "));
        }
        match &select.distinct {
            None | Some(Distinct::Distinct) => Ok(()),
            Some(other) => self.unsupported(select.span(), other),
        }
    }
}

fn aliased(item: &SelectItem) -> Option<(String, Ast)> {
    match item {
        SelectItem::ExprWithAlias { expr, alias } => Some((alias.value.clone(), expr.clone())),
        _ => None,
    }
}

/// Looks for an aggregate outside subqueries.
#[derive(Default)]
struct Aggregates {
    inside: usize,
}

impl Visitor for Aggregates {
    type Break = ();

    fn pre_visit_query(&mut self, _: &Query) -> ControlFlow<()> {
        self.inside += 1;
        ControlFlow::Continue(())
    }

    fn post_visit_query(&mut self, _: &Query) -> ControlFlow<()> {
        self.inside -= 1;
        ControlFlow::Continue(())
    }

    fn pre_visit_expr(&mut self, expr: &Ast) -> ControlFlow<()> {
        if self.inside == 0 && is_aggregate_call(expr) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

fn has_aggregate(node: &impl Visit) -> bool {
    node.visit(&mut Aggregates::default()).is_break()
}

impl Scope<'_, '_> {
    /// Reads GROUP BY. Returns the grouping sets as positions of keys; `None` if rows are not grouped.
    fn groups(&mut self, select: &Select, orders: &[OrderByExpr]) -> QueryResult<Option<Vec<Vec<usize>>>> {
        let GroupByExpr::Expressions(parts, modifiers) = &select.group_by else {
            return Err(super::refused::unsupported(self.source(), select.span(), "GROUP BY ALL"));
        };
        let aggregates =
            has_aggregate(&select.projection) || has_aggregate(&orders.to_vec()) || select.having.is_some();
        if parts.is_empty() && modifiers.is_empty() && !aggregates {
            return Ok(None);
        }
        let mut keys: Vec<Ast> = Vec::new();
        let mut sets: Vec<Vec<usize>> = vec![Vec::new()];
        for option in self.options(parts, modifiers, select)? {
            let option: Vec<Vec<usize>> = option.into_iter().map(|set| positions(&mut keys, set)).collect();
            sets = sets.iter().flat_map(|set| option.iter().map(move |more| [set.as_slice(), more].concat())).collect();
            if sets.len() > MOST_SETS {
                let message = format!("expected at most {MOST_SETS} grouping sets, found {}", sets.len());
                return self.wrong(select.span(), message, None);
            }
        }
        let is_set = sets.len() > 1;
        let keys = keys.iter().map(|key| self.group_key(key, is_set)).collect::<Result<_, _>>()?;
        self.keys = Some(keys);
        Ok(Some(sets))
    }

    fn options(
        &self,
        parts: &[Ast],
        modifiers: &[GroupByWithModifier],
        select: &Select,
    ) -> QueryResult<Vec<Vec<Vec<Ast>>>> {
        let single = |parts: &[Ast]| parts.iter().map(|part| vec![part.clone()]).collect::<Vec<_>>();
        match modifiers {
            [] => {}
            [GroupByWithModifier::Rollup] => return Ok(vec![prefixes(&single(parts))]),
            [GroupByWithModifier::Cube] if parts.len() <= 6 => return Ok(vec![subsets(&single(parts))]),
            _ => {
                return Err(super::refused::unsupported(
                    self.source(),
                    select.span(),
                    format!("`{}`", select.group_by),
                ));
            }
        }
        let one = |part: &Ast| match part {
            Ast::Rollup(parts) => Ok(prefixes(parts)),
            Ast::Cube(parts) if parts.len() <= 6 => Ok(subsets(parts)),
            Ast::Cube(parts) => {
                let message = format!("expected at most {MOST_SETS} grouping sets, found 2^{}", parts.len());
                self.wrong(part.span(), message, None)
            }
            Ast::GroupingSets(sets) => Ok(sets.clone()),
            Ast::Tuple(_) => self.unsupported(part),
            part => match integer(part) {
                None => Ok(vec![vec![part.clone()]]),
                Some(at) => Ok(vec![vec![self.position(part, at, &select.projection)?]]),
            },
        };
        parts.iter().map(one).collect()
    }

    /// The selected expression with a number, from 1.
    fn position(&self, part: &Ast, at: i64, items: &[SelectItem]) -> QueryResult<Ast> {
        let item = usize::try_from(at).ok().and_then(|at| items.get(at.checked_sub(1)?));
        match item {
            Some(SelectItem::UnnamedExpr(expr) | SelectItem::ExprWithAlias { expr, .. }) => Ok(expr.clone()),
            _ => self.wrong(part.span(), format!("no selected column has the number {at}"), None),
        }
    }

    fn group_key(&mut self, key: &Ast, is_set: bool) -> QueryResult<Key> {
        let row = self.rows("GROUP BY", |scope| scope.exact(key))?;
        // The nulls of other grouping sets have one type.
        let expr = if is_set { row.to(row.kind) } else { row.expr.clone() };
        let name = self.planner.fresh();
        self.prepared.push(expr.alias(name.as_str()));
        // A key may be named by its alias or by its expression.
        let meant = match key {
            Ast::Identifier(name) if !matches!(find(&self.columns, None, &name.value), Found::One(_)) => self
                .aliases
                .iter()
                .find(|(alias, _)| alias.eq_ignore_ascii_case(&name.value))
                .map(|(_, ast)| ast.clone()),
            _ => None,
        };
        let grouped = Value { expr: col(name.as_str()), ..row.clone() };
        Ok(Key { ast: meant.unwrap_or_else(|| key.clone()), row, grouped })
    }

    fn items(&mut self, projection: &[SelectItem]) -> QueryResult<Vec<Item>> {
        let mut items = Vec::new();
        for item in projection {
            match item {
                SelectItem::UnnamedExpr(expr) => {
                    let name = self.name_of(expr);
                    items.push(Item { name, ast: Some(expr.clone()), value: self.value(expr)? });
                }
                SelectItem::ExprWithAlias { expr, alias } => {
                    items.push(Item { name: alias.value.clone(), ast: Some(expr.clone()), value: self.value(expr)? });
                }
                SelectItem::Wildcard(options) => items.extend(self.all(item, None, options)?),
                SelectItem::QualifiedWildcard(SelectItemQualifiedWildcardKind::ObjectName(name), options) => {
                    items.extend(self.all(item, Some(name), options)?);
                }
                _ => return Err(super::refused::unsupported(self.source(), item.span(), format!("`{item}`"))),
            }
        }
        Ok(items)
    }

    fn name_of(&self, expr: &Ast) -> String {
        let (table, name) = match expr {
            Ast::Identifier(name) => (None, name),
            Ast::CompoundIdentifier(parts) if parts.len() == 2 => (Some(parts[0].value.as_str()), &parts[1]),
            _ => return column_name(expr),
        };
        match find(&self.columns, table, &name.value) {
            Found::One(column) => column.name.clone(),
            _ => name.value.clone(),
        }
    }

    fn all(
        &self,
        item: &SelectItem,
        table: Option<&ObjectName>,
        options: &WildcardAdditionalOptions,
    ) -> QueryResult<Vec<Item>> {
        let rest = WildcardAdditionalOptions { opt_exclude: None, ..options.clone() }.to_string();
        if !rest.is_empty() {
            return Err(super::refused::unsupported(self.source(), item.span(), format!("`{item}`")));
        }
        if self.keys.is_some() {
            let message = "the column `*` is used beside an aggregate without GROUP BY";
            let help = "name the columns in its place, here and in a GROUP BY".to_owned();
            return self.wrong(item.span(), message, Some(help));
        }
        let table = table.map(ToString::to_string);
        let of_table = |column: &&Column| match &table {
            Some(table) => column.table.eq_ignore_ascii_case(table.trim_matches('"')),
            None => !column.hidden,
        };
        let columns: Vec<&Column> = self.columns.iter().filter(of_table).collect();
        let excluded: Vec<String> = match &options.opt_exclude {
            None => Vec::new(),
            Some(ExcludeSelectItem::Single(name)) => vec![bare(name)],
            Some(ExcludeSelectItem::Multiple(names)) => names.iter().map(bare).collect(),
        };
        let known = |name: &String| columns.iter().any(|column| column.name.eq_ignore_ascii_case(name));
        if let Some(unknown) = excluded.iter().find(|name| !known(name)) {
            return self.wrong(item.span(), format!("unknown column `{unknown}` in EXCLUDE"), None);
        }
        if columns.is_empty() {
            return self.wrong(item.span(), format!("`{item}` has no columns"), Some("name a table with FROM".into()));
        }
        let is_kept = |column: &&&Column| !excluded.iter().any(|name| column.name.eq_ignore_ascii_case(name));
        let kept = columns.iter().filter(is_kept).map(|column| {
            self.check_type(item.span(), &column.name, column.kind)?;
            Ok(Item { name: column.name.clone(), ast: None, value: column.value() })
        });
        kept.collect()
    }

    fn columns_of(&mut self, items: &[Item]) -> Vec<Column> {
        let one = |item: &Item| Column {
            table: String::new(),
            name: item.name.clone(),
            inner: self.planner.fresh(),
            kind: item.value.kind,
            bits: item.value.bits,
            hidden: false,
        };
        items.iter().map(one).collect()
    }

    /// The keys of ORDER BY, and the columns that only they need.
    fn orders(
        &mut self,
        orders: &[OrderByExpr],
        items: &[Item],
        columns: &[Column],
        distinct: bool,
    ) -> QueryResult<(Vec<Expr>, Vec<Order>)> {
        let (mut extra, mut keys) = (Vec::new(), Vec::new());
        for order in orders {
            let selected = match self.selected(&order.expr, items)? {
                Some(at) if items[at].value.is_exact() => Some(columns[at].inner.clone()),
                Some(at) => return self.unfit(&order.expr, &[items[at].value.clone()]),
                None if distinct => return self.unsupported(&order.expr),
                None => None,
            };
            let inner = if let Some(inner) = selected {
                inner
            } else {
                let value = self.exact(&order.expr)?;
                let name = self.planner.fresh();
                extra.push(value.expr.alias(name.as_str()));
                name
            };
            keys.push(self.order(order, &col(inner.as_str()))?);
        }
        Ok((extra, keys))
    }

    /// The selected column that ORDER BY means by a number, an alias or an equal expression.
    fn selected(&self, key: &Ast, items: &[Item]) -> QueryResult<Option<usize>> {
        if let Some(at) = integer(key) {
            let position = usize::try_from(at).ok().and_then(|at| at.checked_sub(1)).filter(|at| *at < items.len());
            return match position {
                Some(position) => Ok(Some(position)),
                None => self.wrong(key.span(), format!("no selected column has the number {at}"), None),
            };
        }
        if matches!(key, Ast::Value(_)) {
            return self.unsupported(key);
        }
        if let Ast::Identifier(name) = key {
            for same in [str::eq, str::eq_ignore_ascii_case] {
                if let Some(at) = items.iter().position(|item| same(&item.name, &name.value)) {
                    return Ok(Some(at));
                }
            }
        }
        Ok(items.iter().position(|item| item.ast.as_ref() == Some(key)))
    }
}

fn bare(name: &ObjectName) -> String {
    name.0.last().and_then(|part| part.as_ident()).map(|ident| ident.value.clone()).unwrap_or_default()
}

fn positions(keys: &mut Vec<Ast>, set: Vec<Ast>) -> Vec<usize> {
    let mut position = |key: Ast| {
        keys.iter().position(|known| *known == key).unwrap_or_else(|| {
            keys.push(key);
            keys.len() - 1
        })
    };
    set.into_iter().map(&mut position).collect()
}

fn prefixes(parts: &[Vec<Ast>]) -> Vec<Vec<Ast>> {
    (0..=parts.len()).rev().map(|length| parts[..length].concat()).collect()
}

fn subsets(parts: &[Vec<Ast>]) -> Vec<Vec<Ast>> {
    let chosen = |bits: usize| parts.iter().enumerate().filter(move |(at, _)| bits & (1 << at) == 0);
    (0..1_usize << parts.len()).map(|bits| chosen(bits).flat_map(|(_, part)| part.clone()).collect()).collect()
}

/// The groups of each grouping set; keys outside the set are null.
fn grouped(frame: &LazyFrame, scope: &Scope<'_, '_>, sets: &[Vec<usize>]) -> QueryResult<LazyFrame> {
    let keys = scope.keys.as_deref().unwrap_or_default();
    // Polars needs an aggregate.
    let aggregates: Vec<Expr> = scope.aggregates.iter().cloned().chain([len().alias("")]).collect();
    let of_set = |set: &Vec<usize>| {
        let set: HashSet<usize> = set.iter().copied().collect();
        let by: Vec<Expr> = keys
            .iter()
            .enumerate()
            .filter(|(at, _)| set.contains(at))
            .map(|(_, key)| key.grouped.expr.clone())
            .collect();
        let nulls = keys.iter().enumerate().filter(|(at, _)| !set.contains(at)).map(|(_, key)| null_of(key));
        let groups = if by.is_empty() {
            frame.clone().select(&aggregates)
        } else {
            frame.clone().group_by(&by).agg(&aggregates)
        };
        let names = keys.iter().map(|key| key.grouped.expr.clone());
        let parts = scope.aggregates.iter().map(|part| col(name_in(part)));
        groups.with_columns(nulls.collect::<Vec<_>>()).select(names.chain(parts).chain([col("")]).collect::<Vec<_>>())
    };
    let frames: Vec<LazyFrame> = sets.iter().map(of_set).collect();
    Ok(match frames.as_slice() {
        [one] => one.clone(),
        _ => concat(frames, UnionArgs::default()).map_err(PolarsError::from)?,
    })
}

fn name_in(expr: &Expr) -> &str {
    match expr {
        Expr::Alias(_, name) | Expr::Column(name) => name.as_str(),
        _ => "",
    }
}

fn null_of(key: &Key) -> Expr {
    let kind = if key.grouped.kind == Kind::Decimal { Kind::Float } else { key.grouped.kind };
    lit(NULL).cast(kind.wide()).alias(name_in(&key.grouped.expr))
}
