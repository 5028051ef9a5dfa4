//! The room from above: the shapes of each step, each told once.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::error::ViewError;
use super::filter::{Query, required};
use super::snapshot::{Opened, Snapshot};
use exact::escape::visible;
use trace::log::frames::Shape;

pub(super) fn answer(snapshot: &Snapshot, query: &Query) -> Result<Value, ViewError> {
    of(snapshot, &snapshot.episode(required(query, "id")?)?)
}

pub(super) fn of(snapshot: &Snapshot, opened: &Opened) -> Result<Value, ViewError> {
    let by_step = snapshot.shapes(opened)?;
    let (mut places, mut shapes) = (BTreeMap::new(), Vec::new());
    let mut place = |shape: &Shape| {
        let told = told(shape);
        *places.entry(told.to_string()).or_insert_with(|| {
            shapes.push(told);
            shapes.len() - 1
        })
    };
    let steps: Vec<Vec<usize>> = (1..=opened.episode.steps.len())
        .map(|t| by_step.get(&t).map(|shapes| shapes.iter().map(&mut place).collect()).unwrap_or_default())
        .collect();
    Ok(json!({"shapes": shapes, "steps": steps}))
}

fn told(shape: &Shape) -> Value {
    json!({
        "name": visible(&shape.name),
        "outline": shape.outline.iter().map(|at| at.map(thousandths)).collect::<Vec<_>>(),
        "radius": shape.radius.map(thousandths),
        "rgba": shape.rgba.map(thousandths),
        "height": thousandths(shape.height),
    })
}

/// A millimetre is finer than a pixel.
fn thousandths(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}
