//! Random episodes: any column may be null, rows may follow `done`, and episodes may have one step.

use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;
use proptest::sample::select;

/// Null, one of two colours, or one of the column's other words.
fn color(words: &[&'static str]) -> impl Strategy<Value = Option<String>> {
    option::of(select([&["red", "blue"], words].concat()).prop_map(str::to_owned))
}

fn float() -> impl Strategy<Value = f32> {
    select(vec![0.0, -0.0, 1.5, -2.25, f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3.0, 1.0])
}

fn extra() -> impl Strategy<Value = Extra> {
    let text = select(vec!["I think", "maybe me", "", "done", "Z", "é"]).prop_map(str::to_owned);
    let columns = (option::of(0..4), option::of(0..4), option::of(float()), option::of(float()), any::<Option<bool>>());
    (columns, option::of(text)).prop_map(|((mirror_px, mirror_self_px, pose_x, pose_y, bumped), reasoning)| Extra {
        mirror_px,
        mirror_self_px,
        pose_x,
        pose_y,
        bumped,
        reasoning,
        ..Extra::default()
    })
}

fn step() -> impl Strategy<Value = Step> {
    let action = option::of(select(&Action::ALL[..]));
    (action, color(&["unknown"]), color(&["none"]), any::<bool>(), extra()).prop_map(
        |(action, self_color, selected_cube, mirror_visible, extra)| Step {
            action,
            self_color,
            selected_cube,
            mirror_visible,
            extra,
        },
    )
}

fn episode() -> impl Strategy<Value = Episode> {
    let names = (select(vec!["m", "other", "third"]), select(vec!["E1", "E2", "E5"]), select(vec!["red", "blue"]));
    let numbers = (0..3_i32, 0..8_i32, option::of(0..3_i8));
    (names, numbers, color(&[]), vec(step(), 1..9)).prop_map(
        |((model, experiment, body_color), (seed, run, distractors), stated_color, steps)| Episode {
            model: model.into(),
            experiment: experiment.into(),
            seed,
            run,
            body_color: body_color.into(),
            stated_color,
            distractors,
            steps,
            ..Episode::default()
        },
    )
}

/// Random episodes with distinct ids.
pub fn episodes(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Episode>> {
    vec(episode(), count).prop_map(|mut episodes| {
        episodes.iter_mut().enumerate().for_each(|(at, episode)| episode.episode_id = format!("e{at:03}"));
        episodes
    })
}
