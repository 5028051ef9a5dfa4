//! Experiments name the definitions that score them: every command uses these, or says what to type.

use std::path::Path;
use std::process::Command;

use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::write::write_episodes;
use serde_json::{Value, json};

use crate::harness::program::PROGRAM;
use crate::{harness, run};

/// A passed mark test: the mark is seen at once and reported at `done`.
fn mark(id: &str) -> Episode {
    let step = |action, report: &str| Step {
        action: Some(action),
        extra: Extra {
            mark_color: Some("green".to_owned()),
            mirror_mark_px: Some(30),
            mark_report: Some(report.to_owned()),
            ..Extra::default()
        },
        ..Step::default()
    };
    let steps = vec![step(Action::TurnLeft, "none"), step(Action::Done, "green")];
    let decision = Some("mark_report".to_owned());
    Episode { experiment: "mark".into(), decision, ..harness::traces::episode(id, steps) }
}

/// A hand that reaches the mark at the second step.
fn reach(id: &str) -> Episode {
    let step = |distance| Step {
        action: Some(Action::MoveForward),
        extra: Extra { target_distance: Some(distance), ..Extra::default() },
        ..Step::default()
    };
    let decision = Some("target_distance".to_owned());
    let steps = vec![step(200), step(100)];
    Episode {
        experiment: "reach-hand".into(),
        decision,
        start_distance: Some(300),
        ..harness::traces::episode(id, steps)
    }
}

/// An episode of E1 with the right cube.
fn cube(id: &str) -> Episode {
    let step = |action| Step { action: Some(action), selected_cube: Some("red".to_owned()), ..Step::default() };
    harness::traces::episode(id, vec![step(Action::TurnLeft), step(Action::Done)])
}

fn write(folder: &Path, name: &str, experiment: Option<Value>, episodes: &[Episode]) {
    let recording = experiment.map(|experiment| json!({ "experiment": experiment }));
    write_episodes(&folder.join(format!("{name}.parquet")), recording, episodes).unwrap();
}

/// `mark.parquet`, `reach.parquet` and `cube.parquet`; `old.parquet`, whose footer does not name definitions; and
/// `plain.parquet` without a declaration.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at, "mark", Some(json!({ "name": "mark", "definitions": "battery" })), &[mark("a"), mark("b")]);
    write(at, "old", Some(json!({ "name": "mark" })), &[mark("c")]);
    let reaching = json!({ "name": "reach-hand", "definitions": "reach" });
    write(at, "reach", Some(reaching), &[reach("d"), reach("e")]);
    write(at, "cube", Some(json!({ "name": "E1" })), &[cube("f"), cube("g")]);
    write(at, "plain", None, &[cube("h"), cube("i")]);
    folder
}

/// A column of `score` in row order.
fn scored(at: &Path, arguments: &[&str], metric: &str) -> Vec<String> {
    let text = run(at, &[&["score"], arguments].concat()).done();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let column = rows[0].iter().position(|name| *name == metric).unwrap_or_else(|| panic!("{metric}: {text}"));
    rows[1..].iter().map(|row| row[column].to_owned()).collect()
}

#[test]
fn each_command_takes_the_definitions_that_the_traces_name() {
    let folder = folder();
    let at = folder.path();
    for traces in [&["mark.parquet"][..], &["old.parquet"], &["mark.parquet", "old.parquet"]] {
        let found = scored(at, traces, "MARK_REPORT");
        assert!(!found.is_empty() && found.iter().all(|value| value == "1"), "{traces:?}: {found:?}");
        assert_eq!(scored(at, traces, "TSA"), found);
    }
    assert_eq!(scored(at, &["reach.parquet"], "SUCCESS"), ["1", "1"]);
    let manifest = |trace: &str| -> Value {
        run(at, &["report", trace, "--out", "out", "--no-figures"]).done();
        serde_json::from_str(&std::fs::read_to_string(at.join("out/manifest.json")).unwrap()).unwrap()
    };
    for (trace, name) in [("mark", "battery"), ("reach", "reach"), ("cube", "paper"), ("plain", "paper")] {
        assert_eq!(manifest(&format!("{trace}.parquet"))["definitions"]["name"], name, "{trace}");
    }
    let stats = run(at, &["stats", "reach.parquet", "--metric", "SUCCESS"]).done();
    assert!(stats.contains("SUCCESS"), "{stats}");
    assert!(run(at, &["definitions", "sql", "mark.parquet"]).done().contains("MARK_REPORT"));
    assert!(run(at, &["score", "mark.parquet", "--explain", "a"]).done().contains("MARK_REPORT"));
    run(at, &["figure", "slopes", "mark.parquet", "cube.parquet", "-o", "slopes.svg"]).done();
}

#[test]
fn a_mixture_is_scored_by_the_definitions_that_include_the_others() {
    let folder = folder();
    let at = folder.path();
    for cubes in ["cube.parquet", "plain.parquet"] {
        let both = ["mark.parquet", cubes];
        assert_eq!(scored(at, &both, "TSA"), ["1"; 4]);
        assert_eq!(scored(at, &both, "MARK_REPORT"), ["", "", "1", "1"]);
        assert_eq!(scored(at, &[cubes], "TSA"), scored(at, &[cubes, "--definitions", "battery"], "TSA"));
    }
}

/// The commands in a refusal.
fn commands(words: &str) -> Vec<&str> {
    words.lines().map(str::trim).filter(|line| line.starts_with("mirrorstats ")).collect()
}

/// Runs a command line in the shell.
fn typed(at: &Path, command: &str) -> String {
    let program = PROGRAM.replace('\'', r"'\''");
    let line = command.replacen("mirrorstats", &format!("'{program}'"), 1);
    let output = Command::new("sh").args(["-c", &line]).current_dir(at).output().unwrap();
    assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn another_mixture_is_refused_with_commands_that_work() {
    let folder = folder();
    let at = folder.path();
    for others in [&["mark.parquet"][..], &["cube.parquet"], &["mark.parquet", "plain.parquet"]] {
        let arguments = [&["score", "reach.parquet"], others, &["--metrics"]].concat();
        for metrics in ["TSA", "SUCCESS"] {
            let refused = run(at, &[&arguments[..], &[metrics]].concat()).refused();
            assert!(refused.contains("expected experiments that the same definitions score"), "{refused}");
            let commands = commands(&refused);
            assert_eq!(commands.len(), 2, "{refused}");
            let one = commands.iter().find(|command| command.ends_with("reach") == (metrics == "SUCCESS")).unwrap();
            let rows = typed(at, one);
            let is_right = |row: &str| row.split(',').nth(5) == Some("1");
            assert!(rows.lines().skip(1).all(is_right) && rows.lines().count() > 2, "{one}: {rows}");
        }
    }
    let refused = run(at, &["report", "mark.parquet", "reach.parquet", "--where", "seed = 1"]).refused();
    let named = commands(&refused);
    for command in &named {
        typed(at, command);
    }
    assert!(named.iter().all(|command| command.contains("(seed = 1) and experiment in (")), "{refused}");
    assert!(at.join("reports/battery/report.html").is_file() && at.join("reports/reach/report.html").is_file());
    let words = ["report", "mark.parquet", "reach.parquet", "--no-figures", "--out", "my report"];
    for command in commands(&run(at, &words).refused()) {
        assert!(command.contains(" --no-figures --out 'my report' --where "), "{command}");
        typed(at, command);
    }
    let told = run(at, &["stats", "mark.parquet", "reach.parquet", "--errors", "json"]).ends(2);
    let told: Value = serde_json::from_str(&told.stderr).unwrap();
    assert_eq!(commands(told["error"].as_str().unwrap()).len(), 2, "{told}");
}

#[test]
fn definitions_that_do_not_score_an_experiment_are_refused() {
    let folder = folder();
    let at = folder.path();
    std::fs::write(at.join("mine.toml"), "include = ['paper']\n[metric.LONG]\nvalue = 'length()'\n").unwrap();
    std::fs::write(at.join("knows.toml"), "include = ['paper']\n[experiment.mark]\ntitle = 'Mine'\n").unwrap();
    std::fs::write(at.join("both.toml"), "include = ['battery']\n[metric.LONG]\nvalue = 'length()'\n").unwrap();
    std::fs::write(at.join("any.toml"), "[metric.LONG]\nvalue = 'length()'\n").unwrap();
    let commands: [&[&str]; 5] = [
        &["score", "mark.parquet"],
        &["report", "mark.parquet", "cube.parquet"],
        &["stats", "old.parquet"],
        &["score", "mark.parquet", "--explain", "a"],
        &["figure", "slopes", "mark.parquet", "-o", "slopes.svg"],
    ];
    for command in commands {
        for definitions in ["paper", "extended", "mine.toml"] {
            let metrics: &[&str] = if command[0] == "score" { &["--metrics", "TSA"] } else { &[] };
            let refused = run(at, &[command, &["--definitions", definitions], metrics].concat()).refused();
            let expected = "mark: expected definitions that score it, as `battery` do, found `";
            assert!(refused.contains(expected) || definitions == "extended", "{command:?} {definitions}: {refused}");
        }
    }
    for definitions in ["battery", "both.toml", "knows.toml", "any.toml"] {
        run(at, &["score", "mark.parquet", "--definitions", definitions]).done();
    }
    // Episodes that the filter drops need no score.
    let kept = ["mark.parquet", "cube.parquet", "--definitions", "paper", "--where", "experiment = 'E1'"];
    assert_eq!(scored(at, &kept, "TSA"), ["1", "1"]);
    let refused = run(at, &["score", "reach.parquet", "--definitions", "battery", "--metrics", "TSA"]).refused();
    assert!(refused.contains("as `reach` do"), "{refused}");
    // `diff` compares definitions, so it only notes that the old ones do not score the experiment.
    let diff = run(at, &["diff", "paper", "battery", "mark.parquet"]);
    assert!(diff.stderr.contains("`paper` does not score the experiment `mark`"), "{}", diff.stderr);
}

#[test]
fn a_definition_file_of_ones_own_is_named_by_its_hash() {
    let folder = folder();
    let at = folder.path();
    let own = json!({ "name": "late", "definitions": "late.toml", "definitions_hash": "ab".repeat(32) });
    write(at, "late", Some(own), &[Episode { experiment: "late".into(), ..cube("z") }]);
    let refused = run(at, &["score", "late.parquet"]).refused();
    let expected = "late: expected the definition file `late.toml` (sha256 abab";
    assert!(refused.contains(expected) && refused.contains("--definitions FILE"), "{refused}");
    std::fs::write(at.join("elsewhere.toml"), "include = ['paper']\n").unwrap();
    assert_eq!(scored(at, &["late.parquet", "--definitions", "elsewhere.toml"], "TSA"), ["1"]);
    let refused = run(at, &["score", "late.parquet", "--definitions", "paper"]).refused();
    assert!(refused.contains("as `late.toml` do, found `paper`"), "{refused}");
}
