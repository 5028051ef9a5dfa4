//! A plan as one SQL statement over a table `steps`: the second lowering, for other engines.
//!
//! Each stage of the statement is a common table expression with one row an episode. An aggregate
//! belongs to the first stage in which everything it reads is known:
//!
//! ```text
//! WITH e1 AS (SELECT s.episode_id, MIN(CASE WHEN ... THEN s.t END) AS n4, ... FROM steps s GROUP BY s.episode_id),
//!      e2 AS (SELECT s.episode_id, MAX(...) AS n9 FROM steps s JOIN e1 ON ... GROUP BY s.episode_id)
//! SELECT ... FROM e1 JOIN e2 ON ... ORDER BY ...
//! ```
//!
//! Nothing is used but CASE, COALESCE, MIN, MAX, SUM, COUNT, JOIN and arithmetic, so that Polars SQL,
//! `DuckDB`, Spark SQL and `DataFusion` run the portable form as it is; a dialect differs only in regular
//! expressions, for which there is no common function. Truth values of episodes travel as 0 and 1.
//!
//! Sums beyond 64 bits, which the native engine refuses, are an error or a wrap of the engine that
//! runs the statement.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use sqlparser::keywords::ALL_KEYWORDS;

use super::catalog::Kind;
use super::columns::{Level, Type};
use super::pattern::java;
use super::plan::{Aggregate, Arithmetic, Comparison, Constant, NodeId, Op, Plan};

/// Whose SQL to write.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dialect {
    /// What all engines share.
    #[default]
    Portable,
    /// Spark SQL.
    Spark,
    /// `DuckDB`.
    Duckdb,
    /// Polars SQL, which `--engine polars` runs.
    Polars,
}

impl Dialect {
    /// As it is typed.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Spark => "spark",
            Self::Duckdb => "duckdb",
            Self::Polars => "polars",
        }
    }

    /// A name as it stands in a statement.
    fn quoted(self, name: &str) -> String {
        match self {
            Self::Portable | Self::Duckdb if is_plain(name) => name.to_owned(),
            Self::Spark if is_plain(name) && !is_keyword(name) => name.to_owned(),
            Self::Spark => format!("`{}`", name.replace('`', "``")),
            Self::Polars | Self::Portable | Self::Duckdb => format!("\"{}\"", name.replace('"', "\"\"")),
        }
    }

    /// The column of a metric.
    pub fn output_name(self, metric: &str) -> String {
        match self {
            Self::Portable => metric.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect(),
            Self::Spark | Self::Duckdb | Self::Polars => self.quoted(metric),
        }
    }

    /// The column of a metric as an engine names it in its answer.
    pub fn output_alias(self, metric: &str) -> String {
        match self {
            Self::Portable => self.output_name(metric),
            Self::Spark | Self::Duckdb | Self::Polars => metric.to_owned(),
        }
    }

    /// The function that says whether a text has a match of a regular expression.
    const fn matches(self) -> Option<&'static str> {
        match self {
            Self::Portable => None,
            Self::Spark | Self::Polars => Some("regexp_like"),
            Self::Duckdb => Some("regexp_matches"),
        }
    }

    /// A text as it stands in a statement.
    pub fn text(self, value: &str) -> String {
        match self {
            // Spark reads backslashes in texts as escapes.
            Self::Spark => format!("'{}'", value.replace('\\', "\\\\").replace('\'', "\\'")),
            Self::Portable | Self::Duckdb | Self::Polars => format!("'{}'", value.replace('\'', "''")),
        }
    }

    /// An integer as it stands in a statement. Spark's have 32 bits unless they say that they have 64.
    fn integer(self, value: i64) -> String {
        let suffix = if self == Self::Spark { "L" } else { "" };
        match value {
            i64::MIN => format!("(-{}{suffix} - 1)", i64::MAX),
            value if value < 0 => format!("({value}{suffix})"),
            value => format!("{value}{suffix}"),
        }
    }

    /// A pattern of the `regex` crate as it stands in a statement.
    pub(crate) fn pattern(self, pattern: &str) -> String {
        match self {
            Self::Spark => self.text(&java(pattern).unwrap_or_else(|| unreachable!("the binder has read the pattern"))),
            Self::Portable | Self::Duckdb | Self::Polars => self.text(pattern),
        }
    }
}

/// A plan that a dialect cannot say.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LoweringError {
    /// Regular expressions.
    #[error("`{metric}` uses regexp_like, which has no form that all engines share; choose --dialect spark or duckdb")]
    Regexp {
        /// The first metric that needs it.
        metric: String,
    },
    /// A name that needs quotes, which engines write differently.
    #[error("the name `{name}` needs quotes, which engines write differently; choose --dialect spark or duckdb")]
    Name {
        /// The column.
        name: String,
    },
    /// Two metrics whose names are one without quotes.
    #[error("two metrics would both be called `{name}`; choose --dialect spark or duckdb")]
    SameName {
        /// The name.
        name: String,
    },
    /// Too long a statement.
    #[error("the statement exceeds {limit} bytes; choose fewer metrics with --metrics")]
    Length {
        /// The longest statement written.
        limit: usize,
    },
}

/// The longest statement that is written, in bytes.
const LONGEST: usize = 4 * 1024 * 1024;
/// Positive infinity, and the number that is none.
const INFINITY: &str = "CAST('inf' AS DOUBLE)";
const NAN: &str = "CAST('NaN' AS DOUBLE)";
/// The smallest integer, which has no literal of its own.
const SMALLEST: &str = "(-9223372036854775807 - 1)";
/// The columns that name an episode besides its id, in the order of the episode table.
const KEYS: [&str; 4] = ["model", "experiment", "seed", "run"];

/// The statement that computes the episode table: `episode_id, model, experiment, seed, run`, then the metrics.
///
/// Engines differ in how they quote names, so the portable form quotes none: a metric's `-` becomes `_` there.
///
/// # Errors
/// A construct that the dialect cannot say, by the name of the metric that uses it.
pub fn lower(plan: &Plan, dialect: Dialect) -> Result<String, LoweringError> {
    let roots = plan.outputs.iter().map(|output| output.node).chain(plan.filter);
    let needed = plan.needed_by(roots);
    let lowering = Lowering { plan, dialect, stages: stages(plan, &needed), checked: &[] };
    lowering.check_patterns()?;
    lowering.check_names(&needed)?;
    let mut text = String::new();
    let last = lowering.write_stages(&needed, &mut text)?;
    lowering.select(last, &mut text)?;
    Ok(text)
}

/// The statement that says whether numbers leave 64 bits: a row an episode, a column `g<node>` for each of `checked`,
/// 1 where the node does and 0 elsewhere.
///
/// For engines that wrap: what such a number is compared with is the same in doubles, which is far off then.
///
/// # Errors
/// As [`lower`].
pub fn lower_checks(plan: &Plan, dialect: Dialect, checked: &[NodeId]) -> Result<String, LoweringError> {
    let needed = plan.needed_by(checked.iter().copied());
    let lowering = Lowering { plan, dialect, stages: stages(plan, &needed), checked };
    let mut text = String::new();
    let last = lowering.write_stages(&needed, &mut text)?;
    lowering.select_checks(last, &mut text)?;
    Ok(text)
}

/// When each node is known: 0 for what a step says by itself, k for what stage k has computed.
fn stages(plan: &Plan, needed: &[NodeId]) -> BTreeMap<NodeId, usize> {
    let mut stages = BTreeMap::new();
    for &id in needed {
        let node = plan.node(id);
        let before = node.op.operands().iter().map(|operand| stages[operand]).max().unwrap_or(0);
        let stage = match &node.op {
            Op::Aggregate(..) | Op::At(..) => before + 1,
            Op::Length => 1,
            Op::Column(_) if node.level == Level::Episode => 1,
            _ => before,
        };
        stages.insert(id, stage);
    }
    stages
}

/// Whether a node is a column of its stage's table.
fn is_column_of_stage(op: &Op, level: Level) -> bool {
    matches!(op, Op::Aggregate(..) | Op::At(..) | Op::Length)
        || (matches!(op, Op::Column(_)) && level == Level::Episode)
}

struct Lowering<'p> {
    plan: &'p Plan,
    dialect: Dialect,
    stages: BTreeMap<NodeId, usize>,
    /// The nodes that are looked at for overflow.
    checked: &'p [NodeId],
}

impl Lowering<'_> {
    /// Writes all stages and gives the last one's number.
    fn write_stages(&self, needed: &[NodeId], text: &mut String) -> Result<usize, LoweringError> {
        let known = needed.iter().map(|id| self.stages[id]);
        let last = known.chain(self.checked.iter().map(|&id| self.stage_of_check(id))).max().unwrap_or(0).max(1);
        for stage in 1..=last {
            text.push_str(if stage == 1 { "WITH " } else { ",\n" });
            self.stage(stage, needed, text)?;
        }
        Ok(last)
    }

    /// The stage that knows whether a node overflows at some step.
    fn stage_of_check(&self, id: NodeId) -> usize {
        let node = self.plan.node(id);
        match node.op {
            Op::Aggregate(..) => self.stages[&id],
            _ if node.level == Level::Step => self.stages[&id] + 1,
            _ => self.stages[&id].max(1),
        }
    }

    fn check_patterns(&self) -> Result<(), LoweringError> {
        if self.dialect.matches().is_some() {
            return Ok(());
        }
        let uses = |root: NodeId| {
            let nodes = self.plan.needed_by([root]);
            nodes.into_iter().any(|id| matches!(self.plan.node(id).op, Op::Matches(..)))
        };
        let output = self.plan.outputs.iter().find(|output| uses(output.node)).map(|output| output.name.clone());
        let filter = self.plan.filter.filter(|&node| uses(node)).map(|_| "the filter".to_owned());
        output.or(filter).map_or(Ok(()), |metric| Err(LoweringError::Regexp { metric }))
    }

    fn check_names(&self, needed: &[NodeId]) -> Result<(), LoweringError> {
        if self.dialect != Dialect::Portable {
            return Ok(());
        }
        if let Some((name, _)) = self.plan.columns(needed).into_iter().find(|(name, _)| !is_plain(name)) {
            return Err(LoweringError::Name { name: name.to_owned() });
        }
        let mut seen = BTreeSet::new();
        for name in self.plan.outputs.iter().map(|output| self.dialect.output_name(&output.name)) {
            // Some engines fold the case of names without quotes.
            if !seen.insert(name.to_lowercase()) {
                return Err(LoweringError::SameName { name });
            }
        }
        Ok(())
    }

    fn name(&self, name: &str) -> String {
        self.dialect.quoted(name)
    }

    /// `e2 AS (SELECT s.episode_id, ... AS n9 FROM steps s JOIN e1 ... GROUP BY s.episode_id)`
    fn stage(&self, stage: usize, needed: &[NodeId], text: &mut String) -> Result<(), LoweringError> {
        let _ = write!(text, "e{stage} AS (\n  SELECT s.episode_id AS episode_id");
        if stage == 1 {
            for key in KEYS {
                let _ = write!(text, ",\n    MIN(s.{key}) AS {key}");
            }
        }
        for &id in needed {
            let node = self.plan.node(id);
            if self.stages[&id] == stage && is_column_of_stage(&node.op, node.level) {
                let _ = write!(text, ",\n    {} AS n{}", self.aggregate(id), id.index());
                check_length(text)?;
            }
        }
        for &id in self.checked.iter().filter(|&&id| self.stage_of_check(id) == stage) {
            if let Some(check) = self.check_of_stage(id) {
                let _ = write!(text, ",\n    {check} AS g{}", id.index());
                check_length(text)?;
            }
        }
        text.push_str("\n  FROM steps s");
        for before in 1..stage {
            let _ = write!(text, "\n  JOIN e{before} ON s.episode_id = e{before}.episode_id");
        }
        text.push_str("\n  GROUP BY s.episode_id\n)");
        Ok(())
    }

    fn select(&self, last: usize, text: &mut String) -> Result<(), LoweringError> {
        text.push_str("\nSELECT e1.episode_id AS episode_id");
        for key in KEYS {
            let _ = write!(text, ",\n  e1.{key} AS {key}");
        }
        for output in &self.plan.outputs {
            let value = match (self.plan.node(output.node).ty, output.kind) {
                (Type::Bool, _) => self.truth_as_int(output.node),
                (_, Kind::Rate | Kind::Quantity) => self.value(output.node),
            };
            let _ = write!(text, ",\n  {value} AS {}", self.dialect.output_name(&output.name));
            check_length(text)?;
        }
        join_stages(last, text);
        if let Some(filter) = self.plan.filter {
            let _ = write!(text, "\nWHERE {}", self.truth(filter));
        }
        text.push_str("\nORDER BY experiment, model, seed, run, episode_id\n");
        check_length(text)
    }

    /// The column of a stage that tells of overflow: for a sum the same in doubles, for what has a value a step
    /// whether there is one that overflows.
    fn check_of_stage(&self, id: NodeId) -> Option<String> {
        let node = self.plan.node(id);
        match &node.op {
            Op::Aggregate(_, x) => {
                Some(format!("SUM({})", self.each_step(*x, format!("CAST({} AS DOUBLE)", self.value(*x)))))
            }
            _ if node.level == Level::Step => Some(format!("MAX(CASE WHEN {} THEN 1 ELSE 0 END)", self.overflows(id))),
            _ => None,
        }
    }

    fn select_checks(&self, last: usize, text: &mut String) -> Result<(), LoweringError> {
        text.push_str("\nSELECT e1.episode_id AS episode_id");
        for &id in self.checked {
            let (node, at) = (self.plan.node(id), format!("e{}.g{}", self.stage_of_check(id), id.index()));
            let check = match node.op {
                Op::Aggregate(..) => {
                    format!("CASE WHEN {} THEN 1 ELSE 0 END", far_apart(&self.column_of_stage(id), &at))
                }
                _ if node.level == Level::Step => at,
                _ => format!("CASE WHEN {} THEN 1 ELSE 0 END", self.overflows(id)),
            };
            let _ = write!(text, ",\n  {check} AS g{}", id.index());
            check_length(text)?;
        }
        join_stages(last, text);
        text.push('\n');
        Ok(())
    }

    /// Whether an operation on integers leaves 64 bits.
    fn overflows(&self, id: NodeId) -> String {
        let double = |id: &NodeId| format!("CAST({} AS DOUBLE)", self.value(*id));
        let exact = match &self.plan.node(id).op {
            Op::Arithmetic(Arithmetic::Quotient | Arithmetic::Remainder, x, y) => {
                return format!("({} = {SMALLEST} AND {} = -1)", self.value(*x), self.value(*y));
            }
            Op::Arithmetic(op, x, y) => arithmetic(self.dialect, *op, &double(x), &double(y)),
            Op::Negate(x) => format!("(0 - {})", double(x)),
            _ => double(&id),
        };
        far_apart(&self.value(id), &exact)
    }

    /// The aggregate of a stage's table.
    fn aggregate(&self, id: NodeId) -> String {
        let node = self.plan.node(id);
        match &node.op {
            Op::Length => "COUNT(s.t)".to_owned(),
            Op::Column(name) if node.ty == Type::Bool => {
                format!("MIN(CASE WHEN s.{0} THEN 1 WHEN NOT s.{0} THEN 0 END)", self.name(name))
            }
            Op::Column(name) if node.ty == Type::Float => {
                self.extreme("MIN", node.ty, &format!("CAST(s.{} AS DOUBLE)", self.name(name)))
            }
            Op::Column(name) => format!("MIN(s.{})", self.name(name)),
            Op::At(value, moment) => {
                let value = if node.ty == Type::Bool { self.truth_as_int(*value) } else { self.value(*value) };
                self.extreme("MAX", node.ty, &format!("CASE WHEN s.t = {} THEN {value} END", self.value(*moment)))
            }
            Op::Aggregate(aggregate, x) => match aggregate {
                Aggregate::First => format!("MIN(CASE WHEN {} THEN s.t END)", self.truth(*x)),
                Aggregate::Last => format!("MAX(CASE WHEN {} THEN s.t END)", self.truth(*x)),
                Aggregate::Any => format!("MAX(CASE WHEN {} THEN 1 ELSE 0 END)", self.truth(*x)),
                Aggregate::All => format!("MIN(CASE WHEN {} THEN 1 ELSE 0 END)", self.truth(*x)),
                Aggregate::Count => {
                    let counted = format!("CASE WHEN {} THEN 1 ELSE 0 END", self.truth(*x));
                    format!("SUM({})", self.each_step(*x, counted))
                }
                Aggregate::Min => self.extreme("MIN", node.ty, &self.value(*x)),
                Aggregate::Max => self.extreme("MAX", node.ty, &self.value(*x)),
                Aggregate::Sum => format!("SUM({})", self.each_step(*x, wide(&self.value(*x)))),
            },
            _ => self.value(id),
        }
    }

    /// What is summed over the steps. A constant is one value to Polars, however many steps there are.
    fn each_step(&self, summed: NodeId, text: String) -> String {
        let nodes = self.plan.needed_by([summed]);
        let varies = |id: &NodeId| {
            let node = self.plan.node(*id);
            node.op == Op::Time || matches!(node.op, Op::Column(_)) || is_column_of_stage(&node.op, node.level)
        };
        if self.dialect != Dialect::Polars || nodes.iter().any(varies) {
            return text;
        }
        format!("CASE WHEN s.t IS NOT NULL THEN {text} END")
    }

    /// The smallest or largest value. A NaN is above all other numbers; Polars passes over it.
    fn extreme(&self, function: &str, ty: Type, value: &str) -> String {
        if self.dialect != Dialect::Polars || ty != Type::Float {
            return format!("{function}({value})");
        }
        let is_nan = format!("{function}(CASE WHEN {value} <= {INFINITY} THEN 0 WHEN {value} > {INFINITY} THEN 1 END)");
        format!("CASE WHEN {is_nan} = 1 THEN {NAN} ELSE {function}({value}) END")
    }

    /// Where a stage's column is read.
    fn column_of_stage(&self, id: NodeId) -> String {
        format!("e{}.n{}", self.stages[&id], id.index())
    }

    /// A node of numbers or text.
    fn value(&self, id: NodeId) -> String {
        let node = self.plan.node(id);
        if is_column_of_stage(&node.op, node.level) {
            return self.column_of_stage(id);
        }
        match &node.op {
            Op::Column(name) if node.ty == Type::Float => format!("CAST(s.{} AS DOUBLE)", self.name(name)),
            Op::Column(name) => format!("s.{}", self.name(name)),
            Op::Time => "s.t".to_owned(),
            Op::Constant(constant) => self.constant(constant, node.ty),
            Op::Spread(x) => self.value(*x),
            Op::Negate(x) => format!("(0 - {})", self.number(*x)),
            Op::Arithmetic(op, x, y) => arithmetic(self.dialect, *op, &self.number(*x), &self.number(*y)),
            // Spark's 1 and 0 have 32 bits.
            Op::IntFromBool(x) if self.dialect == Dialect::Spark => {
                format!("CAST({} AS BIGINT)", self.truth_as_int(*x))
            }
            Op::IntFromBool(x) => self.truth_as_int(*x),
            Op::FloatFromInt(x) => format!("CAST({} AS DOUBLE)", self.value(*x)),
            Op::Case { branches, otherwise } => self.case(branches, *otherwise, |id| self.value(id)),
            Op::Coalesce(values) => coalesce(values.iter().map(|&id| self.value(id))),
            _ => self.truth_as_int(id),
        }
    }

    /// An operand of arithmetic, its integers as wide as the native engine's whatever the file or a constant has.
    fn number(&self, id: NodeId) -> String {
        let node = self.plan.node(id);
        match node.op {
            Op::Arithmetic(..) | Op::Negate(_) => self.value(id),
            _ if node.ty == Type::Int => wide(&self.value(id)),
            _ => self.value(id),
        }
    }

    /// A truth value as 0, 1 or null.
    fn truth_as_int(&self, id: NodeId) -> String {
        let node = self.plan.node(id);
        match &node.op {
            _ if is_column_of_stage(&node.op, node.level) => self.column_of_stage(id),
            Op::Spread(x) => self.truth_as_int(*x),
            Op::Case { branches, otherwise } => self.case(branches, *otherwise, |id| self.truth_as_int(id)),
            Op::Coalesce(values) => coalesce(values.iter().map(|&id| self.truth_as_int(id))),
            Op::Constant(Constant::Bool(value)) => i64::from(*value).to_string(),
            Op::Constant(_) => "CAST(NULL AS BIGINT)".to_owned(),
            _ => {
                let truth = self.truth(id);
                format!("CASE WHEN {truth} THEN 1 WHEN NOT {truth} THEN 0 END")
            }
        }
    }

    /// A node of truth values, as a condition.
    fn truth(&self, id: NodeId) -> String {
        let node = self.plan.node(id);
        match &node.op {
            Op::Column(name) if node.level == Level::Step => format!("s.{}", self.name(name)),
            Op::Spread(x) => self.truth(*x),
            Op::Not(x) => format!("(NOT {})", self.truth(*x)),
            Op::And(x, y) => format!("({} AND {})", self.truth(*x), self.truth(*y)),
            Op::Or(x, y) => format!("({} OR {})", self.truth(*x), self.truth(*y)),
            Op::Compare(comparison, x, y) => {
                let (x, y) = (self.operand(*x), self.operand(*y));
                format!("({x} {} {y})", symbol(*comparison))
            }
            Op::Distinct(x, y) => {
                let (x, y) = (self.operand(*x), self.operand(*y));
                format!(
                    "(CASE WHEN {x} IS NULL AND {y} IS NULL THEN 0 WHEN {x} IS NULL OR {y} IS NULL THEN 1 \
                     WHEN {x} = {y} THEN 0 ELSE 1 END = 1)"
                )
            }
            Op::IsNull(x) => format!("({} IS NULL)", self.operand(*x)),
            Op::IsTrue(x) => format!("(CASE WHEN {} THEN 1 ELSE 0 END = 1)", self.truth(*x)),
            Op::IsFalse(x) => format!("(CASE WHEN NOT {} THEN 1 ELSE 0 END = 1)", self.truth(*x)),
            Op::Matches(x, pattern) => {
                let function = self.dialect.matches().unwrap_or("regexp_like");
                format!("{function}({}, {})", self.value(*x), self.dialect.pattern(pattern))
            }
            _ => format!("({} = 1)", self.truth_as_int(id)),
        }
    }

    /// An operand of a comparison: truth values are compared as integers.
    fn operand(&self, id: NodeId) -> String {
        if self.plan.node(id).ty == Type::Bool { self.truth_as_int(id) } else { self.value(id) }
    }

    fn case(
        &self,
        branches: &[(NodeId, NodeId)],
        otherwise: Option<NodeId>,
        value: impl Fn(NodeId) -> String,
    ) -> String {
        let mut text = "CASE".to_owned();
        for (when, then) in branches {
            let _ = write!(text, " WHEN {} THEN {}", self.truth(*when), value(*then));
        }
        if let Some(otherwise) = otherwise {
            let _ = write!(text, " ELSE {}", value(otherwise));
        }
        text + " END"
    }

    fn constant(&self, constant: &Constant, ty: Type) -> String {
        match constant {
            Constant::Null => format!("CAST(NULL AS {})", type_name(ty, self.dialect)),
            Constant::Bool(value) => i64::from(*value).to_string(),
            Constant::Int(value) => self.dialect.integer(*value),
            // Polars takes no exponent without a point.
            Constant::Float(bits) if self.dialect == Dialect::Polars => {
                format!("CAST('{:?}' AS DOUBLE)", f64::from_bits(*bits))
            }
            Constant::Float(bits) => format!("CAST({:e} AS DOUBLE)", f64::from_bits(*bits)),
            Constant::Text(value) => self.dialect.text(value),
        }
    }
}

fn join_stages(last: usize, text: &mut String) {
    text.push_str("\nFROM e1");
    for stage in 2..=last {
        let _ = write!(text, "\nJOIN e{stage} ON e1.episode_id = e{stage}.episode_id");
    }
}

/// Whether an integer that may have wrapped is not what it is in doubles: wrapping moves it by 2^64, rounding by far less.
fn far_apart(integer: &str, double: &str) -> String {
    format!("(ABS(CAST({integer} AS DOUBLE) - {double}) > CAST(4.0e18 AS DOUBLE))")
}

fn check_length(text: &str) -> Result<(), LoweringError> {
    if text.len() > LONGEST { Err(LoweringError::Length { limit: LONGEST }) } else { Ok(()) }
}

/// Whether every engine takes a name without quotes.
fn is_plain(name: &str) -> bool {
    let starts = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    starts && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

fn coalesce(values: impl Iterator<Item = String>) -> String {
    format!("COALESCE({})", values.collect::<Vec<_>>().join(", "))
}

/// An integer of 64 bits.
fn wide(value: &str) -> String {
    format!("CAST({value} AS BIGINT)")
}

const fn symbol(comparison: Comparison) -> &'static str {
    match comparison {
        Comparison::Equal => "=",
        Comparison::NotEqual => "<>",
        Comparison::Less => "<",
        Comparison::LessEqual => "<=",
        Comparison::Greater => ">",
        Comparison::GreaterEqual => ">=",
    }
}

const fn type_name(ty: Type, dialect: Dialect) -> &'static str {
    match (ty, dialect) {
        (Type::Text, Dialect::Spark) => "STRING",
        (Type::Text, _) => "VARCHAR",
        (Type::Float, _) => "DOUBLE",
        (Type::Int | Type::Bool, _) => "BIGINT",
    }
}

/// Whether a name may also be a word of SQL.
fn is_keyword(name: &str) -> bool {
    ALL_KEYWORDS.binary_search(&name.to_ascii_uppercase().as_str()).is_ok()
}

/// Quotient and remainder without a division of integers, which engines disagree about: the remainder is exact
/// everywhere, and what is left divides without a fraction. Spark divides as doubles, and has a word of its own.
fn arithmetic(dialect: Dialect, op: Arithmetic, x: &str, y: &str) -> String {
    match op {
        Arithmetic::Add => format!("({x} + {y})"),
        Arithmetic::Subtract => format!("({x} - {y})"),
        Arithmetic::Multiply => format!("({x} * {y})"),
        Arithmetic::Remainder => format!("CASE WHEN {y} <> 0 THEN {} END", remainder(dialect, x, y)),
        Arithmetic::Quotient if matches!(dialect, Dialect::Polars | Dialect::Duckdb) => {
            format!("CASE WHEN {y} <> 0 THEN ({x} - {}) // {y} END", remainder(dialect, x, y))
        }
        Arithmetic::Quotient if dialect == Dialect::Spark => format!("CASE WHEN {y} <> 0 THEN ({x} DIV {y}) END"),
        Arithmetic::Quotient => format!("CASE WHEN {y} <> 0 THEN CAST(({x} - {x} % {y}) / {y} AS BIGINT) END"),
    }
}

/// The remainder with the sign of x. Polars gives it that of y, so that y is given that of x; the smallest integer
/// has no other sign.
fn remainder(dialect: Dialect, x: &str, y: &str) -> String {
    if dialect != Dialect::Polars {
        return format!("{x} % {y}");
    }
    format!(
        "CASE WHEN {y} = {SMALLEST} AND {x} <> {SMALLEST} THEN {x} \
         ELSE {x} % (CASE WHEN ({x} < 0) = ({y} < 0) THEN {y} ELSE (0 - {y}) END) END"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::columns::{Column, Columns};
    use crate::metric::definitions::Definitions;

    fn plan(text: &str) -> Plan {
        let columns = [
            ("action", Type::Text, Level::Step),
            ("mirror_visible", Type::Bool, Level::Step),
            ("pose_x", Type::Float, Level::Step),
            ("grip force", Type::Int, Level::Step),
            ("body_color", Type::Text, Level::Episode),
        ];
        let columns: Columns = columns.map(|(name, ty, level)| (name, Column { ty, level })).into_iter().collect();
        Definitions::from_toml("test", text, &columns).unwrap().plan
    }

    fn metric(value: &str) -> Plan {
        plan(&format!("[metric.M]\nvalue = \"{value}\""))
    }

    #[test]
    fn each_aggregate_stands_in_the_first_stage_that_knows_what_it_reads() {
        let plan = plan(
            r#"
            [let]
            done = "first(action = 'done')"
            [metric.SEEN]
            value = "any(mirror_visible and t < coalesce(done, length()))"
            [metric.X-Y]
            value = "count(pose_x > 1)"
            when = "SEEN = 1 and body_color <> 'it''s'"
            "#,
        );
        insta::assert_snapshot!(lower(&plan, Dialect::Portable).unwrap());
    }

    #[test]
    fn what_a_dialect_cannot_say_is_refused_by_name() {
        let pattern = metric("any(regexp_like(action, 'd.n[e]'))");
        assert_eq!(lower(&pattern, Dialect::Portable), Err(LoweringError::Regexp { metric: "M".into() }));
        assert!(lower(&pattern, Dialect::Duckdb).unwrap().contains("regexp_matches(s.action, 'd.n[e]')"));
        let odd = metric(r#"max(\"grip force\")"#);
        assert_eq!(lower(&odd, Dialect::Portable), Err(LoweringError::Name { name: "grip force".into() }));
        assert!(lower(&odd, Dialect::Spark).unwrap().contains("MAX(s.`grip force`)"));
        let same = plan("[metric.A-B]\nvalue = \"length()\"\n[metric.a_b]\nvalue = \"1\"");
        assert_eq!(lower(&same, Dialect::Portable), Err(LoweringError::SameName { name: "a_b".into() }));
    }

    #[test]
    fn texts_cannot_leave_their_quotes() {
        let quoted = metric(r"any(action = 'a\\'' or 1=1 --')");
        assert!(lower(&quoted, Dialect::Portable).unwrap().contains(r"'a\'' or 1=1 --'"));
        assert!(lower(&quoted, Dialect::Spark).unwrap().contains(r"'a\\\' or 1=1 --'"));
    }
}
