//! Stops the recording of an agent that cannot answer: a model that refuses everything, a program that prints no JSON.
//!
//! Rule: a reply without a decision is unusable. Consecutive ones stop the recording, counted per episode and in order
//! of arrival. With one episode under way the second count includes the first. With several, the first is independent
//! of other episodes; which ones are complete at the second is not.

use std::fmt;
use std::num::NonZeroU32;
use std::sync::{Mutex, PoisonError};

use super::plan::{Key, Subject};
use super::replies::UnreadableReply;
use exact::escape::visible;
use trace::episode::Step;
use trace::replies::ReplyCounts;

/// A recording that was given up because of consecutive unusable replies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenUp {
    pub model: String,
    pub in_a_row: u32,
    pub last: UnreadableReply,
}

impl fmt::Display for GivenUp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { model, in_a_row, last } = self;
        write!(
            f,
            "the agent `{}` gave {in_a_row} replies in a row without a decision; the last: {}: {}\n  \
             help: --max-unusable N allows more in a row, --keep-going any number; whole episodes stay, and the same \
             command continues",
            visible(model),
            last.status,
            last.words()
        )
    }
}

/// The consecutive unusable replies of a recording.
#[derive(Debug)]
pub(super) struct Unusable {
    most: Option<NonZeroU32>,
    found: Mutex<Found>,
}

#[derive(Debug, Default)]
struct Found {
    in_a_row: u32,
    given_up: Option<GivenUp>,
}

impl Unusable {
    /// A count of zero; `most` consecutive replies end the recording.
    pub(super) fn new(most: Option<NonZeroU32>) -> Self {
        Self { most, found: Mutex::default() }
    }

    /// Counts the reply of a step; `in_episode` is the number of consecutive ones of its episode before it. Returns
    /// true if the recording is to stop.
    pub(super) fn add(&self, subject: &Subject, key: &Key, t: i32, row: &Step, in_episode: &mut u32) -> bool {
        let Some(status) = row.extra.reply_status.as_deref() else { return false };
        let mut found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        if ReplyCounts::is_read(status) {
            (*in_episode, found.in_a_row) = (0, 0);
            return false;
        }
        *in_episode = in_episode.saturating_add(1);
        found.in_a_row = found.in_a_row.saturating_add(1);
        let in_a_row = found.in_a_row.max(*in_episode);
        let is_over = self.most.is_some_and(|most| in_a_row >= most.get());
        if is_over && found.given_up.is_none() {
            let last = UnreadableReply::of(subject, key, t, row, status);
            found.given_up = Some(GivenUp { model: subject.model.clone(), in_a_row, last });
        }
        is_over
    }

    pub(super) fn given_up(&self) -> Option<GivenUp> {
        self.found.lock().unwrap_or_else(PoisonError::into_inner).given_up.clone()
    }
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::Unusable;
    use crate::record::plan::{Key, Subject};
    use crate::sim::Experiment;
    use trace::episode::{Extra, Step};

    fn row(status: &str) -> Step {
        let reply = Some("I go \u{1b}on.".to_owned());
        Step { extra: Extra { reply_status: Some(status.to_owned()), reply, ..Extra::default() }, ..Step::default() }
    }

    /// Adds replies of these episodes and statuses; returns the number after which the recording stops.
    fn stops_after(most: u32, replies: &[(i32, &str)]) -> (Option<usize>, Unusable) {
        let unusable = Unusable::new(NonZeroU32::new(most));
        let mut in_episodes = [0; 4];
        let add = |(run, status): &(i32, &str)| {
            let key = Key::first(Experiment::E1, 1, *run);
            unusable.add(&Subject::of("m"), &key, 7, &row(status), &mut in_episodes[usize::try_from(*run).unwrap()])
        };
        let at = replies.iter().position(add);
        (at.map(|at| at + 1), unusable)
    }

    #[test]
    fn consecutive_unusable_replies_stop_the_recording() {
        let bad = |run| (run, "parse_failed");
        let good = |run| (run, "ok");
        for (replies, expected) in [
            (vec![bad(1), bad(1), bad(1), bad(1)], Some(3)),
            (vec![bad(1), bad(1), good(1), bad(1), bad(1)], None),
            (vec![bad(1), bad(1), (1, "repaired"), bad(1), (1, "refusal"), (1, "empty")], Some(6)),
            // Over consecutive episodes.
            (vec![good(1), bad(1), bad(2), bad(3)], Some(4)),
            // One failing episode among healthy ones.
            (vec![bad(1), good(2), bad(1), good(2), bad(1)], Some(5)),
            (vec![bad(1), good(2), bad(2), good(1), bad(1), good(2), bad(2)], None),
        ] {
            assert_eq!(stops_after(3, &replies).0, expected, "{replies:?}");
            assert_eq!(stops_after(0, &replies).0, None, "no number ends it");
        }
    }

    #[test]
    fn the_message_has_agent_count_and_reply() {
        let (_, unusable) = stops_after(2, &[(1, "parse_failed"), (2, "refusal")]);
        let words = unusable.given_up().unwrap().to_string();
        let expected = "the agent `m` gave 2 replies in a row without a decision; the last: refusal: `I go \\u{1b}on.` \
                        (E1/m/s1/r2, step 7)\n  help: --max-unusable N";
        assert!(words.starts_with(expected), "{words}");
        assert_eq!(stops_after(2, &[(1, "refusal")]).1.given_up(), None);
    }
}
