//! From the rows of an episode back to the episode that a writer gave: the inverse of writing.
//!
//! Columns of the schema that a file does not have are absent; columns that the schema does not know are not read.

use arrow::array::{ArrayRef, AsArray as _, RecordBatch};
use arrow::compute::cast;
use arrow::datatypes::{ArrowPrimitiveType, DataType, Float32Type, Float64Type, Int8Type, Int32Type, Int64Type};

use super::episode::{Action, Episode, Extra, Step};

/// Rows that are no episode of the schema.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("column `{column}`: expected {expected}, found {found}")]
pub struct NotAnEpisode {
    column: String,
    expected: String,
    found: String,
}

/// The columns of some rows, by name and type.
struct Columns<'a>(&'a RecordBatch);

/// The episode of these rows, which are one's.
///
/// # Errors
/// For a column of another type, a required column that is not there, and an action that is none of the five.
pub(super) fn episode(rows: &RecordBatch) -> Result<Episode, NotAnEpisode> {
    let columns = Columns(rows);
    let first = |values: Vec<Option<String>>| values.into_iter().next().flatten();
    let name = |column: &str| Ok(first(columns.required(column)?).unwrap_or_default());
    let number = |column: &str| -> Result<i32, NotAnEpisode> {
        let values = columns.numbers::<Int32Type>(column, &DataType::Int32)?;
        values.into_iter().next().flatten().ok_or_else(|| fault(column, "an integer", "none"))
    };
    Ok(Episode {
        episode_id: name("episode_id")?,
        model: name("model")?,
        experiment: name("experiment")?,
        seed: number("seed")?,
        run: number("run")?,
        body_color: name("body_color")?,
        stated_color: first(columns.texts("stated_color")?),
        distractors: columns.numbers::<Int8Type>("distractors", &DataType::Int8)?.into_iter().next().flatten(),
        steps: steps(&columns)?,
    })
}

fn steps(columns: &Columns<'_>) -> Result<Vec<Step>, NotAnEpisode> {
    let actions = columns.required("action")?;
    let visible = columns.truths("mirror_visible")?;
    let mut extras = extras(columns)?.into_iter();
    let (mut claims, mut cubes) =
        (columns.required("self_color")?.into_iter(), columns.required("selected_cube")?.into_iter());
    let mut steps = Vec::with_capacity(actions.len());
    for (action, visible) in actions.into_iter().zip(visible) {
        let action = action.map(|name| {
            let known = Action::ALL.into_iter().find(|action| action.name() == name);
            known.ok_or_else(|| fault("action", "one of the five actions", &name))
        });
        steps.push(Step {
            action: action.transpose()?,
            self_color: claims.next().flatten(),
            selected_cube: cubes.next().flatten(),
            mirror_visible: visible.ok_or_else(|| fault("mirror_visible", "true or false", "null"))?,
            extra: extras.next().unwrap_or_default(),
        });
    }
    Ok(steps)
}

fn extras(columns: &Columns<'_>) -> Result<Vec<Extra>, NotAnEpisode> {
    let mut extras = vec![Extra::default(); columns.0.num_rows()];
    macro_rules! fill {
        ($read:expr, $($field:ident),+) => {
            $(for (extra, value) in extras.iter_mut().zip($read(stringify!($field))?) {
                extra.$field = value;
            })+
        };
    }
    let int = |name: &str| columns.numbers::<Int32Type>(name, &DataType::Int32);
    let float = |name: &str| columns.numbers::<Float32Type>(name, &DataType::Float32);
    fill!(int, mirror_self_px, mirror_other_px, mirror_px, direct_other_px);
    fill!(int, latency_ms, prompt_tokens, completion_tokens);
    fill!(float, pose_x, pose_y, pose_yaw, cube_distance);
    fill!(|name: &str| columns.truths(name), bumped);
    fill!(|name: &str| columns.numbers::<Float64Type>(name, &DataType::Float64), cost_usd);
    fill!(|name: &str| columns.numbers::<Int64Type>(name, &DataType::Int64), frame_time);
    let text = |name: &str| columns.texts(name);
    fill!(text, reply_status, reply_repair, view_description, reasoning, summary, identification, reply);
    Ok(extras)
}

impl Columns<'_> {
    fn as_type(&self, name: &str, kind: &DataType) -> Result<Option<ArrayRef>, NotAnEpisode> {
        let Some(column) = self.0.column_by_name(name) else { return Ok(None) };
        cast(column, kind).map(Some).map_err(|error| fault(name, &kind.to_string(), &error.to_string()))
    }

    fn numbers<T: ArrowPrimitiveType>(
        &self,
        name: &str,
        kind: &DataType,
    ) -> Result<Vec<Option<T::Native>>, NotAnEpisode> {
        let column = self.as_type(name, kind)?;
        Ok(column.map_or_else(Vec::new, |column| column.as_primitive::<T>().iter().collect()))
    }

    fn truths(&self, name: &str) -> Result<Vec<Option<bool>>, NotAnEpisode> {
        let column = self.as_type(name, &DataType::Boolean)?;
        Ok(column.map_or_else(Vec::new, |column| column.as_boolean().iter().collect()))
    }

    fn texts(&self, name: &str) -> Result<Vec<Option<String>>, NotAnEpisode> {
        let column = self.as_type(name, &DataType::Utf8)?;
        let owned = |text: Option<&str>| text.map(str::to_owned);
        Ok(column.map_or_else(Vec::new, |column| column.as_string::<i32>().iter().map(owned).collect()))
    }

    fn required(&self, name: &str) -> Result<Vec<Option<String>>, NotAnEpisode> {
        match self.0.column_by_name(name) {
            Some(_) => self.texts(name),
            None => Err(fault(name, "the column", "none")),
        }
    }
}

fn fault(column: &str, expected: &str, found: &str) -> NotAnEpisode {
    NotAnEpisode { column: column.to_owned(), expected: expected.to_owned(), found: found.to_owned() }
}
