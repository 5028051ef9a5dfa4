//! Rewrites SQL as people write it into SQL that Polars runs. Unnamed columns get DuckDB's names, each grouping set
//! becomes a select, and scalar subqueries become values.

use std::collections::HashMap;
use std::ops::ControlFlow;

use sqlparser::ast::{
    Expr, Function, FunctionArg, FunctionArgExpr, FunctionArguments, GroupByExpr, GroupByWithModifier, Ident,
    OrderByKind, Query, Select, SelectItem, SetExpr, SetOperator, SetQuantifier, Statement, Value, Visit as _,
    VisitMut as _, Visitor, VisitorMut, With, visit_expressions_mut,
};
use sqlparser::dialect::GenericDialect;
use sqlparser::parser::Parser;

const AGGREGATES: [&str; 24] = [
    "any_value",
    "array_agg",
    "avg",
    "corr",
    "count",
    "covar",
    "covar_samp",
    "first",
    "last",
    "listagg",
    "max",
    "mean",
    "median",
    "min",
    "quantile_cont",
    "quantile_disc",
    "stddev",
    "stddev_pop",
    "stddev_samp",
    "string_agg",
    "sum",
    "var",
    "var_samp",
    "variance",
];

const MOST_SETS: usize = 64;

fn aggregate(expr: &Expr) -> bool {
    let Expr::Function(function) = expr else { return false };
    let name = function.name.to_string().to_ascii_lowercase();
    function.over.is_none() && AGGREGATES.contains(&name.as_str())
}

pub(super) fn bare_column(select: &Select) -> Option<Ident> {
    if !matches!(&select.group_by, GroupByExpr::Expressions(keys, modifiers) if keys.is_empty() && modifiers.is_empty())
    {
        return None;
    }
    let mut found = Bare::default();
    for item in &select.projection {
        match item {
            SelectItem::UnnamedExpr(expr) | SelectItem::ExprWithAlias { expr, .. } => drop(expr.visit(&mut found)),
            _ => drop(found.column.get_or_insert_with(|| Ident::new("*"))),
        }
    }
    found.column.filter(|_| found.has_aggregate)
}

#[derive(Default)]
struct Bare {
    inside: usize,
    has_aggregate: bool,
    column: Option<Ident>,
}

impl Visitor for Bare {
    type Break = ();

    fn pre_visit_query(&mut self, _: &Query) -> ControlFlow<()> {
        self.inside += 1;
        ControlFlow::Continue(())
    }

    fn post_visit_query(&mut self, _: &Query) -> ControlFlow<()> {
        self.inside -= 1;
        ControlFlow::Continue(())
    }

    fn pre_visit_expr(&mut self, expr: &Expr) -> ControlFlow<()> {
        match expr {
            expr if aggregate(expr) => {
                self.has_aggregate |= self.inside == 0;
                self.inside += 1;
            }
            Expr::Identifier(name) if self.inside == 0 => drop(self.column.get_or_insert_with(|| name.clone())),
            Expr::CompoundIdentifier(names) if self.inside == 0 => {
                self.column = self.column.take().or_else(|| names.last().cloned());
            }
            _ => {}
        }
        ControlFlow::Continue(())
    }

    fn post_visit_expr(&mut self, expr: &Expr) -> ControlFlow<()> {
        self.inside -= usize::from(aggregate(expr));
        ControlFlow::Continue(())
    }
}

pub(super) fn rewrite(statement: &mut Statement) -> Result<(), String> {
    match statement.visit(&mut Rewriter) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(words) => Err(words),
    }
}

struct Rewriter;

impl VisitorMut for Rewriter {
    type Break = String;

    fn pre_visit_query(&mut self, query: &mut Query) -> ControlFlow<String> {
        name_columns(&mut query.body);
        order_by_names(query);
        match divided(&mut query.body) {
            Ok(()) => ControlFlow::Continue(()),
            Err(words) => ControlFlow::Break(words),
        }
    }
}

fn name_columns(body: &mut SetExpr) {
    match body {
        SetExpr::Select(select) => name_columns_of(select),
        SetExpr::SetOperation { left, right, .. } => {
            name_columns(left);
            name_columns(right);
        }
        _ => {}
    }
}

fn name_columns_of(select: &mut Select) {
    let mut taken: HashMap<String, usize> = HashMap::new();
    for item in &mut select.projection {
        let SelectItem::UnnamedExpr(expr) = item else { continue };
        if matches!(expr, Expr::Identifier(_) | Expr::CompoundIdentifier(_)) {
            continue;
        }
        let name = column_name(expr);
        let times = taken.entry(name.clone()).and_modify(|times| *times += 1).or_default();
        let name = if *times == 0 { name } else { format!("{name}_{times}") };
        *item = SelectItem::ExprWithAlias { expr: expr.clone(), alias: Ident::with_quote('"', name) };
    }
}

/// Replaces ORDER BY expressions by the aliases of equal selected expressions: Polars sorts only selected columns.
fn order_by_names(query: &mut Query) {
    let (SetExpr::Select(select), Some(order)) = (query.body.as_ref(), &mut query.order_by) else { return };
    let OrderByKind::Expressions(keys) = &mut order.kind else { return };
    for key in keys.iter_mut().filter(|key| !matches!(key.expr, Expr::Identifier(_) | Expr::Value(_))) {
        let name = column_name(&key.expr);
        let selected = select.projection.iter().find_map(|item| match item {
            SelectItem::ExprWithAlias { expr, alias } if column_name(expr) == name => Some(alias.clone()),
            _ => None,
        });
        if let Some(alias) = selected {
            key.expr = Expr::Identifier(alias);
        }
    }
}

fn column_name(expr: &Expr) -> String {
    match expr {
        Expr::Nested(inner) => column_name(inner),
        Expr::BinaryOp { left, op, right } => format!("({} {op} {})", column_name(left), column_name(right)),
        Expr::Function(function) if is_count_of_rows(function) => "count_star()".to_owned(),
        _ => {
            let mut expr = expr.clone();
            let _ = visit_expressions_mut(&mut expr, |part| {
                if let Expr::Function(function) = part {
                    function.name = Ident::new(function.name.to_string().to_ascii_lowercase()).into();
                }
                ControlFlow::<()>::Continue(())
            });
            // A quote would end the name.
            expr.to_string().replace('"', "")
        }
    }
}

fn is_count_of_rows(function: &Function) -> bool {
    let FunctionArguments::List(list) = &function.args else { return false };
    let star = matches!(list.args.as_slice(), [FunctionArg::Unnamed(FunctionArgExpr::Wildcard)]);
    star && function.name.to_string().eq_ignore_ascii_case("count")
        && function.over.is_none()
        && function.filter.is_none()
}

fn divided(body: &mut SetExpr) -> Result<(), String> {
    let SetExpr::Select(select) = body else { return Ok(()) };
    let Some(sets) = grouping_sets(&select.group_by)? else { return Ok(()) };
    let keys: Vec<Expr> = sets.iter().flatten().cloned().collect();
    let selects = sets.iter().map(|set| Box::new(SetExpr::Select(Box::new(of_set(select, set, &keys)))));
    let union = selects.reduce(|left, right| {
        let (op, set_quantifier) = (SetOperator::Union, SetQuantifier::All);
        Box::new(SetExpr::SetOperation { left, op, set_quantifier, right })
    });
    if let Some(union) = union {
        *body = *union;
    }
    Ok(())
}

/// The grouping sets of a GROUP BY; `None` if it has only one.
fn grouping_sets(group_by: &GroupByExpr) -> Result<Option<Vec<Vec<Expr>>>, String> {
    let GroupByExpr::Expressions(keys, modifiers) = group_by else { return Ok(None) };
    let parts = |keys: &[Expr]| keys.iter().map(|key| vec![key.clone()]).collect::<Vec<_>>();
    let options: Vec<Vec<Vec<Expr>>> = match modifiers.as_slice() {
        [GroupByWithModifier::Rollup] => vec![prefixes(&parts(keys))],
        [GroupByWithModifier::Cube] => vec![subsets(&parts(keys))?],
        _ => keys.iter().map(sets_of).collect::<Result<_, _>>()?,
    };
    if options.iter().all(|sets| sets.len() == 1) {
        return Ok(None);
    }
    let mut sets: Vec<Vec<Expr>> = vec![Vec::new()];
    for option in options {
        sets = sets.iter().flat_map(|set| option.iter().map(move |more| [set.as_slice(), more].concat())).collect();
        if sets.len() > MOST_SETS {
            return Err(format!("expected at most {MOST_SETS} grouping sets, found {}", sets.len()));
        }
    }
    Ok(Some(sets))
}

fn sets_of(key: &Expr) -> Result<Vec<Vec<Expr>>, String> {
    match key {
        Expr::Rollup(parts) => Ok(prefixes(parts)),
        Expr::Cube(parts) => subsets(parts),
        Expr::GroupingSets(sets) => Ok(sets.clone()),
        key => Ok(vec![vec![key.clone()]]),
    }
}

fn prefixes(parts: &[Vec<Expr>]) -> Vec<Vec<Expr>> {
    (0..=parts.len()).rev().map(|length| parts[..length].concat()).collect()
}

fn subsets(parts: &[Vec<Expr>]) -> Result<Vec<Vec<Expr>>, String> {
    let count = 1_usize.checked_shl(u32::try_from(parts.len()).unwrap_or(u32::MAX)).filter(|count| *count <= MOST_SETS);
    let count = count.ok_or_else(|| format!("expected at most {MOST_SETS} grouping sets, found 2^{}", parts.len()))?;
    let chosen = |bits: usize| parts.iter().enumerate().filter(move |(at, _)| bits & (1 << at) == 0);
    Ok((0..count).map(|bits| chosen(bits).flat_map(|(_, part)| part.clone()).collect()).collect())
}

/// The select of one grouping set; keys outside the set are null.
fn of_set(select: &Select, set: &[Expr], keys: &[Expr]) -> Select {
    let mut select = select.clone();
    select.group_by = GroupByExpr::Expressions(set.to_vec(), Vec::new());
    for item in &mut select.projection {
        let (SelectItem::UnnamedExpr(expr) | SelectItem::ExprWithAlias { expr, .. }) = &*item else { continue };
        if !keys.contains(expr) || set.contains(expr) {
            continue;
        }
        let alias = match (&*item, expr) {
            (SelectItem::ExprWithAlias { alias, .. }, _) | (_, Expr::Identifier(alias)) => alias.clone(),
            (_, other) => Ident::with_quote('"', column_name(other)),
        };
        *item = SelectItem::ExprWithAlias { expr: null_like(expr), alias };
    }
    select
}

/// A null of the key's type: unions need one type, and Polars needs an aggregate beside aggregates.
fn null_like(key: &Expr) -> Expr {
    let text = format!("max(CASE WHEN 1 = 0 THEN {key} END)");
    let parsed = Parser::new(&GenericDialect {}).try_with_sql(&text).and_then(|mut parser| parser.parse_expr());
    parsed.unwrap_or_else(|_| Expr::value(Value::Null))
}

pub(super) fn substitute<E>(
    statement: &mut Statement,
    value: impl FnMut(&Query, SubqueryResult) -> Result<Value, E>,
) -> Result<(), E> {
    let with = if let Statement::Query(query) = statement { query.with.clone() } else { None };
    match statement.visit(&mut Substitute { with, value }) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(error) => Err(error),
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SubqueryResult {
    /// The value of its only row.
    Value,
    /// True if the subquery has a row.
    Exists,
}

struct Substitute<F> {
    with: Option<With>,
    value: F,
}

impl<E, F: FnMut(&Query, SubqueryResult) -> Result<Value, E>> VisitorMut for Substitute<F> {
    type Break = E;

    fn post_visit_expr(&mut self, expr: &mut Expr) -> ControlFlow<E> {
        let (query, asked, negated) = match expr {
            Expr::Subquery(query) => (query, SubqueryResult::Value, false),
            Expr::Exists { subquery, negated } => (subquery, SubqueryResult::Exists, *negated),
            _ => return ControlFlow::Continue(()),
        };
        if query.with.is_none() {
            query.with.clone_from(&self.with);
        }
        match (self.value)(query, asked) {
            Ok(Value::Boolean(found)) if asked == SubqueryResult::Exists => {
                *expr = Expr::value(Value::Boolean(found != negated));
            }
            Ok(value) => *expr = Expr::value(value),
            Err(error) => return ControlFlow::Break(error),
        }
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rewritten(text: &str) -> String {
        let mut statements = Parser::parse_sql(&GenericDialect {}, text).unwrap();
        rewrite(&mut statements[0]).unwrap();
        statements[0].to_string()
    }

    #[test]
    fn unnamed_columns_are_named_as_in_duckdb() {
        assert_eq!(
            rewritten("select a, COUNT(*), AVG(x), avg(x), (x + 1) from t"),
            "SELECT a, COUNT(*) AS \"count_star()\", AVG(x) AS \"avg(x)\", avg(x) AS \"avg(x)_1\", (x + 1) AS \"(x + 1)\" FROM t"
        );
        assert_eq!(
            rewritten("select a, max(x) from t group by a order by MAX(x) desc, a"),
            "SELECT a, max(x) AS \"max(x)\" FROM t GROUP BY a ORDER BY \"max(x)\" DESC, a"
        );
    }

    #[test]
    fn grouping_sets_are_selects_with_nulls() {
        let null = |key: &str| format!("max(CASE WHEN 1 = 0 THEN {key} END) AS {key}");
        assert_eq!(
            rewritten("select a, b, sum(x) as s from t group by rollup(a, b)"),
            format!(
                "SELECT a, b, sum(x) AS s FROM t GROUP BY a, b UNION ALL SELECT a, {}, sum(x) AS s FROM t GROUP BY a \
                 UNION ALL SELECT {}, {}, sum(x) AS s FROM t",
                null("b"),
                null("a"),
                null("b")
            )
        );
        assert_eq!(rewritten("select a from t group by cube(a, b), c").matches("UNION ALL").count(), 3);
        let many = (0..8).map(|at| format!("k{at}")).collect::<Vec<_>>().join(", ");
        let mut statements =
            Parser::parse_sql(&GenericDialect {}, &format!("select 1 from t group by cube({many})")).unwrap();
        assert!(rewrite(&mut statements[0]).unwrap_err().contains("at most 64"));
    }
}
