//! The functions that a query may call, and the kinds of their arguments. The differential test calls each of them on
//! both Polars and DuckDB; every other function is refused.

use polars::prelude::DataType;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Null,
    Bool,
    Int,
    /// A number with a point, which DuckDB keeps as a decimal fraction.
    Decimal,
    /// 32 bits, which DuckDB compares and adds with 32 bits.
    Real,
    Float,
    Text,
    /// A date or another type that queries do not read.
    Other,
}

impl Kind {
    /// The kind of a column, and the bits of its largest integer.
    pub(super) fn of(ty: &DataType) -> (Self, u32) {
        match ty {
            DataType::Null => (Self::Null, 0),
            DataType::Boolean => (Self::Bool, 0),
            DataType::Int8 => (Self::Int, 7),
            DataType::Int32 => (Self::Int, 31),
            DataType::Int64 => (Self::Int, 63),
            DataType::Float32 => (Self::Real, 0),
            DataType::Float64 => (Self::Float, 0),
            DataType::String => (Self::Text, 0),
            _ => (Self::Other, 0),
        }
    }

    pub(super) fn wide(self) -> DataType {
        match self {
            Self::Null => DataType::Null,
            Self::Bool => DataType::Boolean,
            Self::Int => DataType::Int64,
            Self::Real => DataType::Float32,
            Self::Decimal | Self::Float => DataType::Float64,
            Self::Text => DataType::String,
            Self::Other => DataType::Binary,
        }
    }

    pub(super) fn sql(self) -> &'static str {
        match self {
            Self::Null => "NULL",
            Self::Bool => "BOOLEAN",
            Self::Int => "BIGINT",
            Self::Decimal => "DECIMAL",
            Self::Real => "FLOAT",
            Self::Float => "DOUBLE",
            Self::Text => "VARCHAR",
            Self::Other => "another type",
        }
    }

    pub(super) fn is_number(self) -> bool {
        matches!(self, Self::Null | Self::Int | Self::Decimal | Self::Float)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arg {
    Number,
    Text,
    /// Any value; several of one call have one kind.
    Any,
    /// A literal text that is not empty.
    Literal,
    /// A literal integer from 0 to 15.
    Digits,
    /// A literal integer from 1.
    Position,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    Scalar,
    /// Over groups; over a window with PARTITION BY alone.
    Aggregate,
    /// Like `Aggregate`, and over a window with ORDER BY.
    Running,
    /// Over a window with ORDER BY.
    Window,
}

#[derive(Clone, Copy, Debug)]
pub struct Signature {
    pub name: &'static str,
    pub role: Role,
    pub args: &'static [Arg],
    /// The last argument may be repeated.
    pub repeats: bool,
}

const fn of(name: &'static str, role: Role, args: &'static [Arg]) -> Signature {
    Signature { name, role, args, repeats: false }
}

const fn several(name: &'static str) -> Signature {
    Signature { name, role: Role::Scalar, args: &[Arg::Any, Arg::Any], repeats: true }
}

pub const FUNCTIONS: &[Signature] = &[
    of("abs", Role::Scalar, &[Arg::Number]),
    of("avg", Role::Running, &[Arg::Number]),
    of("ceil", Role::Scalar, &[Arg::Number]),
    several("coalesce"),
    of("contains", Role::Scalar, &[Arg::Text, Arg::Literal]),
    of("count", Role::Running, &[Arg::Any]),
    of("dense_rank", Role::Window, &[]),
    of("ends_with", Role::Scalar, &[Arg::Text, Arg::Literal]),
    of("exp", Role::Scalar, &[Arg::Number]),
    of("floor", Role::Scalar, &[Arg::Number]),
    several("greatest"),
    of("ifnull", Role::Scalar, &[Arg::Any, Arg::Any]),
    of("lag", Role::Window, &[Arg::Any]),
    of("lag", Role::Window, &[Arg::Any, Arg::Position]),
    of("lead", Role::Window, &[Arg::Any]),
    of("lead", Role::Window, &[Arg::Any, Arg::Position]),
    several("least"),
    of("length", Role::Scalar, &[Arg::Text]),
    of("ln", Role::Scalar, &[Arg::Number]),
    of("lower", Role::Scalar, &[Arg::Text]),
    of("ltrim", Role::Scalar, &[Arg::Text]),
    of("max", Role::Running, &[Arg::Any]),
    of("mean", Role::Running, &[Arg::Number]),
    of("median", Role::Aggregate, &[Arg::Number]),
    of("min", Role::Running, &[Arg::Any]),
    of("nullif", Role::Scalar, &[Arg::Any, Arg::Any]),
    of("rank", Role::Window, &[]),
    of("replace", Role::Scalar, &[Arg::Text, Arg::Literal, Arg::Literal]),
    of("round", Role::Scalar, &[Arg::Number]),
    of("round", Role::Scalar, &[Arg::Number, Arg::Digits]),
    of("row_number", Role::Window, &[]),
    of("rtrim", Role::Scalar, &[Arg::Text]),
    of("sqrt", Role::Scalar, &[Arg::Number]),
    of("starts_with", Role::Scalar, &[Arg::Text, Arg::Literal]),
    of("stddev", Role::Aggregate, &[Arg::Number]),
    of("stddev_samp", Role::Aggregate, &[Arg::Number]),
    of("substring", Role::Scalar, &[Arg::Text, Arg::Position]),
    of("substring", Role::Scalar, &[Arg::Text, Arg::Position, Arg::Digits]),
    of("sum", Role::Running, &[Arg::Number]),
    of("trim", Role::Scalar, &[Arg::Text]),
    of("upper", Role::Scalar, &[Arg::Text]),
    of("var_samp", Role::Aggregate, &[Arg::Number]),
    of("variance", Role::Aggregate, &[Arg::Number]),
];

/// The targets of casts, by the kind of the value; each is tested as the functions are.
pub const CASTS: &[(Kind, &[&str])] = &[
    (Kind::Bool, &["BOOLEAN", "INTEGER", "BIGINT", "DOUBLE", "VARCHAR"]),
    (Kind::Int, &["BIGINT", "DOUBLE", "VARCHAR"]),
    (Kind::Decimal, &["DOUBLE"]),
    (Kind::Real, &["DOUBLE"]),
    (Kind::Float, &["DOUBLE"]),
    (Kind::Text, &["VARCHAR"]),
];

pub fn named(name: &str) -> impl Iterator<Item = &'static Signature> {
    FUNCTIONS.iter().filter(move |signature| signature.name.eq_ignore_ascii_case(name))
}

pub(super) fn is_aggregate(name: &str) -> bool {
    named(name).any(|signature| matches!(signature.role, Role::Aggregate | Role::Running))
}
