//! The accepted functions as Polars expressions.

use polars::prelude::{
    Column, DataType, Expr, Field, FillNullStrategy, IntoColumn as _, NULL, PolarsError as Inner, PolarsResult,
    RoundMode, Schema, StringChunked, lit, when,
};

use super::accepted::Kind;
use super::value::{Value, common, guarded, one_of, sum_bits};

/// The value of a scalar function whose arguments have the kinds of its signature; `None` if they do not fit together.
pub(super) fn scalar(name: &str, args: &[Value], numbers: &[i64]) -> Option<Value> {
    let first = args.first()?;
    let text = |expr: Expr| Some(Value::new(expr, Kind::Text));
    let float = |expr: Expr| Some(Value::new(expr, Kind::Float));
    let string = || first.to(Kind::Text).str();
    match name {
        "abs" => Some(Value { expr: wide(first).abs(), ..first.clone() }),
        "ceil" | "floor" | "round" => rounded(name, first, numbers),
        "coalesce" | "ifnull" | "greatest" | "least" => chosen(name, args),
        "nullif" => {
            let kind = common(args)?;
            let equal = args[0].to(kind).eq(args[1].to(kind));
            let expr = when(equal.fill_null(lit(false))).then(lit(NULL).cast(kind.wide())).otherwise(args[0].to(kind));
            Some(one_of(expr, kind, args))
                .filter(|value| args[0].kind == value.kind && args.iter().all(Value::is_exact))
        }
        "exp" => float(first.float().exp()),
        "ln" => float(first.float().log(lit(std::f64::consts::E))),
        "sqrt" => float(first.float().sqrt()),
        "contains" => Some(Value::bool(string().contains_literal(args[1].expr.clone()))),
        "ends_with" => Some(Value::bool(string().ends_with(args[1].expr.clone()))),
        "starts_with" => Some(Value::bool(string().starts_with(args[1].expr.clone()))),
        "length" => Some(Value::int(string().len_chars().strict_cast(DataType::Int64), 31)),
        "lower" => text(cased(first, |character| character.to_lowercase().collect())),
        "upper" => text(cased(first, |character| character.to_uppercase().collect())),
        "trim" => text(string().strip_chars(lit(" "))),
        "ltrim" => text(string().strip_chars_start(lit(" "))),
        "rtrim" => text(string().strip_chars_end(lit(" "))),
        "replace" => text(string().replace_all(args[1].expr.clone(), args[2].expr.clone(), true)),
        "substring" => {
            let length = numbers.get(1).map_or(lit(NULL).cast(DataType::UInt64), |length| lit(*length));
            text(string().slice(lit(numbers.first()? - 1), length))
        }
        _ => None,
    }
}

fn wide(value: &Value) -> Expr {
    value.to(value.kind)
}

fn rounded(name: &str, value: &Value, digits: &[i64]) -> Option<Value> {
    let kind = match (value.kind, name) {
        (Kind::Int, "round") => return Some(value.clone()),
        (Kind::Int, _) => Kind::Float,
        (kind, _) => kind,
    };
    let expr = value.to(kind);
    let expr = match name {
        "ceil" => expr.ceil(),
        "floor" => expr.floor(),
        _ => expr.round(u32::try_from(digits.first().copied().unwrap_or(0)).ok()?, RoundMode::HalfAwayFromZero),
    };
    value.is_exact().then(|| Value { expr, kind, bits: u32::from(kind == Kind::Decimal && !digits.is_empty()) })
}

fn chosen(name: &str, args: &[Value]) -> Option<Value> {
    let kind = common(args)?;
    if name != "coalesce" && name != "ifnull" && !args.iter().all(Value::is_exact) {
        return None;
    }
    let take = |a: Expr, b: Expr| match name {
        "greatest" => when(a.clone().is_null().or(b.clone().gt(a.clone()))).then(b).otherwise(a),
        "least" => when(a.clone().is_null().or(b.clone().lt(a.clone()))).then(b).otherwise(a),
        _ => when(a.clone().is_null()).then(b).otherwise(a),
    };
    let expr = args.iter().map(|value| value.to(kind)).reduce(take)?;
    Some(one_of(expr, kind, args))
}

/// Upper and lower case, letter by letter as in DuckDB. A letter that becomes several is refused.
fn cased(value: &Value, of: fn(char) -> Vec<char>) -> Expr {
    let one = move |character: char| {
        if let [one] = of(character).as_slice() {
            return Ok(*one);
        }
        let words = format!("`{character}` becomes several letters in the other case, which engines do differently");
        Err(Inner::ComputeError(words.into()))
    };
    let all = move |column: Column| -> PolarsResult<Column> {
        let texts = column.str()?.iter();
        let texts =
            texts.map(|text| text.map(|text| text.chars().map(one).collect::<PolarsResult<String>>()).transpose());
        Ok(texts.collect::<PolarsResult<StringChunked>>()?.with_name(column.name().clone()).into_column())
    };
    value.to(Kind::Text).map(all, |_: &Schema, field: &Field| Ok(Field::new(field.name().clone(), DataType::String)))
}

type OfParts = Box<dyn FnOnce(&[Expr]) -> Value>;

/// An aggregate: parts that Polars computes, and the value of those.
pub(super) struct Aggregate {
    pub(super) parts: Vec<Expr>,
    pub(super) value: OfParts,
}

fn made(parts: Vec<Expr>, value: impl FnOnce(&[Expr]) -> Value + 'static) -> Aggregate {
    Aggregate { parts, value: Box::new(value) }
}

fn single(part: Expr, kind: Kind, bits: u32) -> Aggregate {
    made(vec![part], move |parts| Value { expr: parts[0].clone(), kind, bits })
}

/// A number of rows, which 31 bits hold.
fn counted(part: Expr) -> Aggregate {
    single(part.cast(DataType::Int64), Kind::Int, 31)
}

pub(super) fn distinct_count(column: &Value) -> Aggregate {
    counted(column.expr.clone().drop_nulls().n_unique())
}

/// The aggregate of a column; `None` for kinds that do not fit.
pub(super) fn aggregate(name: &str, of: &Value) -> Option<Aggregate> {
    let column = wide(of);
    let float = |part: Expr| single(part, Kind::Float, 0);
    match name {
        "count" => Some(counted(column.count())),
        "min" | "max" => extreme(name, of, column.clone().min(), column.clone().max(), column.is_nan().any(true)),
        "sum" => total(of, [column.clone().sum(), column.count(), of.float().sum()]),
        _ if !of.kind.is_number() && of.kind != Kind::Real => None,
        "avg" | "mean" => Some(float(of.float().mean())),
        // DuckDB interpolates a FLOAT in 32 bits.
        "median" if of.kind != Kind::Real => Some(float(of.float().median())),
        "stddev" | "stddev_samp" => Some(float(of.float().std(1))),
        "variance" | "var_samp" => Some(float(of.float().var(1))),
        _ => None,
    }
}

/// A sum as an integer and as a float; null without a value.
fn total(of: &Value, [sum, count, float]: [Expr; 3]) -> Option<Aggregate> {
    let (kind, bits) = (of.kind, sum_bits(of.bits));
    let is_number = matches!(kind, Kind::Int | Kind::Decimal | Kind::Float | Kind::Real);
    is_number.then(|| {
        made(vec![sum, count, float], move |parts| {
            let float = parts[2].clone();
            let sum = match kind {
                Kind::Int => guarded(parts[0].clone(), float, bits),
                Kind::Decimal => Value { expr: float, kind, bits: 1 },
                _ => Value::new(float, Kind::Float),
            };
            Value { expr: when(parts[1].clone().gt(lit(0))).then(sum.expr).otherwise(lit(NULL)), ..sum }
        })
    })
}

/// The least or greatest value. NaN is greater than all numbers in DuckDB; Polars leaves it out.
fn extreme(name: &str, of: &Value, least: Expr, greatest: Expr, nan: Expr) -> Option<Aggregate> {
    let part = if name == "min" { least } else { greatest };
    Some(match (of.kind, name) {
        (Kind::Null | Kind::Other, _) => return None,
        (Kind::Float, "max") => made(vec![part, nan], |parts| {
            let expr = when(parts[1].clone()).then(lit(f64::NAN)).otherwise(parts[0].clone());
            Value::new(expr, Kind::Float)
        }),
        (Kind::Decimal, _) => single(part, Kind::Decimal, 1),
        (kind, _) => single(part, kind, of.bits),
    })
}

/// An aggregate from the first row of a sorted partition to each row.
pub(super) fn running(name: &str, of: &Value) -> Option<Aggregate> {
    let column = wide(of);
    let filled = || column.clone().fill_null(lit(0));
    let floats = || of.float().fill_null(lit(0.0)).cum_sum(false);
    let last = |part: Expr| part.fill_null_with_strategy(FillNullStrategy::Forward(None));
    match name {
        "count" => Some(counted(column.cum_count(false))),
        _ if !matches!(of.kind, Kind::Int | Kind::Float) => None,
        "sum" => total(of, [filled().cum_sum(false), column.cum_count(false), floats()]),
        "avg" | "mean" => Some(made(vec![floats(), column.cum_count(false)], |parts| {
            let mean = parts[0].clone() / parts[1].clone().cast(DataType::Float64);
            Value::new(when(parts[1].clone().gt(lit(0))).then(mean).otherwise(lit(NULL)), Kind::Float)
        })),
        "min" | "max" => {
            let nan = of.float().is_nan().fill_null(lit(false)).cast(DataType::Int64).cum_sum(false).gt(lit(0));
            extreme(name, of, last(column.clone().cum_min(false)), last(column.cum_max(false)), nan)
        }
        _ => None,
    }
}
