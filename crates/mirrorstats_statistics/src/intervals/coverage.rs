//! The fewest episodes for an interval to be shown as a 95 % interval.
//!
//! Rule: an interval is given if, from that number of episodes on, it contained the truth in at least nine of ten
//! simulated studies, in every scenario of `benches/COVERAGE-INTERVALS.md`; otherwise the reason is given instead. No
//! number of episodes protects against an outcome that never occurred: without one in n episodes, its rate may still be
//! 3/n (the rule of three, Hanley and Lippman-Hand 1983).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::intervals::interval::Interval;

/// Student's t of a mean of steps.
pub const STUDENT: u64 = 12;
/// The bootstrap (bias-corrected and accelerated) of a mean of steps; with fewer values, resamples repeat too few.
pub const BOOTSTRAP: u64 = 15;
/// A restricted mean, to any decision or to a correct one.
pub const RESTRICTED_MEAN: u64 = 6;
/// A median by Brookmeyer and Crowley.
pub const MEDIAN: u64 = 4;
/// A difference of restricted means, episodes on each side; for pairs too, though fewer would suffice.
pub const DIFFERENCE: u64 = 12;
/// A difference of means by Welch's t, episodes on each side.
pub const WELCH: u64 = 8;
/// A difference of rates by unit, units on the smaller side.
pub const UNITS: u64 = 6;
/// A mean by clusters, with t(clusters - 1).
pub const CLUSTERS: u64 = 2;

/// The reason for a withheld interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "reason", rename_all = "snake_case")]
pub enum Withheld {
    /// Fewer values, pairs or clusters than the coverage needs.
    TooFew {
        /// The number that it needs.
        fewest: u64,
    },
    /// All values are equal: they say nothing about those of other episodes.
    NoSpread,
    /// The method has no bounds for these values, or there are too many of them for it.
    Undefined,
    /// Scenes, seeds or participants have several episodes, which the method takes as independent.
    Dependent,
    /// The two sides were recorded differently.
    Incomparable,
    /// A conditional metric is defined in a part of the episodes, which the outcome selects.
    Selected,
}

/// The interval of `n` values if it may be shown, otherwise the reason why not.
pub fn given(
    interval: Option<Interval>,
    n: u64,
    fewest: u64,
    has_spread: bool,
) -> (Option<Interval>, Option<Withheld>) {
    let reason = match interval {
        _ if n < fewest => Withheld::TooFew { fewest },
        Some(found) if found.low < found.high => return (interval, None),
        None if has_spread => Withheld::Undefined,
        _ => Withheld::NoSpread,
    };
    (None, Some(reason))
}

#[cfg(test)]
mod tests {
    use super::{Withheld, given};
    use crate::intervals::interval::Interval;

    #[test]
    fn an_interval_is_given_or_a_reason() {
        let wide = Some(Interval { low: 1.0, high: 2.0 });
        let point = Some(Interval { low: 1.0, high: 1.0 });
        assert_eq!(given(wide, 12, 12, true), (wide, None));
        assert_eq!(given(wide, 11, 12, true), (None, Some(Withheld::TooFew { fewest: 12 })));
        assert_eq!(given(point, 12, 12, false), (None, Some(Withheld::NoSpread)));
        assert_eq!(given(None, 12, 12, false), (None, Some(Withheld::NoSpread)));
        assert_eq!(given(None, 12, 12, true), (None, Some(Withheld::Undefined)));
    }
}
