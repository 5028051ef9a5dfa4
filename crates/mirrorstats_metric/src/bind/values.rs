//! Refuses literals that a column with a list of values never takes: the comparison would never hold.
//!
//! Rule: the plan gives the possible values: those of a column with a list, its value at a timestep, and `case` and
//! `coalesce` over such values and literals. Everything else may be any text. Comparisons by order are not checked,
//! since they also make sense with other texts (`x between 'turn' and 'turn~'`).

use super::super::logical_plan::plan::{Constant, NodeId, Op};
use super::super::syntax::Expr;
use super::scope::Scope;
use super::{Binder, Bound};
use mirrorstats_exact::suggest::nearest;
use mirrorstats_toml_spec::Fault;

#[derive(Debug, Default)]
struct PossibleValues {
    columns: Vec<String>,
    texts: Vec<String>,
}

impl Scope<'_, '_> {
    /// Refuses an equality of a column and a value that it never has, in either order.
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
    pub(super) fn literal_text(&self, node: NodeId) -> Option<String> {
        match &self.builder.node(node).op {
            Op::Constant(Constant::Text(text)) => Some(text.clone()),
            _ => None,
        }
    }

    /// The possible values of a node except null; `None` if any text is possible.
    fn possible(&self, node: NodeId) -> Option<PossibleValues> {
        let mut possible = PossibleValues::default();
        self.walk(node, |node, todo| {
            match &node.op {
                Op::Column(name) => {
                    let values = &self.columns.known(name)?.values;
                    possible.texts.extend_from_slice(Some(values).filter(|values| !values.is_empty())?);
                    possible.columns.push(name.clone());
                }
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
            Some(())
        })?;
        Some(possible)
    }
}

impl PossibleValues {
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
