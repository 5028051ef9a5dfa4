//! Emphasis of cells in a column: the best and the second best competitors.
//!
//! Competitors are the models of one group under one metric. Undefined cells do not compete, and a metric without
//! a better direction has no best.

use std::cmp::Ordering;

use super::MetricCell;
use crate::style::EmphasisRule;
use mirrorstats_metric::catalogs::catalog::Better;
use mirrorstats_tables::Emphasis;

pub(crate) fn emphasise(cells: &mut [&mut MetricCell], better: Better, rule: EmphasisRule) {
    let compare: fn(&MetricCell, &MetricCell) -> Ordering = match rule {
        // Ties come from tests, which cells do not have.
        EmphasisRule::None | EmphasisRule::Tied => return,
        EmphasisRule::PrintedMean => by_printed_mean,
        EmphasisRule::ExactMean => by_exact_mean,
    };
    let best_first = |a: &MetricCell, b: &MetricCell| match better {
        Better::Higher => compare(b, a),
        Better::Lower | Better::Neither => compare(a, b),
    };
    let mut ranked: Vec<&mut MetricCell> =
        cells.iter_mut().map(|cell| &mut **cell).filter(|cell| cell.value.mean().is_some()).collect();
    if better == Better::Neither || ranked.is_empty() {
        return;
    }
    ranked.sort_by(|a, b| best_first(a, b));
    let ties_with =
        |of: usize| ranked[of..].iter().take_while(|cell| best_first(cell, ranked[of]) == Ordering::Equal).count();
    let bold = ties_with(0);
    let underlined = if bold < ranked.len() { ties_with(bold) } else { 0 };
    // The last is neither the best of one nor the second best of two, except in the paper's tables.
    let has_worse = |place: usize| rule == EmphasisRule::PrintedMean || place < ranked.len();
    let bold = if has_worse(bold) { bold } else { 0 };
    let underlined = if has_worse(bold + underlined) { underlined } else { 0 };
    for (at, cell) in ranked.into_iter().take(bold + underlined).enumerate() {
        cell.emphasis = if at < bold { Emphasis::Bold } else { Emphasis::Underline };
    }
}

fn by_printed_mean(a: &MetricCell, b: &MetricCell) -> Ordering {
    match (a.value.mean(), b.value.mean()) {
        (Some(a), Some(b)) => a.cmp_value(b),
        (a, b) => a.is_some().cmp(&b.is_some()),
    }
}

/// Exact even if products of the sums exceed 128 bits. A cell that prints as zero is zero.
fn by_exact_mean(a: &MetricCell, b: &MetricCell) -> Ordering {
    let fraction = |cell: &MetricCell| (cell.sum, i128::from(cell.n.max(1)));
    compare_fractions(fraction(a), fraction(b))
}

fn compare_fractions(a: (i128, i128), b: (i128, i128)) -> Ordering {
    let whole = a.0.div_euclid(a.1).cmp(&b.0.div_euclid(b.1));
    let rests = (a.0.rem_euclid(a.1), b.0.rem_euclid(b.1));
    whole.then_with(|| match rests {
        (0, 0) => Ordering::Equal,
        (0, _) => Ordering::Less,
        (_, 0) => Ordering::Greater,
        (rest_a, rest_b) => compare_fractions((b.1, rest_b), (a.1, rest_a)),
    })
}

#[cfg(test)]
mod tests {
    use std::cmp::Ordering;

    use proptest::prelude::*;

    use super::{compare_fractions, emphasise};
    use crate::layout::{MetricCell, Value};
    use crate::style::EmphasisRule::{self, ExactMean, PrintedMean};
    use mirrorstats_exact::moments::Moments;
    use mirrorstats_exact::number::Decimal;
    use mirrorstats_metric::catalogs::catalog::Better::{self, Higher, Lower, Neither};
    use mirrorstats_tables::Emphasis;

    /// Cells of (sum, n), printed with two digits; n = 0 is undefined. Each letter of the expected text is a cell.
    fn check(of: &[(i128, u64)], better: Better, rule: EmphasisRule, expected: &str) {
        let cell = |&(sum, n): &(i128, u64)| {
            let mean = Decimal::of_ratio(sum, n.into(), 2);
            let value = mean.map_or(Value::Undefined, |mean| Value::MeanSe { mean, se: None });
            MetricCell::plain(value, &Moments { n, sum, sum_sq: sum }, n)
        };
        let mut cells: Vec<MetricCell> = of.iter().map(cell).collect();
        emphasise(&mut cells.iter_mut().collect::<Vec<_>>(), better, rule);
        let letter = |cell: &MetricCell| match cell.emphasis {
            Emphasis::Plain => '.',
            Emphasis::Bold => 'b',
            Emphasis::Underline => 'u',
        };
        assert_eq!(cells.iter().map(letter).collect::<String>(), expected, "{of:?} {better:?} {rule:?}");
    }

    #[test]
    fn the_paper_ranks_distinct_printed_means() {
        // 13/14 and 14/15 both print 0.93: both are second.
        check(&[(1, 1), (13, 14), (14, 15), (0, 3)], Higher, PrintedMean, "buu.");
        check(&[(13, 14), (14, 15), (0, 3)], Higher, PrintedMean, "bbu");
        check(&[(0, 5), (0, 6), (0, 0)], Higher, PrintedMean, "bb.");
        check(&[(3, 21), (1, 21), (2, 21), (1, 21)], Lower, PrintedMean, ".bub");
        check(&[(4, 21)], Higher, PrintedMean, "b");
    }

    #[test]
    fn exact_means_tie_only_where_they_are_equal() {
        check(&[(1, 1), (13, 14), (14, 15), (0, 3)], Higher, ExactMean, "b.u.");
        check(&[(2, 4), (1, 2), (1, 3)], Higher, ExactMean, "bb.");
        check(&[(2, 4), (1, 2), (1, 3), (1, 4)], Higher, ExactMean, "bbu.");
        check(&[(1, 2), (2, 4), (0, 0)], Higher, ExactMean, "...");
        check(&[(4, 21)], Higher, ExactMean, ".");
        check(&[(4, 21), (0, 0)], Higher, ExactMean, "..");
        check(&[(-1, 2), (1, 3)], Lower, ExactMean, "b.");
    }

    #[test]
    fn the_worst_is_not_the_second_best() {
        check(&[(1, 1), (1, 2)], Higher, ExactMean, "b.");
        check(&[(1, 1), (1, 2), (0, 0)], Higher, ExactMean, "b..");
        check(&[(1, 1), (1, 2), (2, 4)], Higher, ExactMean, "b..");
        check(&[(1, 1), (1, 2), (2, 4), (1, 3)], Higher, ExactMean, "buu.");
        check(&[(1, 1), (1, 2)], Higher, PrintedMean, "bu");
    }

    #[test]
    fn no_cell_stands_out_without_a_better_direction() {
        check(&[(1, 2), (1, 3)], Neither, PrintedMean, "..");
        check(&[(1, 2), (1, 3)], Higher, EmphasisRule::None, "..");
        check(&[(0, 0), (0, 0)], Higher, PrintedMean, "..");
    }

    proptest! {
        #[test]
        fn fractions_compare_as_their_products(a in -500_i128..500, b in 1_i128..60, c in -500_i128..500, d in 1_i128..60) {
            prop_assert_eq!(compare_fractions((a, b), (c, d)), (a * d).cmp(&(c * b)));
        }
    }

    #[test]
    fn huge_fractions_compare_without_overflow() {
        assert_eq!(compare_fractions((i128::MAX, 3), (i128::MAX - 1, 3)), Ordering::Greater);
        assert_eq!(compare_fractions((i128::MIN, 3), (i128::MAX, 2)), Ordering::Less);
    }
}
