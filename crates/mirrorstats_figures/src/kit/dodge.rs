//! Separates marks at the same position, so that each is visible.

use std::collections::BTreeMap;

use super::marker::polar;
use super::sheet::{Point, many};

/// The angle between neighbours of a sunflower, radians.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;

/// Moves coinciding points onto a spiral around their position, `apart` px between neighbours.
pub(crate) fn fanned(places: &[Point], apart: f64) -> Vec<Point> {
    moved(places, |at, count| match count {
        1 => (0.0, 0.0),
        2..=4 => polar(apart / (2.0 * (std::f64::consts::PI / many(count)).sin()), turn(at, count)),
        _ => polar(apart * 0.62 * (many(at) + 0.5).sqrt(), GOLDEN_ANGLE * many(at)),
    })
}

/// Moves coinciding points side by side, at most `room` px wide together.
pub(crate) fn abreast(places: &[Point], apart: f64, room: f64) -> Vec<Point> {
    moved(places, |at, count| {
        let step = apart.min(room / many(count.max(2) - 1));
        (step * (many(at) - many(count - 1) / 2.0), 0.0)
    })
}

fn turn(at: usize, count: usize) -> f64 {
    std::f64::consts::TAU * (many(at) / many(count) + 0.25)
}

/// Moves each place by `offset`, which gets its index among nearly equal places and their number.
fn moved(places: &[Point], offset: impl Fn(usize, usize) -> Point) -> Vec<Point> {
    let mut sharing: BTreeMap<(i64, i64), Vec<usize>> = BTreeMap::new();
    for (at, &place) in places.iter().enumerate() {
        sharing.entry(tenths(place)).or_default().push(at);
    }
    let mut moved = places.to_vec();
    for group in sharing.values() {
        for (at, &index) in group.iter().enumerate() {
            let (x, y) = offset(at, group.len());
            moved[index] = (places[index].0 + x, places[index].1 + y);
        }
    }
    moved
}

#[expect(clippy::cast_possible_truncation, reason = "`as` clamps, and sheets are small")]
fn tenths((x, y): Point) -> (i64, i64) {
    ((x * 10.0).round() as i64, (y * 10.0).round() as i64)
}

#[cfg(test)]
mod tests {
    use super::{abreast, fanned};

    #[test]
    fn distant_marks_do_not_move() {
        let places = [(1.0, 2.0), (30.0, 2.0)];
        assert_eq!((fanned(&places, 6.0), abreast(&places, 6.0, 20.0)), (places.to_vec(), places.to_vec()));
    }

    #[test]
    fn overlapping_marks_are_spread() {
        for count in [2, 3, 5, 20] {
            let fanned = fanned(&vec![(50.0, 50.0); count], 6.0);
            for (at, a) in fanned.iter().enumerate() {
                for b in &fanned[at + 1..] {
                    assert!((a.0 - b.0).hypot(a.1 - b.1) > 4.0, "{count}: {a:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn a_row_keeps_to_its_room() {
        let row = abreast(&[(50.0, 50.0); 20], 6.0, 40.0);
        assert!((row[0].0 - 30.0).abs() < 1e-9 && (row[19].0 - 70.0).abs() < 1e-9);
    }
}
