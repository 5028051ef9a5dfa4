//! The integers behind a mean number of steps and its standard error.

use std::ops::RangeInclusive;

use mirrorstats_exact::moments::Moments;

use super::contradiction::Contradiction;
use super::generator::Generator;
use super::published::{Pair, Value};
use super::{BUDGET, EPISODES, printing};

/// The number of exchanges before a search gives up.
const EXCHANGES: usize = 6_000;
/// The most steps that one exchange moves.
const STRIDE: usize = 12;

/// The sum of 21 numbers of steps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    /// Their sum.
    pub sum: usize,
    /// The range of the sum of their squares.
    pub squares: RangeInclusive<usize>,
}

/// The sum and sums of squares that print as a pair's published mean and standard error.
///
/// A mean with two decimals allows at most one sum of 21 integers.
///
/// # Errors
/// If no sum prints as the mean, or no sum of squares as the standard error.
pub fn target(pair: &Pair, metric: &str) -> Result<Target, Contradiction> {
    let means = |sum: usize| printing::matches_mean(pair, metric, moments(sum, 0));
    let Some(sum) = (0..=EPISODES * BUDGET).find(|&sum| means(sum)) else {
        return Err(Contradiction::new(pair, metric, nearest_sums(pair, metric)));
    };
    let prints = |squares: &usize| printing::matches(pair, metric, moments(sum, *squares));
    let mut squares = (least_squares(pair, metric, sum)..=sum * BUDGET).skip_while(|x| !prints(x)).take_while(prints);
    match squares.next() {
        Some(first) => Ok(Target { sum, squares: first..=squares.last().unwrap_or(first) }),
        None => Err(Contradiction::new(pair, metric, format!("no 21 integers with the sum {sum} spread like that"))),
    }
}

/// A sum of squares slightly below all that print as the standard error, where the search begins.
fn least_squares(pair: &Pair, metric: &str, sum: usize) -> usize {
    let below = printed_hundredths(pair, metric, |value| &value.se).unwrap_or(0).saturating_sub(1);
    (sum * sum).div_ceil(EPISODES) + below.pow(2) * EPISODES * (EPISODES - 1) / 100_usize.pow(2)
}

/// The first printed mean or standard error, in hundredths.
fn printed_hundredths(pair: &Pair, metric: &str, part: fn(&Value) -> &String) -> Option<usize> {
    let (whole, decimals) = part(pair.prints(metric).iter().find_map(|print| print.value.as_ref())?).split_once('.')?;
    format!("{whole}{}", decimals.get(..2)?).parse().ok()
}

fn moments(sum: usize, sum_sq: usize) -> Moments {
    Moments { n: EPISODES as u64, sum: sum as i128, sum_sq: sum_sq as i128 }
}

/// Searches for numbers within `bounds` that meet the target.
///
/// Starts from the most even numbers, which have the least sum of squares. Then it moves steps between two random
/// numbers if this brings the squares nearer. `None` if there are no such numbers or the search fails.
pub fn search(bounds: &[RangeInclusive<usize>], target: &Target, generator: &mut Generator) -> Option<Vec<usize>> {
    let mut numbers = even(bounds, target.sum)?;
    let mut squares: usize = numbers.iter().map(|x| x * x).sum();
    if squares > *target.squares.end() {
        return None;
    }
    for _ in 0..EXCHANGES {
        let missing = distance(&target.squares, squares);
        if missing == 0 {
            return Some(numbers);
        }
        let (to, from) = (generator.below(numbers.len()), generator.below(numbers.len()));
        let steps = 1 + generator.below(STRIDE);
        let (up, down) = (numbers[to] + steps, numbers[from].saturating_sub(steps));
        if to == from || numbers[from] < steps || !bounds[to].contains(&up) || !bounds[from].contains(&down) {
            continue;
        }
        let moved = squares + up * up + down * down - numbers[to].pow(2) - numbers[from].pow(2);
        if distance(&target.squares, moved) < missing {
            (numbers[to], numbers[from], squares) = (up, down, moved);
        }
    }
    None
}

/// The most even numbers with this sum within bounds; `None` if there are none.
fn even(bounds: &[RangeInclusive<usize>], sum: usize) -> Option<Vec<usize>> {
    let mut numbers: Vec<usize> = bounds.iter().map(|range| *range.start()).collect();
    for _ in numbers.iter().sum()..sum {
        let (_, lowest) =
            numbers.iter_mut().enumerate().filter(|(i, x)| **x < *bounds[*i].end()).min_by_key(|(_, x)| **x)?;
        *lowest += 1;
    }
    (numbers.iter().sum::<usize>() == sum).then_some(numbers)
}

fn distance(range: &RangeInclusive<usize>, value: usize) -> usize {
    range.start().saturating_sub(value) + value.saturating_sub(*range.end())
}

/// Lists the sums nearest to a mean that no sum prints as.
fn nearest_sums(pair: &Pair, metric: &str) -> String {
    let none = "no sum of 21 integers prints as this mean";
    let shown = |sum: usize| {
        let values =
            pair.prints(metric).iter().filter_map(|p| printing::value(p.source, metric, moments(sum, sum * sum)));
        let means: Vec<String> = values.map(|value| value.mean).collect();
        format!("the sum {sum} prints as {}", means.join(" and "))
    };
    match printed_hundredths(pair, metric, |value| &value.mean).map(|mean| mean * EPISODES / 100) {
        Some(below) => format!("{none}: {}, {}", shown(below), shown(below + 1)),
        None => none.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::generator::Generator;
    use super::{Target, search};

    /// Any existing numbers can be found again from their sum and squares, within their bounds.
    #[test]
    fn numbers_are_found_by_their_sum_and_squares() {
        let mut generator = Generator::of("test");
        for round in 0..50 {
            let highs: Vec<usize> = (0..21).map(|_| 1 + generator.below(100)).collect();
            let hidden: Vec<usize> = highs.iter().map(|&high| generator.below(high + 1)).collect();
            let (sum, squares) = (hidden.iter().sum(), hidden.iter().map(|x| x * x).sum::<usize>());
            let bounds: Vec<_> = highs.iter().map(|&high| 0..=high).collect();
            let target = Target { sum, squares: squares..=squares + 8 };
            let found = search(&bounds, &target, &mut generator).unwrap_or_else(|| panic!("round {round}: {hidden:?}"));
            assert!(found.iter().zip(&bounds).all(|(x, range)| range.contains(x)), "{found:?}");
            assert_eq!(found.iter().sum::<usize>(), sum);
            assert!(target.squares.contains(&found.iter().map(|x| x * x).sum()), "{found:?}");
        }
    }

    #[test]
    fn searches_stay_within_bounds() {
        let bounds = vec![1..=3; 4];
        for (sum, squares) in [(3, 0..=100), (13, 0..=100), (8, 0..=15), (8, 21..=100)] {
            let target = Target { sum, squares };
            assert_eq!(search(&bounds, &target, &mut Generator::of("test")), None, "{target:?}");
        }
    }
}
