//! An episode's world at its start, as plain data.
//!
//! Rule: a scene is drawn only from its configuration, experiment, seed and run. Experiments with shared scenes draw
//! the same layout from the same seed and run. E1, E2 and E3 do: E2 leaves the mirror out, E3 adds a false statement,
//! so they compare in pairs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::body::Pose;
use super::config::WorldConfig;
use super::floor::{FloorPlan, Square};
use mirrorstats_exact::hash;
use mirrorstats_exact::names;
use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::angle::Heading;
use mirrorstats_experiment::spec::{PaneKind, Part, is_default};
use mirrorstats_trace::schema::colors::Color;

/// Increases whenever the same configuration and seeds give other rooms or other motion. Early builds wrote 1, 2 and 3.
pub const SCENE_VERSION: u32 = 4;

/// Digits of a scene's fingerprint: enough for any study.
const FINGERPRINT_DIGITS: usize = 16;

/// The distance of an agent that starts before the mirror, m.
pub(super) const BEFORE_MIRROR: f64 = 2.0;

pub(crate) const MOST_OTHERS: usize = 6;
pub(crate) const MOST_CUBES: usize = 12;

/// An episode's world at its start.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Scene {
    /// By its name.
    #[schemars(with = "String")]
    pub experiment: Experiment,
    /// The block of runs.
    pub seed: i32,
    /// The run within it.
    pub run: i32,
    /// The colour of the agent's own body.
    pub body_color: Color,
    /// The false colour that the prompt states, as in E3.
    pub stated_color: Option<Color>,
    /// The place of the layout's mirror; in E2 the place where it would be.
    pub mirror: MirrorPlace,
    /// Mirrors and windows, the first of them at `mirror`.
    pub panes: Vec<HungPane>,
    /// Marks on bodies.
    pub marks: Vec<WornMark>,
    /// The pose of the agent at the start.
    pub start: Pose,
    /// The candidates, or the clutter, as in E5.
    pub cubes: Vec<Cube>,
    /// The other agents.
    pub others: Vec<Other>,
    /// The hand that is to reach the mark on the front, where the task is that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hand: Option<HandStart>,
}

/// A mirror or window on a wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct HungPane {
    /// Its kind.
    pub kind: PaneKind,
    /// Its place.
    pub place: MirrorPlace,
    /// Along the wall, m.
    pub width: f64,
    /// m.
    pub height: f64,
    /// The height of its centre, m.
    pub center_height: f64,
    /// Steps by which it is late.
    pub delay: u32,
    /// The colour in which it shows the own body, where that is another.
    pub paint: Option<Color>,
    /// The body that is seen in it alone: in place of the own one, or behind the window.
    pub double: Option<Other>,
    /// The first step that shows it; the first of all if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from_t: Option<u32>,
    /// The last step that shows it; the last of all if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub until_t: Option<u32>,
    /// True if it has a frame.
    #[serde(default, skip_serializing_if = "is_default")]
    pub frame: bool,
}

/// A mark on a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct WornMark {
    /// The part of the body.
    pub part: Part,
    /// Of its paint; never that of the body.
    pub color: Color,
    /// The first step that shows it.
    pub from_t: u32,
    /// Whose body: 0 is the agent's own, 1 the first of the others.
    pub wearer: usize,
    /// The patch of the front, if it is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) patch: Option<Patch>,
}

/// A square on the front of a body that stands still.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Patch {
    /// Of its middle from that of the body, to the left of the body where positive, mm.
    pub aside_mm: i32,
    /// Of its middle above the floor, mm.
    pub height_mm: i32,
    /// Of its sides, mm.
    pub edge_mm: i32,
}

/// The shape of a hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HandShape {
    Ball,
    Block,
}

names!(HandShape { Ball: "ball", Block: "block" });

/// A hand at the start of an episode. Its places are whole steps from the mark, so that distances are exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct HandStart {
    /// Of its paint.
    pub color: Color,
    /// Its shape.
    pub shape: HandShape,
    /// Half of its width, mm.
    pub(crate) half_mm: i32,
    /// From the mark, in steps: away from the camera, to the left of the picture, up.
    pub from_mark: [i32; 3],
}

/// The place of the mirror.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MirrorPlace {
    /// Quarter turns counter-clockwise from the wall at +x to its wall, 0 to 3.
    #[schemars(range(max = 3))]
    pub wall: u8,
    /// Of its centre from that of the wall, m; counter-clockwise seen from above where positive.
    pub offset: f64,
}

/// A cube with its sides along the walls.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cube {
    /// Of its paint.
    pub color: Color,
    /// Of its centre, m.
    pub x: f64,
    /// Of its centre, m.
    pub y: f64,
    /// Under it, m: the floor, or the cube that it stands on.
    pub base: f64,
    /// m.
    pub edge: f64,
}

/// Another agent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Other {
    /// Of its body.
    pub color: Color,
    /// The pose at the start.
    pub start: Pose,
    /// The seed of its walk.
    pub habit: u32,
}

impl MirrorPlace {
    /// The heading of a viewer who faces it squarely.
    pub const fn heading(self) -> Heading {
        Heading::new(self.wall % 4 * 3)
    }

    /// The middle of its face, m.
    pub fn center(self, config: &WorldConfig) -> [f64; 2] {
        let [out_x, out_y] = self.heading().direction();
        let depth = config.room.size / 2.0 - config.mirror.gap;
        [depth * out_x - self.offset * out_y, depth * out_y + self.offset * out_x]
    }

    /// The distance of a point from its face, m.
    pub fn distance(self, spot: [f64; 2], config: &WorldConfig) -> f64 {
        let [out_x, out_y] = self.heading().direction();
        config.room.size / 2.0 - config.mirror.gap - (spot[0] * out_x + spot[1] * out_y)
    }

    /// The distance of a point from its centre along the wall, m; signed as `offset`.
    pub fn aside(self, spot: [f64; 2]) -> f64 {
        let [out_x, out_y] = self.heading().direction();
        spot[1] * out_x - spot[0] * out_y - self.offset
    }

    /// The place of a body's image across the picture of an eye that faces the mirror; larger to the left. The image is as
    /// far behind the mirror as the body is before it.
    pub(crate) fn across(self, body: [f64; 2], eye: [f64; 2], config: &WorldConfig) -> f64 {
        (self.aside(body) - self.aside(eye)) / (self.distance(body, config) + self.distance(eye, config))
    }
}

impl HungPane {
    /// Returns true if the wall has it at a step, counted from 1.
    pub fn is_shown_at(&self, t: u32) -> bool {
        self.from_t.is_none_or(|from| from <= t) && self.until_t.is_none_or(|until| t <= until)
    }

    /// The colour of the body in it, if it is not the own body in its own colour.
    pub(super) fn shown_color(&self) -> Option<Color> {
        self.paint.or_else(|| self.double.map(|double| double.color))
    }
}

/// The distance from a body's axis to the middle of a patch, mm.
const FRONT_MM: i32 = 125;

impl Patch {
    /// Its middle in the frame of a body: ahead, to the left, up; m.
    pub fn place(self) -> [f64; 3] {
        [FRONT_MM, self.aside_mm, self.height_mm].map(|length| f64::from(length) / 1000.0)
    }

    /// Its middle in the room, on the front of a body at this pose, m.
    pub fn center(self, body: Pose) -> [f64; 3] {
        in_room(body, self.place())
    }
}

pub(super) fn in_room(body: Pose, [ahead, left, up]: [f64; 3]) -> [f64; 3] {
    let [x, y] = body.heading.direction();
    [body.x + ahead * x - left * y, body.y + ahead * y + left * x, up]
}

/// The steps of a way along the axes.
pub(super) fn manhattan(way: [i32; 3]) -> u32 {
    way.iter().map(|steps| steps.unsigned_abs()).sum()
}

impl HandStart {
    pub fn half(self) -> f64 {
        f64::from(self.half_mm) / 1000.0
    }
}

impl Cube {
    pub fn square(&self) -> Square {
        Square { center: [self.x, self.y], half: self.edge / 2.0 }
    }

    pub fn top(&self) -> f64 {
        self.base + self.edge
    }
}

impl Scene {
    /// The colour of an agent, directly or through a pane; `None` if it is absent.
    pub(super) fn agent_color(&self, agent: usize, pane: Option<&HungPane>) -> Option<Color> {
        let is_window = pane.is_some_and(|pane| pane.kind == PaneKind::Window);
        match (agent.checked_sub(1), pane) {
            _ if is_window => None,
            (None, None) => Some(self.body_color),
            (None, Some(pane)) if pane.double.is_some() => None,
            (None, Some(pane)) => Some(pane.paint.unwrap_or(self.body_color)),
            (Some(other), _) => self.others.get(other).map(|other| other.color),
        }
    }

    /// The panes and marks that a step shows, in the order of the scene.
    pub(super) fn shown_at(&self, t: u32) -> Vec<bool> {
        let panes = self.panes.iter().map(|pane| pane.is_shown_at(t));
        panes.chain(self.marks.iter().map(|mark| mark.from_t <= t)).collect()
    }

    pub fn own_mark_at(&self, t: u32) -> Option<Color> {
        self.marks.iter().find(|mark| mark.from_t <= t && mark.wearer == 0).map(|mark| mark.color)
    }

    /// The first colour other than the own body's in which a pane shows a body: a decoy's paint, or the colour of a
    /// body that only this pane shows. `None` without one.
    pub fn shown_color(&self) -> Option<Color> {
        self.panes.iter().filter_map(HungPane::shown_color).find(|color| *color != self.body_color)
    }

    /// The shared features of paired episodes: the room, the body, the cubes, the start and the others. The compared
    /// features are not part of it: the mirror, and the statement.
    pub fn fingerprint(&self, config: &WorldConfig) -> String {
        let Self { body_color, start, cubes, others, .. } = self;
        let mut parts = json!([SCENE_VERSION, config.room, body_color, start, cubes, others]);
        if let (Some(hand), Some(parts)) = (self.hand, parts.as_array_mut()) {
            // The hand's position is relative to the mark to be reached.
            parts.extend([json!(hand), json!(self.marks)]);
        }
        let mut hash = hash::of_bytes(parts.to_string().as_bytes());
        hash.truncate(FINGERPRINT_DIGITS);
        hash
    }

    /// The Manhattan distance from the hand to the mark at the start, mm; `None` without a hand.
    pub fn start_distance(&self) -> Option<i32> {
        i32::try_from(manhattan(self.hand?.from_mark) * self.experiment.hand?.step_mm).ok()
    }

    /// Steps after which an episode ends automatically. With a hand: those of the way to the mark and some more,
    /// limited by the experiment; otherwise the configuration's.
    pub fn budget(&self, config: &WorldConfig) -> u32 {
        match (self.experiment.hand, self.hand) {
            (Some(task), Some(hand)) => {
                (manhattan(hand.from_mark) + task.extra_steps).min(self.experiment.steps.unwrap_or(u32::MAX))
            }
            _ => config.for_experiment(&self.experiment).episode.steps,
        }
    }

    /// The number of others to the left of the own body in the first mirror at the start; `None` without a mirror.
    pub(crate) fn mirror_place(&self, config: &WorldConfig) -> Option<usize> {
        let mirror = self.panes.first()?.place;
        let across = |spot: [f64; 2]| mirror.across(spot, self.start.ahead(config.eye.forward).spot(), config);
        let own = across(self.start.spot());
        Some(self.others.iter().filter(|other| across(other.start.spot()) > own).count())
    }

    pub(super) fn candidates(&self) -> &[Cube] {
        if self.experiment.has_candidates() { &self.cubes } else { &[] }
    }

    pub fn floor_plan(&self, config: &WorldConfig) -> FloorPlan {
        floor_plan(config, &self.cubes)
    }
}

pub(super) fn floor_plan(config: &WorldConfig, cubes: &[Cube]) -> FloorPlan {
    FloorPlan {
        reach: config.room.size / 2.0 - config.mirror.gap - config.body.radius,
        radius: config.body.radius,
        squares: cubes.iter().filter(|cube| cube.base <= 0.0).map(Cube::square).collect(),
    }
}
