//! Scores as numbers, by the rule of Inspect's own metrics (`value_to_float` in `scorer/_metric.py`).

use serde_json::{Map, Value, json};

use super::shape;
use crate::error::ImportError;
use crate::rows::Rows;

/// `score` of the first scorer, and a column for each. `later` are the scorers that the log lists after the first.
pub(super) fn columns(
    scores: &Value,
    later: &[String],
    part: &str,
    rows: &mut Rows<'_>,
) -> Result<Map<String, Value>, ImportError> {
    let mut columns = Map::new();
    columns.insert("score".to_owned(), Value::Null);
    let mut is_first = true;
    for (name, score) in scores.as_object().into_iter().flatten() {
        is_first &= !later.contains(name);
        shape(score, Value::is_object, "an object with `value` as each of the `scores`", part, rows)?;
        for (column, found) in parts(name, &score["value"]) {
            let value = json!(number(found));
            if value.is_null() && !found.is_null() {
                rows.notes.count(format!("scores without a number, of `{name}`"), 1);
            }
            if std::mem::take(&mut is_first) {
                columns["score"] = value.clone();
            }
            if columns.contains_key(&column) {
                rows.notes.count(format!("scores of a second scorer for the column `{column}`"), 1);
            } else {
                columns.insert(column, value);
            }
        }
    }
    Ok(columns)
}

fn parts<'v>(name: &str, value: &'v Value) -> Vec<(String, &'v Value)> {
    match value {
        Value::Object(parts) => parts.iter().map(|(key, part)| (format!("score_{name}_{key}"), part)).collect(),
        part => vec![(format!("score_{name}"), part)],
    }
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Bool(value) => Some(f64::from(u8::from(*value))),
        Value::String(text) => match text.as_str() {
            "C" => Some(1.0),
            "P" => Some(0.5),
            "I" | "N" => Some(0.0),
            text => match text.to_lowercase().as_str() {
                "yes" | "true" => Some(1.0),
                "no" | "false" => Some(0.0),
                text => python_float(text),
            },
        },
        value => value.as_f64(),
    }
}

/// The number that Python's `float` reads: white space around it, and single underscores between digits.
fn python_float(text: &str) -> Option<f64> {
    let text = text.trim();
    let is_digit = |at: Option<usize>| at.and_then(|at| text.as_bytes().get(at)).is_some_and(u8::is_ascii_digit);
    let mut underscores = text.match_indices('_').map(|(at, _)| at);
    let is_spelt = underscores.all(|at| is_digit(at.checked_sub(1)) && is_digit(Some(at + 1)));
    text.replace('_', "").parse().ok().filter(|number: &f64| is_spelt && number.is_finite())
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::number;

    #[test]
    fn scores_are_the_numbers_of_inspects_metrics() {
        for (value, expected) in [
            (json!("C"), Some(1.0)),
            (json!("P"), Some(0.5)),
            (json!("I"), Some(0.0)),
            (json!("N"), Some(0.0)),
            (json!("Yes"), Some(1.0)),
            (json!("TRUE"), Some(1.0)),
            (json!("no"), Some(0.0)),
            (json!("False"), Some(0.0)),
            (json!(true), Some(1.0)),
            (json!(false), Some(0.0)),
            (json!(-3), Some(-3.0)),
            (json!(0.25), Some(0.25)),
            (json!(" +1_000.5e-1\n"), Some(100.05)),
            (json!(".5"), Some(0.5)),
            (json!("5."), Some(5.0)),
        ] {
            assert_eq!(number(&value), expected, "{value}");
        }
        let others = ["c", "p", "n", " yes", "", "nan", "inf", "-Infinity", "1e999", "1__0", "_1", "1_", "0x1", "1,5"];
        for value in others.map(Value::from).into_iter().chain([json!(null), json!([1.0]), json!({ "a": 1.0 })]) {
            assert_eq!(number(&value), None, "{value}");
        }
    }
}
