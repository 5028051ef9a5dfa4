//! The fields of the lists: counts, means with their sums, timesteps.

use super::Limit;
use crate::cells::KeyValue;
use crate::cells::diff::{CellChange, Numbers, Pair};
use exact::number::Decimal;
use score::evidence::ranges;

/// Decimal places: enough to show one episode in a thousand.
const PLACES: u32 = 3;

/// The most runs of timesteps that a line shows.
const MOST_RUNS: usize = 6;

/// The text for a missing value.
pub(super) const UNDEFINED: &str = "undefined";

pub(super) fn left_out(all: usize, limit: Limit) -> Option<String> {
    let rest = all.saturating_sub(limit.0);
    (rest > 0).then(|| format!("{rest} more: --limit shows more, --json all"))
}

pub(super) fn pair(pair: &Pair<String>) -> String {
    if pair.before == pair.after { pair.after.clone() } else { format!("{} -> {}", pair.before, pair.after) }
}

pub(super) fn key(value: &KeyValue) -> String {
    match value {
        KeyValue::Missing => UNDEFINED.to_owned(),
        value => exact::escape::visible(&value.to_string()),
    }
}

pub(super) fn value(value: Option<i64>) -> String {
    value.map_or_else(|| UNDEFINED.to_owned(), |value| value.to_string())
}

pub(super) fn n(numbers: &Pair<Option<Numbers>>) -> String {
    let one = |numbers: Option<Numbers>| numbers.map_or_else(|| "no episode".to_owned(), |cell| cell.n.to_string());
    pair(&Pair { before: one(numbers.before), after: one(numbers.after) })
}

/// The mean as counts and as a number: `18/21 = 0.857 -> 19/21 = 0.905`.
pub(super) fn mean(numbers: &Pair<Option<Numbers>>) -> String {
    let one = |numbers: Option<Numbers>| match numbers {
        Some(cell) if cell.n > 0 => {
            let mean = Decimal::of_ratio(cell.sum, cell.n.into(), PLACES);
            let mean = mean.map_or_else(String::new, |mean| format!(" = {mean}"));
            format!("{}/{}{mean}", cell.sum, cell.n)
        }
        _ => UNDEFINED.to_owned(),
    };
    pair(&Pair { before: one(numbers.before), after: one(numbers.after) })
}

pub(super) fn mean_change(cell: &CellChange) -> String {
    let change = cell.exact_mean_change().and_then(|(above, below)| Decimal::of_ratio(above, below, PLACES));
    let sign = |above: i128| if above > 0 { "+" } else { "" };
    let above = cell.exact_mean_change().map_or(0, |(above, _)| above);
    change.map_or_else(String::new, |change| format!("{}{change}", sign(above)))
}

pub(super) fn se(numbers: &Pair<Option<Numbers>>) -> String {
    let one = |numbers: Option<Numbers>| {
        let se = numbers.and_then(|cell| cell.se).and_then(|se| Decimal::of_float(se, PLACES));
        se.map_or_else(|| UNDEFINED.to_owned(), |se| se.to_string())
    };
    pair(&Pair { before: one(numbers.before), after: one(numbers.after) })
}

/// The timesteps that decided a value: `t = 3-7, 9`.
pub(super) fn timesteps(timesteps: Option<&Vec<i64>>) -> String {
    let Some(timesteps) = timesteps else { return "not known".to_owned() };
    if timesteps.is_empty() {
        return "no step".to_owned();
    }
    let all = ranges(timesteps);
    let runs: Vec<&str> = all.split(", ").collect();
    if runs.len() <= MOST_RUNS {
        return format!("t = {all}");
    }
    format!("t = {}, ... ({} steps)", runs[..MOST_RUNS].join(", "), timesteps.len())
}

#[cfg(test)]
mod tests {
    use super::{left_out, timesteps};
    use crate::changes::Limit;

    #[test]
    fn long_lists_count_their_omissions() {
        assert_eq!(left_out(5, Limit(5)), None);
        assert_eq!(left_out(7, Limit(5)).unwrap(), "2 more: --limit shows more, --json all");
        let odd: Vec<i64> = (0..10).map(|at| 2 * at + 1).collect();
        assert_eq!(timesteps(Some(&odd)), "t = 1, 3, 5, 7, 9, 11, ... (10 steps)");
    }

    #[test]
    fn no_step_is_not_an_unknown_step() {
        assert_eq!([timesteps(None), timesteps(Some(&vec![]))], ["not known", "no step"]);
        assert_eq!(timesteps(Some(&vec![2, 3, 4, 9])), "t = 2-4, 9");
    }
}
