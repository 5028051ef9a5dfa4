//! The room from above, step by step, for a picture of a few hundred pixels.
//!
//! Rule: the size of the answer is bounded for any number of steps and shapes. Coordinates are whole centimetres, a
//! shape that does not move is sent once, and steps are skipped if too many shapes move.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use crate::filter::{Query, required};
use crate::{Snapshot, ViewError};
use mirrorstats_exact::escape::visible;
use mirrorstats_log::frames::{SceneShape, hull};

/// The maximum number of distinct shapes in an answer, about 600 kB.
const MOST: usize = 12_000;

pub(crate) fn answer(snapshot: &Snapshot, query: &Query) -> Result<Value, ViewError> {
    let opened = snapshot.episode(required(query, "id")?)?;
    // The episode's page reports an unreadable log, and its frame a failed replay.
    let mut map = Map::default();
    Ok(match snapshot.each_shapes(&opened, &mut |t, shapes| map.add(t, shapes)) {
        Ok(()) => map.into_json(opened.episode.steps.len()),
        Err(_) => Map::default().into_json(0),
    })
}

/// All that is drawn of a shape, in centimetres: name, paint, height, radius, then the corners.
type Drawn = Vec<i64>;

#[derive(Debug)]
pub(crate) struct Map {
    /// The interval of steps with shapes.
    every: usize,
    names: Vec<String>,
    paints: Vec<[i64; 4]>,
    shapes: BTreeMap<Drawn, usize>,
    steps: BTreeMap<usize, Vec<usize>>,
}

impl Default for Map {
    fn default() -> Self {
        Self { every: 1, names: Vec::new(), paints: Vec::new(), shapes: BTreeMap::new(), steps: BTreeMap::new() }
    }
}

impl Map {
    pub fn add(&mut self, t: usize, shapes: &[SceneShape]) {
        if !(t - 1).is_multiple_of(self.every) || shapes.len() > MOST {
            return;
        }
        let ids = from_above(shapes).iter().map(|shape| self.id(shape)).collect();
        self.steps.insert(t, ids);
        while self.shapes.len() > MOST && self.steps.len() > 1 {
            self.every *= 2;
            self.thin();
        }
    }

    fn id(&mut self, shape: &SceneShape) -> usize {
        let name = place(&mut self.names, visible(&shape.name));
        let [r, g, b, a] = shape.rgba;
        let paint = place(&mut self.paints, [whole(r * 255.0), whole(g * 255.0), whole(b * 255.0), whole(a * 100.0)]);
        let mut drawn = vec![name, paint, centimetres(shape.height), shape.radius.map_or(0, centimetres)];
        drawn.extend(shape.outline.iter().flatten().map(|at| centimetres(*at)));
        let next = self.shapes.len();
        *self.shapes.entry(drawn).or_insert(next)
    }

    /// Removes the steps that are no longer needed, and the shapes that only they used.
    fn thin(&mut self) {
        let every = self.every;
        self.steps.retain(|t, _| (t - 1).is_multiple_of(every));
        let kept: BTreeSet<usize> = self.steps.values().flatten().copied().collect();
        let places: BTreeMap<usize, usize> = kept.into_iter().enumerate().map(|(new, old)| (old, new)).collect();
        self.shapes.retain(|_, at| places.get(at).map(|new| *at = *new).is_some());
        self.steps.values_mut().flatten().for_each(|at| *at = places[at]);
    }

    pub fn into_json(self, length: usize) -> Value {
        let mut shapes: Vec<(usize, Drawn)> = self.shapes.into_iter().map(|(drawn, at)| (at, drawn)).collect();
        shapes.sort_unstable();
        let shapes: Vec<Drawn> = shapes.into_iter().map(|(_, drawn)| drawn).collect();
        let mut counts = vec![0; shapes.len()];
        self.steps.values().flatten().for_each(|at| counts[*at] += 1);
        let stays = |at: &usize| counts[*at] == self.steps.len();
        let still: Vec<usize> = (0..shapes.len()).filter(stays).collect();
        let moving = |t: usize| self.steps.get(&t).map(|ids| ids.iter().copied().filter(|at| !stays(at)).collect());
        let steps: Vec<Option<Vec<usize>>> = (1..=length).step_by(self.every).map(moving).collect();
        json!({
            "every": self.every, "names": self.names, "paints": self.paints, "shapes": shapes, "still": still, "steps": steps,
        })
    }
}

/// The shapes with each body reduced to its outline and head: its fifty parts are a few pixels in size.
fn from_above(shapes: &[SceneShape]) -> Vec<SceneShape> {
    let mut parts: BTreeMap<&str, Vec<&SceneShape>> = BTreeMap::new();
    let mut all = Vec::new();
    for shape in shapes {
        match shape.name.split_once('_') {
            Some((body, part)) if body.starts_with("agent") && !part.contains("head") => {
                parts.entry(body).or_default().push(shape);
            }
            _ => all.push(shape.clone()),
        }
    }
    all.extend(parts.into_iter().filter_map(|(body, parts)| {
        let largest = parts.iter().max_by(|a, b| spread(a).total_cmp(&spread(b)))?;
        let outline = hull(parts.iter().flat_map(|part| corners(part)).collect());
        let height = parts.iter().map(|part| part.height).sum::<f64>() / f64::from(u32::try_from(parts.len()).ok()?);
        Some(SceneShape { name: body.to_owned(), outline, radius: None, rgba: largest.rgba, height })
    }));
    all
}

/// The largest distance from a part's centre to its outline.
fn spread(part: &SceneShape) -> f64 {
    let [first, ..] = part.outline[..] else { return 0.0 };
    let far = |at: &[f64; 2]| (at[0] - first[0]).hypot(at[1] - first[1]);
    part.radius.unwrap_or_default().max(part.outline.iter().map(far).fold(0.0, f64::max) / 2.0)
}

/// The corners of a part; a round part gets eight.
fn corners(part: &SceneShape) -> Vec<[f64; 2]> {
    let Some(radius) = part.radius else { return part.outline.clone() };
    let around = |at: &[f64; 2]| {
        let [x, y] = *at;
        (0..8).map(move |eighth| {
            let (sin, cos) = (std::f64::consts::FRAC_PI_4 * f64::from(eighth)).sin_cos();
            [x + radius * cos, y + radius * sin]
        })
    };
    part.outline.iter().flat_map(around).collect()
}

fn place<T: PartialEq>(list: &mut Vec<T>, value: T) -> i64 {
    let at = list.iter().position(|known| *known == value).unwrap_or_else(|| {
        list.push(value);
        list.len() - 1
    });
    i64::try_from(at).unwrap_or_default()
}

/// A centimetre is finer than a pixel.
fn centimetres(metres: f64) -> i64 {
    whole(metres * 100.0)
}

#[expect(clippy::cast_possible_truncation, reason = "a place beyond the numbers is at their end")]
fn whole(value: f64) -> i64 {
    value.round() as i64
}

#[cfg(test)]
mod tests {
    use super::{MOST, Map};
    use mirrorstats_log::frames::SceneShape;

    fn shape(name: &str, x: f64) -> SceneShape {
        SceneShape {
            name: name.into(),
            outline: vec![[x, 0.0]],
            radius: Some(0.1),
            rgba: [1.0, 0.0, 0.0, 1.0],
            height: 0.5,
        }
    }

    #[test]
    fn a_body_is_drawn_as_an_outline_and_a_head() {
        let mut map = Map::default();
        map.add(1, &[shape("agent0_head", 1.0), shape("agent0_left_foot", 0.5), shape("agent0_torso", 1.0)]);
        let entry = map.into_json(1);
        assert_eq!(entry["names"], serde_json::json!(["agent0_head", "agent0"]));
        let outline = entry["shapes"][1].as_array().unwrap()[4..].iter().step_by(2).map(|x| x.as_i64().unwrap());
        assert_eq!((outline.clone().min(), outline.max()), (Some(40), Some(110)));
    }

    #[test]
    fn shapes_that_do_not_move_are_listed_once() {
        let mut map = Map::default();
        for t in 1..=3_u32 {
            map.add(t as usize, &[shape("cube0", 1.0), shape("agent0", f64::from(t))]);
        }
        let entry = map.into_json(3);
        assert_eq!(entry["still"], serde_json::json!([0]));
        assert_eq!(entry["steps"], serde_json::json!([[1], [2], [3]]));
        assert_eq!(entry["shapes"][2], serde_json::json!([1, 0, 50, 10, 200, 0]));
    }

    #[test]
    fn with_too_many_shapes_some_steps_are_left_out() {
        let mut map = Map::default();
        let length = 3 * MOST;
        for t in 1..=length {
            let x = f64::from(u32::try_from(t).unwrap());
            map.add(t, &[shape("cube0", 1.0), shape("agent0", x)]);
        }
        let entry = map.into_json(length);
        let (every, shapes) = (entry["every"].as_u64().unwrap(), entry["shapes"].as_array().unwrap());
        assert!(every > 1 && shapes.len() <= MOST + 1, "{every}, {}", shapes.len());
        let last = entry["steps"].as_array().unwrap().last().unwrap()[0].as_u64().unwrap();
        let t = (entry["steps"].as_array().unwrap().len() as u64 - 1) * every + 1;
        assert_eq!(shapes[usize::try_from(last).unwrap()][4], 100 * t);
    }
}
