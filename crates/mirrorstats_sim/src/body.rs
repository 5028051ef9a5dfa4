//! A humanoid in a room: its position, direction and limbs.
//!
//! Rule: a body is upright and moves as a cylinder; its limbs have three positions, standing and the two halves of a
//! stride. None is visible in one's own view.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::config::BodyConfig;
use mirrorstats_exact::names;
use mirrorstats_experiment::angle::{Heading, Quaternion};
use mirrorstats_experiment::spec::Body;

pub(super) struct BodyModel {
    pub(super) xml: &'static str,
    /// The parts that keep their own colour.
    pub(super) neutral_parts: &'static [&'static str],
    /// The height by which legs rise in a stride, m: otherwise the humanoid's toes would enter the floor.
    lift: f64,
}

impl BodyModel {
    pub(super) const fn new(body: Body) -> Self {
        match body {
            Body::Mannequin => Self {
                xml: include_str!("../../../assets/world/mannequin.xml"),
                neutral_parts: &["head", "face", "neck"],
                lift: 0.0,
            },
            Body::Humanoid => {
                Self { xml: include_str!("../../../assets/world/humanoid.xml"), neutral_parts: &[], lift: 0.0125 }
            }
        }
    }
}

/// The position and direction of a body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// m, from the centre of the room.
    pub x: f64,
    /// m, from the centre of the room.
    pub y: f64,
    /// Steps of 30 degrees counter-clockwise from +x.
    pub heading: Heading,
}

impl Pose {
    /// The position of the body's axis.
    pub const fn spot(self) -> [f64; 2] {
        [self.x, self.y]
    }

    /// Its position `length` ahead, or back if negative.
    #[must_use]
    pub fn ahead(self, length: f64) -> Self {
        let [x, y] = self.heading.direction();
        Self { x: self.x + length * x, y: self.y + length * y, heading: self.heading }
    }
}

/// The position of the limbs: in the picture after a step the body is in the middle of a stride.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Stride {
    /// All limbs hang down.
    #[default]
    Standing,
    /// The left leg and the right arm are ahead.
    Left,
    /// The right leg and the left arm are ahead.
    Right,
}

/// A body as it is at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Figure {
    /// Its position and direction.
    pub pose: Pose,
    /// The position of its limbs.
    pub stride: Stride,
    /// Steps that it has taken, of which the next stride follows.
    pub steps: u32,
}

impl Figure {
    pub const fn standing(pose: Pose) -> Self {
        Self { pose, stride: Stride::Standing, steps: 0 }
    }

    pub(crate) const fn step_to(&mut self, pose: Pose) {
        self.steps = self.steps.wrapping_add(1);
        self.stride = if self.steps % 2 == 1 { Stride::Left } else { Stride::Right };
        self.pose = pose;
    }

    pub fn turn(&mut self, thirties: i8) {
        self.stride = Stride::Standing;
        self.pose.heading = self.pose.heading.turned(thirties);
    }

    pub const fn stand(&mut self) {
        self.stride = Stride::Standing;
    }
}

/// A rigid piece of the humanoid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Piece {
    Trunk,
    LeftArm,
    RightArm,
    LeftLeg,
    RightLeg,
}

// Every body has one of each, named as in `assets/world/mannequin.xml` and `humanoid.xml`.
names!(Piece {
    Trunk: "trunk",
    LeftArm: "left_arm",
    RightArm: "right_arm",
    LeftLeg: "left_leg",
    RightLeg: "right_leg",
});

impl Piece {
    fn swing(self, stride: Stride, config: &BodyConfig) -> f64 {
        let side = match stride {
            Stride::Standing => return 0.0,
            Stride::Left => 1.0,
            Stride::Right => -1.0,
        };
        match self {
            Self::Trunk => 0.0,
            Self::LeftArm => -side * config.arm_swing,
            Self::RightArm => side * config.arm_swing,
            Self::LeftLeg => side * config.leg_swing,
            Self::RightLeg => -side * config.leg_swing,
        }
    }

    /// Its placement in the room: its rotation, and the position of its origin, which is `joint` in the body's frame.
    pub fn place(self, figure: &Figure, joint: [f64; 3], config: &BodyConfig) -> ([f64; 3], Quaternion) {
        let Pose { x, y, heading } = figure.pose;
        let [cosine, sine] = heading.direction();
        let is_lifted = matches!(self, Self::LeftLeg | Self::RightLeg) && figure.stride != Stride::Standing;
        let height = joint[2] + if is_lifted { BodyModel::new(config.shape).lift } else { 0.0 };
        let origin = [x + cosine * joint[0] - sine * joint[1], y + sine * joint[0] + cosine * joint[1], height];
        let swing = Quaternion::about_y(-self.swing(figure.stride, config));
        (origin, heading.rotation().after(swing))
    }
}
