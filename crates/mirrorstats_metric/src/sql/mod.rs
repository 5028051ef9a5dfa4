//! A plan as one SQL statement over a table `steps`: the second lowering, for other engines.
//!
//! ```text
//! plan ──► one_pass.rs ──► layout.rs ───────► statement.rs (passes and columns)
//!          (landmarks of   (which pass, which  expression.rs (nodes)
//!           one pass)       column)            dialect.rs (what engines write differently)
//! ```
//!
//! A pass over the steps is a common table expression with one row per episode. An aggregate belongs to the first pass
//! in which all its inputs are known. Most definitions need one pass, which reads like SQL written by hand:
//!
//! ```text
//! WITH e1 AS (SELECT s.episode_id, MIN(CASE WHEN ... THEN s.t END) AS done_4, ... FROM (...) s GROUP BY s.episode_id)
//! SELECT ... FROM e1 ORDER BY ...
//! ```
//!
//! The portable form uses only CASE, COALESCE, MIN, MAX, SUM, COUNT, JOIN (LEFT JOIN for `lag`) and arithmetic. Polars
//! SQL, `DuckDB`, Spark SQL and `DataFusion` run it unchanged. It needs a second pass for a search between two
//! landmarks; `DuckDB` and Spark filter lists instead.
//!
//! The native engine refuses sums beyond 64 bits; other engines fail or wrap.

mod dialect;
mod expression;
mod layout;
mod one_pass;
mod pattern;
mod statement;

use std::collections::BTreeSet;

pub use self::dialect::Dialect;
use self::dialect::is_plain;
use self::layout::Layout;
use self::one_pass::OnePass;
use self::statement::Statement;
use super::logical_plan::plan::{NodeId, Op, Plan};

use mirrorstats_exact::budget::SETTING;

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LoweringError {
    #[error("`{metric}` uses regexp_like, which has no form that all engines share; choose --dialect spark or duckdb")]
    Regexp { metric: String },
    #[error("the name `{name}` needs quotes, which engines write differently; choose --dialect spark or duckdb")]
    Name { name: String },
    #[error("two metrics would both be called `{name}`; choose --dialect spark or duckdb")]
    SameName { name: String },
    #[error(
        "the statement exceeds {limit} bytes; choose fewer metrics with --metrics, or raise the limit: {SETTING}=10 in the environment"
    )]
    Length { limit: u64 },
}

/// The statement that computes the episode table: `episode_id, model, experiment, seed, run`, then the metrics. Engines
/// quote names differently, so the portable form does not quote: a metric's `-` becomes `_` there.
pub fn lower(plan: &Plan, dialect: Dialect) -> Result<String, LoweringError> {
    check_patterns(plan, dialect)?;
    check_names(plan, dialect)?;
    let OnePass { plan, windowed } = OnePass::of(plan);
    let roots: Vec<NodeId> = plan.outputs.iter().map(|output| output.node).chain(plan.filter).collect();
    let layout = Layout::new(&plan, dialect, &roots, &windowed);
    let mut statement = Statement::new(&layout);
    statement.passes()?;
    statement.episodes()?;
    Ok(statement.text)
}

fn check_patterns(plan: &Plan, dialect: Dialect) -> Result<(), LoweringError> {
    if dialect.functions().is_some() {
        return Ok(());
    }
    let uses = |root: NodeId| plan.needed_by([root]).into_iter().any(|id| matches!(plan.node(id).op, Op::Matches(..)));
    let output = plan.outputs.iter().find(|output| uses(output.node)).map(|output| output.name.clone());
    let filter = plan.filter.filter(|&node| uses(node)).map(|_| "the filter".to_owned());
    output.or(filter).map_or(Ok(()), |metric| Err(LoweringError::Regexp { metric }))
}

fn check_names(plan: &Plan, dialect: Dialect) -> Result<(), LoweringError> {
    if dialect != Dialect::Portable {
        return Ok(());
    }
    if let Some((name, _)) = plan.columns(&plan.needed()).into_iter().find(|(name, _)| !is_plain(name)) {
        return Err(LoweringError::Name { name: name.to_owned() });
    }
    let mut seen = BTreeSet::new();
    for name in plan.outputs.iter().map(|output| dialect.output_name(&output.name)) {
        // Some engines ignore case in names without quotes.
        if !seen.insert(name.to_lowercase()) {
            return Err(LoweringError::SameName { name });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::columns::{Column, Columns, Level, Type};
    use crate::definitions::Definitions;
    use crate::file::built_in_names;
    use crate::tests::schema_columns;

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
    fn each_aggregate_is_in_the_first_pass_that_has_its_operands() {
        let plan = plan(
            r#"
            [let]
            done = "first(action = 'done')"
            [metric.SEEN]
            value = "any(mirror_visible and t < coalesce(done, length()))"
            [metric.X-Y]
            value = "count(pose_x > 1)"
            when = "SEEN = 1 and body_color <> 'it''s'"
            [metric.BETWEEN]
            value = "count(mirror_visible and t between first(mirror_visible) and done)"
            [metric.AT]
            value = "at(\"grip force\", done) + at(t, done - 1)"
            "#,
        );
        insta::assert_snapshot!("spark", lower(&plan, Dialect::Spark).unwrap());
        insta::assert_snapshot!("duckdb", lower(&plan, Dialect::Duckdb).unwrap());
    }

    #[test]
    fn the_built_in_definitions_take_one_pass_where_lists_can_be_searched() {
        for name in built_in_names() {
            let plan = Definitions::load(name, &schema_columns()).unwrap().plan;
            let passes = |dialect| lower(&plan, dialect).unwrap().matches("GROUP BY").count();
            assert_eq!([Dialect::Duckdb, Dialect::Spark].map(passes), [1, 1], "{name}");
        }
    }

    #[test]
    fn columns_of_the_traces_do_not_clash_with_generated_names() {
        let statements = (0..10).map(|n| {
            let column = Column { ty: Type::Text, level: Level::Step };
            let text = "[metric.M]\nvalue = \"first(c = 'a') - last(c = 'a' and t > 1) + count(c is null)\"";
            let text = text.replace("(c ", &format!("(c{n} "));
            let plan = Definitions::from_toml("test", &text, &[(format!("c{n}"), column)].into_iter().collect());
            let statement = lower(&plan.unwrap().plan, Dialect::Portable).unwrap();
            assert!(!statement.contains(&format!(" AS c{n}\n")), "{statement}");
            statement.contains(&format!(" AS c{n}_\n"))
        });
        assert_eq!(statements.filter(|renamed| *renamed).count(), 1);
    }

    #[test]
    fn unsupported_functions_of_a_dialect_are_refused_by_name() {
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
    fn a_lagged_step_is_joined_on_its_time() {
        let text = "count(lag(action) = action and lag(lag(t)) > 1) + length()";
        let statement = lower(&metric(text), Dialect::Portable).unwrap();
        for (lag, columns) in [(1, "t AS lag1_t,\n      action AS lag1_0"), (2, "t AS lag2_t\n")] {
            assert_eq!(statement.matches(&format!("LEFT JOIN (\n    SELECT episode_id AS lag{lag}_id")).count(), 1);
            assert!(statement.contains(columns), "{statement}");
            let on = format!("ON s.episode_id = lag{lag}.lag{lag}_id AND s.t = lag{lag}.lag{lag}_next");
            assert!(statement.contains(&on), "{statement}");
        }
        assert!(statement.contains("CASE WHEN lag1.lag1_t IS NOT NULL THEN lag1.lag1_0 END = s.action"), "{statement}");
    }

    #[test]
    fn lag_looks_back_by_its_number_of_steps() {
        let nested = |depth: usize| format!("max({}t{})", "lag(".repeat(depth), ")".repeat(depth));
        assert_eq!(lower(&metric(&nested(8)), Dialect::Duckdb).unwrap().matches("LEFT JOIN").count(), 8);
        let text =
            format!("[let]\nx = \"{}\"\n[metric.M]\nvalue = \"max(lag(x))\"", &nested(8)[4..nested(8).len() - 1]);
        let refused = Definitions::from_toml("test", &text, &Columns::default()).unwrap_err().to_string();
        assert!(refused.contains("`lag` looks back by 8 steps at most"), "{refused}");
        // An aggregate is one value, after which lags are counted from zero.
        lower(&metric(&format!("count(lag(t) < {})", nested(8))), Dialect::Duckdb).unwrap();
    }

    #[test]
    fn texts_cannot_leave_their_quotes() {
        let quoted = metric(r"any(action = 'a\\'' or 1=1 --')");
        assert!(lower(&quoted, Dialect::Portable).unwrap().contains(r"'a\'' or 1=1 --'"));
        assert!(lower(&quoted, Dialect::Spark).unwrap().contains(r"'a\\\' or 1=1 --'"));
    }
}
