//! An experiment made of one file and a folder with a prompt: recorded, replayed and reported like the paper's.

use std::fs;
use std::process::Command;

use serde_json::{Value, json};

use super::recordings::Bench;
use crate::harness::files::{assert_same, fixture, repository, write_small_world};
use crate::harness::need;
use crate::harness::program::{PROGRAM, run, stderr, stdout, succeeds};
use crate::harness::traces::{recording, texts};

const ECHO: &str = r#"
[experiment.late-echo]
title = "A late echo"
order = 6
chance = { TSA = "1/4" }
scenes = "E1"
prompt = "asked"
decision = "selected_cube"

[[experiment.late-echo.mirror]]
kind = "delayed"
delay = 3
"#;

/// Logs its input to `heard.jsonl`, moves twice, and takes the red cube.
const TAKES_RED: &str = r#"while read -r line; do
  printf '%s\n' "$line" >> heard.jsonl
  case "$line" in *'"kind":"observation"'*)
    n=$((n + 1)); action=w; cube=none
    if [ $n -eq 3 ]; then action=done; cube=red; fi
    echo '{"view-description":"a wall","reasoning":"go on","action":"'$action'","summary":"went on","selected_cube":"'$cube'","identification":"I am red"}' ;;
  esac
done
"#;

/// A folder with the experiment, its prompt, and a program.
fn bench() -> Bench {
    let bench = Bench::new();
    fs::create_dir(bench.path("asked")).unwrap();
    fs::write(bench.path("echo.toml"), ECHO).unwrap();
    fs::write(bench.path("asked/system.txt"), "Answer in JSON.\n").unwrap();
    fs::write(bench.path("asked/user.txt"), "Which cube is like you?\n{{ position_text }}\n").unwrap();
    fs::write(bench.path("program.sh"), TAKES_RED).unwrap();
    bench
}

/// `record` of the program, which sees frames, in the experiment.
fn play(bench: &Bench, out: &str, runs: &str) -> Command {
    need::drawing();
    let words = format!("--experiment echo.toml --seeds 1 --runs {runs} --no-log --agent");
    let mut command = bench.record_with_frames(out, &words);
    command.arg("exec:sh program.sh");
    command
}

fn whole(folder: &Bench) -> Value {
    let answer: Value = run(folder.folder.path(), &["experiments", "explain", "echo.toml", "--json"]).json();
    answer["experiments"][0].clone()
}

#[test]
fn a_custom_experiment_is_recorded_and_reported() {
    let bench = bench();
    let at = bench.folder.path();
    bench.recorded("runs", "--agent random --experiment E1,echo.toml --seeds 2 --runs 4");
    let trace = bench.path("runs/late-echo-random.parquet");
    let footer = recording(&trace);
    assert_eq!(footer["experiment"], whole(&bench));
    assert_eq!(
        (&footer["experiment"]["title"], &footer["experiment"]["scenes"]),
        (&json!("A late echo"), &json!("E1"))
    );
    for hash in [&footer["experiment"]["prompt_hash"], &footer["reply_schema_hash"]] {
        assert_eq!(hash.as_str().unwrap().len(), 64);
    }
    // The trace is enough; the experiment's file and prompt are no longer needed.
    fs::remove_file(bench.path("echo.toml")).unwrap();
    fs::remove_dir_all(bench.path("asked")).unwrap();
    run(at, &["trace", "validate", "runs"]).done();
    let replayed: Value = run(at, &["world", "replay", "runs/late-echo-random.parquet", "--json"]).json();
    assert_eq!((&replayed["episodes"], &replayed["divergences"]), (&json!(8), &json!([])));

    let recorded = fixture("recorded/E1-oracle.parquet").display().to_string();
    run(at, &["report", "runs", &recorded, "--out", "report"]).done();
    let table = fs::read_to_string(bench.path("report/tables/main.md")).unwrap();
    let places = ["### E1: Active mirror-based", "### late-echo: A late echo\n"].map(|title| table.find(title));
    assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{table}");
    let rows = |text: &str| text.lines().filter(|line| line.starts_with("| random")).count();
    let (five, own) = table.split_at(places[1].unwrap());
    assert_eq!((rows(five), rows(own)), (1, 1), "{table}");
    assert!(five.contains("| oracle"), "{table}");
    let cells = fs::read_to_string(bench.path("report/cells.csv")).unwrap();
    assert!(cells.contains("\nlate-echo,random,TSA,8,"), "{cells}");

    let stats: Value = run(at, &["stats", "runs", &recorded, "--json"]).json();
    let levels: Vec<_> = stats["chance"].as_array().unwrap().iter().filter(|row| row["metric"] == "TSA").collect();
    let level = |name: &str| levels.iter().find(|row| row["experiment"] == name).unwrap()["level"].clone();
    assert_eq!((level("E1"), level("late-echo")), (json!("1/3"), json!("1/4")));
}

#[test]
fn a_custom_experiment_and_e1_share_scenes() {
    let bench = bench();
    // Experiments are contrasted if their chance levels are equal.
    fs::write(bench.path("echo.toml"), ECHO.replace("1/4", "1/3")).unwrap();
    bench.recorded("runs", "--agent random --experiment E1,E2,echo.toml --seeds 2 --runs 2");
    let scenes = |name: &str| {
        let mut scenes = texts(&bench.path(&format!("runs/{name}-random.parquet")), "scene");
        scenes.dedup();
        scenes
    };
    assert_eq!((scenes("E1").len(), scenes("late-echo")), (4, scenes("E1")));
    assert!(scenes("E1").iter().all(Option::is_some));
    let stats: Value = run(bench.folder.path(), &["stats", "runs", "--json"]).json();
    let is_ours = |row: &&Value| row["against"] == "late-echo" && row["metric"] == "TSA";
    let row = stats["conditions"].as_array().unwrap().iter().find(is_ours).unwrap();
    assert_eq!((&row["baseline"], &row["matching"]["paired"]), (&json!("E1"), &json!(true)));
    assert_eq!((&row["matching"]["pairs"], &row["matching"]["alone"]), (&json!(4), &json!(0)));
}

#[test]
fn a_custom_prompt_is_sent_and_changing_it_needs_another_recording() {
    let bench = bench();
    let at = bench.folder.path();
    succeeds(&mut play(&bench, "runs", "1"));
    let heard = fs::read_to_string(bench.path("heard.jsonl")).unwrap();
    let heard: Vec<Value> = heard.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(heard[0]["family"], "asked");
    assert_eq!(heard[0]["system_prompt"], "Answer in JSON.");
    assert_eq!(heard[0]["stated_color"], Value::Null);
    let asked = heard[1]["user_prompt"].as_str().unwrap();
    assert!(asked.starts_with("Which cube is like you?\nPosition: x = "), "{asked}");
    let name = "late-echo-exec.parquet";
    run(at, &["world", "replay", &format!("runs/{name}")]).done();
    let cubes = texts(&bench.path(&format!("runs/{name}")), "selected_cube");
    assert_eq!(cubes.last().unwrap().as_deref(), Some("red"));

    fs::write(bench.path("asked/user.txt"), "Which cube has your colour?\n{{ position_text }}\n").unwrap();
    let before = bench.files("runs");
    let refused = play(&bench, "runs", "2").output().unwrap();
    let said = stderr(&refused);
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(said.contains("experiment.prompt_hash") && said.contains("help: record into another folder"), "{said}");
    assert_same(&bench.files("runs"), &before);

    succeeds(&mut play(&bench, "anew", "1"));
    let parts = |out: &str| {
        let footer = recording(&bench.path(&format!("{out}/{name}")));
        let parts = footer["fingerprints"].as_object().unwrap().clone();
        assert_eq!(parts.len(), 1);
        parts.into_iter().next().unwrap()
    };
    let [(one, old), (other, new)] = ["runs", "anew"].map(parts);
    assert_ne!(one, other);
    let differ: Vec<_> = old.as_object().unwrap().iter().filter(|(key, part)| new[*key] != **part).collect();
    assert_eq!(differ.iter().map(|(key, _)| key.as_str()).collect::<Vec<_>>(), ["prompts"]);
}

/// The first `sh` block of a page.
fn commands_of(page: &str) -> String {
    let text = fs::read_to_string(repository().join(page)).unwrap();
    let (_, block) = text.split_once("```sh\n").unwrap();
    block.split_once("```\n").unwrap().0.to_owned()
}

#[test]
fn the_documented_example_works_as_it_is_pasted() {
    let folder = tempfile::tempdir().unwrap();
    let place = std::path::Path::new(PROGRAM).parent().unwrap().display();
    let mut shell = Command::new("sh");
    shell.current_dir(folder.path()).env("PATH", format!("{place}:{}", std::env::var("PATH").unwrap()));
    let said = stdout(&succeeds(shell.args(["-e", "-c", &commands_of("docs/how-to/experiments.md")])));
    assert!(said.contains("late/echo.toml: no fault") && said.contains("A late echo"), "{said}");
    assert!(said.contains("a mirror that shows the room 3 steps late"), "{said}");
    assert!(folder.path().join("late/report/tables/main.md").exists());
}

#[test]
fn scenes_and_sheets_show_any_experiment() {
    let bench = bench();
    let at = bench.folder.path();
    let scenes = |list: &str| -> Vec<Value> {
        let text = run(at, &["world", "scene", list, "--run", "2"]).done();
        serde_json::Deserializer::from_str(&text).into_iter().map(Result::unwrap).collect()
    };
    fs::write(bench.path("two.toml"), format!("{ECHO}\n{}", ECHO.replace("late-echo", "echo"))).unwrap();
    let names: Vec<Value> = scenes("E1,two.toml").iter().map(|scene| scene["experiment"].clone()).collect();
    assert_eq!(names, ["E1", "late-echo", "echo"]);
    let [e1, echo] = ["E1", "echo.toml"].map(|list| scenes(list).remove(0));
    assert_eq!((&e1["cubes"], &e1["start"], &e1["body_color"]), (&echo["cubes"], &echo["start"], &echo["body_color"]));

    need::drawing();
    let height = |list: &[&str]| {
        let words = ["world", "sheet", "--config", "small.toml", "--out", "sheet"];
        run(at, &[&words[..], list].concat()).done();
        let png = fs::read(bench.path("sheet/sheet.png")).unwrap();
        u32::from_be_bytes(png[20..24].try_into().unwrap())
    };
    // A row is half a small frame and 22 pixels of text; the margins add 6 pixels.
    let of_rows = |rows: u32| rows * (24 + 22) + 6;
    assert_eq!(height(&[]), of_rows(5));
    assert_eq!(height(&["--experiment", "mark"]), of_rows(1));
    assert_eq!(height(&["--experiment", "two.toml,E2"]), of_rows(3));
    let said = run(at, &["world", "sheet", "--experiment", "E9"]).ends(2).stderr;
    assert!(said.contains("or mine.toml, found `E9`"), "{said}");
}

#[test]
fn the_schemas_of_files_and_footers_are_printed() {
    let folder = tempfile::tempdir().unwrap();
    let schema = |name: &str| run(folder.path(), &["trace", "schema", name]).json();
    assert_eq!(schema("experiment")["title"], "Experiment");
    assert_eq!(schema("experiments")["title"], "ExperimentFile");
}

#[test]
fn a_narrower_view_is_in_the_footer_and_not_pooled_with_the_studys() {
    let bench = Bench::new();
    let at = bench.folder.path();
    bench.recorded("far", "--agent random --experiment E1 --seeds 1 --runs 2 --no-log --shard 1/2");
    write_small_world(at, "eye.fovy = 60.0\n");
    bench.recorded("near", "--agent random --experiment E1 --seeds 1 --runs 2 --no-log --shard 2/2");
    let view = |out: &str| recording(&bench.path(&format!("{out}/E1-random.parquet")))["view"]["fov_y"].clone();
    assert_eq!((view("far"), view("near")), (json!(110.0), json!(60.0)));
    let said = run(at, &["stats", "far", "near"]).refused();
    assert!(said.contains("eye.fovy") && said.contains("--condition NAME"), "{said}");
}
