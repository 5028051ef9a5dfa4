//! One SELECT: WHERE, groups, HAVING, windows, columns, DISTINCT, ORDER BY.

use std::ops::ControlFlow;
use std::slice;

use polars::prelude::{Expr, LazyFrame, NULL, UnionArgs, UniqueKeepStrategy, col, concat, len, lit};
use sqlparser::ast::{
    Distinct, ExcludeSelectItem, Expr as Ast, GroupByExpr, ObjectName, OrderByExpr, Query, Select, SelectItem,
    SelectItemQualifiedWildcardKind, Spanned as _, Visit, Visitor, WildcardAdditionalOptions,
};

use super::accepted::Kind;
use super::names::{column_name, integer, reference};
use super::plan::Planner;
use super::refused::QueryResult;
use super::relation::{Column, Order, Relation, find, sort};
use super::run::PolarsError;
use super::scope::{Key, Scope};
use super::value::Value;
use super::windows::is_aggregate_call;

/// Each grouping set is a frame of its own.
const MOST_SETS: usize = 64;

pub(super) struct Item {
    name: String,
    ast: Option<Ast>,
    value: Value,
}

impl Item {
    pub(super) fn of(column: &Column) -> Self {
        Self { name: column.name.clone(), ast: None, value: column.value.clone() }
    }
}

impl Planner<'_> {
    pub(super) fn select(&mut self, select: &Select, orders: &[OrderByExpr]) -> QueryResult<Relation> {
        self.only_known_clauses(select)?;
        let from = self.from(&select.from)?;
        let mut scope = self.scope(from.columns);
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
            return scope.text.refuse(having);
        }
        let distinct = select.distinct == Some(Distinct::Distinct);
        let mut results = Vec::new();
        let columns = items.iter().map(|item| {
            let expr = scope.names.keep(&mut results, item.value.expr.clone());
            let value = Value { expr, ..item.value.clone() };
            Column { table: String::new(), name: item.name.clone(), value, hidden: false }
        });
        let columns: Vec<Column> = columns.collect();
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
        results.extend(extra);
        frame = frame.with_columns(results);
        let chosen: Vec<Expr> = columns.iter().map(|column| column.value.expr.clone()).collect();
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
            return self.text.refuse_at(select.span(), rest.trim().trim_start_matches("SELECT "));
        }
        match &select.distinct {
            None | Some(Distinct::Distinct) => Ok(()),
            Some(other) => self.text.refuse_at(select.span(), other),
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
        let parts = match &select.group_by {
            GroupByExpr::Expressions(parts, modifiers) if modifiers.is_empty() => parts,
            other => return self.text.refuse_at(select.span(), other),
        };
        let aggregates =
            has_aggregate(&select.projection) || has_aggregate(&orders.to_vec()) || select.having.is_some();
        if parts.is_empty() && !aggregates {
            return Ok(None);
        }
        let asts = match parts.as_slice() {
            [Ast::Rollup(parts)] if parts.len() < MOST_SETS => {
                (0..=parts.len()).rev().map(|length| parts[..length].concat()).collect()
            }
            [Ast::Cube(parts)] if parts.len() <= 6 => subsets(parts),
            [Ast::GroupingSets(sets)] if sets.len() <= MOST_SETS => sets.clone(),
            parts => vec![parts.iter().map(|part| self.plain_key(part, &select.projection)).collect::<Result<_, _>>()?],
        };
        let mut keys: Vec<Ast> = Vec::new();
        let sets: Vec<Vec<usize>> = asts.into_iter().map(|set| positions(&mut keys, set)).collect();
        let is_set = sets.len() > 1;
        let keys = keys.iter().map(|key| self.group_key(key, is_set)).collect::<Result<_, _>>()?;
        self.keys = Some(keys);
        Ok(Some(sets))
    }

    /// A key of GROUP BY, which may be the number of a selected column.
    fn plain_key(&self, part: &Ast, items: &[SelectItem]) -> QueryResult<Ast> {
        match (part, integer(part)) {
            (Ast::Rollup(_) | Ast::Cube(_) | Ast::GroupingSets(_) | Ast::Tuple(_), _) => self.text.refuse(part),
            (_, None) => Ok(part.clone()),
            (_, Some(at)) => match &items[self.numbered(part, at, items.len())?] {
                SelectItem::UnnamedExpr(expr) | SelectItem::ExprWithAlias { expr, .. } => Ok(expr.clone()),
                _ => self.text.refuse(part),
            },
        }
    }

    /// The position of a selected column by its number, from 1.
    fn numbered(&self, ast: &Ast, number: i64, count: usize) -> QueryResult<usize> {
        let position = usize::try_from(number).ok().and_then(|number| number.checked_sub(1));
        position
            .filter(|position| *position < count)
            .ok_or_else(|| self.text.fault(ast.span(), format!("no selected column has the number {number}")).into())
    }

    fn group_key(&mut self, key: &Ast, is_set: bool) -> QueryResult<Key> {
        let row = self.rows("GROUP BY", |scope| scope.exact(key))?;
        // The nulls of other grouping sets have one type.
        let expr = if is_set { row.to(row.kind) } else { row.expr.clone() };
        let expr = self.names.keep(&mut self.prepared, expr);
        // A key may be named by its alias or by its expression.
        let meant = match key {
            Ast::Identifier(name) if find(&self.columns, None, name).len() != 1 => self.alias(name),
            _ => None,
        };
        let grouped = Value { expr, ..row.clone() };
        Ok(Key { ast: meant.unwrap_or_else(|| key.clone()), row, grouped })
    }

    fn items(&mut self, projection: &[SelectItem]) -> QueryResult<Vec<Item>> {
        let mut items = Vec::new();
        for item in projection {
            let (name, expr) = match item {
                SelectItem::UnnamedExpr(expr) => (self.name_of(expr), expr),
                SelectItem::ExprWithAlias { expr, alias } => (alias.value.clone(), expr),
                SelectItem::Wildcard(options) => {
                    items.extend(self.all(item, None, options)?);
                    continue;
                }
                SelectItem::QualifiedWildcard(SelectItemQualifiedWildcardKind::ObjectName(name), options) => {
                    items.extend(self.all(item, Some(name), options)?);
                    continue;
                }
                _ => return self.text.refuse(item),
            };
            items.push(Item { name, ast: Some(expr.clone()), value: self.value(expr)? });
        }
        Ok(items)
    }

    fn name_of(&self, expr: &Ast) -> String {
        let Some((table, name)) = reference(expr) else { return column_name(expr) };
        match find(&self.columns, table, name)[..] {
            [column] => column.name.clone(),
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
            return self.text.refuse(item);
        }
        let fault = |message: String| self.text.fault(item.span(), message);
        if self.keys.is_some() {
            let fault = fault("the column `*` is used beside an aggregate without GROUP BY".to_owned());
            return Err(fault.help("name the columns in its place, here and in a GROUP BY").into());
        }
        let table = table.map(ToString::to_string);
        let of_table = |column: &&Column| match &table {
            Some(table) => column.table.eq_ignore_ascii_case(table.trim_matches('"')),
            None => !column.hidden,
        };
        let columns: Vec<&Column> = self.columns.iter().filter(of_table).collect();
        let excluded = match &options.opt_exclude {
            None => &[][..],
            Some(ExcludeSelectItem::Single(name)) => slice::from_ref(name),
            Some(ExcludeSelectItem::Multiple(names)) => names,
        };
        let excluded: Vec<String> = excluded.iter().map(bare).collect();
        let known = |name: &&String| columns.iter().any(|column| column.name.eq_ignore_ascii_case(name));
        if let Some(unknown) = excluded.iter().find(|name| !known(name)) {
            return Err(fault(format!("unknown column `{unknown}` in EXCLUDE")).into());
        }
        if columns.is_empty() {
            return Err(fault(format!("`{item}` has no columns")).help("name a table with FROM").into());
        }
        let is_kept = |column: &&&Column| !excluded.iter().any(|name| column.name.eq_ignore_ascii_case(name));
        let kept = columns.iter().filter(is_kept).map(|column| {
            self.check_type(item.span(), &column.name, column.value.kind)?;
            Ok(Item::of(column))
        });
        kept.collect()
    }

    /// The keys of ORDER BY, and the columns that only they need.
    pub(super) fn orders(
        &mut self,
        orders: &[OrderByExpr],
        items: &[Item],
        columns: &[Column],
        distinct: bool,
    ) -> QueryResult<(Vec<Expr>, Vec<Order>)> {
        let (mut extra, mut keys) = (Vec::new(), Vec::new());
        for order in orders {
            let column = match self.selected(&order.expr, items)? {
                Some(at) if items[at].value.is_exact() => columns[at].value.expr.clone(),
                Some(at) => return self.text.unfit(&order.expr, slice::from_ref(&items[at].value)),
                None if distinct => return self.text.refuse(&order.expr),
                None => {
                    let value = self.exact(&order.expr)?;
                    self.names.keep(&mut extra, value.expr)
                }
            };
            keys.push(self.order(order, column)?);
        }
        Ok((extra, keys))
    }

    /// The selected column that ORDER BY means by a number, an alias or an equal expression.
    fn selected(&self, key: &Ast, items: &[Item]) -> QueryResult<Option<usize>> {
        if let Some(at) = integer(key) {
            return self.numbered(key, at, items.len()).map(Some);
        }
        if matches!(key, Ast::Value(_)) {
            return self.text.refuse(key);
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
        let (inside, outside): (Vec<_>, Vec<_>) = keys.iter().enumerate().partition(|(at, _)| set.contains(at));
        let by: Vec<Expr> = inside.into_iter().map(|(_, key)| key.grouped.expr.clone()).collect();
        let nulls: Vec<Expr> = outside.into_iter().map(|(_, key)| null_of(key)).collect();
        let groups = if by.is_empty() {
            frame.clone().select(&aggregates)
        } else {
            frame.clone().group_by(&by).agg(&aggregates)
        };
        let names = keys.iter().map(|key| key.grouped.expr.clone());
        let parts = scope.aggregates.iter().map(|part| col(name_in(part)));
        groups.with_columns(nulls).select(names.chain(parts).chain([col("")]).collect::<Vec<_>>())
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
