//! Answers of the command line: the output of `--json`, and text for people.

use pyo3::prelude::*;
use serde::Serialize;

use crate::error;

/// The JSON of an answer and its text, for `mirrorstats._answer`.
pub type Answer = (String, String);

/// An answer with its text on the command line.
pub fn of(answer: &impl Serialize, text: String) -> PyResult<Answer> {
    let json = serde_json::to_string(answer).map_err(error::of_input)?;
    Ok((json, text))
}
