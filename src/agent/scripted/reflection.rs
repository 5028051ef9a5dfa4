//! Which body in the mirror is one's own.
//!
//! One's own reflection is where nobody else's can be: as far behind the mirror as one stands before it, straight across.
//! When one steps aside it steps along, when one comes nearer it comes nearer by as much. So every new place is a test: the
//! trunk of a body must be drawn exactly where one's own would be. Another body that happens to be drawn there once does not
//! follow.
//!
//! Rule: a colour is one's own when the tests from several places agree on it. Nothing is concluded from a wall that has not
//! been seen to be a mirror.

use crate::agent::perception::View;
use crate::agent::perception::camera::Place;
use crate::agent::perception::paint;
use crate::base::palette::Color;

use super::room::{Room, Side};

/// A test that found a body where one's own would be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// The mirror's wall.
    pub side: Side,
    /// The colour of the body.
    pub color: Color,
    /// From where.
    pub place: Place,
}

/// Tests that agree before a colour is one's own.
const TESTS: usize = 3;
/// Places from which they were made.
const PLACES: usize = 2;
/// Heights of the trunk that the test looks at, m above the floor.
const TRUNK: (f64, f64) = (0.85, 1.30);
/// Half the width of what it looks at, m.
const HALF_TRUNK: f64 = 0.13;
/// Where, beside the trunk, there is no body, m from the middle.
const ASIDE: (f64, f64) = (0.42, 0.70);
/// Where, above the head, there is none, m above the floor.
const OVER: (f64, f64) = (1.75, 1.95);
/// Pixels of the trunk that can be told from noise.
const LEAST: usize = 40;

/// Where the head and the chest are, where a mark may show: heights above the floor and half of the width, m.
const PATCHES: [((f64, f64), f64); 2] = [((1.52, 1.63), 0.06), ((1.15, 1.29), 0.07)];
/// Pixels of a patch that can be told from noise, and its share of the place.
const PATCH: (usize, f64) = (6, 0.4);
/// Views that show the same patch before it is one.
const SIGHTINGS: usize = 2;

/// The tests so far.
#[derive(Clone, Debug, Default)]
pub struct Reflection {
    matches: Vec<Match>,
    patches: Vec<Color>,
}

/// A part of the picture: rows and columns, the last ones excluded.
#[derive(Clone, Copy)]
struct Window {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Reflection {
    /// Looks for one's own body in every mirror that is in view.
    pub fn see(&mut self, view: &View, room: &Room) {
        for side in Side::ALL {
            if !room.is_mirror(side, side.along(view.pose.place)) {
                continue;
            }
            let color = room.mirrored(side, view.pose.place).and_then(|double| body_at(view, double));
            self.matches.extend(color.map(|color| Match { side, color, place: view.pose.place }));
            if let (Some(color), Some(double)) = (color, room.mirrored(side, view.pose.place)) {
                self.patches.extend(patch_at(view, double, color));
            }
        }
    }

    /// The colour of one's own body, once the tests suffice.
    pub fn own_color(&self) -> Option<Color> {
        let mut counts: Vec<(usize, Color)> = Color::ALL
            .iter()
            .map(|color| (self.matches.iter().filter(|found| found.color == *color).count(), *color))
            .collect();
        counts.sort();
        let (count, color) = counts.pop()?;
        let agree = 3 * count >= 2 * self.matches.len();
        (count >= TESTS && agree && self.places(color) >= PLACES).then_some(color)
    }

    /// The colour of a patch on one's own body, once it was seen often enough; the one seen last where there are several.
    pub fn own_mark(&self) -> Option<Color> {
        let last = *self.patches.last()?;
        let is_tested = self.own_color().is_some_and(|own| own != last);
        let sightings = self.patches.iter().filter(|patch| **patch == last).count();
        (is_tested && sightings >= SIGHTINGS).then_some(last)
    }

    /// How many tests have found a body.
    pub const fn matches(&self) -> usize {
        self.matches.len()
    }

    fn places(&self, color: Color) -> usize {
        let mut places: Vec<Place> = Vec::new();
        for found in self.matches.iter().filter(|found| found.color == color) {
            if places.iter().all(|place| place.distance(found.place) > 0.1) {
                places.push(found.place);
            }
        }
        places.len()
    }
}

/// The colour of a body of one's own size whose axis is at `double`; `None` where there is none in view.
fn body_at(view: &View, double: Place) -> Option<Color> {
    let camera = &view.camera;
    let bearing = camera.bearing(double);
    if bearing.ahead < 0.5 {
        return None;
    }
    let (middle, scale) = (camera.column(bearing), camera.scale(bearing.ahead));
    let row = |height| camera.row(bearing.ahead, height);
    let window = |(from, to): (f64, f64), (low, high): (f64, f64)| Window {
        left: middle + from * scale,
        right: middle + to * scale,
        top: row(high),
        bottom: row(low),
    };
    let (color, share) = commonest(view, window((-HALF_TRUNK, HALF_TRUNK), TRUNK))?;
    let elsewhere = [
        window((-ASIDE.1, -ASIDE.0), TRUNK),
        window((ASIDE.0, ASIDE.1), TRUNK),
        window((-HALF_TRUNK, HALF_TRUNK), OVER),
    ];
    let alone = elsewhere.iter().all(|&beside| share_of(view, beside, color) < 0.4);
    (share > 0.6 && alone).then_some(color)
}

/// A colour on the head or the chest of the body at `double` that is not the body's.
fn patch_at(view: &View, double: Place, body: Color) -> Option<Color> {
    let bearing = view.camera.bearing(double);
    let (middle, scale) = (view.camera.column(bearing), view.camera.scale(bearing.ahead));
    PATCHES.iter().find_map(|((low, high), half)| {
        let row = |height: f64| view.camera.row(bearing.ahead, height);
        let window =
            Window { left: middle - half * scale, right: middle + half * scale, top: row(*high), bottom: row(*low) };
        let pixels = colors(view, window);
        let count = |color: Color| pixels.iter().filter(|found| **found == Some(color)).count();
        let color = Color::ALL.into_iter().filter(|color| *color != body).max_by_key(|&color| (count(color), color))?;
        (count(color) >= PATCH.0 && part(count(color), pixels.len()) >= PATCH.1).then_some(color)
    })
}

/// The commonest colour in a window that is wholly in view, and its share of the pixels.
fn commonest(view: &View, window: Window) -> Option<(Color, f64)> {
    let pixels = colors(view, window);
    let whole = inside(view, window);
    let count = |color: Color| pixels.iter().filter(|found| **found == Some(color)).count();
    let color = Color::ALL.into_iter().max_by_key(|&color| (count(color), color))?;
    (whole && pixels.len() >= LEAST).then(|| (color, part(count(color), pixels.len())))
}

fn share_of(view: &View, window: Window, color: Color) -> f64 {
    let pixels = colors(view, window);
    part(pixels.iter().filter(|found| **found == Some(color)).count(), pixels.len().max(1))
}

#[expect(clippy::cast_precision_loss, reason = "pixels of a picture are few")]
fn part(some: usize, all: usize) -> f64 {
    some as f64 / all as f64
}

#[expect(clippy::cast_precision_loss, reason = "pixels of a picture are few")]
fn inside(view: &View, window: Window) -> bool {
    window.left >= 0.0 && window.right <= view.frame.width as f64 && window.bottom <= view.frame.height as f64
}

fn colors(view: &View, window: Window) -> Vec<Option<Color>> {
    let (columns, rows) =
        (span(window.left, window.right, view.frame.width), span(window.top, window.bottom, view.frame.height));
    let at = |row: usize, column: usize| 3 * (row * view.frame.width + column);
    rows.flat_map(|row| columns.clone().map(move |column| at(row, column)))
        .map(|at| paint::color(&view.frame.rgb[at..at + 3]))
        .collect()
}

/// Whole pixels from `from` to `to`, of those that there are.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the picture")]
#[expect(clippy::cast_precision_loss, reason = "pixels of a picture are few")]
fn span(from: f64, to: f64, end: usize) -> std::ops::Range<usize> {
    let pixel = |edge: f64| edge.round().clamp(0.0, end as f64) as usize;
    pixel(from)..pixel(to)
}
