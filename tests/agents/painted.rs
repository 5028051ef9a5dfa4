//! A painted room to walk in, drawn by tracing one ray per pixel, without a simulator or ground truth.
//!
//! The room is square, with a mirror in the middle of the east wall, cubes, and bodies that stand still: a trunk of one
//! colour and a grey head.

use std::sync::Arc;

use mirrorstats_agents::perception::camera::{Heading, Place, Viewpoint};
use mirrorstats_agents::scripted::Scripted;
use mirrorstats_agents::{Observation, Reply, Task};
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::frame::Frame;
use mirrorstats_trace::schema::colors::Color;

const HALF: f64 = 4.0;
const CEILING: f64 = 2.8;
const STEP: f64 = 0.4;
const EDGE: f64 = 0.5;
const GIRTH: f64 = 0.4;
const EYE: (f64, f64) = (0.14, 1.52);
const SIZE: (usize, usize) = (320, 240);
const HALF_VIEW: f64 = 1.428_148_006_742_114_5;

type Point = [f64; 3];

/// The things in the room.
#[derive(Clone, Debug)]
pub struct Painted {
    pub own: Color,
    pub has_mirror: bool,
    pub cubes: Vec<(Color, Place)>,
    pub others: Vec<(Color, Place)>,
}

impl Painted {
    /// The view of a body's eye at `pose`.
    pub fn frame(&self, pose: Viewpoint) -> Frame {
        self.frame_reflecting(pose, pose.place)
    }

    /// The view at `pose` if the mirror shows the own body at another place.
    pub fn frame_reflecting(&self, pose: Viewpoint, reflected: Place) -> Frame {
        let (width, height) = SIZE;
        let [cosine, sine] = pose.heading.direction();
        let eye = [pose.place.x + EYE.0 * cosine, pose.place.y + EYE.0 * sine, EYE.1];
        let focal = height as f64 / 2.0 / HALF_VIEW;
        let pixel = |at: usize| {
            let right = ((at % width) as f64 + 0.5 - width as f64 / 2.0) / focal;
            let up = (height as f64 / 2.0 - (at / width) as f64 - 0.5) / focal;
            self.trace(eye, [cosine + right * sine, sine - right * cosine, up], None, reflected)
        };
        Frame::new(width, height, (0..width * height).flat_map(pixel).collect())
    }

    /// The colour where a ray ends. After a reflection, `own` is the place of the viewer's body.
    fn trace(&self, from: Point, ray: Point, after_mirror: Option<()>, own: Place) -> [u8; 3] {
        let mut best = walls(from, ray);
        let bodies = self.others.iter().copied().chain(after_mirror.map(|()| (self.own, own)));
        let things =
            self.cubes.iter().filter_map(|(color, place)| cube(from, ray, *place).map(|far| (far, lit(*color))));
        for hit in things.chain(bodies.filter_map(|(color, place)| body(from, ray, color, place))) {
            best = if hit.0 < best.0 { hit } else { best };
        }
        let end = along(from, ray, best.0);
        let is_mirror = self.has_mirror && end[0] > HALF - 1e-6 && end[1].abs() < 1.5 && (0.15..2.45).contains(&end[2]);
        if is_mirror && after_mirror.is_none() {
            self.trace([end[0] - 1e-6, end[1], end[2]], [-ray[0], ray[1], ray[2]], Some(()), own)
        } else {
            best.1
        }
    }

    fn blocks(&self, place: Place) -> bool {
        let in_cube = |cube: &Place| {
            let beyond = |from: f64, to: f64| ((from - to).abs() - EDGE / 2.0).max(0.0);
            beyond(place.x, cube.x).hypot(beyond(place.y, cube.y)) < GIRTH
        };
        place.x.abs().max(place.y.abs()) > HALF - GIRTH
            || self.cubes.iter().any(|(_, cube)| in_cube(cube))
            || self.others.iter().any(|(_, other)| other.distance(place) < 2.0 * GIRTH)
    }

    /// Plays an episode of a scripted agent: returns its replies and its place at the last one.
    pub fn play(&self, agent: Scripted, task: &Task, start: Viewpoint) -> (Vec<Reply>, Place) {
        let mut agent = agent.agent(task);
        let (mut pose, mut bumped, mut history) = (start, false, None);
        let mut replies: Vec<Reply> = Vec::new();
        for t in 1..=task.step_budget {
            let observation = Observation {
                t,
                remaining: task.step_budget - t + 1,
                x: pose.place.x as f32,
                y: pose.place.y as f32,
                yaw: 30.0 * f32::from(pose.heading.thirties()),
                bumped,
                history: history.take(),
                frame: Arc::new(self.frame(pose)),
                past: Arc::default(),
                fov_y: 110.0,
            };
            let reply = ready(agent.decide(&observation)).unwrap();
            let next = reply.action.map_or(pose, |action| moved(pose, action));
            bumped = next.place != pose.place && self.blocks(next.place);
            pose = if bumped { pose } else { next };
            history = Some((reply.action, reply.words.summary.clone()));
            let is_done = reply.action == Some(Action::Done);
            replies.push(reply);
            if is_done {
                break;
            }
        }
        (replies, pose.place)
    }
}

/// The value of a future that is already ready.
pub fn ready<T>(mut future: std::pin::Pin<Box<dyn Future<Output = T> + '_>>) -> T {
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    match future.as_mut().poll(&mut context) {
        std::task::Poll::Ready(value) => value,
        std::task::Poll::Pending => panic!("a scripted agent is ready at once"),
    }
}

pub fn task(experiment: Experiment, seed: u64) -> Task {
    Task { experiment, stated_color: None, step_budget: 100, seed }
}

pub fn pose(x: f64, y: f64, yaw: f64) -> Viewpoint {
    Viewpoint { place: Place { x, y }, heading: Heading::nearest(yaw) }
}

fn moved(pose: Viewpoint, action: Action) -> Viewpoint {
    mirrorstats_agents::scripted::route::after(pose, action, STEP)
}

fn along(from: Point, ray: Point, far: f64) -> Point {
    [from[0] + far * ray[0], from[1] + far * ray[1], from[2] + far * ray[2]]
}

fn lit(color: Color) -> [u8; 3] {
    color.rgb().map(|channel| (u16::from(channel) * 4 / 5) as u8)
}

/// The nearest of the floor, the ceiling and the walls, seen from inside.
fn walls(from: Point, ray: Point) -> (f64, [u8; 3]) {
    let shades = [[[104, 108, 114], [104, 108, 114]], [[94, 98, 104], [94, 98, 104]], [[80, 82, 84], [120, 122, 125]]];
    let planes = [(-HALF, HALF), (-HALF, HALF), (0.0, CEILING)];
    let mut best = (f64::INFINITY, [0; 3]);
    for (axis, (low, high)) in planes.into_iter().enumerate() {
        for (end, shade) in [low, high].into_iter().zip(shades[axis]) {
            let far = (end - from[axis]) / ray[axis];
            if far > 1e-9 && far < best.0 {
                best = (far, shade);
            }
        }
    }
    best
}

fn cube(from: Point, ray: Point, place: Place) -> Option<f64> {
    let low = [place.x - EDGE / 2.0, place.y - EDGE / 2.0, 0.0];
    let (mut enter, mut leave) = (1e-9_f64, f64::INFINITY);
    for axis in 0..3 {
        let (one, other) = ((low[axis] - from[axis]) / ray[axis], (low[axis] + EDGE - from[axis]) / ray[axis]);
        enter = enter.max(one.min(other));
        leave = leave.min(one.max(other));
    }
    (enter < leave).then_some(enter)
}

/// A cylinder as the trunk, and a thinner one as the head.
fn body(from: Point, ray: Point, color: Color, place: Place) -> Option<(f64, [u8; 3])> {
    let cylinder = |radius: f64, low: f64, high: f64| {
        let (dx, dy) = (from[0] - place.x, from[1] - place.y);
        let a = ray[0] * ray[0] + ray[1] * ray[1];
        let b = dx * ray[0] + dy * ray[1];
        let root = b * b - a * (dx * dx + dy * dy - radius * radius);
        let far = (-b - root.max(0.0).sqrt()) / a;
        let high_enough = (low..high).contains(&(from[2] + far * ray[2]));
        (root > 0.0 && far > 1e-9 && high_enough).then_some(far)
    };
    let trunk = cylinder(0.2, 0.0, 1.38).map(|far| (far, lit(color)));
    trunk.or_else(|| cylinder(0.1, 1.38, 1.62).map(|far| (far, [50, 50, 52])))
}
