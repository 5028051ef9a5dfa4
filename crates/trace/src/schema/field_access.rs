//! Reads and sets the field of an [`Episode`] behind a column, as a [`Value`].

use crate::episode::{Action, Episode};

/// A value of a column in one of the four types that readers see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value<'a> {
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(&'a str),
}

/// The field behind a column, at the step of an index (0-based); a field of the episode is the same at all of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Access {
    /// The value; `None` for null.
    pub(crate) get: fn(&Episode, usize) -> Option<Value<'_>>,
    /// Puts a value there. Says no, and changes nothing, where the field cannot hold it.
    pub(crate) set: fn(&mut Episode, usize, Option<Value<'_>>) -> bool,
}

/// A field that a column is made of.
pub(super) trait Field {
    fn value(&self) -> Option<Value<'_>>;

    fn put(&mut self, value: Option<Value<'_>>) -> bool;
}

/// Fields of a type, where a null is none of their values, and fields that may have one.
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

/// A number that a field of 32 bits had, or a reader's column of them.
#[expect(clippy::cast_possible_truncation, reason = "the column holds 32 bits")]
fn narrowed(value: f64) -> f32 {
    value as f32
}
