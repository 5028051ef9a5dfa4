//! The functions of the calculus: names, arities, documentation.

use crate::logical_plan::plan::Aggregate;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    Of(Aggregate),
    Mean,
    Round,
    At,
    Lag,
    Length,
    Coalesce,
    NullIf,
    Div,
    RegexpLike,
}

pub(super) struct Entry {
    pub(super) function: Function,
    pub(super) name: &'static str,
    pub(super) usage: &'static str,
    pub(super) arity: (usize, usize),
}

const MANY: usize = usize::MAX;

pub(super) const FUNCTIONS: [Entry; 17] = [
    entry(Function::Of(Aggregate::First), "first", "first(p): the t of the first step where p holds, or null", (1, 1)),
    entry(Function::Of(Aggregate::Last), "last", "last(p): the t of the last step where p holds, or null", (1, 1)),
    entry(Function::Of(Aggregate::Any), "any", "any(p): whether p holds at some step", (1, 1)),
    entry(Function::Of(Aggregate::All), "all", "all(p): whether p holds at every step", (1, 1)),
    entry(Function::Of(Aggregate::Count), "count", "count(p): at how many steps p holds", (1, 1)),
    entry(Function::Of(Aggregate::Min), "min", "min(x): the smallest x, or null", (1, 1)),
    entry(Function::Of(Aggregate::Max), "max", "max(x): the largest x, or null", (1, 1)),
    entry(Function::Of(Aggregate::Sum), "sum", "sum(x): the sum of an integer or decimal x, or null", (1, 1)),
    entry(Function::Mean, "mean", "mean(x): the mean of x over the steps, with the digits of x, or null", (1, 1)),
    entry(Function::Round, "round", "round(x, 3): the nearest number with 3 digits after the point", (2, 2)),
    entry(Function::At, "at", "at(x, t0): the value of x at timestep t0, or null", (2, 2)),
    entry(
        Function::Lag,
        "lag",
        "lag(x): the value of x at step t - 1 of the same episode, null at the first step",
        (1, 1),
    ),
    entry(Function::Length, "length", "length(): the number of steps", (0, 0)),
    entry(Function::Coalesce, "coalesce", "coalesce(x, y, ...): the first that is not null", (1, MANY)),
    entry(Function::NullIf, "nullif", "nullif(x, y): null where x = y, else x", (2, 2)),
    entry(Function::Div, "div", "div(x, y): the integer quotient towards zero, null where y = 0", (2, 2)),
    entry(Function::RegexpLike, "regexp_like", "regexp_like(text, 'pattern'): whether the text has a match", (2, 2)),
];

const fn entry(function: Function, name: &'static str, usage: &'static str, arity: (usize, usize)) -> Entry {
    Entry { function, name, usage, arity }
}

pub(super) fn find(name: &str) -> Option<&'static Entry> {
    FUNCTIONS.iter().find(|entry| entry.name == name)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::FUNCTIONS;

    #[test]
    #[expect(clippy::disallowed_methods, reason = "the test writes the page when it is asked to")]
    fn the_page_of_the_reference_is_current() {
        let rows = FUNCTIONS.map(|entry| entry.usage.split_once(": ").unwrap());
        let rows = rows.map(|(call, meaning)| format!("| `{call}` | {meaning} |\n"));
        let page = format!(
            "# Functions of metric expressions\n\nMetrics are SQL expressions over the steps of one episode: SQL's operators, `case`, `in`, `between`, and these functions.\n[Change a metric's definition](../how-to/definitions.md) shows them in use.\n\n| call | value |\n|---|---|\n{}",
            rows.concat()
        );
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/functions.md");
        if std::env::var_os("MIRRORSTATS_WRITE_REFERENCE").is_some() {
            std::fs::write(&path, &page).unwrap();
        }
        assert_eq!(std::fs::read_to_string(&path).unwrap(), page, "{}: not what the program says", path.display());
    }
}
