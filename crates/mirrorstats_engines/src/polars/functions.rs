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

/// An aggregate: parts that Polars computes, and the value of those.
pub(super) struct Aggregate {
    pub(super) parts: Vec<Expr>,
    pub(super) value: fn(&[Expr], u32) -> Value,
    pub(super) bits: u32,
}

/// The aggregate of a column; `None` for kinds that do not fit.
pub(super) fn aggregate(name: &str, of: &Value) -> Option<Aggregate> {
    let column = wide(of);
    let float = |part: Expr| made(vec![part], |parts, _| Value::new(parts[0].clone(), Kind::Float));
    match name {
        "count" => Some(made(vec![column.count().cast(DataType::Int64)], |parts, _| Value::int(parts[0].clone(), 31))),
        "min" | "max" => extreme(name, of, column.clone().min(), column.clone().max(), column.is_nan().any(true)),
        "sum" => Some(Aggregate {
            parts: vec![column.clone().sum(), column.clone().count(), of.float().sum()],
            value: total(of.kind)?,
            bits: sum_bits(of.bits),
        }),
        _ if !of.kind.is_number() && of.kind != Kind::Real => None,
        "avg" | "mean" => Some(float(of.float().mean())),
        // DuckDB interpolates a FLOAT in 32 bits.
        "median" if of.kind != Kind::Real => Some(float(of.float().median())),
        "stddev" | "stddev_samp" => Some(float(of.float().std(1))),
        "variance" | "var_samp" => Some(float(of.float().var(1))),
        _ => None,
    }
}

fn made(parts: Vec<Expr>, value: fn(&[Expr], u32) -> Value) -> Aggregate {
    Aggregate { parts, value, bits: 0 }
}

fn total(kind: Kind) -> Option<fn(&[Expr], u32) -> Value> {
    fn defined(parts: &[Expr], value: Expr) -> Expr {
        when(parts[1].clone().gt(lit(0))).then(value).otherwise(lit(NULL))
    }
    Some(match kind {
        Kind::Int => |parts, bits| {
            let sum = guarded(parts[0].clone(), parts[2].clone(), bits);
            Value { expr: defined(parts, sum.expr), ..sum }
        },
        Kind::Decimal => |parts, _| Value { expr: defined(parts, parts[2].clone()), kind: Kind::Decimal, bits: 1 },
        Kind::Float | Kind::Real => |parts, _| Value::new(defined(parts, parts[2].clone()), Kind::Float),
        _ => return None,
    })
}

/// The least or greatest value. NaN is greater than all numbers in DuckDB; Polars leaves it out.
fn extreme(name: &str, of: &Value, least: Expr, greatest: Expr, nan: Expr) -> Option<Aggregate> {
    let part = if name == "min" { least } else { greatest };
    Some(match (of.kind, name) {
        (Kind::Float, "max") => made(vec![part, nan], |parts, _| {
            let expr = when(parts[1].clone()).then(lit(f64::NAN)).otherwise(parts[0].clone());
            Value::new(expr, Kind::Float)
        }),
        (Kind::Float, _) => made(vec![part], |parts, _| Value::new(parts[0].clone(), Kind::Float)),
        (Kind::Int, _) => {
            Aggregate { parts: vec![part], value: |parts, bits| Value::int(parts[0].clone(), bits), bits: of.bits }
        }
        (Kind::Bool, _) => made(vec![part], |parts, _| Value::bool(parts[0].clone())),
        (Kind::Text, _) => made(vec![part], |parts, _| Value::new(parts[0].clone(), Kind::Text)),
        (Kind::Decimal, _) => {
            made(vec![part], |parts, _| Value { expr: parts[0].clone(), kind: Kind::Decimal, bits: 1 })
        }
        (Kind::Real, _) => made(vec![part], |parts, _| Value::new(parts[0].clone(), Kind::Real)),
        (Kind::Null | Kind::Other, _) => return None,
    })
}

/// An aggregate from the first row of a sorted partition to each row.
pub(super) fn running(name: &str, of: &Value) -> Option<Aggregate> {
    let column = wide(of);
    let filled = || column.clone().fill_null(lit(0));
    let floats = || of.float().fill_null(lit(0.0)).cum_sum(false);
    let last = |part: Expr| part.fill_null_with_strategy(FillNullStrategy::Forward(None));
    match name {
        "count" => {
            Some(made(vec![column.cum_count(false).cast(DataType::Int64)], |parts, _| Value::int(parts[0].clone(), 31)))
        }
        _ if !matches!(of.kind, Kind::Int | Kind::Float) => None,
        "sum" => Some(Aggregate {
            parts: vec![filled().cum_sum(false), column.clone().cum_count(false), floats()],
            value: total(of.kind)?,
            bits: sum_bits(of.bits),
        }),
        "avg" | "mean" => Some(made(vec![floats(), column.cum_count(false)], |parts, _| {
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
