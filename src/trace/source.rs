//! Where each column of the schema comes from: the field of an [`Episode`] behind a column's name.

use std::sync::Arc;

use arrow::array::{
    ArrayRef, BooleanBuilder, Float32Builder, Float64Builder, Int8Builder, Int32Builder, Int64Builder, StringBuilder,
};
use arrow::datatypes::{DataType, Field};

use super::colors;
use super::episode::{Action, Episode};
use super::schema::{Column, Stored};
use crate::base::escape::visible;

/// How to get a column's value in an episode at the step of an index (0-based).
#[derive(Clone, Copy)]
pub(super) enum Source {
    Bool(fn(&Episode, usize) -> Option<bool>),
    Int8(fn(&Episode, usize) -> Option<i8>),
    Int32(fn(&Episode, usize) -> Option<i32>),
    Int64(fn(&Episode, usize) -> Option<i64>),
    Float32(fn(&Episode, usize) -> Option<f32>),
    Float64(fn(&Episode, usize) -> Option<f64>),
    String(fn(&Episode, usize) -> Option<&str>),
}

impl Source {
    /// The source of the column of this name; `None` for a name that the schema does not have.
    pub(super) fn of(name: &str) -> Option<Self> {
        Self::of_episode(name).or_else(|| Self::of_step(name)).or_else(|| Self::of_reply(name))
    }

    fn of_episode(name: &str) -> Option<Self> {
        Some(match name {
            "episode_id" => Self::String(|e, _| Some(&e.episode_id)),
            "model" => Self::String(|e, _| Some(&e.model)),
            "experiment" => Self::String(|e, _| Some(&e.experiment)),
            "seed" => Self::Int32(|e, _| Some(e.seed)),
            "run" => Self::Int32(|e, _| Some(e.run)),
            "body_color" => Self::String(|e, _| Some(&e.body_color)),
            "stated_color" => Self::String(|e, _| e.stated_color.as_deref()),
            "distractors" => Self::Int8(|e, _| e.distractors),
            _ => return None,
        })
    }

    fn of_step(name: &str) -> Option<Self> {
        Some(match name {
            "t" => Self::Int32(|_, i| i32::try_from(i + 1).ok()),
            "action" => Self::String(|e, i| e.steps[i].action.map(Action::name)),
            "self_color" => Self::String(|e, i| e.steps[i].self_color.as_deref()),
            "selected_cube" => Self::String(|e, i| e.steps[i].selected_cube.as_deref()),
            "mirror_visible" => Self::Bool(|e, i| Some(e.steps[i].mirror_visible)),
            "mirror_self_px" => Self::Int32(|e, i| e.steps[i].extra.mirror_self_px),
            "mirror_other_px" => Self::Int32(|e, i| e.steps[i].extra.mirror_other_px),
            "mirror_px" => Self::Int32(|e, i| e.steps[i].extra.mirror_px),
            "direct_other_px" => Self::Int32(|e, i| e.steps[i].extra.direct_other_px),
            "pose_x" => Self::Float32(|e, i| e.steps[i].extra.pose_x),
            "pose_y" => Self::Float32(|e, i| e.steps[i].extra.pose_y),
            "pose_yaw" => Self::Float32(|e, i| e.steps[i].extra.pose_yaw),
            "bumped" => Self::Bool(|e, i| e.steps[i].extra.bumped),
            "cube_distance" => Self::Float32(|e, i| e.steps[i].extra.cube_distance),
            "frame_time" => Self::Int64(|e, i| e.steps[i].extra.frame_time),
            _ => return None,
        })
    }

    fn of_reply(name: &str) -> Option<Self> {
        Some(match name {
            "reply_status" => Self::String(|e, i| e.steps[i].extra.reply_status.as_deref()),
            "reply_repair" => Self::String(|e, i| e.steps[i].extra.reply_repair.as_deref()),
            "view_description" => Self::String(|e, i| e.steps[i].extra.view_description.as_deref()),
            "reasoning" => Self::String(|e, i| e.steps[i].extra.reasoning.as_deref()),
            "summary" => Self::String(|e, i| e.steps[i].extra.summary.as_deref()),
            "identification" => Self::String(|e, i| e.steps[i].extra.identification.as_deref()),
            "reply" => Self::String(|e, i| e.steps[i].extra.reply.as_deref()),
            "latency_ms" => Self::Int32(|e, i| e.steps[i].extra.latency_ms),
            "prompt_tokens" => Self::Int32(|e, i| e.steps[i].extra.prompt_tokens),
            "completion_tokens" => Self::Int32(|e, i| e.steps[i].extra.completion_tokens),
            "cost_usd" => Self::Float64(|e, i| e.steps[i].extra.cost_usd),
            _ => return None,
        })
    }

    /// What is wrong with the column's values in the episode, if anything is: expected and found.
    pub(super) fn fault(self, column: &Column, episode: &Episode) -> Option<(String, String)> {
        let mut steps = 0..episode.steps.len();
        let negative = match self {
            Self::String(get) => return steps.find_map(|i| text_fault(column, get(episode, i)?)),
            _ if !column.counts() => return None,
            Self::Int8(get) => steps.find_map(|i| get(episode, i).filter(|v| *v < 0)).map(|v| v.to_string()),
            Self::Int32(get) => steps.find_map(|i| get(episode, i).filter(|v| *v < 0)).map(|v| v.to_string()),
            Self::Float64(get) => {
                steps.find_map(|i| get(episode, i).filter(|v| *v < 0.0 || v.is_nan())).map(|v| v.to_string())
            }
            Self::Bool(_) | Self::Int64(_) | Self::Float32(_) => None,
        };
        negative.map(|found| (format!("`{}` not to be below zero", column.name), found))
    }

    /// Whether any step of the episode has a value.
    pub(super) fn has_value(self, episode: &Episode) -> bool {
        let mut steps = 0..episode.steps.len();
        match self {
            Self::Bool(get) => steps.any(|i| get(episode, i).is_some()),
            Self::Int8(get) => steps.any(|i| get(episode, i).is_some()),
            Self::Int32(get) => steps.any(|i| get(episode, i).is_some()),
            Self::Int64(get) => steps.any(|i| get(episode, i).is_some()),
            Self::Float32(get) => steps.any(|i| get(episode, i).is_some()),
            Self::Float64(get) => steps.any(|i| get(episode, i).is_some()),
            Self::String(get) => steps.any(|i| get(episode, i).is_some()),
        }
    }
}

fn text_fault(column: &Column, text: &str) -> Option<(String, String)> {
    let expected = if !column.values.is_empty() && !column.values.contains(&text) {
        format!("`{}` to be one of {}", column.name, column.values.join(", "))
    } else if text.is_empty() && column.names() {
        format!("`{}` not to be empty", column.name)
    } else {
        let color = colors::column(column.name).filter(|color| !color.may_hold(text, None))?;
        format!("`{}` to be {}", column.name, color.expected(None))
    };
    Some((expected, format!("`{}`", visible(text))))
}

/// The values of one column, gathered episode by episode.
pub(super) enum Gathered {
    Bool(BooleanBuilder, fn(&Episode, usize) -> Option<bool>),
    Int8(Int8Builder, fn(&Episode, usize) -> Option<i8>),
    Int32(Int32Builder, fn(&Episode, usize) -> Option<i32>),
    Int64(Int64Builder, fn(&Episode, usize) -> Option<i64>),
    Float32(Float32Builder, fn(&Episode, usize) -> Option<f32>),
    Float64(Float64Builder, fn(&Episode, usize) -> Option<f64>),
    String(StringBuilder, fn(&Episode, usize) -> Option<&str>),
}

impl Gathered {
    pub(super) fn new(source: Source) -> Self {
        match source {
            Source::Bool(get) => Self::Bool(BooleanBuilder::new(), get),
            Source::Int8(get) => Self::Int8(Int8Builder::new(), get),
            Source::Int32(get) => Self::Int32(Int32Builder::new(), get),
            Source::Int64(get) => Self::Int64(Int64Builder::new(), get),
            Source::Float32(get) => Self::Float32(Float32Builder::new(), get),
            Source::Float64(get) => Self::Float64(Float64Builder::new(), get),
            Source::String(get) => Self::String(StringBuilder::new(), get),
        }
    }

    /// Adds a value for each step.
    pub(super) fn extend(&mut self, episode: &Episode) {
        let steps = 0..episode.steps.len();
        match self {
            Self::Bool(values, get) => steps.for_each(|i| values.append_option(get(episode, i))),
            Self::Int8(values, get) => steps.for_each(|i| values.append_option(get(episode, i))),
            Self::Int32(values, get) => steps.for_each(|i| values.append_option(get(episode, i))),
            Self::Int64(values, get) => steps.for_each(|i| values.append_option(get(episode, i))),
            Self::Float32(values, get) => steps.for_each(|i| values.append_option(get(episode, i))),
            Self::Float64(values, get) => steps.for_each(|i| values.append_option(get(episode, i))),
            Self::String(values, get) => steps.for_each(|i| values.append_option(get(episode, i))),
        }
    }

    /// The values so far; gathering starts anew.
    pub(super) fn take(&mut self) -> ArrayRef {
        match self {
            Self::Bool(values, _) => Arc::new(values.finish()),
            Self::Int8(values, _) => Arc::new(values.finish()),
            Self::Int32(values, _) => Arc::new(values.finish()),
            Self::Int64(values, _) => Arc::new(values.finish()),
            Self::Float32(values, _) => Arc::new(values.finish()),
            Self::Float64(values, _) => Arc::new(values.finish()),
            Self::String(values, _) => Arc::new(values.finish()),
        }
    }
}

/// The column as a field of the file that the writer makes.
pub(super) fn field(column: &Column) -> Field {
    let stored = match column.stored {
        Stored::Bool => DataType::Boolean,
        Stored::Int8 => DataType::Int8,
        Stored::Int32 => DataType::Int32,
        Stored::Int64 => DataType::Int64,
        Stored::Float32 => DataType::Float32,
        Stored::Float64 => DataType::Float64,
        Stored::String => DataType::Utf8,
    };
    Field::new(column.name, stored, column.nullable)
}

#[cfg(test)]
mod tests {
    use super::{Gathered, Source, field};
    use crate::trace::schema::{COLUMNS, REPLY_REPAIR};

    #[test]
    fn every_column_has_a_source_of_its_type() {
        for column in COLUMNS.iter().chain([&REPLY_REPAIR]) {
            let source = Source::of(column.name).unwrap_or_else(|| panic!("{} has no source", column.name));
            assert_eq!(Gathered::new(source).take().data_type(), field(column).data_type(), "{}", column.name);
        }
    }
}
