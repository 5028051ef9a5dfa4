//! Differences between engines: names, constants, patterns, and functions that some of them lack.

use sqlparser::keywords::ALL_KEYWORDS;

use super::pattern::java;
use crate::columns::Type;
use crate::logical_plan::plan::{Arithmetic, Constant};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dialect {
    #[default]
    Portable,
    Spark,
    Duckdb,
}

/// Functions that the portable form lacks.
pub(super) struct Functions {
    pub(super) matches: &'static str,
    pub(super) any_value: &'static str,
    /// The value at the smallest and at the largest non-null t; the value may be null.
    pub(super) value_at: [&'static str; 2],
    pub(super) of_list: [&'static str; 3],
}

mirrorstats_exact::names!(Dialect { Portable: "portable", Spark: "spark", Duckdb: "duckdb" });

impl Dialect {
    pub(super) fn quoted(self, name: &str) -> String {
        match self {
            Self::Portable | Self::Duckdb if is_plain(name) => name.to_owned(),
            Self::Spark if is_plain(name) && !is_keyword(name) => name.to_owned(),
            Self::Spark => format!("`{}`", name.replace('`', "``")),
            Self::Portable | Self::Duckdb => format!("\"{}\"", name.replace('"', "\"\"")),
        }
    }

    pub fn output_name(self, metric: &str) -> String {
        match self {
            Self::Portable => metric.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect(),
            Self::Spark | Self::Duckdb => self.quoted(metric),
        }
    }

    pub(super) const fn functions(self) -> Option<Functions> {
        match self {
            Self::Portable => None,
            Self::Spark => Some(Functions {
                matches: "regexp_like",
                any_value: "MIN",
                value_at: ["min_by", "max_by"],
                of_list: ["size", "array_min", "array_max"],
            }),
            Self::Duckdb => Some(Functions {
                matches: "regexp_matches",
                any_value: "any_value",
                value_at: ["arg_min_null", "arg_max_null"],
                of_list: ["len", "list_min", "list_max"],
            }),
        }
    }

    pub(super) fn any_value(self) -> &'static str {
        self.functions().map_or("MIN", |functions| functions.any_value)
    }

    pub(super) fn list(self, condition: &str) -> String {
        match self {
            Self::Duckdb => format!("list(s.t) FILTER (WHERE {condition})"),
            _ => format!("collect_list(CASE WHEN {condition} THEN s.t END)"),
        }
    }

    /// The items of a list that meet a condition; `item` is the name of an item in it.
    pub(super) fn filtered(self, list: &str, item: &str, condition: &str) -> String {
        match self {
            Self::Duckdb => format!("[{item} for {item} in {list} if {condition}]"),
            _ => format!("filter({list}, {item} -> {condition})"),
        }
    }

    pub fn text(self, value: &str) -> String {
        match self {
            // Spark reads backslashes in texts as escapes.
            Self::Spark => format!("'{}'", value.replace('\\', "\\\\").replace('\'', "\\'")),
            Self::Portable | Self::Duckdb => format!("'{}'", value.replace('\'', "''")),
        }
    }

    /// An integer literal. Spark's have 32 bits unless marked as 64.
    fn integer(self, value: i64) -> String {
        let suffix = if self == Self::Spark { "L" } else { "" };
        match value {
            i64::MIN => format!("(-{}{suffix} - 1)", i64::MAX),
            value if value < 0 => format!("({value}{suffix})"),
            value => format!("{value}{suffix}"),
        }
    }

    /// A pattern of the `regex` crate as a literal.
    pub fn pattern(self, pattern: &str) -> String {
        match self {
            Self::Spark => self.text(&java(pattern).unwrap_or_else(|| unreachable!("the binder has read the pattern"))),
            Self::Portable | Self::Duckdb => self.text(pattern),
        }
    }

    pub(super) fn constant(self, constant: &Constant, ty: Type) -> String {
        match constant {
            Constant::Null => format!("CAST(NULL AS {})", self.type_name(ty)),
            Constant::Bool(value) => i64::from(*value).to_string(),
            Constant::Int(value) => self.integer(*value),
            Constant::Float(bits) => format!("CAST({:e} AS DOUBLE)", f64::from_bits(*bits)),
            Constant::Text(value) => self.text(value),
        }
    }

    const fn type_name(self, ty: Type) -> &'static str {
        match (ty, self) {
            (Type::Text, Self::Spark) => "STRING",
            (Type::Text, _) => "VARCHAR",
            (Type::Float, _) => "DOUBLE",
            (Type::Int | Type::Bool, _) => "BIGINT",
        }
    }

    /// Quotient and remainder without integer division, on which engines disagree. The remainder is exact everywhere,
    /// and without it the number divides evenly. Spark divides as doubles, but has `DIV`.
    pub(super) fn arithmetic(self, op: Arithmetic, x: &str, y: &str) -> String {
        match op {
            Arithmetic::Add => format!("({x} + {y})"),
            Arithmetic::Subtract => format!("({x} - {y})"),
            Arithmetic::Multiply => format!("({x} * {y})"),
            Arithmetic::Remainder => format!("CASE WHEN {y} <> 0 THEN {x} % {y} END"),
            Arithmetic::Quotient => match self {
                Self::Duckdb => format!("CASE WHEN {y} <> 0 THEN ({x} - {x} % {y}) // {y} END"),
                Self::Spark => format!("CASE WHEN {y} <> 0 THEN ({x} DIV {y}) END"),
                Self::Portable => format!("CASE WHEN {y} <> 0 THEN CAST(({x} - {x} % {y}) / {y} AS BIGINT) END"),
            },
        }
    }
}

pub(super) fn is_plain(name: &str) -> bool {
    let starts = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    starts && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

fn is_keyword(name: &str) -> bool {
    ALL_KEYWORDS.binary_search(&name.to_ascii_uppercase().as_str()).is_ok()
}
