//! Values of optional columns that agree with the required ones: poses follow actions, pixels follow `mirror_visible`.

use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};

use super::draw::Draw;
use super::episodes::COLORS;

/// Gives an episode the values of its optional columns.
pub fn fill(episode: &mut Episode, number: u64, draw: &mut Draw) {
    episode.stated_color = (episode.experiment == "E3").then(|| draw.one(&COLORS[..3]).to_owned());
    episode.distractors = Some(if episode.experiment == "E4" { 2 } else { 0 });
    let mut pose = Pose { x: coordinate(draw), y: coordinate(draw), yaw: f32::from(draw.short(12)) * 30.0 };
    let mut frame_time = i64::try_from(number).unwrap_or_default() * 1_000_000_000_000;
    for step in &mut episode.steps {
        pose.follow(step.action);
        frame_time += 1_000_000_000 + i64::from(draw.small(1000)) * 1_000_000;
        step.extra = extra(step, &pose, frame_time, draw);
    }
}

/// The pose of the agent: metres, degrees.
struct Pose {
    x: f32,
    y: f32,
    yaw: f32,
}

impl Pose {
    fn follow(&mut self, action: Option<Action>) {
        match action {
            Some(Action::MoveForward) => self.advance(0.25),
            Some(Action::MoveBackward) => self.advance(-0.25),
            Some(Action::TurnLeft) => self.yaw = (self.yaw + 30.0) % 360.0,
            Some(Action::TurnRight) => self.yaw = (self.yaw + 330.0) % 360.0,
            _ => {}
        }
    }

    fn advance(&mut self, metres: f32) {
        self.x += metres * self.yaw.to_radians().cos();
        self.y += metres * self.yaw.to_radians().sin();
    }
}

fn extra(step: &Step, pose: &Pose, frame_time: i64, draw: &mut Draw) -> Extra {
    let seen = |pixels: i32| Some(if step.mirror_visible { pixels } else { 0 });
    let reply_status = if step.action.is_some() { "ok" } else { "parse_failed" };
    let (prompt_tokens, completion_tokens) = (1500 + draw.small(64), 60 + draw.small(120));
    Extra {
        mirror_self_px: seen(200 + draw.small(800)),
        mirror_other_px: seen(0),
        mirror_px: seen(4000 + draw.small(4000)),
        direct_other_px: Some(0),
        pose_x: Some(pose.x),
        pose_y: Some(pose.y),
        pose_yaw: Some(pose.yaw),
        bumped: Some(draw.percent(3)),
        cube_distance: Some(pose.x.hypot(pose.y)),
        reply_status: Some(reply_status.to_owned()),
        latency_ms: Some(800 + draw.small(2000)),
        prompt_tokens: Some(prompt_tokens),
        completion_tokens: Some(completion_tokens),
        cost_usd: Some(f64::from(3 * prompt_tokens + 15 * completion_tokens) / 1e6),
        reasoning: step.action.map(|action| reasoning(action, pose, draw)),
        frame_time: Some(frame_time),
        ..Extra::default()
    }
}

fn reasoning(action: Action, pose: &Pose, draw: &mut Draw) -> String {
    let seen = draw.one(&["a wall", "a mirror", "two cubes", "a body", "the door"]);
    format!("{seen} at {:.1} m, so {}", pose.x.hypot(pose.y), action.name())
}

/// A coordinate in a room of 8 m, to the centimetre.
fn coordinate(draw: &mut Draw) -> f32 {
    f32::from(draw.short(800)) / 100.0 - 4.0
}
