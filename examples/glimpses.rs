//! Writes `fixtures/glimpses.parquet`: eight short episodes with the agent's own pixels in the mirror, for scoring
//! under another visibility threshold. `cargo run --example glimpses` writes it again.

use std::path::Path;

use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::write::write_episodes;

/// The number of pixels from which the recorder called the mirror visible.
const RECORDED_THRESHOLD: i32 = 50;

/// An agent, and its own pixels in the mirror at each timestep of its four runs.
const AGENTS: [(&str, [&[i32]; 4]); 2] = [
    ("far glimpser", [&[0, 60, 120, 0, 0], &[0, 0, 80, 0], &[0, 150, 260, 0, 0], &[0, 0, 0]]),
    ("close looker", [&[0, 90, 400, 900, 0], &[0, 310, 0], &[55, 0, 640, 0], &[0, 0, 190, 210]]),
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let episodes: Vec<Episode> = AGENTS
        .iter()
        .flat_map(|(model, runs)| (1..).zip(runs).map(|(run, pixels)| episode(model, run, pixels)))
        .collect();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/glimpses.parquet");
    Ok(write_episodes(&path, None, &episodes)?)
}

/// An episode that names its colour from the second step on and decides for it at the last.
fn episode(model: &str, run: i32, pixels: &[i32]) -> Episode {
    let last = pixels.len() - 1;
    let step = |(at, &pixels): (usize, &i32)| Step {
        action: Some(if at == last { Action::Done } else { Action::TurnLeft }),
        self_color: Some(if at == 0 { "unknown" } else { "blue" }.to_owned()),
        selected_cube: Some(if at == last { "blue" } else { "none" }.to_owned()),
        mirror_visible: pixels >= RECORDED_THRESHOLD,
        extra: Extra { mirror_self_px: Some(pixels), ..Extra::default() },
    };
    Episode {
        episode_id: format!("{}/r{run}", model.replace(' ', "-")),
        model: model.to_owned(),
        experiment: "E1".to_owned(),
        seed: 1,
        run,
        body_color: "blue".to_owned(),
        steps: pixels.iter().enumerate().map(step).collect(),
        ..Episode::default()
    }
}
