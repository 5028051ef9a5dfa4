//! The paper's ten metrics at the edges of their definitions; `by_hand.txt` holds steps and expected values.

use mirrorstats_exact::moments::StandardError;
use mirrorstats_score::cells::group::group;
use mirrorstats_trace::episodes::episode::{Action, Episode, Step};

use crate::harness;
use crate::traces::{score_paper, values};

const METRICS: [&str; 10] = ["TSA", "TTD", "MCR", "MTATO", "CAAL", "CR", "TSA-C", "MGD", "SC", "AR_SC"];

struct Case {
    episode: Episode,
    expected: Vec<Option<i64>>,
}

/// The cases of the file; the text before the first `==` explains it.
fn cases() -> Vec<Case> {
    let text = include_str!("by_hand.txt");
    text.split("\n\n").filter(|part| part.starts_with("== ")).skip(1).map(case).collect()
}

fn case(text: &str) -> Case {
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let name = lines.next().unwrap().trim_start_matches("== ");
    let (experiment, body_color) = lines.next().unwrap().split_once(' ').unwrap();
    let (steps, expected): (Vec<_>, Vec<_>) = lines.partition(|line| !line.starts_with('>'));
    let values = expected[0].split_whitespace().skip(1);
    let episode = Episode {
        experiment: experiment.into(),
        body_color: body_color.into(),
        ..harness::traces::episode(name, steps.into_iter().map(step).collect())
    };
    Case { episode, expected: values.map(|value| (value != ".").then(|| value.parse().unwrap())).collect() }
}

fn step(line: &str) -> Step {
    let fields: Vec<&str> = line.split_whitespace().collect();
    let [action, self_color, cube, mirror] = fields[..] else { panic!("{line}: not four fields") };
    let action = match action {
        "fwd" => Some(Action::MoveForward),
        "back" => Some(Action::MoveBackward),
        "left" => Some(Action::TurnLeft),
        "right" => Some(Action::TurnRight),
        "done" => Some(Action::Done),
        "." => None,
        other => panic!("{line}: no action `{other}`"),
    };
    let text = |field: &str| match field {
        "." => None,
        "?" => Some("unknown".to_owned()),
        word => Some(word.to_owned()),
    };
    assert!(matches!(mirror, "M" | "-"), "{line}: no mirror");
    Step {
        action,
        self_color: text(self_color),
        selected_cube: text(cube),
        mirror_visible: mirror == "M",
        ..Step::default()
    }
}

#[test]
fn the_paper_s_metrics_are_as_worked_out_by_hand() {
    let cases = cases();
    assert!(cases.len() >= 38, "{} cases were read", cases.len());
    let episodes: Vec<Episode> = cases.iter().map(|case| case.episode.clone()).collect();
    let table = score_paper(&episodes);
    assert_eq!(table.metrics.iter().map(|metric| metric.name.as_str()).collect::<Vec<_>>(), METRICS);
    for Case { episode, expected } in &cases {
        assert_eq!(expected.len(), METRICS.len(), "{}", episode.episode_id);
        for ((name, found), expected) in METRICS.iter().zip(values(&table, &episode.episode_id)).zip(expected) {
            assert_eq!(found, *expected, "{name} of `{}`", episode.episode_id);
        }
    }
}

#[test]
fn the_score_of_an_episode_does_not_depend_on_others() {
    for Case { episode, expected } in cases() {
        assert_eq!(
            values(&score_paper(std::slice::from_ref(&episode)), &episode.episode_id),
            expected,
            "{}",
            episode.episode_id
        );
    }
}

#[test]
fn cells_with_one_episode_or_no_success_match_worked_examples() {
    let cases = cases();
    let named = |name: &str, model: &str, id: &str| {
        let case = cases.iter().find(|case| case.episode.episode_id == name).expect("a case of the file");
        Episode { model: model.into(), episode_id: id.into(), ..case.episode.clone() }
    };
    let table = score_paper(&[
        named("done at t = 1, right", "once", "a"),
        named("done at t = 1, wrong", "never", "b"),
        named("rows after done", "mixed", "c"),
        named("no done", "mixed", "d"),
        named("done twice, only the second is right", "never", "e"),
    ]);
    let cells = group(&table, &["model".to_owned()]).unwrap();
    let of = |model: &str, metric: &str| {
        let group = cells.groups.iter().find(|group| group.key[0].to_string() == model).unwrap();
        let at = METRICS.iter().position(|name| *name == metric).unwrap();
        let moments = group.moments[at];
        (group.episodes, moments.n, moments.sum, moments.sum_sq, moments.mean(), moments.se(StandardError::Sample))
    };
    assert_eq!(of("once", "MTATO"), (1, 1, 0, 0, Some(0.0), None));
    assert_eq!(of("once", "SC"), (1, 0, 0, 0, None, None));
    assert_eq!(of("never", "MTATO"), (2, 0, 0, 0, None, None));
    assert_eq!(of("never", "TTD"), (2, 2, 3, 5, Some(1.5), Some(0.5)));
    assert_eq!(of("mixed", "TSA"), (2, 2, 1, 1, Some(0.5), Some(0.5)));
    assert_eq!(of("mixed", "TSA-C"), (2, 1, 1, 1, Some(1.0), None));
    assert_eq!(of("mixed", "MTATO"), (2, 1, 0, 0, Some(0.0), None));
    assert_eq!(of("mixed", "SC"), (2, 1, 0, 0, Some(0.0), None));
}
