//! One SELECT: WHERE, groups, HAVING, windows, columns, DISTINCT, ORDER BY.

use std::ops::ControlFlow;

use polars::prelude::{Expr, LazyFrame, UniqueKeepStrategy, col, len};
use sqlparser::ast::{
    Distinct, ExcludeSelectItem, Expr as Ast, GroupByExpr, ObjectName, OrderByExpr, Query, Select, SelectItem,
    SelectItemQualifiedWildcardKind, Spanned as _, Visit, Visitor, WildcardAdditionalOptions,
};

use super::names::column_name;
use super::plan::{Planner, sort};
use super::refused::{QueryResult, unsupported};
use super::relation::{Column, Found, Relation, find};
use super::scope::{Key, Scope};
use super::value::Value;
use super::windows::{Order, integer, is_aggregate_call};

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
        let is_grouped = scope.groups(select, orders)?;
        let items = scope.items(&select.projection)?;
        let before = scope.windows.len();
        let having = select.having.as_ref().map(|having| scope.truth(having)).transpose()?;
        if let Some(having) = select.having.as_ref().filter(|_| scope.windows.len() > before) {
            return scope.unsupported(having);
        }
        let (distinct, columns) = (select.distinct == Some(Distinct::Distinct), scope.columns_of(&items));
        let (extra, keys) = scope.orders(orders, &items, &columns, distinct)?;
        frame = frame.with_columns(&scope.prepared);
        if is_grouped {
            frame = grouped(frame, &scope);
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
    /// Reads GROUP BY. Returns false if rows are not grouped.
    fn groups(&mut self, select: &Select, orders: &[OrderByExpr]) -> QueryResult<bool> {
        let GroupByExpr::Expressions(parts, modifiers) = &select.group_by else {
            return Err(unsupported(self.source(), select.span(), "GROUP BY ALL"));
        };
        if !modifiers.is_empty() {
            return Err(unsupported(self.source(), select.span(), format!("`{}`", select.group_by)));
        }
        let aggregates =
            has_aggregate(&select.projection) || has_aggregate(&orders.to_vec()) || select.having.is_some();
        if parts.is_empty() && !aggregates {
            return Ok(false);
        }
        let mut asts: Vec<Ast> = Vec::new();
        for part in parts {
            let key = match integer(part) {
                None => part.clone(),
                Some(at) => self.position(part, at, &select.projection)?,
            };
            if !asts.contains(&key) {
                asts.push(key);
            }
        }
        self.keys = Some(asts.iter().map(|key| self.group_key(key)).collect::<Result<_, _>>()?);
        Ok(true)
    }

    /// The selected expression with a number, from 1.
    fn position(&self, part: &Ast, at: i64, items: &[SelectItem]) -> QueryResult<Ast> {
        let item = usize::try_from(at).ok().and_then(|at| items.get(at.checked_sub(1)?));
        match item {
            Some(SelectItem::UnnamedExpr(expr) | SelectItem::ExprWithAlias { expr, .. }) => Ok(expr.clone()),
            _ => self.wrong(part.span(), format!("no selected column has the number {at}"), None),
        }
    }

    fn group_key(&mut self, key: &Ast) -> QueryResult<Key> {
        let row = self.rows("GROUP BY", |scope| scope.exact(key))?;
        let name = self.planner.fresh();
        self.prepared.push(row.expr.clone().alias(name.as_str()));
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
                _ => return Err(unsupported(self.source(), item.span(), format!("`{item}`"))),
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
            return Err(unsupported(self.source(), item.span(), format!("`{item}`")));
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

fn grouped(frame: LazyFrame, scope: &Scope<'_, '_>) -> LazyFrame {
    let keys: Vec<Expr> = scope.keys.iter().flatten().map(|key| key.grouped.expr.clone()).collect();
    // Polars needs an aggregate.
    let aggregates: Vec<Expr> = scope.aggregates.iter().cloned().chain([len().alias("")]).collect();
    if keys.is_empty() { frame.select(aggregates) } else { frame.group_by(keys).agg(aggregates) }
}
