//! The statement that reports numbers beyond 64 bits, for engines that wrap.

use std::collections::BTreeMap;

use super::dialect::SMALLEST;
use super::layout::Layout;
use super::statement::Statement;
use super::{Dialect, LoweringError};
use crate::columns::Level;
use crate::plan::{Arithmetic, NodeId, Op, Plan};

/// The statement that reports numbers beyond 64 bits. It has one row per episode and a column `g<node>` for each of
/// `checked`: 1 if the node exceeds 64 bits, else 0. For engines that wrap silently. Each number is compared with the
/// same computation in doubles: a wrapped number is far from its double.
pub fn lower_checks(plan: &Plan, dialect: Dialect, checked: &[NodeId]) -> Result<String, LoweringError> {
    // A check reads the operands of a value, which are missing if the value is a shared column of steps.
    let layout = Layout::new(plan, dialect, checked, &BTreeMap::new()).without_shared();
    let checks: Vec<_> = checked.iter().filter_map(|&id| layout.check(id)).collect();
    let mut statement = Statement::new(&layout);
    statement.passes(&checks)?;
    statement.text.push_str("\nSELECT e1.episode_id AS episode_id");
    for &id in checked {
        statement.column(2, &format!("{} AS g{}", layout.verdict(id), id.index()))?;
    }
    statement.join();
    statement.text.push('\n');
    Ok(statement.text)
}

impl Layout<'_> {
    /// A pass's column for detecting overflow: the pass, the node that it reads at each step, and its text. For a sum
    /// it is the same sum in doubles. For a value per step it says whether any step overflows.
    fn check(&self, id: NodeId) -> Option<(usize, NodeId, String)> {
        let node = self.plan.node(id);
        let (pass, read, check) = match &node.op {
            Op::Aggregate(_, x) => {
                let summed = self.each_step(*x, format!("CAST({} AS DOUBLE)", self.value(*x)));
                (self.pass(id), *x, format!("SUM({summed})"))
            }
            _ if node.level == Level::Step => {
                (self.pass(id) + 1, id, format!("MAX(CASE WHEN {} THEN 1 ELSE 0 END)", self.overflows(id)))
            }
            _ => return None,
        };
        Some((pass, read, format!("{check} AS g{}", id.index())))
    }

    fn verdict(&self, id: NodeId) -> String {
        let node = self.plan.node(id);
        let overflows = match node.op {
            Op::Aggregate(..) => far_apart(&self.value(id), &format!("e{}.g{}", self.pass(id), id.index())),
            _ if node.level == Level::Step => return format!("e{}.g{}", self.pass(id) + 1, id.index()),
            _ => self.overflows(id),
        };
        format!("CASE WHEN {overflows} THEN 1 ELSE 0 END")
    }

    fn overflows(&self, id: NodeId) -> String {
        let double = |id: &NodeId| format!("CAST({} AS DOUBLE)", self.value(*id));
        let exact = match &self.plan.node(id).op {
            Op::Arithmetic(Arithmetic::Quotient | Arithmetic::Remainder, x, y) => {
                return format!("({} = {SMALLEST} AND {} = -1)", self.value(*x), self.value(*y));
            }
            Op::Arithmetic(op, x, y) => self.dialect.arithmetic(*op, &double(x), &double(y)),
            Op::Negate(x) => format!("(0 - {})", double(x)),
            _ => double(&id),
        };
        far_apart(&self.value(id), &exact)
    }
}

fn far_apart(integer: &str, double: &str) -> String {
    format!("(ABS(CAST({integer} AS DOUBLE) - {double}) > CAST(4.0e18 AS DOUBLE))")
}
