//! The search for one's own body in the mirror.
//!
//! The own reflection is where no other body's can be: as far behind the mirror as the own body is before it, straight
//! across. It steps aside and approaches together with the own body. So every new place is a test: a body's trunk must
//! be drawn exactly where the own one would be. Another body that happens to be drawn there once does not follow.
//!
//! A mirror may be late: then the reflection is where the own one would have been some steps ago. So the same test runs
//! with earlier places. If the current test keeps failing, a lag decides whose tests agree on a colour, from more
//! places, and seldom find nobody. A stranger behind a window follows at no lag.
//!
//! Rule: a colour is one's own when the tests from several places agree on it, regardless of the prompt and of other
//! things in view. Only walls known to be mirrors count.

use crate::perception::View;
use crate::perception::camera::{Bearing, Place, ViewCamera};
use crate::perception::{paint, real};
use mirrorstats_trace::schema::colors::Color;

use super::room::{Room, WallSide};

/// A test that found a body in the place of the own reflection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Match {
    pub side: WallSide,
    pub color: Color,
    pub place: Place,
    /// The delay of the body, in steps.
    pub lag: usize,
}

/// The number of agreeing tests that make a colour one's own.
const TESTS: usize = 3;
/// The minimum number of their places.
const PLACES: usize = 2;
/// The maximum lag of a reflection in steps.
const LATEST: usize = 8;
/// The number of agreeing tests and places of one lag that make a late reflection one's own.
const LATE: (usize, usize) = (4, 3);
/// The minimum distance of two such places along the wall, m. The test cannot measure a body's distance: a stranger who
/// stands in one's line of sight would pass it while one walks to and fro.
const ASIDE_LATE: f64 = 0.15;
/// Missing reflections before a late one is considered.
const MISSES: usize = 4;
/// The minimum distance of two places, m.
const ELSEWHERE: f64 = 0.1;
/// Heights of the trunk's tested part, m above the floor.
const TRUNK: (f64, f64) = (0.85, 1.30);
/// Half the width of the tested part, m.
const HALF_TRUNK: f64 = 0.13;
/// The body-free range beside the trunk, m from the middle.
const ASIDE: (f64, f64) = (0.42, 0.70);
/// The body-free range above the head, m above the floor.
const OVER: (f64, f64) = (1.75, 1.95);
/// The minimum pixels of a trunk, above noise.
const LEAST: usize = 40;

/// The head and the chest, where a mark may be: heights above the floor and half of the width, m.
const PATCHES: [((f64, f64), f64); 2] = [((1.52, 1.63), 0.06), ((1.15, 1.29), 0.07)];
/// The minimum pixels of a patch, above noise, and its minimum share of the place.
const PATCH: (usize, f64) = (6, 0.4);
/// The number of views with the same patch that make a mark.
const SIGHTINGS: usize = 2;

#[derive(Clone, Debug, Default)]
pub struct Reflection {
    matches: Vec<Match>,
    patches: Vec<Color>,
    trail: Vec<Place>,
    misses: [usize; LATEST + 1],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Test {
    /// Too far aside, too small, or occluded.
    Unclear,
    /// The background is visible.
    Nobody,
    Body(Color),
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
    /// Looks for the own body in every mirror in view.
    pub fn see(&mut self, view: &View, room: &Room) {
        let here = view.pose.place;
        self.trail.push(here);
        for side in WallSide::ALL {
            if room.is_mirror(side, side.along(here)) {
                self.see_now(view, room, side);
            }
            self.see_late(view, room, side);
        }
    }

    fn see_now(&mut self, view: &View, room: &Room, side: WallSide) {
        let Some(double) = room.mirrored(side, view.pose.place) else { return };
        match body_at(view, double) {
            Test::Unclear => {}
            Test::Nobody => self.misses[0] += 1,
            Test::Body(color) => {
                self.matches.push(Match { side, color, place: view.pose.place, lag: 0 });
                self.patches.extend(patch_at(view, double, color));
            }
        }
    }

    /// The same test for late reflections. A place where the agent still stands gives no evidence.
    fn see_late(&mut self, view: &View, room: &Room, side: WallSide) {
        let here = view.pose.place;
        for lag in 1..=LATEST.min(self.trail.len() - 1) {
            let place = self.trail[self.trail.len() - 1 - lag];
            let Some(double) = room.mirrored(side, place).filter(|_| place.distance(here) > ELSEWHERE) else {
                continue;
            };
            let is_through = room
                .crossing(view.camera.eye, double)
                .is_some_and(|(crossed, along)| crossed == side && room.is_mirror(side, along));
            match body_at(view, double) {
                Test::Body(color) if is_through => self.matches.push(Match { side, color, place, lag }),
                Test::Nobody if is_through => self.misses[lag] += 1,
                _ => {}
            }
        }
    }

    pub fn own_color(&self) -> Option<Color> {
        self.tested().map(|(color, _)| color)
    }

    fn tested(&self) -> Option<(Color, usize)> {
        let at = |lag, tests, places| self.agreed(lag, tests, places).map(|color| (color, lag));
        let now = at(0, TESTS, PLACES);
        let may_be_late = now.is_none() && self.misses[0] >= MISSES;
        now.or_else(|| (1..=LATEST).filter(|_| may_be_late).find_map(|lag| at(lag, LATE.0, LATE.1)))
    }

    /// The current place of the own reflection behind the mirror, once it was found.
    pub(crate) fn own_place(&self, room: &Room) -> Option<Place> {
        let (color, lag) = self.tested()?;
        let side = self.matches.iter().rfind(|found| found.color == color && found.lag == lag)?.side;
        let place = *self.trail.get(self.trail.len().checked_sub(1 + lag)?)?;
        room.mirrored(side, place)
    }

    /// The colour on which the tests of a lag agree, unless tests that found nobody refute it. A late reflection must
    /// be there nearly always; a current one may be missed as often, by looks past the mirror's edge.
    fn agreed(&self, lag: usize, tests: usize, places: usize) -> Option<Color> {
        let of_lag = || self.matches.iter().filter(move |found| found.lag == lag);
        let count = |color: Color| of_lag().filter(|found| found.color == color).count();
        let (most, color) = Color::ALL.into_iter().map(|color| (count(color), color)).max()?;
        let (found, misses) = (of_lag().count(), self.misses[lag]);
        let agree = 3 * most >= 2 * found && if lag == 0 { most >= misses } else { most >= 2 * misses };
        (most >= tests && agree && self.places(color, lag) >= places).then_some(color)
    }

    /// The colour of a patch on the own body, once seen often enough; the latest if there are several.
    pub(crate) fn own_mark(&self) -> Option<Color> {
        repeated(&self.patches).filter(|last| self.own_color().is_some_and(|own| own != *last))
    }

    pub fn matches(&self) -> usize {
        self.matches.iter().filter(|found| found.lag == 0).count()
    }

    fn places(&self, color: Color, lag: usize) -> usize {
        let mut places: Vec<Place> = Vec::new();
        for found in self.matches.iter().filter(|found| found.color == color && found.lag == lag) {
            let is_new = |place: &Place| match lag {
                0 => place.distance(found.place) > ELSEWHERE,
                _ => (found.side.along(*place) - found.side.along(found.place)).abs() > ASIDE_LATE,
            };
            if places.iter().all(is_new) {
                places.push(found.place);
            }
        }
        places.len()
    }
}

impl Window {
    /// The part between two edges aside of the middle of a thing and two heights above the floor, m.
    fn at(camera: &ViewCamera, bearing: Bearing, (left, right): (f64, f64), (low, high): (f64, f64)) -> Self {
        let (middle, scale) = (camera.column(bearing), camera.scale(bearing.ahead));
        let row = |height| camera.row(bearing.ahead, height);
        Self { left: middle + left * scale, right: middle + right * scale, top: row(high), bottom: row(low) }
    }

    fn is_in_view(self, view: &View) -> bool {
        self.left >= 0.0 && self.right <= real(view.frame.width) && self.bottom <= real(view.frame.height)
    }

    fn pixels(self, view: &View) -> Vec<Option<Color>> {
        let columns = span(self.left, self.right, view.frame.width);
        let rows = span(self.top, self.bottom, view.frame.height);
        let at = |row: usize, column: usize| 3 * (row * view.frame.width + column);
        rows.flat_map(|row| columns.clone().map(move |column| at(row, column)))
            .map(|at| paint::color(&view.frame.rgb[at..at + 3]))
            .collect()
    }
}

/// The body of the own size whose axis is at `double`.
fn body_at(view: &View, double: Place) -> Test {
    let bearing = view.camera.bearing(double);
    if bearing.ahead < 0.5 {
        return Test::Unclear;
    }
    let window = |aside, heights| Window::at(&view.camera, bearing, aside, heights);
    let trunk = window((-HALF_TRUNK, HALF_TRUNK), TRUNK);
    let pixels = trunk.pixels(view);
    let Some((color, share)) = commonest(&pixels, None) else { return Test::Unclear };
    if !trunk.is_in_view(view) || pixels.len() < LEAST {
        return Test::Unclear;
    }
    let elsewhere = [
        window((-ASIDE.1, -ASIDE.0), TRUNK),
        window((ASIDE.0, ASIDE.1), TRUNK),
        window((-HALF_TRUNK, HALF_TRUNK), OVER),
    ];
    let alone = elsewhere.iter().all(|beside| share_of(&beside.pixels(view), color) < 0.4);
    match share {
        _ if share > 0.6 && alone => Test::Body(color),
        // Some of the colour, but little: the room beyond is visible.
        _ if share < 0.1 => Test::Nobody,
        _ => Test::Unclear,
    }
}

/// The colour of a patch on the head or the chest of the body at `double`, other than the body's.
pub(crate) fn patch_at(view: &View, double: Place, body: Color) -> Option<Color> {
    let bearing = view.camera.bearing(double);
    PATCHES.iter().find_map(|(heights, half)| {
        let pixels = Window::at(&view.camera, bearing, (-half, *half), *heights).pixels(view);
        let (color, share) = commonest(&pixels, Some(body))?;
        (count(&pixels, color) >= PATCH.0 && share >= PATCH.1).then_some(color)
    })
}

/// The last patch, if enough views had it.
pub fn repeated(patches: &[Color]) -> Option<Color> {
    let last = *patches.last()?;
    (patches.iter().filter(|patch| **patch == last).count() >= SIGHTINGS).then_some(last)
}

fn commonest(pixels: &[Option<Color>], other_than: Option<Color>) -> Option<(Color, f64)> {
    let colors = Color::ALL.into_iter().filter(|color| Some(*color) != other_than);
    let color = colors.max_by_key(|&color| (count(pixels, color), color))?;
    Some((color, share_of(pixels, color)))
}

fn share_of(pixels: &[Option<Color>], color: Color) -> f64 {
    real(count(pixels, color)) / real(pixels.len().max(1))
}

fn count(pixels: &[Option<Color>], color: Color) -> usize {
    pixels.iter().filter(|found| **found == Some(color)).count()
}

/// Whole pixels from `from` to `to`, clipped to the picture.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the picture")]
fn span(from: f64, to: f64, end: usize) -> std::ops::Range<usize> {
    let pixel = |edge: f64| edge.round().clamp(0.0, real(end)) as usize;
    pixel(from)..pixel(to)
}
