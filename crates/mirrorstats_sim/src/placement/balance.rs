//! Colours with equal frequencies, for any number of seeds and runs of a study.
//!
//! A square of `n` by `n` numbers: each row and each column has each number once. Every rectangle at its first corner
//! has each number equally often, or once more. Seeds are its rows and runs its columns, periodically, so colours are
//! balanced for any size of study and stay unchanged when it grows. A backtracking search, row after row, found the
//! squares.

/// The squares of 2 to 10 colours, row after row, one digit per cell.
const SQUARES: [&str; 9] = [
    "1001",
    "102210021",
    "3201012323101032",
    "2014331402042311302442310",
    "204513153042431205025431342150510324",
    "3165420425016306132455024631634150214320562506314",
    "3214657050672413475031621632075474215036650312472146730503754621",
    "528140637460738125371625804082457361715306248634281750807562413253814076146073582",
    "6872530941104396275892518743063706418529458902167321376590848964705132031528649756983472107420193865",
];

/// The minimum number of colours that can be balanced.
const LEAST: usize = 2;

/// The colour of an episode among `count` colours, by its seed and run: 0 to `count` - 1.
pub fn index(count: usize, seed: i32, run: i32) -> usize {
    if count < LEAST {
        return 0;
    }
    let square = SQUARES[count - LEAST].as_bytes();
    let side = i32::try_from(count).expect("a palette has at most ten colours");
    // Seeds and runs start at 1.
    let [row, column] = [seed, run].map(|from_one| (from_one.wrapping_sub(1)).rem_euclid(side));
    let at = usize::try_from(row * side + column).expect("both are at least 0");
    usize::from(square[at] - b'0')
}

#[cfg(test)]
mod tests {
    use super::{SQUARES, index};

    #[test]
    fn every_study_from_the_first_seed_and_run_is_balanced() {
        for count in 1..=SQUARES.len() + 1 {
            let side = i32::try_from(count).unwrap();
            for (seeds, runs) in (1..=2 * side + 1).flat_map(|seeds| (1..=2 * side + 1).map(move |runs| (seeds, runs)))
            {
                let mut counts = vec![0_usize; count];
                for (seed, run) in (1..=seeds).flat_map(|seed| (1..=runs).map(move |run| (seed, run))) {
                    counts[index(count, seed, run)] += 1;
                }
                let (least, most) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
                assert!(most - least <= 1, "{count} colours, {seeds} seeds of {runs} runs: {counts:?}");
            }
        }
    }

    #[test]
    fn any_seed_and_run_has_a_colour() {
        for number in [i32::MIN, -1, 0, 1, i32::MAX] {
            assert!(index(10, number, number) < 10);
        }
    }
}
