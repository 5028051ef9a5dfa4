//! `gate`: one verdict per cell, one exit code per verdict, and the episodes that flipped.

use std::path::Path;

use serde_json::{Value, json};

use super::comparable::{Cell, LIKE, solved};
use crate::harness::program::{Answer, run};
use resvg::usvg::roxmltree;

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

fn cell_of(folder: &Path, words: &[&str]) -> (i32, Value) {
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
        let (found, cell) = cell_of(folder.path(), &[]);
        assert_eq!((cell["verdict"].as_str().unwrap(), found), (verdict, code), "{cell}");
    }
}

#[test]
fn an_undecided_cell_names_the_episodes_needed() {
    let folder = two(&of(14, 21), &of(13, 21));
    let (_, found) = cell_of(folder.path(), &[]);
    let settled = found["settled_by"].as_u64().unwrap();
    assert!(settled > 21, "{found}");
    assert_eq!(found["why"], format!("about {settled} scenes on each side would settle it"));
    // With that number of scenes the same rates give `held`.
    let n = usize::try_from(settled).unwrap();
    let folder = two(&of(n * 14 / 21, n), &of(n * 14 / 21 - n / 21, n));
    assert_eq!(cell_of(folder.path(), &[]).1["verdict"], "held");
}

#[test]
fn differing_worlds_are_named_and_can_be_pooled() {
    let folder = two(&of(21, 21), &Cell { mirror: 1.2, ..of(0, 21) });
    let (_, found) = cell_of(folder.path(), &[]);
    assert_eq!(found["why"], "world.mirror.width is 3.0 and 1.2");
    let (code, found) = cell_of(folder.path(), &["--pool"]);
    assert_eq!((code, &found["verdict"]), (1, &json!("regressed")));
    for format in ["text", "md", "github", "junit", "json"] {
        let answer = gate(folder.path(), &["--pool", "--format", format]).ends(1).stdout;
        assert!(answer.contains("(--pool): world.mirror.width is 3.0 and 1.2"), "{format}: {answer}");
    }
    // A cell on one side only is not compared.
    Cell { experiment: "E2", ..of(3, 3) }.write(&folder.path().join("base"));
    let answer = gate(folder.path(), &["--pool"]).ends(1).stdout;
    assert!(answer.contains("NEW has no episode"), "{answer}");
}

#[test]
fn another_model_of_the_same_world_is_compared_by_its_scenes() {
    let folder = two(&of(21, 21), &Cell { model: "ant-2", ..of(0, 21) });
    let (code, found) = cell_of(folder.path(), &[]);
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
        assert_eq!(cell_of(folder.path(), &[]).0, 4);
    }
}

#[test]
fn lost_episodes_that_could_turn_a_verdict_withhold_it() {
    let folder = two(&of(21, 21), &Cell { lost: 10, ..of(10, 21) });
    let (_, without) = cell_of(folder.path(), &["--where", "run <= 10"]);
    assert_eq!(without["new"]["lost"], 0);
    let folder = two(&of(60, 60), &Cell { lost: 30, ..of(60, 60) });
    let (code, found) = cell_of(folder.path(), &[]);
    assert_eq!((code, &found["new"]["lost"], &found["new"]["n"]), (4, &json!(30), &json!(30)));
    assert_eq!(found["why"], "held without the 30 lost episodes, regressed if they count against NEW");
}

#[test]
fn scores_replace_traces_and_durations_have_a_margin_in_steps() {
    let folder = two(&of(21, 21), &of(0, 21));
    for side in ["base", "new"] {
        run(folder.path(), &["score", side, "-o", &format!("{side}.parquet")]).done();
    }
    let answer = run(folder.path(), &["gate", "base.parquet", "new.parquet", "--format", "json"]).ends(1).stdout;
    let found: Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(found["cells"][0]["flips"][0]["base"]["timesteps"], Value::Null);
    let told = found["caveats"].to_string();
    assert!(told.contains("base: scores do not say which steps decided") && told.contains("new: scores"), "{told}");
    // Beside the traces the scores have timesteps; the other side still has none.
    std::fs::rename(folder.path().join("base.parquet"), folder.path().join("base/scores.parquet")).unwrap();
    let answer = run(folder.path(), &["gate", "base/scores.parquet", "new.parquet", "--format", "json"]).ends(1).stdout;
    let beside: Value = serde_json::from_str(&answer).unwrap();
    let flip = &beside["cells"][0]["flips"][0];
    assert!(flip["base"]["timesteps"].is_array() && flip["new"]["timesteps"].is_null(), "{flip}");
    assert!(!beside["caveats"].to_string().contains("base: scores"), "{beside}");
    std::fs::remove_file(folder.path().join("base/scores.parquet")).unwrap();
    // All durations are equal. Without variance there is no interval and no verdict.
    let (code, found) = cell_of(folder.path(), &["--metric", "TTD", "--margin", "5"]);
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
    assert!(
        text("text").contains(flip) && text("text").ends_with("\nverdict: regressed; cells: 1 regressed\n"),
        "{}",
        text("text")
    );
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

/// `JUnit` parses as XML, a workflow command is one line of `::COMMAND title=TITLE::MESSAGE`, Markdown has a table.
#[test]
fn every_format_is_well_formed_whatever_the_names_are() {
    let model = "a<b>&\"c\"|d,e:f%g";
    let folder = two(&Cell { model, ..of(21, 21) }, &Cell { model, ..of(0, 21) });
    let text = |format: &str| gate(folder.path(), &["--format", format]).ends(1).stdout;
    let junit = text("junit");
    let options = roxmltree::ParsingOptions { allow_dtd: false, ..roxmltree::ParsingOptions::default() };
    let document = roxmltree::Document::parse_with_options(&junit, options).unwrap();
    let case = document.descendants().find(|node| node.has_tag_name("testcase")).unwrap();
    assert_eq!((case.attribute("classname"), case.attribute("name")), (Some("E1"), Some(&*format!("{model} TSA"))));
    let failure = case.first_element_child().unwrap();
    assert_eq!(failure.tag_name().name(), "failure");
    assert_eq!(failure.text().unwrap().lines().count(), 21);
    let github = text("github");
    let command = github.strip_prefix("::error title=").unwrap();
    let (title, message) = command.split_once("::").unwrap();
    assert_eq!(title, "E1 a<b>&\"c\"|d%2Ce%3Af%25g TSA%3A regressed");
    assert!(message.ends_with('\n') && message.matches('\n').count() == 1, "{message}");
    let markdown = text("md");
    let rows: Vec<&str> = markdown.lines().filter(|line| line.starts_with('|')).collect();
    let columns = |row: &str| row.replace("\\|", "").matches('|').count();
    assert!(rows.len() == 3 && rows.iter().all(|row| columns(row) == 9), "{markdown}");
}

#[test]
fn durations_name_the_episodes_that_would_settle_them() {
    // Every third episode of NEW takes one step more.
    let cell = |long| Cell { long, ..of(21, 21) };
    let folder = two(&cell(2), &cell(3));
    let (code, found) = cell_of(folder.path(), &["--metric", "TTD", "--margin", "0.05"]);
    let settled = found["settled_by"].as_u64().unwrap();
    assert!(code == 4 && settled > 21, "{found}");
    assert_eq!(found["why"], format!("about {settled} scenes on each side would settle it"));
}

#[test]
fn a_filter_and_unusable_replies_are_beside_every_verdict() {
    let folder = two(&of(21, 21), &Cell { unread: 21, ..of(0, 21) });
    for format in ["text", "md", "github", "junit", "json"] {
        let answer = gate(folder.path(), &["--where", "run <= 20", "--format", format]).ends(1).stdout;
        let answer = answer.replace('\n', " ");
        for words in ["NEW: 20 of 40 replies gave no decision (E1 ant 20 of 40)", "run "] {
            assert!(answer.contains(words), "{format}: {answer}");
        }
    }
}
