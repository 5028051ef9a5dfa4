//! Reads and sets the field of an [`Episode`] behind a column, as a [`Value`].

use arrow::array::{Array as _, ArrayRef, AsArray as _};
use arrow::datatypes::{DataType, Float64Type, Int32Type, Int64Type};

use crate::episodes::episode::{Action, Episode};

/// A value of a column in one of the four types that readers see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value<'a> {
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(&'a str),
}

/// The value at a row of an array of 64-bit numbers, truth values or texts; `None` for null.
pub(crate) fn value_at(values: &ArrayRef, row: usize) -> Option<Value<'_>> {
    values.is_valid(row).then(|| match values.data_type() {
        DataType::Boolean => Value::Bool(values.as_boolean().value(row)),
        DataType::Int64 => Value::Int(values.as_primitive::<Int64Type>().value(row)),
        DataType::Float64 => Value::Float(values.as_primitive::<Float64Type>().value(row)),
        DataType::Utf8 => Value::Text(values.as_string::<i32>().value(row)),
        _ => {
            let texts = values.as_dictionary::<Int32Type>();
            Value::Text(texts.values().as_string::<i32>().value(texts.key(row).unwrap_or_default()))
        }
    })
}

/// The field behind a column at a step index (0-based); a field of the episode is the same at all steps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Access {
    pub(crate) get: fn(&Episode, usize) -> Option<Value<'_>>,
    /// Sets the value. Returns false and changes nothing if the field cannot hold it.
    pub(crate) set: fn(&mut Episode, usize, Option<Value<'_>>) -> bool,
}

/// The field behind the column of this name. The timestep follows from the row; values of unknown names are not kept.
pub(super) fn access(name: &str) -> Access {
    const T: Access = Access { get: |_, at| i64::try_from(at).ok().map(|at| Value::Int(at + 1)), set: |_, _, _| true };
    const NONE: Access = Access { get: |_, _| None, set: |_, _, _| false };
    match name {
        "t" => T,
        name => FIELDS.iter().find(|(field, _)| *field == name).map_or(NONE, |(_, access)| *access),
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
        participant episode_hash start_distance shown_color
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

/// Non-nullable and nullable fields.
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
