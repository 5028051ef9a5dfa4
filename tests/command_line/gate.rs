//! `gate`: a verdict for each cell, an exit code for each verdict, and the episodes that flipped.

use std::path::Path;

use serde_json::{Value, json};

use super::comparable::{Cell, LIKE, solved};
use crate::harness::program::{Answer, run};

/// A folder with `base` and `new`.
fn two(base: &Cell, new: &Cell) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    base.write(&folder.path().join("base"));
    new.write(&folder.path().join("new"));
    folder
}

fn of(successes: usize, n: usize) -> Cell<'static> {
    Cell { solved: solved(successes, n), ..LIKE }
}

fn gate(folder: &Path, words: &[&str]) -> Answer {
    run(folder, &[&["gate", "base", "new"], words].concat())
}

fn cell(folder: &Path, words: &[&str]) -> (i32, Value) {
    let answer = gate(folder, &[&["--format", "json"], words].concat());
    let found: Value = serde_json::from_str(&answer.stdout).unwrap();
    assert_eq!(found["verdict"], found["cells"][0]["verdict"]);
    (answer.code, found["cells"][0].clone())
}

#[test]
fn each_verdict_has_its_exit_code() {
    for (base, new, verdict, code) in [
        (of(0, 21), of(21, 21), "improved", 0),
        (of(60, 60), of(60, 60), "held", 0),
        (of(21, 21), of(0, 21), "regressed", 1),
        (of(14, 21), of(13, 21), "cannot_say", 4),
        (of(21, 21), Cell { mirror: 1.2, ..of(0, 21) }, "not_comparable", 5),
    ] {
        let folder = two(&base, &new);
        let (found, cell) = cell(folder.path(), &[]);
        assert_eq!((cell["verdict"].as_str().unwrap(), found), (verdict, code), "{cell}");
    }
}

#[test]
fn a_cell_of_which_nothing_is_said_names_the_episodes_that_would_settle_it() {
    let folder = two(&of(14, 21), &of(13, 21));
    let (_, found) = cell(folder.path(), &[]);
    let settled = found["settled_by"].as_u64().unwrap();
    assert!(settled > 21, "{found}");
    assert_eq!(found["why"], format!("about {settled} scenes on each side would settle it"));
    // With so many the same rates hold.
    let n = usize::try_from(settled).unwrap();
    let folder = two(&of(n * 14 / 21, n), &of(n * 14 / 21 - n / 21, n));
    assert_eq!(cell(folder.path(), &[]).1["verdict"], "held");
}

#[test]
fn what_differs_is_named_and_may_be_pooled() {
    let folder = two(&of(21, 21), &Cell { mirror: 1.2, ..of(0, 21) });
    let (_, found) = cell(folder.path(), &[]);
    assert_eq!(found["why"], "world.mirror.width is 3.0 and 1.2");
    let (code, found) = cell(folder.path(), &["--pool"]);
    assert_eq!((code, &found["verdict"]), (1, &json!("regressed")));
    for format in ["text", "md", "github", "junit", "json"] {
        let answer = gate(folder.path(), &["--pool", "--format", format]).ends(1).stdout;
        assert!(answer.contains("(--pool): world.mirror.width is 3.0 and 1.2"), "{format}: {answer}");
    }
    // A cell of one side alone is none.
    Cell { experiment: "E2", ..of(3, 3) }.write(&folder.path().join("base"));
    let answer = gate(folder.path(), &["--pool"]).ends(1).stdout;
    assert!(answer.contains("NEW has no episode"), "{answer}");
}

#[test]
fn another_model_of_the_same_world_is_compared_by_its_scenes() {
    let folder = two(&of(21, 21), &Cell { model: "ant-2", ..of(0, 21) });
    let (code, found) = cell(folder.path(), &[]);
    assert_eq!((code, &found["model"], &found["base_model"]), (1, &json!("ant-2"), &json!("ant")));
    let flip = &found["flips"][0];
    assert_eq!(
        (&flip["base"]["episode_id"], &flip["new"]["episode_id"]),
        (&json!("E1/ant/s1/r1"), &json!("E1/ant-2/s1/r1"))
    );
    assert_eq!((&flip["base"]["timesteps"], &flip["new"]["value"]), (&json!([2]), &json!(0)));
}

#[test]
fn repeats_of_few_scenes_give_no_verdict() {
    let few = |successes| Cell { scenes: 3, ..of(successes, 60) };
    for (base, new) in [(60, 0), (60, 60)] {
        let folder = two(&few(base), &few(new));
        assert_eq!(cell(folder.path(), &[]).0, 4);
    }
}

#[test]
fn a_verdict_that_lost_episodes_could_turn_is_none() {
    let folder = two(&of(21, 21), &Cell { lost: 10, ..of(10, 21) });
    let (_, without) = cell(folder.path(), &["--where", "run <= 10"]);
    assert_eq!(without["new"]["lost"], 0);
    let folder = two(&of(60, 60), &Cell { lost: 30, ..of(60, 60) });
    let (code, found) = cell(folder.path(), &[]);
    assert_eq!((code, &found["new"]["lost"], &found["new"]["n"]), (4, &json!(30), &json!(30)));
    assert_eq!(found["why"], "held without the 30 lost episodes, regressed if they count against NEW");
}

#[test]
fn scores_stand_for_traces_and_durations_have_a_margin_in_steps() {
    let folder = two(&of(21, 21), &of(0, 21));
    for side in ["base", "new"] {
        run(folder.path(), &["score", side, "-o", &format!("{side}.parquet")]).done();
    }
    let answer = run(folder.path(), &["gate", "base.parquet", "new.parquet", "--format", "json"]).ends(1).stdout;
    let found: Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(found["cells"][0]["flips"][0]["base"]["timesteps"], Value::Null);
    // All durations are equal: without spread there is no interval, and no verdict.
    let (code, found) = cell(folder.path(), &["--metric", "TTD", "--margin", "5"]);
    assert_eq!((code, &found["p_adjusted"]), (4, &Value::Null));
    let message = gate(folder.path(), &["--metric", "TSB"]).refused();
    assert!(message.contains("TSA"), "{message}");
    assert!(gate(folder.path(), &["--margin", "0"]).refused().contains("above 0"));
}

#[test]
fn every_format_names_the_flips() {
    let folder = two(&of(21, 21), &Cell { prompt: "p", ..of(0, 21) });
    let text = |format: &str| gate(folder.path(), &["--format", format]).ends(1).stdout;
    let flip = "E1/ant/s1/r1 1 (step 2) -> E1/ant/s1/r1 0 (step 2)";
    assert!(text("text").contains(flip) && text("text").ends_with("\nregressed: 1 regressed\n"), "{}", text("text"));
    assert!(text("md").contains("| E1 | ant | regressed |"), "{}", text("md"));
    let github = text("github");
    assert!(github.starts_with("::error title=E1 ant TSA%3A regressed::regressed: worse by 1.000, p "), "{github}");
    assert_eq!(github.lines().count(), 1);
    assert!(github.contains("%0AE1/ant/s1/r1 1"));
    let junit = text("junit");
    assert!(
        junit.contains("<failure message=\"regressed: worse by 1.000, p ") && junit.contains("1 (step 2) -&gt;"),
        "{junit}"
    );
    assert!(junit.contains("tests=\"1\" failures=\"1\" errors=\"0\" skipped=\"0\""), "{junit}");
}

#[cfg(feature = "view")]
#[test]
fn a_flip_leads_to_its_frames_where_a_page_was_exported_beside_the_traces() {
    let folder = two(&of(21, 21), &of(0, 21));
    run(folder.path(), &["view", "new", "--export", "new-page"]).done();
    let (_, found) = cell(folder.path(), &[]);
    let flip = &found["flips"][0];
    assert_eq!(flip["new"]["frames"], "new-page/index.html?view=episode&id=E1/ant/s1/r1&t=2");
    // The page has other values of the earlier episodes, whose ids are the same.
    assert_eq!(flip["base"]["frames"], Value::Null);
}
