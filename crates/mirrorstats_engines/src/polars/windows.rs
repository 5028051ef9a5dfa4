//! Calls of functions: scalar, of groups, and over windows.
//!
//! Polars computes a window with an order in the order of the frame, which is sorted before.

use polars::prelude::{DataType, Expr, NULL, lit, when};
use sqlparser::ast::{
    DuplicateTreatment, Expr as Ast, Function, FunctionArg, FunctionArgExpr, FunctionArguments, OrderByExpr,
    Spanned as _, Value as Literal, ValueWithSpan, WindowSpec, WindowType,
};

use super::accepted::{Arg, FUNCTIONS, Kind, Role, Signature, is_aggregate, named};
use super::functions::{aggregate, distinct_count, running, scalar};
use super::names::integer;
use super::refused::{QueryError, QueryResult};
use super::relation::Order;
use super::run::PolarsError;
use super::scope::{Scope, Window};
use super::value::{Value, common};
use mirrorstats_exact::suggest::did_you_mean;

/// The numbers among the arguments of a call; `None` if no signature fits.
fn fitting(name: &str, args: &[&Ast], values: &[Value]) -> Option<Vec<i64>> {
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
        let Some((args, distinct)) = arguments(function) else { return self.text.refuse(ast) };
        let call = Call { ast, name, args: &args };
        if let Some(window) = &function.over {
            return self.over(call, role, distinct || function.filter.is_some(), window);
        }
        match role {
            Role::Scalar if !distinct && function.filter.is_none() => match call.expressions() {
                Some(args) => self.call(ast, name, &args),
                None => self.text.refuse(ast),
            },
            Role::Aggregate | Role::Running => self.of_group(call, distinct, function.filter.as_deref()),
            _ => self.text.refuse(ast),
        }
    }

    fn no_function(&self, ast: &Ast, name: &str) -> QueryResult<Value> {
        let fault = self.text.fault(ast.span(), format!("`query` does not support the function `{name}`"));
        let near = did_you_mean(name, FUNCTIONS.iter().map(|signature| signature.name));
        Err(QueryError::Unsupported(Box::new(fault.help_if(near))))
    }

    pub(super) fn call(&mut self, ast: &Ast, name: &str, args: &[&Ast]) -> QueryResult<Value> {
        let values = args.iter().map(|arg| self.value(arg)).collect::<Result<Vec<_>, _>>()?;
        let value = fitting(name, args, &values).and_then(|numbers| scalar(name, &values, &numbers));
        value.map_or_else(|| self.text.unfit(ast, &values), Ok)
    }

    /// The argument of an aggregate; rows are counted as a constant.
    fn argument(&mut self, Call { ast, name, args }: Call<'_>) -> QueryResult<Value> {
        match args {
            [FunctionArgExpr::Wildcard] | [] if name == "count" => Ok(Value::int(lit(1_i64), 1)),
            [FunctionArgExpr::Expr(arg)] => {
                let value = self.value(arg)?;
                let fits = fitting(name, &[arg], std::slice::from_ref(&value)).is_some() && value.kind != Kind::Null;
                if fits { Ok(value) } else { self.text.unfit(ast, &[value]) }
            }
            _ => self.text.refuse(ast),
        }
    }

    fn of_group(&mut self, call: Call<'_>, distinct: bool, filter: Option<&Ast>) -> QueryResult<Value> {
        let Call { ast, name, .. } = call;
        if let Some(place) = self.rows_of {
            let message = format!("the aggregate `{name}` is in {place}, where rows are meant");
            return Err(self.text.fault(ast.span(), message).help("move it to HAVING or to a subquery in FROM").into());
        }
        let (value, filter) = self.rows("an aggregate", |scope| {
            let value = scope.argument(call)?;
            Ok((value, filter.map(|filter| scope.truth(filter)).transpose()?))
        })?;
        if distinct && (name != "count" || !value.is_exact()) {
            return self.text.refuse(ast);
        }
        // A filtered row is a null, which every aggregate leaves out.
        let kept = match filter {
            Some(met) => when(met).then(value.expr.clone()).otherwise(lit(NULL)),
            None => value.expr.clone(),
        };
        let column = Value { expr: self.names.keep(&mut self.prepared, kept), ..value };
        let found = if distinct { Some(distinct_count(&column)) } else { aggregate(name, &column) };
        let Some(found) = found else { return self.text.unfit(ast, &[column]) };
        let parts = found.parts.into_iter().map(|part| self.names.keep(&mut self.aggregates, part));
        let parts: Vec<Expr> = parts.collect();
        Ok((found.value)(&parts))
    }

    fn over(&mut self, call: Call<'_>, role: Role, special: bool, window: &WindowType) -> QueryResult<Value> {
        let WindowType::WindowSpec(spec) = window else { return self.text.refuse(call.ast) };
        let only_parts = spec.window_name.is_none() && spec.window_frame.is_none();
        if special || !only_parts || self.rows_of.is_some() {
            return self.text.refuse(call.ast);
        }
        let (mut window, partition) = self.window(spec)?;
        let value = match (role, window.order.is_empty()) {
            (Role::Window, _) => self.ranked(call, &mut window, &partition)?,
            (Role::Running, _) | (Role::Aggregate, true) => self.whole_or_running(call, &mut window, &partition)?,
            _ => return self.text.refuse(call.ast),
        };
        self.windows.push(window);
        Ok(value)
    }

    fn window(&mut self, spec: &WindowSpec) -> QueryResult<(Window, Vec<Expr>)> {
        let mut window = Window { prepared: Vec::new(), order: Vec::new(), steps: Vec::new() };
        // Polars has no window without a partition.
        let mut partition = vec![self.names.keep(&mut window.prepared, lit(0_i64))];
        for key in &spec.partition_by {
            let value = self.exact(key)?;
            partition.push(self.names.keep(&mut window.prepared, value.expr));
        }
        for key in &spec.order_by {
            let value = self.exact(&key.expr)?;
            let column = self.names.keep(&mut window.prepared, value.expr);
            window.order.push(self.order(key, column)?);
        }
        Ok((window, partition))
    }

    /// A value by which rows are sorted or grouped.
    pub(super) fn exact(&mut self, ast: &Ast) -> QueryResult<Value> {
        let value = self.value(ast)?;
        if value.is_exact() { Ok(value) } else { self.text.unfit(ast, &[value]) }
    }

    pub(super) fn order(&self, key: &OrderByExpr, column: Expr) -> QueryResult<Order> {
        if key.with_fill.is_some() {
            return self.text.refuse(&key.expr);
        }
        let (descending, nulls_last) = (key.options.asc == Some(false), key.options.nulls_first != Some(true));
        Ok(Order { column, descending, nulls_last })
    }

    /// Adds a step with one column for each part.
    fn step(&mut self, window: &mut Window, parts: Vec<Expr>, over: &[Expr]) -> QueryResult<Vec<Expr>> {
        let (mut step, mut columns) = (Vec::new(), Vec::new());
        for part in parts {
            let part = part.over(over).map_err(PolarsError::from)?;
            columns.push(self.names.keep(&mut step, part));
        }
        window.steps.push(step);
        Ok(columns)
    }

    fn peers(window: &Window, partition: &[Expr]) -> Vec<Expr> {
        partition.iter().cloned().chain(window.order.iter().map(|order| order.column.clone())).collect()
    }

    fn whole_or_running(&mut self, call: Call<'_>, window: &mut Window, partition: &[Expr]) -> QueryResult<Value> {
        let Call { ast, name, .. } = call;
        let value = self.argument(call)?;
        let column = Value { expr: self.names.keep(&mut window.prepared, value.expr.clone()), ..value };
        let ordered = !window.order.is_empty();
        let found = if ordered { running(name, &column) } else { aggregate(name, &column) };
        let Some(found) = found else { return self.text.unfit(ast, &[column]) };
        let mut parts = self.step(window, found.parts, partition)?;
        if ordered {
            // The frame ends with the last row of equal keys.
            let last = parts.into_iter().map(Expr::last).collect();
            parts = self.step(window, last, &Self::peers(window, partition))?;
        }
        Ok((found.value)(&parts))
    }

    fn ranked(&mut self, call: Call<'_>, window: &mut Window, partition: &[Expr]) -> QueryResult<Value> {
        let Call { ast, name, .. } = call;
        let Some(asts) = call.expressions() else { return self.text.refuse(ast) };
        let values = asts.iter().map(|arg| self.value(arg)).collect::<Result<Vec<_>, _>>()?;
        let fit = fitting(name, &asts, &values);
        let Some(numbers) = fit.filter(|_| !window.order.is_empty()) else { return self.text.unfit(ast, &values) };
        if let Some(value) = values.first().filter(|value| common([*value]).is_some()) {
            let back = numbers.first().copied().unwrap_or(1) * if name == "lag" { 1 } else { -1 };
            let column = self.names.keep(&mut window.prepared, value.expr.clone());
            let mut shifted = self.step(window, vec![column.shift(lit(back))], partition)?;
            return Ok(Value { expr: shifted.remove(0), ..value.clone() });
        }
        let one = self.names.keep(&mut window.prepared, lit(1_i64));
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
