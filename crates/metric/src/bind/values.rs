//! Literals beside columns that take only some values: one that the column never takes is a slip, and the comparison would
//! never hold.
//!
//! Rule: what a node can be is read off the plan: a column with a list of values, its value at a timestep, and `case` and
//! `coalesce` over such and over literals. Anything else can be any text. Comparisons by order are not looked at: they also
//! make sense beside a text that is invalid of the values (`x between 'turn' and 'turn~'`).

use std::collections::HashSet;

use super::super::plan::{Comparison, Constant, NodeId, Op};
use super::super::syntax::Expr;
use super::scope::Scope;
use super::{Binder, Bound};
use exact::suggest::nearest;
use toml_spec::Fault;

/// The texts that a node can be.
#[derive(Debug, Default)]
struct Possible {
    /// The columns that they come from, in the order of the expression.
    columns: Vec<String>,
    texts: Vec<String>,
}

impl Scope<'_, '_> {
    /// Refuses a comparison of two values by equality that never holds, at its literal; other comparisons pass.
    pub(super) fn check_comparison(
        &mut self,
        comparison: Comparison,
        left: (Bound, &Expr),
        right: (Bound, &Expr),
    ) -> Option<()> {
        match comparison {
            Comparison::Equal | Comparison::NotEqual => self.check_equality(left, right),
            Comparison::Less | Comparison::LessEqual | Comparison::Greater | Comparison::GreaterEqual => Some(()),
        }
    }

    /// Refuses to ask whether a column has a value that it never has, the operands in either order.
    pub(super) fn check_equality(&mut self, left: (Bound, &Expr), right: (Bound, &Expr)) -> Option<()> {
        for ((value, _), (literal, at)) in [(left, right), (right, left)] {
            let Some(text) = self.binder.literal_text(literal.node) else { continue };
            let possible = self.binder.possible(value.node).filter(|possible| !possible.columns.is_empty());
            let Some(possible) = possible.filter(|possible| !possible.texts.contains(&text)) else { continue };
            let fault = Fault::new(self.place(at), possible.never(&text)).label("not one of its values");
            return self.binder.refuse(fault.help(possible.instead(&text)));
        }
        Some(())
    }
}

impl Binder<'_> {
    fn literal_text(&self, node: NodeId) -> Option<String> {
        match &self.builder.node(node).op {
            Op::Constant(Constant::Text(text)) => Some(text.clone()),
            _ => None,
        }
    }

    /// The possible values of a node, apart from null; `None` for any text.
    fn possible(&self, node: NodeId) -> Option<Possible> {
        let mut possible = Possible::default();
        let (mut seen, mut todo) = (HashSet::new(), vec![node]);
        while let Some(node) = todo.pop() {
            if !seen.insert(node) {
                continue;
            }
            match &self.builder.node(node).op {
                Op::Column(name) => possible.add_column(name, self.columns.values(name)?),
                Op::Constant(Constant::Text(text)) => possible.texts.push(text.clone()),
                Op::Constant(Constant::Null) => {}
                Op::Spread(x) | Op::At(x, _) | Op::Lag(x) => todo.push(*x),
                Op::Coalesce(values) => todo.extend(values.iter().rev()),
                Op::Case { branches, otherwise } => {
                    todo.extend(otherwise);
                    todo.extend(branches.iter().rev().map(|(_, value)| value));
                }
                _ => return None,
            }
        }
        Some(possible)
    }
}

impl Possible {
    fn add_column(&mut self, name: &str, values: &[String]) {
        self.columns.push(name.to_owned());
        self.texts.extend_from_slice(values);
    }

    fn never(&self, text: &str) -> String {
        let columns: Vec<String> = self.columns.iter().map(|name| format!("`{name}`")).collect();
        match columns.as_slice() {
            [one] => format!("{one} never is '{text}'"),
            several => format!("none of {} ever is '{text}'", several.join(", ")),
        }
    }

    fn instead(&self, text: &str) -> String {
        match nearest(text, self.texts.iter().map(String::as_str)) {
            Some(near) => format!("did you mean '{near}'?"),
            None => format!("it is one of {}, or null", self.texts.join(", ")),
        }
    }
}
