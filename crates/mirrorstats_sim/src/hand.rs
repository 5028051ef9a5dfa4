//! The hand of a reaching task: its position and its obstacles.
//!
//! Rule: its position is whole steps from the mark away from the camera, left in the picture and up, so distances are
//! exact. It never enters the body, the mirror's plane, the floor, the ceiling or a wall.

use super::body::Pose;
use super::config::{WorldConfig, metres};
use super::scene::{BEFORE_MIRROR, HandStart, Patch, Scene, in_room, manhattan};
use mirrorstats_experiment::spec::{Hand, Part};
use mirrorstats_trace::episodes::episode::Action;

/// Half of the body's box ahead and to the side, and its height, m.
const BODY: [f64; 3] = [0.12, 0.3, 1.62];

/// The units and limits of a hand's steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct HandRules<'a> {
    pub task: Hand,
    pub patch: Patch,
    pub hand: HandStart,
    pub config: &'a WorldConfig,
    pub body: Pose,
}

impl<'a> HandRules<'a> {
    pub fn for_scene(scene: &Scene, config: &'a WorldConfig) -> Option<Self> {
        let patch = scene.marks.iter().find(|mark| mark.part == Part::Front)?.patch?;
        Some(Self { task: scene.experiment.hand?, patch, hand: scene.hand?, config, body: scene.start })
    }

    fn local(&self, from_mark: [i32; 3]) -> [f64; 3] {
        let (step, mark) = (metres(self.task.step_mm), self.patch.place());
        [0, 1, 2].map(|axis| mark[axis] + step * f64::from(from_mark[axis]))
    }

    pub fn center(&self, from_mark: [i32; 3]) -> [f64; 3] {
        in_room(self.body, self.local(from_mark))
    }

    pub fn is_free(&self, from_mark: [i32; 3]) -> bool {
        let half = self.hand.half();
        let [ahead, left, up] = self.local(from_mark);
        let is_in_body = ahead.abs() < BODY[0] + half && left.abs() < BODY[1] + half && up < BODY[2] + half;
        let [x, y, _] = self.center(from_mark);
        let room = self.config.room.size / 2.0 - half;
        let is_in_room = x.abs() <= room && y.abs() <= room && up >= half && up <= self.config.room.height - half;
        !is_in_body && is_in_room && ahead + half <= BEFORE_MIRROR
    }

    /// The Manhattan distance to the mark, mm.
    pub fn distance_mm(&self, from_mark: [i32; 3]) -> u32 {
        self.task.step_mm * manhattan(from_mark)
    }

    pub fn is_reached(&self, from_mark: [i32; 3]) -> bool {
        self.distance_mm(from_mark) <= self.task.within * self.task.step_mm
    }
}

pub(super) fn step(action: Action) -> Option<[i32; 3]> {
    Some(match action {
        Action::HandForward => [1, 0, 0],
        Action::HandBackward => [-1, 0, 0],
        Action::HandLeft => [0, 1, 0],
        Action::HandRight => [0, -1, 0],
        Action::HandUp => [0, 0, 1],
        Action::HandDown => [0, 0, -1],
        Action::MoveForward | Action::MoveBackward | Action::TurnLeft | Action::TurnRight | Action::Done => {
            return None;
        }
    })
}
