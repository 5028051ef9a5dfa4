//! The text of a statement: one common table expression per pass over the steps, then one row per episode.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use super::LoweringError;
use super::layout::{KEYS, Layout};
use crate::catalogs::catalog::Kind;
use crate::columns::{Level, Type};
use crate::logical_plan::plan::{NodeId, Op};
use mirrorstats_exact::budget::Limit;

const LONGEST: Limit = Limit::new("bytes of a statement", 4 << 20);

pub(super) struct Statement<'l, 'p> {
    layout: &'l Layout<'p>,
    pub(super) text: String,
    passes: usize,
}

#[derive(Default)]
struct Reads {
    columns: BTreeSet<String>,
    shared: BTreeSet<NodeId>,
    earlier: BTreeMap<usize, BTreeSet<NodeId>>,
    seen: BTreeSet<(usize, NodeId)>,
    lag: usize,
}

impl<'l, 'p> Statement<'l, 'p> {
    pub(super) fn new(layout: &'l Layout<'p>) -> Self {
        Self { layout, text: String::new(), passes: 0 }
    }

    pub(super) fn passes(&mut self) -> Result<(), LoweringError> {
        let layout = self.layout;
        self.passes = layout.needed.iter().map(|&id| layout.pass(id)).max().unwrap_or(0).max(1);
        (1..=self.passes).try_for_each(|pass| self.pass(pass))
    }

    /// `e2 AS (SELECT s.episode_id, ... AS n9 FROM steps s JOIN e1 ... GROUP BY s.episode_id)`
    fn pass(&mut self, pass: usize) -> Result<(), LoweringError> {
        let (layout, mut reads) = (self.layout, Reads::default());
        let opening = match pass {
            1 => "-- Pass 1 over the steps: constants, counts and landmarks of each episode.\nWITH ",
            _ => ",\n-- A further pass over the steps: what needs landmarks of the passes before.\n",
        };
        let _ = write!(self.text, "{opening}e{pass} AS (\n  SELECT s.episode_id AS episode_id");
        if pass == 1 {
            for key in KEYS {
                self.column(4, &format!("{}(s.{key}) AS {key}", layout.dialect.any_value()))?;
            }
            for condition in layout.listed() {
                let list = layout.dialect.list(&layout.truth(condition));
                self.column(4, &format!("{list} AS {}", layout.column('l', condition)))?;
                layout.reads(condition, &mut reads);
            }
        }
        for &id in layout.needed.iter().filter(|&&id| layout.pass(id) == pass && layout.is_aggregate(id)) {
            self.column(4, &format!("{} AS {}", layout.aggregate(id), layout.column('n', id)))?;
            layout.aggregate_reads(id, &mut reads);
        }
        let earlier = std::mem::take(&mut reads.earlier);
        self.steps(pass, reads)?;
        self.earlier_steps(&earlier)?;
        for before in 1..pass {
            let _ = write!(self.text, "\n  JOIN e{before} ON s.episode_id = e{before}.episode_id");
        }
        self.text.push_str("\n  GROUP BY s.episode_id\n)");
        Ok(())
    }

    fn steps(&mut self, pass: usize, mut reads: Reads) -> Result<(), LoweringError> {
        if reads.shared.is_empty() {
            self.text.push_str("\n  FROM steps s");
            return Ok(());
        }
        let inline = self.layout.clone().without_shared();
        let keys: &[&str] = if pass == 1 { &KEYS } else { &[] };
        let own = ["episode_id", "t"].iter().chain(keys);
        reads.columns.extend(own.map(|name| self.layout.dialect.quoted(name)));
        let columns: Vec<String> = reads.columns.iter().map(|name| format!("s.{name}")).collect();
        let _ = write!(self.text, "\n  FROM (\n    SELECT {}", columns.join(", "));
        for id in reads.shared {
            let value = if inline.plan.node(id).ty == Type::Bool { inline.truth(id) } else { inline.value(id) };
            self.column(6, &format!("{value} AS {}", inline.step_column(id)))?;
        }
        self.text.push_str("\n    FROM steps s\n  ) s");
        Ok(())
    }

    /// Joins earlier steps to each step: those of the same episode at t - 1, t - 2, ..., as far as needed.
    fn earlier_steps(&mut self, earlier: &BTreeMap<usize, BTreeSet<NodeId>>) -> Result<(), LoweringError> {
        let layout = self.layout;
        for (&lag, columns) in earlier {
            let [id, next, time] = ["id", "next", "t"].map(|word| layout.lag_column(lag, word));
            let _ =
                write!(self.text, "\n  LEFT JOIN (\n    SELECT episode_id AS {id}, t + {lag} AS {next}, t AS {time}");
            for &column in columns {
                if let Op::Column(name) = &layout.plan.node(column).op {
                    let own = layout.lag_column(lag, &column.index().to_string());
                    self.column(6, &format!("{} AS {own}", layout.dialect.quoted(name)))?;
                }
            }
            let _ = write!(
                self.text,
                "\n    FROM steps\n  ) lag{lag} ON s.episode_id = lag{lag}.{id} AND s.t = lag{lag}.{next}"
            );
        }
        Ok(())
    }

    pub(super) fn episodes(&mut self) -> Result<(), LoweringError> {
        let layout = self.layout;
        self.text.push_str("\n-- The episode table: a row per episode, its keys and its metrics.");
        self.text.push_str("\nSELECT e1.episode_id AS episode_id");
        for key in KEYS {
            self.column(2, &format!("e1.{key} AS {key}"))?;
        }
        for output in &layout.plan.outputs {
            let value = match (layout.plan.node(output.node).ty, output.kind) {
                (Type::Bool, _) => layout.truth_as_int(output.node),
                (_, Kind::Rate | Kind::Quantity) => layout.value(output.node),
            };
            // The nearest double: readers round it to the digits of the metric, which gives the exact value back.
            let value = match output.decimals {
                0 => value,
                decimals => format!("CAST({value} AS DOUBLE) / CAST(1e{decimals} AS DOUBLE)"),
            };
            self.column(2, &format!("{value} AS {}", layout.dialect.output_name(&output.name)))?;
        }
        self.text.push_str("\nFROM e1");
        for pass in 2..=self.passes {
            let _ = write!(self.text, "\nJOIN e{pass} ON e1.episode_id = e{pass}.episode_id");
        }
        if let Some(filter) = layout.plan.filter {
            let _ = write!(self.text, "\nWHERE {}", layout.truth(filter));
        }
        self.text.push_str("\nORDER BY experiment, model, seed, run, episode_id\n");
        self.check_length()
    }

    fn column(&mut self, indent: usize, column: &str) -> Result<(), LoweringError> {
        let _ = write!(self.text, ",\n{:indent$}{column}", "");
        self.check_length()
    }

    fn check_length(&self) -> Result<(), LoweringError> {
        let fits = self.layout.is_within_budget() && LONGEST.check(self.text.len() as u64).is_ok();
        if fits { Ok(()) } else { Err(LoweringError::Length { limit: LONGEST.most() }) }
    }
}

impl Layout<'_> {
    fn reads(&self, id: NodeId, reads: &mut Reads) {
        let node = self.plan.node(id);
        if !reads.seen.insert((reads.lag, id)) {
            return;
        }
        match &node.op {
            _ if node.level != Level::Step => {}
            _ if reads.lag == 0 && self.shared.contains(&id) => drop(reads.shared.insert(id)),
            Op::Lag(x) => {
                reads.lag += 1;
                reads.earlier.entry(reads.lag).or_default();
                self.reads(*x, reads);
                reads.lag -= 1;
            }
            Op::Column(_) if reads.lag > 0 => drop(reads.earlier.entry(reads.lag).or_default().insert(id)),
            Op::Column(name) => drop(reads.columns.insert(self.dialect.quoted(name))),
            op => op.operands().into_iter().for_each(|operand| self.reads(operand, reads)),
        }
    }

    fn aggregate_reads(&self, id: NodeId, reads: &mut Reads) {
        match &self.plan.node(id).op {
            Op::Column(name) => drop(reads.columns.insert(self.dialect.quoted(name))),
            op => op.operands().into_iter().for_each(|operand| self.reads(operand, reads)),
        }
        if let Some((_, Some(condition))) = self.landmark(id) {
            self.reads(condition, reads);
        }
    }
}
