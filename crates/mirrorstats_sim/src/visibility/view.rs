//! The eye as a point and three directions, and the codes of what its rays meet.

use super::super::label_image::LabelImage;
use super::super::mirror_eye;
use super::super::model::{Item, Stage, group};
use super::super::scene::HungPane;
use super::super::world::World;
use mirrorstats_experiment::angle::sine_cosine;
use mirrorstats_experiment::spec::PaneKind;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Shown {
    /// A thing that the eye sees directly: the room, a body, a cube, a mark.
    Direct(Item),
    /// The same through the pane of this number.
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

    /// The meaning of a byte of [`Shown::code`].
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
pub(super) struct RayView {
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
    pub(crate) fn of_eye(world: &World, width: usize, height: usize) -> Self {
        let eye = &world.config().eye;
        let pose = world.pose();
        let [x, y] = pose.heading.direction();
        let ahead = pose.ahead(eye.forward);
        let (sine, cosine) = sine_cosine(eye.fovy / 2.0);
        let tangent = sine / cosine;
        let wide = tangent * f64::from(eye.width) / f64::from(eye.height_px);
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
    pub fn through(&self, world: &World, pane: &HungPane) -> Self {
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

/// The groups of geoms that rays meet.
fn shown_groups() -> [u8; 6] {
    let mut groups = [0; 6];
    for group in [group::ROOM, group::CEILING, group::THINGS, group::EGO] {
        groups[usize::try_from(group).expect("groups are 0 to 5")] = 1;
    }
    groups
}

pub(super) fn by_mujoco(world: &World, stages: &mut (Stage, Vec<Stage>), width: usize, height: usize) -> LabelImage {
    let view = RayView::of_eye(world, width, height);
    let (stage, beyond) = stages;
    let mut codes = Vec::with_capacity(width * height);
    let groups = shown_groups();
    for y in 0..height {
        for x in 0..width {
            let ray = view.ray(x, y);
            let (geom, distance) = stage.data.ray(&view.origin, &ray, Some(&groups), true, None, None);
            let shown = match geom.map_or(Item::Room, |geom| stage.items()[geom]) {
                Item::Pane(pane) => {
                    let met = plus(view.origin, distance, ray);
                    Shown::Through(pane, onwards(world, &mut beyond[pane], pane, met, ray))
                }
                item => Shown::Direct(item),
            };
            codes.push(shown.code());
        }
    }
    LabelImage { width, height, codes }
}

fn onwards(world: &World, stage: &mut Stage, pane: usize, met: Vector, ray: Vector) -> Item {
    let hung = &world.scene().panes[pane];
    let [out_x, out_y] = hung.place.heading().direction();
    let out = [out_x, out_y, 0.0];
    let (from, ray) = match hung.kind {
        PaneKind::Window => (plus(met, -mirror_eye::shift(world.config()), out), ray),
        _ => (met, plus(ray, -2.0 * dot(ray, out), out)),
    };
    let from = plus(from, 1e-9, ray);
    let (geom, _) = stage.data.ray(&from, &ray, Some(&shown_groups()), true, None, None);
    geom.map_or(Item::Room, |geom| stage.items()[geom])
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
