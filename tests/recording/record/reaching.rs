//! A hand that reaches for a mark: recorded with frames, replayed, and reported over levels and arms.

use std::fs;

use serde_json::{Value, json};

use super::recordings::Bench;
use crate::harness::files::assert_same;
use crate::harness::need;
use crate::harness::program::{run, stderr, succeeds};
use crate::harness::traces::{episodes, recording, rows};

/// The scenes of the built-in experiments with a smaller eye; `more` has further keys and tables.
fn file(name: &str, view: &str, more: &str) -> String {
    format!(
        "[experiment.{name}]\ntitle = \"Small\"\nprompt = \"reach-bare\"\nscenes = \"reach-scheme\"\ncamera = \"behind\"\n\
         view = {view}\nhand = {{ step = 0.1, least = 6, most = 12, within = 1, extra_steps = 10 }}\n{more}\n\
         [[experiment.{name}.mark]]\npart = \"front\"\n"
    )
}

fn mirror(name: &str, keys: &str) -> String {
    format!("[[experiment.{name}.mirror]]\n{keys}\nwidth = 2.0\nheight = 2.0\nbottom = 0.0\n")
}

#[test]
fn frames_log_and_trace_of_a_late_mirror_replay_step_by_step() {
    let bench = Bench::new();
    let at = bench.folder.path();
    let small = "{ width = 96, height = 72, fovy = 60 }";
    fs::write(
        bench.path("late.toml"),
        file("small-late", small, &mirror("small-late", "kind = \"delayed\"\ndelay = 2")),
    )
    .unwrap();
    need::drawing();
    succeeds(&mut bench.record_with_frames("runs", "--experiment late.toml --seeds 1 --runs 2 --agent random"));
    let trace = bench.path("runs/small-late-random.parquet");
    let recorded = episodes(&trace);
    assert_eq!(recorded.len(), 2);
    for episode in &recorded {
        let start = episode.start_distance.unwrap();
        assert!((600..=1200).contains(&start) && episode.steps.len() <= usize::try_from(start / 100 + 10).unwrap());
        let mut before = start;
        for step in &episode.steps {
            let distance = step.extra.target_distance.unwrap();
            let moved = if step.extra.bumped == Some(true) { 0 } else { 100 };
            assert_eq!((distance - before).abs(), moved, "{}", episode.episode_id);
            before = distance;
        }
    }
    let said = run(at, &["world", "replay", "runs", "--frames", "frames", "--mcap", "again.mcap", "--json"]).json();
    assert_eq!((&said["episodes"], &said["divergences"]), (&json!(2), &json!([])));
    run(at, &["trace", "recover", "again.mcap", "-o", "again.parquet"]).done();
    assert!(fs::read(bench.path("again.parquet")).unwrap() == fs::read(&trace).unwrap());
    run(at, &["trace", "validate", "runs"]).done();

    // The log has the same frames as the replay.
    let strip = |source: &str, out: &str| {
        run(at, &["world", "filmstrip", "small-late/random/s1/r2", source, "--out", out]).done();
        fs::read(bench.path(out)).unwrap()
    };
    let [log, anew] = [("runs/small-late-random.mcap", "log.png"), ("runs/small-late-random.parquet", "anew.png")]
        .map(|(source, out)| strip(source, out));
    assert!(log == anew);

    // A late mirror shows the start for two steps. Nothing else moves, and the hand itself is in view.
    let frames = |t: usize| fs::read(bench.path(&format!("frames/small-late-random-s1-r2/t{t:03}.png"))).unwrap();
    assert_ne!(frames(1), frames(recorded[1].steps.len()));
}

#[test]
fn frames_have_the_size_that_the_file_says() {
    let bench = Bench::new();
    let view = "{ width = 1024, height = 1024, fovy = 60 }";
    fs::write(
        bench.path("large.toml"),
        file("large", view, &format!("steps = 1\n{}", mirror("large", "kind = \"mirror\""))),
    )
    .unwrap();
    need::drawing();
    succeeds(&mut bench.record_with_frames("runs", "--experiment large.toml --seeds 1 --runs 1 --agent random"));
    let footer = recording(&bench.path("runs/large-random.parquet"));
    assert_eq!(footer["experiment"]["view"], json!({ "width": 1024, "height": 1024, "fovy": 60 }));
    run(bench.folder.path(), &["world", "replay", "runs", "--frames", "frames"]).done();
    let png = fs::read(bench.path("frames/large-random-s1-r1/t001.png")).unwrap();
    assert_eq!(png[16..24], [0, 0, 4, 0, 0, 0, 4, 0], "1024 x 1024 pixels");
}

/// Levels and arms of two agents that need no pictures, as a researcher sees them.
#[test]
fn levels_and_arms_are_pairs_in_one_report() {
    let bench = Bench::new();
    let at = bench.folder.path();
    let words = "--experiment reach-scheme,reach-bare,reach-no-mirror --seeds 2 --runs 3 --no-log";
    for agent in ["random", "frozen"] {
        bench.recorded("runs", &format!("{words} --agent {agent}"));
    }
    run(at, &["report", "runs", "--definitions", "reach", "--out", "report"]).done();
    let table = fs::read_to_string(bench.path("report/tables/main.md")).unwrap();
    // Shares are printed like rates.
    let frozen = table.lines().find(|line| line.starts_with("| frozen")).unwrap();
    assert!(frozen.contains("0.00 (all equal)") && !table.contains("0000"), "{table}");
    for figure in ["intervals", "slopes"] {
        let svg = fs::read_to_string(bench.path(&format!("report/figures/{figure}.svg"))).unwrap();
        assert!(
            svg.contains("SUCCESS") && !["TSA with its", "TSA of each"].iter().any(|words| svg.contains(words)),
            "{figure}"
        );
    }
    let heads = ["SUCCESS", "SIR", "FCR", "PCR", "UNREADABLE", "### reach-no-mirror: Reaching a mark without a mirror"];
    assert!(heads.iter().all(|head| table.contains(head)), "{table}");
    let stats = run(at, &["stats", "runs", "--definitions", "reach", "--json"]).json();
    let pair = |against: &str, metric: &str| -> Value {
        let rows = stats["conditions"].as_array().unwrap();
        let is_ours =
            |row: &&Value| row["baseline"] == "reach-scheme" && row["against"] == against && row["metric"] == metric;
        rows.iter().find(is_ours).unwrap_or_else(|| panic!("{against}, {metric}: {rows:?}")).clone()
    };
    for (against, metric) in [("reach-bare", "SUCCESS"), ("reach-no-mirror", "SUCCESS")] {
        let row = pair(against, metric);
        assert_eq!((&row["matching"]["paired"], &row["matching"]["pairs"]), (&json!(true), &json!(6)), "{row}");
    }
    // No agent is asked for a colour or a cube, so these columns are absent; beside other episodes they have no value.
    let columns = rows(&bench.path("runs/reach-bare-frozen.parquet")).schema();
    assert!(["self_color", "selected_cube"].iter().all(|name| columns.column_with_name(name).is_none()), "{columns}");
    run(at, &["trace", "validate", "runs"]).done();
    bench.recorded("both", "--experiment E1,reach-bare --seeds 1 --runs 2 --no-log --agent random");
    // Each has its own definitions; a file that includes both scores the mixture.
    fs::write(bench.path("both.toml"), "include = [\"paper\", \"reach\"]\n").unwrap();
    let scores = run(at, &["score", "both", "--definitions", "both.toml"]).done();
    assert_eq!(scores.lines().filter(|line| line.starts_with("reach-bare/random/s1/")).count(), 2, "{scores}");

    // The same command again gives the same bytes and records nothing twice.
    let before = bench.files("runs");
    bench.recorded("runs", &format!("{words} --agent frozen"));
    assert_same(&bench.files("runs"), &before);
}

#[test]
fn a_script_without_a_hand_is_refused_before_anything_is_made() {
    let bench = Bench::new();
    let refused =
        bench.record("runs", "--experiment E1,reach-bare --seeds 1 --runs 1 --agent guesser").output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    let said = stderr(&refused);
    assert!(
        said.contains("`guesser` has no hand, which `reach-bare` asks for; scripted agents that have one: oracle, "),
        "{said}"
    );
    assert!(!bench.path("runs").exists());
}
