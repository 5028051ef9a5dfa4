//! The eye as a point and three directions, and the codes of what its rays meet.

use super::super::label_image::LabelImage;
use super::super::mirror_eye;
use super::super::model::Item;
use super::super::scene::HungPane;
use super::super::world::World;
use mirrorstats_experiment::angle::sine_cosine;
use mirrorstats_experiment::spec::PaneKind;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Shown {
    /// A thing that the eye sees directly: the room, a body, a cube, a mark.
    Direct(Item),
    Through(usize, Item),
}

impl Shown {
    pub fn code(self) -> u8 {
        let code = match self {
            Self::Direct(Item::Pane(pane)) => Item::COUNT * (1 + pane),
            Self::Direct(item) => item.number(),
            Self::Through(pane, item) => Item::COUNT * (1 + pane) + item.number(),
        };
        u8::try_from(code).expect("a world holds fewer than 256 things to be seen")
    }

    pub fn of_code(code: u8) -> Self {
        let (look, at) = (usize::from(code) / Item::COUNT, usize::from(code) % Item::COUNT);
        look.checked_sub(1)
            .map_or(Self::Direct(Item::from_number(at)), |pane| Self::Through(pane, Item::from_number(at)))
    }

    pub const fn pane(self) -> Option<usize> {
        match self {
            Self::Direct(_) => None,
            Self::Through(pane, _) => Some(pane),
        }
    }
}

pub(super) type Vector = [f64; 3];

pub(super) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a + times * b`
pub(super) fn plus(a: Vector, times: f64, b: Vector) -> Vector {
    [a[0] + times * b[0], a[1] + times * b[1], a[2] + times * b[2]]
}

/// A pinhole camera: the ray of a pixel is `forward + u right + v up`, with u and v from -1 to 1.
#[derive(Clone, Copy, Debug)]
pub struct RayView {
    pub origin: Vector,
    pub forward: Vector,
    /// Half of the view's width at one metre.
    pub right: Vector,
    /// Half of the view's height at one metre.
    pub up: Vector,
    pub width: usize,
    pub height: usize,
}

/// The middle of a pixel among `count` of them, from -1 to 1.
pub(super) fn middle(at: usize, count: usize) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a number of pixels")]
    let [at, count] = [at as f64, count as f64];
    2.0 * (at + 0.5) / count - 1.0
}

impl RayView {
    pub fn of_eye(world: &World, width: usize, height: usize) -> Self {
        let eye = &world.config().eye;
        let pose = world.pose();
        let [x, y] = pose.heading.direction();
        let ahead = pose.ahead(eye.forward);
        let [wide, tangent] = eye.half_extent();
        let (down, level) = if eye.pitch > 0.0 { sine_cosine(eye.pitch) } else { (0.0, 1.0) };
        Self {
            origin: [ahead.x, ahead.y, eye.height],
            forward: [level * x, level * y, -down],
            right: [wide * y, -wide * x, 0.0],
            up: [tangent * down * x, tangent * down * y, tangent * level],
            width,
            height,
        }
    }

    /// The view through a pane: for a mirror from the eye's mirror image, for a window from an eye moved back by the
    /// distance of the second room.
    pub(crate) fn through(&self, world: &World, pane: &HungPane) -> Self {
        let [out_x, out_y] = pane.place.heading().direction();
        let [x, y] = pane.place.center(world.config());
        if pane.kind == PaneKind::Window {
            let back = [-out_x, -out_y, 0.0];
            return Self { origin: plus(self.origin, mirror_eye::shift(world.config()), back), ..*self };
        }
        self.reflected([x, y, pane.center_height], [-out_x, -out_y, 0.0])
    }

    fn reflected(&self, point: Vector, normal: Vector) -> Self {
        let turn = |direction: Vector| plus(direction, -2.0 * dot(direction, normal), normal);
        let away = dot(minus(self.origin, point), normal);
        Self {
            origin: plus(self.origin, -2.0 * away, normal),
            forward: turn(self.forward),
            right: turn(self.right),
            up: turn(self.up),
            ..*self
        }
    }

    pub fn ray(&self, x: usize, y: usize) -> Vector {
        let [u, v] = [middle(x, self.width), -middle(y, self.height)];
        plus(plus(self.forward, u, self.right), v, self.up)
    }
}

impl LabelImage {
    pub fn at(&self, x: usize, y: usize) -> Shown {
        Shown::of_code(self.codes[y * self.width + x])
    }
}

#[cfg(test)]
mod tests {
    use super::{Item, Shown};
    use crate::model::AGENTS;
    use crate::scene::MOST_CUBES;
    use mirrorstats_experiment::spec::{MOST_MARKS, MOST_PANES};

    #[test]
    fn every_code_round_trips() {
        let bodies = (0..AGENTS).map(Item::Agent).chain([Item::Room, Item::Hand, Item::Double]);
        let items: Vec<Item> =
            bodies.chain((0..MOST_CUBES).map(Item::Cube)).chain((0..MOST_MARKS).map(Item::Mark)).collect();
        let through = (0..MOST_PANES).flat_map(|pane| items.iter().map(move |item| Shown::Through(pane, *item)));
        for shown in items.iter().map(|item| Shown::Direct(*item)).chain(through) {
            assert_eq!(Shown::of_code(shown.code()), shown);
        }
    }
}
