//! The markers of models: ten shapes, filled or hollow, with about equal areas.

use std::f64::consts::PI;

use super::palette::{ModelStyle, PALETTE, Shape};
use super::sheet::{Fill, Point, Sheet, many};

/// Draws the model's marker around `center`; `r` is the radius of the circle marker, px.
pub fn draw(sheet: &mut Sheet, center: Point, r: f64, style: &ModelStyle) {
    let paper = PALETTE.surface.paper;
    let fill =
        if style.hollow { Fill::outlined(paper, style.color, 1.2) } else { Fill::outlined(style.color, paper, 0.6) };
    let corners = match style.marker {
        Shape::Circle => return sheet.circle(center, r, fill),
        Shape::Square => regular(4, r * 1.25, 0.25 * PI),
        Shape::Diamond => regular(4, r * 1.3, 0.0),
        Shape::Triangle => regular(3, r * 1.4, 0.0),
        Shape::TriangleDown => regular(3, r * 1.4, PI),
        Shape::Pentagon => regular(5, r * 1.15, 0.0),
        Shape::Hexagon => regular(6, r * 1.12, PI / 6.0),
        Shape::Star => star(r * 1.5, r * 0.65),
        Shape::Cross => cross(r * 1.25, r * 0.45),
        Shape::Bar => vec![(-r * 1.3, -r * 0.62), (r * 1.3, -r * 0.62), (r * 1.3, r * 0.62), (-r * 1.3, r * 0.62)],
    };
    let moved: Vec<_> = corners.iter().map(|&(x, y)| (center.0 + x, center.1 + y)).collect();
    sheet.polygon(&moved, fill);
}

/// A point on a circle; the angle is clockwise from the top.
pub(crate) fn polar(radius: f64, angle: f64) -> Point {
    (radius * angle.sin(), -radius * angle.cos())
}

fn regular(corners: usize, radius: f64, turn: f64) -> Vec<Point> {
    (0..corners).map(|i| polar(radius, turn + 2.0 * PI * many(i) / many(corners))).collect()
}

fn star(outer: f64, inner: f64) -> Vec<Point> {
    (0..10).map(|i| polar(if i % 2 == 0 { outer } else { inner }, PI * many(i) / 5.0)).collect()
}

fn cross(reach: f64, half: f64) -> Vec<Point> {
    let arm = [(half, -reach), (half, -half), (reach, -half)];
    let turns: [fn(Point) -> Point; 4] = [|(x, y)| (x, y), |(x, y)| (-y, x), |(x, y)| (-x, -y), |(x, y)| (y, -x)];
    turns.into_iter().flat_map(|turn| arm.map(turn)).collect()
}
