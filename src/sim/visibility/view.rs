//! The eye as a point and three directions, and what a ray from it may meet.

use super::super::angle::sine_cosine;
use super::super::model::{AGENTS, Item, Stage, group};
use super::super::world::World;
use super::LabelImage;

/// What a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Shown {
    /// A wall, the floor or the ceiling, directly.
    Room,
    /// The mirror, and in it a wall, the floor or the ceiling.
    Mirror,
    /// An agent (0 is the own body) or a cube.
    Direct(Item),
    /// The same by way of the mirror.
    Reflected(Item),
}

const MIRROR: u8 = 1;
const DIRECT: u8 = 2;
const REFLECTED: u8 = 64;

impl Shown {
    /// One byte for it.
    pub fn code(self) -> u8 {
        match self {
            Self::Room | Self::Direct(Item::Room) => 0,
            Self::Mirror | Self::Direct(Item::Mirror) | Self::Reflected(Item::Room | Item::Mirror) => MIRROR,
            Self::Direct(item) => DIRECT + index(item),
            Self::Reflected(item) => REFLECTED + index(item),
        }
    }

    /// What a byte of [`Shown::code`] stands for.
    pub fn of_code(code: u8) -> Self {
        match code {
            0 => Self::Room,
            MIRROR => Self::Mirror,
            DIRECT..REFLECTED => Self::Direct(of_index(code - DIRECT)),
            _ => Self::Reflected(of_index(code - REFLECTED)),
        }
    }
}

fn index(item: Item) -> u8 {
    let at = match item {
        Item::Agent(agent) => agent,
        Item::Cube(cube) => AGENTS + cube,
        Item::Room | Item::Mirror => 0,
    };
    u8::try_from(at).expect("a world holds fewer than 60 things")
}

fn of_index(index: u8) -> Item {
    let at = usize::from(index);
    at.checked_sub(AGENTS).map_or(Item::Agent(at), Item::Cube)
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
pub(super) struct View {
    pub origin: Vector,
    pub forward: Vector,
    /// As long as half of the view is wide, one metre ahead.
    pub right: Vector,
    /// As long as half of the view is high, one metre ahead.
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

impl View {
    /// The agent's eye, with a view of some size of the same shape.
    pub fn of_eye(world: &World, width: usize, height: usize) -> Self {
        let eye = &world.config().eye;
        let pose = world.pose();
        let [x, y] = pose.heading.direction();
        let ahead = pose.ahead(eye.forward);
        let (sine, cosine) = sine_cosine(eye.fovy / 2.0);
        let tangent = sine / cosine;
        let wide = tangent * f64::from(eye.width) / f64::from(eye.height_px);
        Self {
            origin: [ahead.x, ahead.y, eye.height],
            forward: [x, y, 0.0],
            right: [wide * y, -wide * x, 0.0],
            up: [0.0, 0.0, tangent],
            width,
            height,
        }
    }

    /// The view from behind a mirror: that of the eye's mirror image.
    pub fn reflected(&self, point: Vector, normal: Vector) -> Self {
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

/// Labels by MuJoCo's own rays, the mirror by a second ray from where the first met it.
pub(super) fn by_mujoco(world: &World, stage: &mut Stage, width: usize, height: usize) -> LabelImage {
    let view = View::of_eye(world, width, height);
    let all = groups(&[group::ROOM, group::CEILING, group::THINGS, group::EGO]);
    let mut codes = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            let ray = view.ray(x, y);
            let (geom, distance) = stage.data.ray(&view.origin, &ray, Some(&all), true, None, None);
            let first = geom.map_or(Item::Room, |geom| stage.items()[geom]);
            let shown = match (first, geom) {
                (Item::Mirror, Some(mirror)) => Shown::Reflected(beyond(stage, mirror, &view, ray, distance)),
                (item, _) => Shown::Direct(item),
            };
            codes.push(shown.code());
        }
    }
    LabelImage { width, height, codes }
}

fn beyond(stage: &mut Stage, mirror: usize, view: &View, ray: Vector, distance: f64) -> Item {
    let rotation = stage.data.geom_xmat()[mirror];
    let normal = [rotation[2], rotation[5], rotation[8]];
    let from = plus(view.origin, distance, ray);
    let onwards = plus(ray, -2.0 * dot(ray, normal), normal);
    let all = groups(&[group::ROOM, group::CEILING, group::THINGS, group::EGO]);
    let from = plus(from, 1e-9, onwards);
    let (geom, _) = stage.data.ray(&from, &onwards, Some(&all), true, None, None);
    geom.map_or(Item::Room, |geom| stage.items()[geom])
}

fn groups(shown: &[i32]) -> [u8; 6] {
    let mut groups = [0; 6];
    for group in shown {
        groups[usize::try_from(*group).expect("groups are 0 to 5")] = 1;
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::super::super::scene::MOST_CUBES;
    use super::{AGENTS, Item, Shown};

    #[test]
    fn every_code_comes_back() {
        let items = (0..AGENTS).map(Item::Agent).chain((0..MOST_CUBES).map(Item::Cube));
        let shown = items.flat_map(|item| [Shown::Direct(item), Shown::Reflected(item)]);
        for shown in shown.chain([Shown::Room, Shown::Mirror]) {
            assert_eq!(Shown::of_code(shown.code()), shown);
        }
    }
}
