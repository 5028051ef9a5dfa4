//! Episodes lost to infrastructure, and their possible effect.
//!
//! Rule: a lost episode is neither a success nor a failure. It is counted separately, and the rate is given with the
//! bounds between "all lost ones fail" and "all succeed" (Manski 1989).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::intervals::interval::{Interval, wilson};

/// The recorded reply outcomes that are caused by the infrastructure and not by the model.
pub const INFRASTRUCTURE: [&str; 3] = ["rate_limited", "server_error", "timeout"];

/// A rate with some of its episodes lost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Lossy {
    /// The episodes that count: not lost, and the metric defined.
    pub n: u64,
    /// The successes among them.
    pub successes: u64,
    /// The lost episodes.
    pub lost: u64,
    /// The rate if every lost episode were a 0, and if every one were a 1.
    pub bounds: Interval,
    /// The lower end of the score interval at the lower bound, the upper end at the upper bound.
    pub interval: Interval,
}

/// The bounds of a rate from the `lost` episodes and the values of the others. `None` if there is nothing to count.
pub fn bounds(values: impl IntoIterator<Item = i64>, lost: u64, confidence: f64) -> Option<Lossy> {
    let (mut n, mut successes) = (0, 0);
    for value in values {
        n += 1;
        successes += u64::from(value == 1);
    }
    let (worst, best) = (wilson(successes, n + lost, confidence)?, wilson(successes + lost, n + lost, confidence)?);
    let all = (n + lost) as f64;
    Some(Lossy {
        n,
        successes,
        lost,
        bounds: Interval { low: successes as f64 / all, high: (successes + lost) as f64 / all },
        interval: Interval { low: worst.low, high: best.high },
    })
}

#[cfg(test)]
mod tests {
    use super::bounds;
    use crate::intervals::interval::{Interval, wilson};

    #[test]
    fn lost_episodes_widen_the_bounds() {
        let found = bounds([1, 1, 0], 2, 0.95).unwrap();
        assert_eq!((found.n, found.successes, found.lost), (3, 2, 2));
        assert_eq!((found.bounds.low, found.bounds.high), (2.0 / 5.0, 4.0 / 5.0));
        let (worst, best) = (wilson(2, 5, 0.95).unwrap(), wilson(4, 5, 0.95).unwrap());
        assert_eq!(found.interval, Interval { low: worst.low, high: best.high });
    }

    #[test]
    fn without_losses_the_bounds_are_the_rate() {
        let found = bounds([1, 0], 0, 0.95).unwrap();
        assert_eq!((found.lost, found.bounds.low, found.bounds.high), (0, 0.5, 0.5));
        assert_eq!(bounds([], 0, 0.95), None);
    }

    #[test]
    fn all_episodes_lost_gives_no_verdict() {
        let found = bounds([], 1, 0.95).unwrap();
        assert_eq!((found.bounds.low, found.bounds.high), (0.0, 1.0));
    }
}
