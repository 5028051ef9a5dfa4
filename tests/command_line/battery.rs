//! The battery's definitions, worked out by hand.

use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::write::write_episodes;

use crate::harness::traces;
use crate::run;

/// A step of a mark test: the mark on the own body, its pixels, the report, true if it is the decision.
type Row<'a> = (Option<&'a str>, Option<i32>, Option<&'a str>, bool);

const fn action(is_done: bool) -> Action {
    if is_done { Action::Done } else { Action::TurnLeft }
}

fn mark_test(id: &str, rows: &[Row]) -> Episode {
    let step = |&(mark, px, report, is_done): &Row| Step {
        action: Some(action(is_done)),
        extra: Extra {
            mark_color: mark.map(str::to_owned),
            mirror_mark_px: px,
            mark_report: report.map(str::to_owned),
            ..Extra::default()
        },
        ..Step::default()
    };
    let steps = rows.iter().map(step).collect();
    let decision = Some("mark_report".to_owned());
    Episode { experiment: "mark".into(), decision, ..traces::episode(id, steps) }
}

/// A red body, with blue shown in a pane; a claim at the first step, a cube and perhaps `done` at the second.
fn pane(id: &str, experiment: &str, claim: &str, cube: &str, is_done: bool) -> Episode {
    // The pane is in view at once: a decoy counts as mirror evidence, a stranger has 60 px.
    let is_window = experiment == "window";
    let first = Step {
        action: Some(action(false)),
        self_color: Some(claim.to_owned()),
        mirror_visible: !is_window,
        extra: Extra { mirror_double_px: is_window.then_some(60), ..Extra::default() },
        ..Step::default()
    };
    let second = Step { action: Some(action(is_done)), selected_cube: Some(cube.to_owned()), ..Step::default() };
    Episode {
        experiment: experiment.into(),
        body_color: "red".into(),
        shown_color: Some("blue".to_owned()),
        ..traces::episode(id, vec![first, second])
    }
}

fn scores(episodes: &[(&str, Vec<Episode>)], engine: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    for (name, episodes) in episodes {
        write_episodes(&folder.path().join(name), None, episodes).unwrap();
    }
    let metrics = "TSA,DECOY_CLAIM,WINDOW_CLAIM,MARK_REPORT,MARK_SEEN,MARK_DELAY,MARK_FALSE";
    let words = ["score", ".", "--definitions", "battery", "--engine", engine, "--metrics", metrics];
    run(folder.path(), &words).done()
}

fn files() -> Vec<(&'static str, Vec<Episode>)> {
    let (none, green, pink) = (Some("none"), Some("green"), Some("pink"));
    let marks = vec![
        // Another body's mark at t = 2. 7 px do not count as seen, 8 do: t = 4 to 6.
        mark_test(
            "a",
            &[
                (None, Some(0), none, false),
                (None, Some(0), pink, false),
                (green, Some(7), none, false),
                (green, Some(8), none, false),
                (green, Some(30), none, false),
                (green, Some(0), green, true),
            ],
        ),
        // Done before there is a mark: `none` is wrong here.
        mark_test("b", &[(None, Some(0), none, false), (None, Some(0), none, true)]),
        // Right at once, and never done.
        mark_test("d", &[(green, Some(25), green, false), (green, Some(25), green, false)]),
        // The right colour before there is a mark is an invention. The mark is first seen at the decision.
        mark_test("e", &[(None, Some(0), green, false), (green, Some(25), green, true)]),
        // Seen, then a wrong colour: wrong, but not a false mark.
        mark_test("f", &[(green, Some(25), None, false), (green, Some(25), pink, true)]),
    ];
    let panes = vec![
        pane("g", "decoy", "blue", "blue", true),
        pane("h", "decoy", "blue", "red", true),
        pane("i", "decoy", "blue", "blue", false),
        pane("j", "window", "blue", "red", true),
        pane("k", "window", "unknown", "blue", true),
    ];
    // Only what was in view counts: a claim before the stranger is visible, a decoy with too few pixels beside a
    // mirror, a decoy with enough, and the second of two own marks.
    let mut early = pane("m", "window", "blue", "red", true);
    early.steps[0].extra.mirror_double_px = Some(0);
    early.steps[1].extra.mirror_double_px = Some(60);
    let mut unseen = pane("n", "decoy", "blue", "blue", true);
    unseen.steps.iter_mut().for_each(|step| step.extra.shown_px = Some(59));
    let mut seen = pane("o", "decoy", "blue", "blue", true);
    seen.steps.iter_mut().for_each(|step| step.extra.shown_px = Some(60));
    let mut second = mark_test("p", &[(green, Some(30), none, false), (green, Some(30), green, true)]);
    second.steps.iter_mut().for_each(|step| step.extra.mark1_px = Some(7));
    // No own mark in the whole trace: `none` is right.
    let unmarked = vec![mark_test("c", &[(None, None, none, false), (None, None, none, true)])];
    let plain = vec![Episode { shown_color: None, ..pane("l", "E1", "blue", "red", true) }];
    let by_view = vec![early, unseen, seen, second];
    vec![
        ("by-view.parquet", by_view),
        ("marks.parquet", marks),
        ("panes.parquet", panes),
        ("unmarked.parquet", unmarked),
        ("plain.parquet", plain),
    ]
}

const EXPECTED: &str = "\
episode_id,model,experiment,seed,run,TSA,DECOY_CLAIM,WINDOW_CLAIM,MARK_REPORT,MARK_SEEN,MARK_DELAY,MARK_FALSE
a,m,mark,1,1,1,,,1,1,2,1
b,m,mark,1,1,0,,,0,0,,0
c,m,mark,1,1,1,,,,,,0
d,m,mark,1,1,0,,,0,1,0,0
e,m,mark,1,1,1,,,1,0,0,1
f,m,mark,1,1,0,,,0,1,,0
g,m,decoy,1,1,0,1,,,,,
h,m,decoy,1,1,1,0,,,,,
i,m,decoy,1,1,0,0,,,,,
j,m,window,1,1,1,,1,,,,
k,m,window,1,1,0,,0,,,,
l,m,E1,1,1,1,,,,,,
m,m,window,1,1,1,,0,,,,
n,m,decoy,1,1,0,,,,,,
o,m,decoy,1,1,0,1,,,,,
p,m,mark,1,1,1,,,1,0,,0
";

/// The rows sorted by episode id; tables have another order.
fn by_id(scores: &str) -> String {
    let mut lines: Vec<&str> = scores.lines().collect();
    lines[1..].sort_unstable();
    lines.join("\n") + "\n"
}

#[test]
fn the_battery_is_as_worked_out_by_hand() {
    assert_eq!(by_id(&scores(&files(), "native")), EXPECTED);
}

#[test]
fn reports_of_the_paper_have_no_battery() {
    let expected: String = EXPECTED
        .lines()
        .filter(|line| line.contains(",E1,") || line.starts_with("ep"))
        .fold(String::new(), |text, line| text + line + "\n");
    let plain = files().pop().unwrap();
    assert_eq!(scores(&[plain], "native"), expected);
}
