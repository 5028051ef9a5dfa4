//! The replies of a recording under way: the number without a decision, the first of these, and the end of a recording
//! whose agent cannot answer: a model that refuses everything, a program that prints no JSON.
//!
//! Rule: a reply without a decision is unusable. Consecutive ones stop the recording, counted per episode and in order
//! of arrival. With one episode under way the second count includes the first. With several, the first is independent
//! of other episodes; which ones are complete at the second is not.

use std::num::NonZeroU32;
use std::sync::Mutex;

use schemars::JsonSchema;
use serde::Serialize;

use super::plan::{Key, Subject};
use mirrorstats_agents::locked;
use mirrorstats_exact::escape::visible;
use mirrorstats_trace::episodes::episode::Step;
use mirrorstats_trace::validate::replies::ReplyCounts;

const SHOWN: usize = 200;

/// Replies in order of arrival, from any thread.
#[derive(Debug, Default)]
pub struct Replies(Mutex<Found>);

#[derive(Debug, Default)]
struct Found {
    counts: ReplyCounts,
    first: Option<(Key, i32, UnreadableReply)>,
}

/// The replies of one start of a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct RepliesAnswer {
    /// The number of replies, including those of episodes that did not come to their end.
    #[serde(flatten)]
    pub counts: ReplyCounts,
    /// The first one that gave no decision, by experiment, seed, run and step; null if all gave one.
    pub first_unreadable: Option<UnreadableReply>,
}

/// A reply that gave no decision.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct UnreadableReply {
    /// The episode.
    pub episode_id: String,
    /// The step, from 1.
    pub step: i32,
    /// The status, by the names of the trace's column `reply_status`.
    pub status: String,
    /// The beginning of what was replied, characters that act on a terminal escaped; null if there is no text.
    pub text: Option<String>,
    /// The reason why it gave none, in the words of its parser, shortened likewise; null where the status says all.
    pub fault: Option<String>,
}

impl Replies {
    /// Adds the reply of a step. Returns it if it is the first to arrive without a decision.
    pub fn add(&self, subject: &Subject, key: &Key, step: i32, row: &Step) -> Option<UnreadableReply> {
        let status = row.extra.reply_status.as_deref()?;
        let mut found = locked(&self.0);
        found.counts.add(status, 1);
        let comes_before = |(first, at, _): &(Key, i32, UnreadableReply)| (key, step) < (first, *at);
        if ReplyCounts::is_read(status) || !found.first.as_ref().is_none_or(comes_before) {
            return None;
        }
        let is_first_in_time = found.first.is_none();
        let reply = UnreadableReply::new(subject, key, step, row, status);
        found.first = Some((key.clone(), step, reply.clone()));
        is_first_in_time.then_some(reply)
    }

    pub fn counts(&self) -> ReplyCounts {
        locked(&self.0).counts.clone()
    }

    pub fn answer(&self) -> RepliesAnswer {
        let found = locked(&self.0);
        RepliesAnswer {
            counts: found.counts.clone(),
            first_unreadable: found.first.as_ref().map(|(_, _, reply)| reply.clone()),
        }
    }
}

impl UnreadableReply {
    pub(super) fn new(subject: &Subject, key: &Key, step: i32, row: &Step, status: &str) -> Self {
        let text = row.extra.reply.as_deref().filter(|text| !text.trim().is_empty()).map(beginning);
        let fault = row.extra.reply_fault.as_deref().map(beginning);
        Self { episode_id: key.episode_id(subject), step, status: status.to_owned(), text, fault }
    }

    pub fn words(&self) -> String {
        let text = self.text.as_ref().map_or_else(|| "no text".to_owned(), |text| format!("`{text}`"));
        let fault = self.fault.as_ref().map_or_else(String::new, |fault| format!(": {fault}"));
        format!("{text} ({}, step {}){fault}", visible(&self.episode_id), self.step)
    }
}

fn beginning(text: &str) -> String {
    let mut shown = String::new();
    for c in text.trim().chars() {
        let piece = visible(c.encode_utf8(&mut [0; 4]));
        if shown.chars().count() + piece.chars().count() > SHOWN {
            shown.push_str("...");
            break;
        }
        shown.push_str(&piece);
    }
    shown
}

/// A recording that was given up because of consecutive unusable replies.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the agent `{}` gave {in_a_row} replies in a row without a decision; the last: {}: {}\n  \
     help: --max-unusable N allows more in a row, --keep-going any number; whole episodes stay, and the same \
     command continues",
    visible(model),
    last.status,
    last.words()
)]
pub struct GivenUp {
    pub model: String,
    pub in_a_row: u32,
    pub last: UnreadableReply,
}

#[derive(Debug)]
pub(super) struct Unusable {
    most: Option<NonZeroU32>,
    found: Mutex<InARow>,
}

#[derive(Debug, Default)]
struct InARow {
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
        let mut found = locked(&self.found);
        if ReplyCounts::is_read(status) {
            (*in_episode, found.in_a_row) = (0, 0);
            return false;
        }
        *in_episode = in_episode.saturating_add(1);
        found.in_a_row = found.in_a_row.saturating_add(1);
        let in_a_row = found.in_a_row.max(*in_episode);
        let is_over = self.most.is_some_and(|most| in_a_row >= most.get());
        if is_over && found.given_up.is_none() {
            let last = UnreadableReply::new(subject, key, t, row, status);
            found.given_up = Some(GivenUp { model: subject.model.clone(), in_a_row, last });
        }
        is_over
    }

    pub(super) fn given_up(&self) -> Option<GivenUp> {
        locked(&self.found).given_up.clone()
    }
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::{Replies, SHOWN, Unusable, beginning};
    use crate::plan::{Key, Subject};
    use mirrorstats_experiment::Experiment;
    use mirrorstats_trace::episodes::episode::{Extra, Step};

    fn row(status: &str, reply: Option<&str>) -> Step {
        let extra =
            Extra { reply_status: Some(status.to_owned()), reply: reply.map(str::to_owned), ..Extra::default() };
        Step { action: None, self_color: None, selected_cube: None, mirror_visible: false, extra }
    }

    #[test]
    fn one_unusable_reply_is_printed_and_the_earliest_is_reported() {
        let replies = Replies::default();
        let key = |run| Key::first(Experiment::E1, 1, run);
        assert_eq!(replies.add(&Subject::for_model("m"), &key(2), 1, &row("ok", None)), None);
        assert_eq!(replies.answer().first_unreadable, None);
        let told = replies.add(&Subject::for_model("m"), &key(2), 3, &row("parse_failed", Some("later"))).unwrap();
        assert_eq!((told.step, told.text.as_deref()), (3, Some("later")));
        assert_eq!(replies.add(&Subject::for_model("m"), &key(1), 9, &row("refusal", Some(" \n"))), None);
        assert_eq!(replies.add(&Subject::for_model("m"), &key(1), 10, &row("parse_failed", None)), None);
        let answer = replies.answer();
        let first = answer.first_unreadable.unwrap();
        assert_eq!((first.episode_id.as_str(), first.step, first.text), ("E1/m/s1/r1", 9, None));
        assert_eq!((answer.counts.replies, answer.counts.to_string().as_str()), (4, "parse_failed 2, refusal 1"));
    }

    #[test]
    fn a_text_is_shown_on_one_line_and_cut() {
        assert_eq!(beginning(" I go\n\u{1b}[31mon. "), "I go\\u{a}\\u{1b}[31mon.");
        let long = beginning(&"\u{e9}".repeat(SHOWN + 1));
        assert_eq!((long.chars().count(), long.ends_with("...")), (SHOWN + 3, true));
        assert!(beginning(&"\u{1b}".repeat(1_000)).len() <= SHOWN + 3);
        assert!(!beginning(&"x".repeat(SHOWN)).ends_with("..."));
    }

    fn said(status: &str) -> Step {
        let reply = Some("I go \u{1b}on.".to_owned());
        Step { extra: Extra { reply_status: Some(status.to_owned()), reply, ..Extra::default() }, ..Step::default() }
    }

    /// Adds replies of these episodes and statuses; returns the number after which the recording stops.
    fn stops_after(most: u32, replies: &[(i32, &str)]) -> (Option<usize>, Unusable) {
        let unusable = Unusable::new(NonZeroU32::new(most));
        let mut in_episodes = [0; 4];
        let add = |(run, status): &(i32, &str)| {
            let key = Key::first(Experiment::E1, 1, *run);
            unusable.add(
                &Subject::for_model("m"),
                &key,
                7,
                &said(status),
                &mut in_episodes[usize::try_from(*run).unwrap()],
            )
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
