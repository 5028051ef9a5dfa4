//! Calls of functions: scalar, of groups, and over windows.
//!
//! Polars computes a window with an order in the order of the frame, which is sorted before.

use polars::prelude::{DataType, Expr, NULL, col, lit, when};
use sqlparser::ast::{
    DuplicateTreatment, Expr as Ast, Function, FunctionArg, FunctionArgExpr, FunctionArguments, OrderByExpr,
    Spanned as _, UnaryOperator, Value as Literal, ValueWithSpan, WindowSpec, WindowType,
};

use super::accepted::{Arg, Kind, Role, Signature, is_aggregate, named};
use super::functions::{Aggregate, aggregate, running};
use super::refused::{QueryError, QueryResult, unsupported};
use super::scope::Scope;
use super::value::{Value, common};
use mirrorstats_exact::suggest::nearest;

/// A key of ORDER BY.
#[derive(Clone, Debug)]
pub(super) struct Order {
    pub(super) inner: String,
    pub(super) descending: bool,
    pub(super) nulls_last: bool,
}

pub(super) struct Window {
    /// Columns that the steps read.
    pub(super) prepared: Vec<Expr>,
    pub(super) order: Vec<Order>,
    /// New columns. A step may read the columns of the step before it.
    pub(super) steps: Vec<Vec<Expr>>,
}

/// The numbers among the arguments of a call; `None` if no signature fits.
pub(super) fn fitting(name: &str, args: &[&Ast], values: &[Value]) -> Option<Vec<i64>> {
    named(name).find_map(|signature| numbers(signature, args, values))
}

fn numbers(signature: &Signature, args: &[&Ast], values: &[Value]) -> Option<Vec<i64>> {
    let count = signature.args.len();
    if args.len() != count && (args.is_empty() || !signature.repeats) {
        return None;
    }
    let mut numbers = Vec::new();
    for (at, (ast, value)) in args.iter().zip(values).enumerate() {
        let arg = signature.args[at.min(count - 1)];
        if matches!(arg, Arg::Digits | Arg::Position) {
            let number = integer(ast)?;
            let range = if arg == Arg::Digits { 0..=15 } else { 1..=1_000_000 };
            numbers.push(Some(number).filter(|number| range.contains(number))?);
        } else if !fits(arg, ast, value) {
            return None;
        }
    }
    Some(numbers)
}

fn fits(arg: Arg, ast: &Ast, value: &Value) -> bool {
    match arg {
        Arg::Number => value.kind.is_number() || value.kind == Kind::Real,
        Arg::Text => matches!(value.kind, Kind::Text | Kind::Null),
        Arg::Literal => match ast {
            Ast::Value(ValueWithSpan { value: Literal::SingleQuotedString(text), .. }) => !text.is_empty(),
            _ => false,
        },
        _ => true,
    }
}

pub(super) fn integer(ast: &Ast) -> Option<i64> {
    match ast {
        Ast::Value(ValueWithSpan { value: Literal::Number(text, false), .. }) => text.parse().ok(),
        Ast::UnaryOp { op: UnaryOperator::Plus, expr } => integer(expr),
        _ => None,
    }
}

/// The plain arguments of a call, and whether they are DISTINCT; `None` if it has other parts.
fn arguments<'a>(function: &'a Function) -> Option<(Vec<&'a FunctionArgExpr>, bool)> {
    let rest = Function { args: FunctionArguments::None, filter: None, over: None, ..function.clone() };
    let FunctionArguments::List(list) = &function.args else { return None };
    if rest.to_string() != function.name.to_string() || function.uses_odbc_syntax || !list.clauses.is_empty() {
        return None;
    }
    let plain = |arg: &'a FunctionArg| if let FunctionArg::Unnamed(arg) = arg { Some(arg) } else { None };
    let distinct = list.duplicate_treatment == Some(DuplicateTreatment::Distinct);
    Some((list.args.iter().map(plain).collect::<Option<_>>()?, distinct))
}

pub(super) fn is_aggregate_call(ast: &Ast) -> bool {
    matches!(ast, Ast::Function(function) if function.over.is_none() && is_aggregate(&function.name.to_string()))
}

/// A call of a function: the name in lowercase.
#[derive(Clone, Copy)]
struct Call<'a> {
    ast: &'a Ast,
    name: &'a str,
    args: &'a [&'a FunctionArgExpr],
}

impl<'a> Call<'a> {
    /// The arguments, unless one is `*`.
    fn expressions(self) -> Option<Vec<&'a Ast>> {
        let plain = |arg: &&'a FunctionArgExpr| if let FunctionArgExpr::Expr(arg) = *arg { Some(arg) } else { None };
        self.args.iter().map(plain).collect()
    }
}

impl Scope<'_, '_> {
    pub(super) fn function(&mut self, ast: &Ast, function: &Function) -> QueryResult<Value> {
        let name = function.name.to_string().to_ascii_lowercase();
        let name = if name == "substr" { "substring" } else { &name };
        let Some(role) = named(name).map(|signature| signature.role).next() else {
            return self.no_function(ast, name);
        };
        let Some((args, distinct)) = arguments(function) else { return self.unsupported(ast) };
        let call = Call { ast, name, args: &args };
        if let Some(window) = &function.over {
            return self.over(call, role, distinct || function.filter.is_some(), window);
        }
        match role {
            Role::Scalar if !distinct && function.filter.is_none() => match call.expressions() {
                Some(args) => self.call(ast, name, &args),
                None => self.unsupported(ast),
            },
            Role::Aggregate | Role::Running => self.of_group(call, distinct, function.filter.as_deref()),
            _ => self.unsupported(ast),
        }
    }

    fn no_function(&self, ast: &Ast, name: &str) -> QueryResult<Value> {
        let names = super::accepted::FUNCTIONS.iter().map(|signature| signature.name);
        let error = unsupported(self.source(), ast.span(), format!("the function `{name}`"));
        Err(match (error, nearest(name, names)) {
            (QueryError::Unsupported(fault), Some(near)) => {
                QueryError::Unsupported(Box::new(fault.help(format!("did you mean `{near}`?"))))
            }
            (error, _) => error,
        })
    }

    /// The argument of an aggregate; rows are counted as a constant.
    fn argument(&mut self, Call { ast, name, args }: Call<'_>) -> QueryResult<Value> {
        match args {
            [FunctionArgExpr::Wildcard] | [] if name == "count" => Ok(Value::int(lit(1_i64), 1)),
            [FunctionArgExpr::Expr(arg)] => {
                let value = self.value(arg)?;
                let fits = fitting(name, &[arg], std::slice::from_ref(&value)).is_some() && value.kind != Kind::Null;
                if fits { Ok(value) } else { self.unfit(ast, &[value]) }
            }
            _ => self.unsupported(ast),
        }
    }

    fn of_group(&mut self, call: Call<'_>, distinct: bool, filter: Option<&Ast>) -> QueryResult<Value> {
        let Call { ast, name, .. } = call;
        if let Some(place) = self.rows_of {
            let message = format!("the aggregate `{name}` is in {place}, where rows are meant");
            return self.wrong(ast.span(), message, Some("move it to HAVING or to a subquery in FROM".to_owned()));
        }
        let (value, filter) = self.rows("an aggregate", |scope| {
            let value = scope.argument(call)?;
            Ok((value, filter.map(|filter| scope.truth(filter)).transpose()?))
        })?;
        if distinct && (name != "count" || !value.is_exact()) {
            return self.unsupported(ast);
        }
        // A filtered row is a null, which every aggregate leaves out.
        let kept = match filter {
            Some(met) => when(met).then(value.expr.clone()).otherwise(lit(NULL)),
            None => value.expr.clone(),
        };
        let column = self.planner.fresh();
        self.prepared.push(kept.alias(column.as_str()));
        let column = Value { expr: col(column.as_str()), ..value };
        let found = if distinct { Some(distinct_count(&column)) } else { aggregate(name, &column) };
        let Some(found) = found else { return self.unfit(ast, &[column]) };
        let parts = found.parts.into_iter().map(|part| {
            let name = self.planner.fresh();
            self.aggregates.push(part.alias(name.as_str()));
            col(name.as_str())
        });
        let parts: Vec<Expr> = parts.collect();
        Ok((found.value)(&parts, found.bits))
    }

    fn over(&mut self, call: Call<'_>, role: Role, special: bool, window: &WindowType) -> QueryResult<Value> {
        let WindowType::WindowSpec(spec) = window else { return self.unsupported(call.ast) };
        let only_parts = spec.window_name.is_none() && spec.window_frame.is_none();
        if special || !only_parts || self.rows_of.is_some() {
            return self.unsupported(call.ast);
        }
        let (mut window, partition) = self.window(spec)?;
        let value = match (role, window.order.is_empty()) {
            (Role::Window, _) => self.ranked(call, &mut window, &partition)?,
            (Role::Running, _) | (Role::Aggregate, true) => self.whole_or_running(call, &mut window, &partition)?,
            _ => return self.unsupported(call.ast),
        };
        self.windows.push(window);
        Ok(value)
    }

    fn window(&mut self, spec: &WindowSpec) -> QueryResult<(Window, Vec<Expr>)> {
        let mut window = Window { prepared: Vec::new(), order: Vec::new(), steps: Vec::new() };
        // Polars has no window without a partition.
        let mut partition = vec![self.prepare(&mut window, lit(0_i64))];
        for key in &spec.partition_by {
            let value = self.exact(key)?;
            partition.push(self.prepare(&mut window, value.expr));
        }
        for key in &spec.order_by {
            let value = self.exact(&key.expr)?;
            let expr = self.prepare(&mut window, value.expr);
            window.order.push(self.order(key, &expr)?);
        }
        Ok((window, partition))
    }

    /// A value by which rows are sorted or grouped.
    pub(super) fn exact(&mut self, ast: &Ast) -> QueryResult<Value> {
        let value = self.value(ast)?;
        if value.is_exact() { Ok(value) } else { self.unfit(ast, &[value]) }
    }

    pub(super) fn order(&self, key: &OrderByExpr, expr: &Expr) -> QueryResult<Order> {
        let Expr::Column(inner) = expr else { return self.unsupported(&key.expr) };
        if key.with_fill.is_some() {
            return self.unsupported(&key.expr);
        }
        let (descending, nulls_last) = (key.options.asc == Some(false), key.options.nulls_first != Some(true));
        Ok(Order { inner: inner.to_string(), descending, nulls_last })
    }

    fn prepare(&mut self, window: &mut Window, expr: Expr) -> Expr {
        let name = self.planner.fresh();
        window.prepared.push(expr.alias(name.as_str()));
        col(name.as_str())
    }

    /// Adds a step with one column for each part.
    fn step(&mut self, window: &mut Window, parts: Vec<Expr>, over: &[Expr]) -> QueryResult<Vec<Expr>> {
        let (mut step, mut columns) = (Vec::new(), Vec::new());
        for part in parts {
            let name = self.planner.fresh();
            step.push(part.over(over).map_err(super::run::PolarsError::from)?.alias(name.as_str()));
            columns.push(col(name.as_str()));
        }
        window.steps.push(step);
        Ok(columns)
    }

    fn peers(window: &Window, partition: &[Expr]) -> Vec<Expr> {
        partition.iter().cloned().chain(window.order.iter().map(|order| col(order.inner.as_str()))).collect()
    }

    fn whole_or_running(&mut self, call: Call<'_>, window: &mut Window, partition: &[Expr]) -> QueryResult<Value> {
        let Call { ast, name, .. } = call;
        let value = self.argument(call)?;
        let column = Value { expr: self.prepare(window, value.expr.clone()), ..value };
        let ordered = !window.order.is_empty();
        let found = if ordered { running(name, &column) } else { aggregate(name, &column) };
        let Some(Aggregate { parts, value, bits }) = found else { return self.unfit(ast, &[column]) };
        let mut parts = self.step(window, parts, partition)?;
        if ordered {
            // The frame ends with the last row of equal keys.
            let last = parts.into_iter().map(Expr::last).collect();
            parts = self.step(window, last, &Self::peers(window, partition))?;
        }
        Ok(value(&parts, bits))
    }

    fn ranked(&mut self, call: Call<'_>, window: &mut Window, partition: &[Expr]) -> QueryResult<Value> {
        let Call { ast, name, .. } = call;
        let Some(asts) = call.expressions() else { return self.unsupported(ast) };
        let values = asts.iter().map(|arg| self.value(arg)).collect::<Result<Vec<_>, _>>()?;
        let fit = fitting(name, &asts, &values);
        let Some(numbers) = fit.filter(|_| !window.order.is_empty()) else { return self.unfit(ast, &values) };
        if let Some(value) = values.first().filter(|value| common([*value]).is_some()) {
            let back = numbers.first().copied().unwrap_or(1) * if name == "lag" { 1 } else { -1 };
            let column = self.prepare(window, value.expr.clone());
            let mut shifted = self.step(window, vec![column.shift(lit(back))], partition)?;
            return Ok(Value { expr: shifted.remove(0), ..value.clone() });
        }
        let one = self.prepare(window, lit(1_i64));
        let row = self.step(window, vec![one.cum_sum(false)], partition)?;
        if name == "row_number" {
            return Ok(Value::int(row[0].clone(), 31));
        }
        let peers = Self::peers(window, partition);
        let rank = self.step(window, vec![row[0].clone().first()], &peers)?;
        if name == "rank" {
            return Ok(Value::int(rank[0].clone(), 31));
        }
        let starts = rank[0].clone().eq(row[0].clone()).cast(DataType::Int64).cum_sum(false);
        Ok(Value::int(self.step(window, vec![starts], partition)?[0].clone(), 31))
    }
}

fn distinct_count(column: &Value) -> Aggregate {
    let parts = vec![column.expr.clone().drop_nulls().n_unique().cast(DataType::Int64)];
    Aggregate { parts, value: |parts, _| Value::int(parts[0].clone(), 31), bits: 0 }
}
