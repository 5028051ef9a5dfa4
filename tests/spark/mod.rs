//! `--engine spark` at the process boundary: with a real cluster on loopback, and with a stand-in for `spark-submit`
//! where only its input and the handling of its answers matter.
//!
//! The cluster needs Java and pyspark: `scripts/get-spark.sh` fetches both.

mod cluster;
mod on_cluster;
mod parts;
mod stand_in;

use crate::harness::files::fixture;
use crate::harness::program::{Answer, answer, program};
use crate::harness::traces::write_trace as write;
use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};

/// An episode with texts that are easy to get wrong; seen at t = 2, decided at t = 3.
fn episode(id: &str, experiment: &str, run: i32) -> Episode {
    let texts = [Some("I think it's\nme"), None, Some("naïve Straße, maybe\n"), Some("line1\rline2 \\ 'x'")];
    let step = |at: usize, action| Step {
        action,
        self_color: ["red", "unknown", "blue", "red"].get(at + usize::try_from(run).unwrap() % 2).map(|c| (*c).into()),
        selected_cube: (at > 0).then(|| "blue".into()),
        mirror_visible: at == 1,
        extra: Extra {
            reasoning: texts[at].map(str::to_owned),
            mirror_self_px: (at != 2).then_some(100 * run),
            pose_x: [Some(1.5), Some(f32::NAN), None, Some(-0.0)][at],
            ..Extra::default()
        },
    };
    let actions = [Some(Action::TurnLeft), None, Some(Action::Done), Some(Action::Done)];
    let steps = actions.into_iter().enumerate().map(|(at, action)| step(at, action)).collect();
    Episode {
        model: "it's `m` \\ é".into(),
        experiment: experiment.into(),
        run,
        body_color: "blue".into(),
        stated_color: (run == 1).then(|| "red".into()),
        ..crate::harness::traces::episode(id, steps)
    }
}
