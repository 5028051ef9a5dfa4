//! Reads and sets the field of an [`Episode`] behind a column, as a [`Value`].

use std::collections::HashMap;
use std::sync::LazyLock;

use crate::episodes::answers::{Answered, is_answer};
use crate::episodes::episode::{Action, Episode};
use crate::schema::{Column, Value};

/// The field behind a column at a step index (0-based); a field of the episode is the same at all steps.
#[derive(Clone, Copy)]
struct Access {
    get: fn(&Episode, usize) -> Option<Value<'_>>,
    set: fn(&mut Episode, usize, Option<Value<'_>>) -> bool,
}

/// The timestep follows from the row; values of unknown names are not kept.
fn access(name: &str) -> Access {
    const T: Access = Access { get: |_, at| i64::try_from(at).ok().map(|at| Value::Int(at + 1)), set: |_, _, _| true };
    const NONE: Access = Access { get: |_, _| None, set: |_, _, _| false };
    static BY_NAME: LazyLock<HashMap<&str, Access>> =
        LazyLock::new(|| FIELDS.iter().copied().chain([("t", T)]).collect());
    BY_NAME.get(name).copied().unwrap_or(NONE)
}

impl Column {
    pub fn of_steps<'a>(&self, episode: &'a Episode) -> impl Iterator<Item = Option<Value<'a>>> {
        let (get, answer) = (access(self.name).get, is_answer(self.name).then_some(self.name));
        (0..episode.steps.len()).map(move |at| match answer {
            Some(name) => episode.steps[at].extra.answers.get(name).map(Answered::value),
            None => get(episode, at),
        })
    }

    /// Sets the value at a step index; returns false and changes nothing if the field cannot hold it.
    pub(crate) fn put(&self, episode: &mut Episode, at: usize, value: Option<Value<'_>>) -> bool {
        (access(self.name).set)(episode, at, value)
    }
}

macro_rules! fields {
    ($($episode:ident, $at:ident => $place:expr, [$($field:ident)+];)+) => {
        &[$($((stringify!($field), Access {
            get: |$episode, $at| $place.$field.value(),
            set: |$episode, $at, value| $place.$field.put(value),
        }),)+)+]
    };
}

const FIELDS: &[(&str, Access)] = fields! {
    episode, _at => episode, [
        episode_id model experiment seed run body_color stated_color distractors condition scene repetition decision fingerprint
        participant episode_hash start_distance unreadable_answers shown_color
    ];
    episode, at => episode.steps[at], [action self_color selected_cube mirror_visible];
    episode, at => episode.steps[at].extra, [
        mirror_self_px mirror_other_px mirror_px direct_other_px pose_x pose_y pose_yaw bumped cube_distance reply_status
        reply_repair reply_fault view_description reasoning summary identification reply latency_ms prompt_tokens
        completion_tokens cost_usd frame_time frame_digest mark_color mark_report mirror_mark_px
        mirror_double_px shown_px pane1_body_px pane2_body_px pane3_body_px pane4_body_px mark1_px mark2_px mark3_px mark4_px
        target_distance answer answer_truth
    ];
};

trait Field {
    fn value(&self) -> Option<Value<'_>>;

    fn put(&mut self, value: Option<Value<'_>>) -> bool;
}

macro_rules! field {
    ($type:ty, $held:pat => $made:expr, $own:ident => $value:expr) => {
        impl Field for $type {
            fn value(&self) -> Option<Value<'_>> {
                let $own = self;
                Some($value)
            }

            fn put(&mut self, value: Option<Value<'_>>) -> bool {
                let made: Option<$type> = if let Some($held) = value { $made } else { None };
                made.map(|made| *self = made).is_some()
            }
        }

        impl Field for Option<$type> {
            fn value(&self) -> Option<Value<'_>> {
                self.as_ref().map(|$own| $value)
            }

            fn put(&mut self, value: Option<Value<'_>>) -> bool {
                let made: Option<$type> = if let Some($held) = value { $made } else { None };
                let fits = made.is_some() == value.is_some();
                if fits {
                    *self = made;
                }
                fits
            }
        }
    };
}

field!(bool, Value::Bool(value) => Some(value), own => Value::Bool(*own));
field!(i8, Value::Int(value) => i8::try_from(value).ok(), own => Value::Int((*own).into()));
field!(i32, Value::Int(value) => i32::try_from(value).ok(), own => Value::Int((*own).into()));
field!(i64, Value::Int(value) => Some(value), own => Value::Int(*own));
field!(f32, Value::Float(value) => Some(narrowed(value)), own => Value::Float((*own).into()));
field!(f64, Value::Float(value) => Some(value), own => Value::Float(*own));
field!(String, Value::Text(value) => Some(value.to_owned()), own => Value::Text(own));
field!(Action, Value::Text(value) => Action::named(value), own => Value::Text(own.name()));

/// A number from a 32-bit field, or from a reader's column of them.
#[expect(clippy::cast_possible_truncation, reason = "the column holds 32 bits")]
fn narrowed(value: f64) -> f32 {
    value as f32
}
