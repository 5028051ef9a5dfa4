//! Possible sums of squares of integers with a given count, range and sum.
//!
//! Rule: exact, by search. Take n integers from 0 to h with the sum t. Their sum of squares has the parity of t. It is
//! smallest if the integers differ by at most one, and largest if all but one are 0 or h. Not every value of that
//! parity in between is attained (n = 4, t = 4: 4, 6, 8, 10, 16). So the search removes the largest integer and repeats
//! the question for the others. Both ends are attained and bound every branch; a large remainder succeeds at the first
//! try, and failures are remembered. A search of more than `MOST_STEPS`, which only few values over a huge range take,
//! gives up and reports the value as attained: only proven cases are called impossible.

use std::collections::HashSet;

use super::first_not;

/// `count` integers from 0 to `most`, their sum and the sum of their squares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Question {
    count: i128,
    most: i128,
    sum: i128,
    squares: i128,
}

/// The most values that one search tries.
const MOST_STEPS: u32 = 1_000_000;

/// Searches that may share their results.
#[derive(Debug, Default)]
pub struct Search {
    failed: HashSet<Question>,
    steps: u32,
}

impl Search {
    /// Returns true if `count` integers from `low` to `high` have this sum and this sum of squares.
    pub(crate) fn is_attained(&mut self, count: i128, (low, high): (i128, i128), sum: i128, squares: i128) -> bool {
        let shifted = Question {
            count,
            most: high - low,
            sum: sum - count * low,
            squares: squares - 2 * low * sum + count * low * low,
        };
        self.steps = 0;
        if self.failed.len() > MOST_STEPS as usize {
            self.failed.clear();
        }
        self.succeeds(shifted)
    }

    fn succeeds(&mut self, question: Question) -> bool {
        let Question { count, most, sum, squares } = question;
        if count < 0 || most < 0 || sum < 0 || sum > count * most || (sum - squares) % 2 != 0 {
            return false;
        }
        let (least, greatest) = (least_squares(count, sum), greatest_squares(most, sum));
        if squares <= least || squares >= greatest {
            return squares == least || squares == greatest;
        }
        if count == 2 {
            return has_pair(most, sum, squares);
        }
        if self.failed.contains(&question) {
            return false;
        }
        let found = self.removes_largest(question);
        if !found {
            self.failed.insert(question);
        }
        found
    }

    fn removes_largest(&mut self, Question { count, most, sum, squares }: Question) -> bool {
        let mut largest = largest_that_leaves(count, most.min(sum), sum, squares);
        while largest * count >= sum && greatest_squares(largest, sum) >= squares {
            self.steps += 1;
            if self.steps > MOST_STEPS {
                return true;
            }
            let others =
                Question { count: count - 1, most: largest, sum: sum - largest, squares: squares - largest * largest };
            if self.succeeds(others) {
                return true;
            }
            largest -= 1;
        }
        false
    }
}

/// The smallest and the largest sum of squares of `count` integers from `low` to `high` with this sum. `None` if no
/// such integers have the sum.
pub(crate) fn ends(count: i128, (low, high): (i128, i128), sum: i128) -> Option<(i128, i128)> {
    let shifted = sum - count * low;
    if count < 0 || low > high || shifted < 0 || shifted > count * (high - low) {
        return None;
    }
    let back = |squares: i128| squares + 2 * low * sum - count * low * low;
    Some((back(least_squares(count, shifted)), back(greatest_squares(high - low, shifted))))
}

/// The largest integer up to `most` that leaves enough of the squares for the others. Found by bisection: from the mean
/// on, the smallest sum of squares of it and the others grows with it.
fn largest_that_leaves(count: i128, most: i128, sum: i128, squares: i128) -> i128 {
    let leaves = |largest: i128| largest * largest + least_squares(count - 1, sum - largest) <= squares;
    let mean = (sum + count - 1) / count;
    first_not((mean + 1, most), leaves) - 1
}

fn least_squares(count: i128, sum: i128) -> i128 {
    if count == 0 {
        return 0;
    }
    let (each, more) = (sum / count, sum % count);
    count * each * each + more * (2 * each + 1)
}

/// As many values at `most` as the sum allows, and one with the remainder.
fn greatest_squares(most: i128, sum: i128) -> i128 {
    if most == 0 {
        return 0;
    }
    (sum / most) * most * most + (sum % most) * (sum % most)
}

/// x + y = sum and x² + y² = squares: (x - y)² = 2 squares - sum².
fn has_pair(most: i128, sum: i128, squares: i128) -> bool {
    let apart = 2 * squares - sum * sum;
    if apart < 0 {
        return false;
    }
    let root = apart.isqrt();
    root * root == apart && root <= sum && i128::midpoint(sum, root) <= most
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::{Search, ends};

    /// The sums and sums of squares of all multisets of `count` integers from `low` to `high`, by enumeration.
    fn enumerated(count: usize, low: i128, high: i128) -> BTreeSet<(i128, i128)> {
        let mut reached = BTreeSet::from([(0, 0)]);
        for _ in 0..count {
            reached = reached.iter().flat_map(|(s, q)| (low..=high).map(move |x| (s + x, q + x * x))).collect();
        }
        reached
    }

    #[test]
    fn the_search_agrees_with_enumeration() {
        for (count, low, high) in
            [(1, 1, 9), (2, 0, 12), (3, 1, 14), (4, 0, 11), (5, -3, 6), (6, 1, 8), (9, 0, 4), (12, 0, 3)]
        {
            let known = enumerated(count, low, high);
            let count = i128::try_from(count).unwrap();
            let mut search = Search::default();
            for sum in count * low - 1..=count * high + 1 {
                let known_ends = known.range((sum, i128::MIN)..=(sum, i128::MAX)).map(|(_, squares)| *squares);
                let found = ends(count, (low, high), sum);
                assert_eq!(found, known_ends.clone().min().zip(known_ends.max()), "{count} {low}..{high} {sum}");
                let (least, greatest) = found.unwrap_or((0, 9));
                for squares in least - 3..=greatest + 3 {
                    let is_attained = search.is_attained(count, (low, high), sum, squares);
                    assert_eq!(is_attained, known.contains(&(sum, squares)), "{count} {low}..{high} {sum} {squares}");
                }
            }
        }
    }

    #[test]
    fn some_values_between_the_ends_are_not_attained() {
        let mut search = Search::default();
        let attained: Vec<i128> = (0..=20).filter(|&squares| search.is_attained(4, (0, 9), 4, squares)).collect();
        assert_eq!(attained, [4, 6, 8, 10, 16]);
    }

    #[test]
    fn huge_ranges_come_to_an_end() {
        let range = (-3_000_000_000_000, 3_000_000_000_000);
        let mut search = Search::default();
        // 3 integers with the sum 0: their squares add up to 2 (a² + ab + b²), and a² + ab + b² is never 2 modulo 3.
        assert!(!search.is_attained(3, range, 0, 2 * 2));
        assert!(search.is_attained(3, range, 0, 2 * 7_000_000_000_000_003));
        assert!(search.is_attained(5, range, 1, 10_000_000_000_001));
    }

    #[test]
    fn large_counts_are_decided_at_once() {
        let mut search = Search::default();
        let (least, greatest) = ends(1000, (1, 100), 40_000).unwrap();
        let attained = (least..least + 400).chain(greatest - 400..=greatest);
        let count = attained.filter(|&squares| search.is_attained(1000, (1, 100), 40_000, squares)).count();
        assert!(count > 200, "{count}");
    }
}
