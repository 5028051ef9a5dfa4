//! The number of a pair's 21 episodes with each property: the integers behind its rates.

use mirrorstats_exact::moments::Moments;

use super::EPISODES;
use super::contradiction::Contradiction;
use super::printing;
use super::published::Pair;

/// Episodes of one model in one experiment that have a property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    /// Ended by `done`.
    pub finished: usize,
    /// TSA.
    pub successes: usize,
    /// MCR: saw the mirror before the end.
    pub consulted: usize,
    /// MTATO: succeeded and saw the mirror before the end.
    pub ordered: usize,
    /// CAAL: said the true colour before the end.
    pub attributed: usize,
    /// CR: claimed a colour before the mirror was seen.
    pub confabulated: usize,
    /// `AR_SC`: claimed a wrong colour before the mirror was seen.
    pub applicable: usize,
    /// SC: said the true colour once the mirror was seen, after a wrong claim before it.
    pub corrected: usize,
}

/// All counts that the pair's published rates allow; those with the fewest finished episodes first.
///
/// Two decimals distinguish every k/n with n up to 21, so each count is one number. Only the number of finished
/// episodes, the denominator of TSA-C, may have several values.
///
/// # Errors
/// If a published rate is not k/n for any k.
pub fn solve(pair: &Pair) -> Result<Vec<Counts>, Contradiction> {
    let successes = share(pair, "TSA", EPISODES)?;
    let applicable = share(pair, "AR_SC", EPISODES)?;
    let counts = Counts {
        finished: EPISODES,
        successes,
        consulted: share(pair, "MCR", EPISODES)?,
        ordered: share(pair, "MTATO", successes)?,
        attributed: share(pair, "CAAL", EPISODES)?,
        confabulated: share(pair, "CR", EPISODES)?,
        applicable,
        corrected: share(pair, "SC", applicable)?,
    };
    let finished: Vec<usize> =
        (successes..=EPISODES).filter(|&n| printing::matches(pair, "TSA-C", rate(successes, n))).collect();
    if finished.is_empty() {
        return Err(Contradiction::new(
            pair,
            "TSA-C",
            format!("no number of finished episodes explains {successes} successes"),
        ));
    }
    Ok(finished.into_iter().map(|finished| Counts { finished, ..counts }).collect())
}

/// The k of a rate k/n.
fn share(pair: &Pair, metric: &str, n: usize) -> Result<usize, Contradiction> {
    (0..=n).find(|&k| printing::matches(pair, metric, rate(k, n))).ok_or_else(|| {
        let because = match n {
            0 => "it has no episode to be defined on".to_owned(),
            _ => format!("no k of {n} episodes gives it"),
        };
        Contradiction::new(pair, metric, because)
    })
}

/// The moments of k ones among n zeros and ones.
fn rate(k: usize, n: usize) -> Moments {
    Moments { n: n as u64, sum: k as i128, sum_sq: k as i128 }
}

#[cfg(test)]
mod tests {
    use super::super::published::{Reading, pairs};
    use super::solve;

    #[test]
    fn only_three_pairs_leave_the_number_of_finished_episodes_open() {
        let open: Vec<(String, String, usize, usize)> = pairs(Reading::Corrected)
            .into_iter()
            .map(|pair| (solve(&pair).unwrap(), pair))
            .filter(|(counts, _)| counts.len() > 1)
            .map(|(counts, pair)| (pair.experiment, pair.model, counts[0].finished, counts[counts.len() - 1].finished))
            .collect();
        let named = |experiment: &str, model: &str, from, to| (experiment.to_owned(), model.to_owned(), from, to);
        assert_eq!(
            open,
            [
                named("E2", "Ministral 3 14B", 1, 21),
                named("E5", "Ministral 3 14B", 1, 21),
                named("E5", "Gemma4 26B", 16, 18),
            ]
        );
    }
}
