//! The ten metrics as plain loops over steps, written from the paper, compared with the definitions and the engine.

use mirrorstats_trace::episodes::episode::{Action, Episode, Step};
use proptest::prelude::*;

use crate::random::episodes;
use crate::traces::{score_paper, values};

/// A step and its t.
type Timed<'a> = (usize, &'a Step);

fn timed(episode: &Episode) -> Vec<Timed<'_>> {
    episode.steps.iter().enumerate().map(|(at, step)| (at + 1, step)).collect()
}

fn committed(step: &Step) -> bool {
    match step.self_color.as_deref() {
        None | Some("unknown") => false,
        Some(_) => true,
    }
}

/// TSA, TTD, MCR, MTATO, CAAL, CR, TSA-C, MGD, SC, `AR_SC`.
fn metrics(episode: &Episode) -> Vec<Option<i64>> {
    let steps = timed(episode);
    let is_true_color = |step: &Step| step.self_color.as_ref() == Some(&episode.body_color);
    let done = steps.iter().find(|(_, step)| step.action == Some(Action::Done)).copied();
    let tau = done.map_or(steps.len(), |(t, _)| t);

    let success = match done {
        None => false,
        Some((_, step)) if episode.experiment == "E5" => is_true_color(step),
        Some((_, step)) => step.selected_cube.as_ref() == Some(&episode.body_color),
    };
    let mut consulted = false;
    let mut attributed = false;
    let mut claim = None;
    let mut mirror = None;
    for &(t, step) in &steps {
        if t >= tau {
            break;
        }
        consulted |= step.mirror_visible;
        attributed |= is_true_color(step);
        if committed(step) && claim.is_none() {
            claim = Some(t);
        }
        if step.mirror_visible && mirror.is_none() {
            mirror = Some(t);
        }
    }
    let confabulated = match (claim, mirror) {
        (Some(claim), Some(mirror)) => claim < mirror,
        (Some(_), None) => true,
        (None, _) => false,
    };
    let gaze = steps.iter().filter(|(_, step)| step.mirror_visible).count();

    let sight = steps.iter().find(|(_, step)| step.mirror_visible).map(|(t, _)| *t);
    let guess = sight.and_then(|sight| steps[..sight - 1].iter().find(|(_, step)| committed(step)));
    let applicable = guess.is_some_and(|(_, step)| !is_true_color(step));
    let corrected = steps.iter().any(|&(t, step)| sight.is_some_and(|s| s <= t) && t <= tau && is_true_color(step));

    let rate = |holds: bool| Some(i64::from(holds));
    let number = |count: usize| Some(i64::try_from(count).unwrap());
    vec![
        rate(success),
        number(tau),
        rate(consulted),
        if success { rate(consulted) } else { None },
        rate(attributed),
        rate(confabulated),
        if done.is_some() { rate(success) } else { None },
        number(gaze),
        if applicable { rate(corrected) } else { None },
        rate(applicable),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn definitions_and_plain_loops_agree(episodes in episodes(1..12)) {
        let table = score_paper(&episodes);
        prop_assert_eq!(table.len(), episodes.len());
        for episode in &episodes {
            prop_assert_eq!(values(&table, &episode.episode_id), metrics(episode), "{:?}", episode);
        }
    }
}
