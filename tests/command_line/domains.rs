//! Traces of other domains: identity, time, and the columns that a definition file declares.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};

#[cfg(feature = "view")]
use crate::harness::files::contents;
use crate::harness::files::{fixture, repository};
use crate::harness::traces::recording;
use crate::run;

/// Steps of two policies on two tasks. Of the mirror's columns they have only `action`, which is a number here.
fn steps() -> String {
    let mut lines = String::new();
    for (model, solved) in [("act", [3, 5, 0, 2, 4, 3]), ("diffusion", [0, 6, 0, 0, 5, 0])] {
        for (run, solved) in (1..).zip(solved) {
            for t in 1..=6 {
                let step = json!({
                    "episode_id": format!("{model}-{run}"), "t": t, "model": model, "experiment": "pusht", "seed": 1,
                    "run": run, "task": if run % 2 == 0 { "pull" } else { "push" }, "reward": f64::from(t) / 8.0,
                    "action": t * 7, "action_change": f64::from(run * t % 4) / 4.0, "success": t == solved,
                });
                writeln!(lines, "{step}").unwrap();
            }
        }
    }
    lines
}

/// A folder with `steps.jsonl`, `robots.toml` (definitions) and `robots.parquet` (a trace).
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("steps.jsonl"), steps()).unwrap();
    fs::copy(repository().join("examples/domains/robots.toml"), folder.path().join("robots.toml")).unwrap();
    let told =
        run(folder.path(), &["import", "steps.jsonl", "-o", "robots.parquet", "--definitions", "robots.toml"]).done();
    assert!(told.starts_with("imported 12 episodes, 72 steps into robots.parquet\n"), "{told}");
    folder
}

/// The declaration in the first row of CSV scores.
const IMPORTED: &str = r#""{""origin"":""import""}""#;

/// The output of a command on `robots.parquet` with its definitions.
fn asked(folder: &Path, words: &[&str]) -> String {
    run(folder, &[words, &["robots.parquet", "--definitions", "robots.toml"]].concat()).done()
}

#[test]
fn a_gate_compares_the_policies_of_another_domain() {
    let folder = folder();
    let at = folder.path();
    // The later policy never succeeds.
    let later = steps().replace("\"success\":true", "\"success\":false");
    fs::write(at.join("later.jsonl"), later).unwrap();
    run(at, &["import", "later.jsonl", "-o", "later.parquet", "--definitions", "robots.toml"]).done();
    let gate = |base: &str, format: &str| {
        run(at, &["gate", base, "later.parquet", "--definitions", "robots.toml", "--format", format])
    };
    let found: Value = serde_json::from_str(&gate("robots.parquet", "json").ends(1).stdout).unwrap();
    assert_eq!((&found["metric"], &found["cells"][0]["model"]), (&json!("SUCCESS"), &json!("act")));
    let flip = &found["cells"][0]["flips"][0];
    assert_eq!((&flip["base"]["episode_id"], &flip["base"]["timesteps"]), (&json!("act-1"), &json!([3])));
    assert_eq!((&flip["new"]["value"], &found["cells"][0]["new"]["n"]), (&json!(0), &json!(6)));
    // Scores give the same verdicts, without steps.
    asked(at, &["score", "-o", "robots.csv"]);
    let scores: Value = serde_json::from_str(&gate("robots.csv", "json").ends(1).stdout).unwrap();
    assert_eq!(scores["cells"][0]["why"], found["cells"][0]["why"]);
    assert_eq!(scores["cells"][0]["flips"][0]["base"]["timesteps"], Value::Null);
}

#[test]
fn a_trace_of_a_robot_benchmark_is_scored_by_a_definition_file_alone() {
    let folder = folder();
    let at = folder.path();
    assert_eq!(recording(&at.join("robots.parquet"))["domain"], "robots");
    asked(at, &["trace", "validate"]);
    asked(at, &["score", "-o", "scores.csv"]);
    let scores = fs::read_to_string(at.join("scores.csv")).unwrap();
    let rows: Vec<&str> = scores.lines().take(4).collect();
    assert_eq!(rows[0], "episode_id,model,experiment,seed,run,SUCCESS,TIME,DURATION,SOLVED,JERKS,mirrorstats.declared");
    assert_eq!(
        rows[1..],
        [
            &format!("act-1,act,pusht,1,1,1,3,3,1,1,{IMPORTED}"),
            "act-2,act,pusht,1,2,1,5,5,1,0,",
            "act-3,act,pusht,1,3,0,,6,,2,"
        ]
    );
    #[cfg(feature = "polars")]
    {
        let rows = run(
            at,
            &[
                "query",
                "select task, min(\"action\") as least from steps group by task order by task",
                "robots.parquet",
                "--definitions",
                "robots.toml",
            ],
        )
        .done();
        assert!(rows.contains("pull") && rows.contains("i64"), "{rows}");
    }
}

#[test]
fn reports_statistics_figures_and_differences_know_any_domain() {
    let folder = folder();
    let at = folder.path();
    let shown = asked(at, &["report", "--out", "out"]);
    assert!(shown.contains("5/6") && shown.contains("2/6"), "{shown}");
    let manifest: Value = serde_json::from_str(&fs::read_to_string(at.join("out/manifest.json")).unwrap()).unwrap();
    assert_eq!(manifest["definitions"]["domain"], "robots");
    run(at, &["verify", "out"]).done();
    let told = asked(at, &["stats", "--by", "model,task"]);
    assert!(told.contains("pull") && told.contains("SUCCESS"), "{told}");
    let durations = asked(at, &["stats", "--tables"]);
    assert!(
        durations.contains("Kaplan-Meier") && durations.contains("Durations: unfinished episodes censored"),
        "{durations}"
    );
    for figure in ["intervals", "forest", "heatmap", "spider", "decision-curve"] {
        asked(at, &["figure", figure, "-o", "figure.svg"]);
        let drawn = fs::read_to_string(at.join("figure.svg")).unwrap();
        assert!(drawn.contains("diffusion") && !drawn.contains("\"TSA\""), "{figure}");
    }
    for (figure, words) in [
        ("gaze", "figure `gaze` needs the steps of each episode"),
        ("e5-outcomes", "figure `e5-outcomes` needs the outcomes of an open question"),
    ] {
        let words_of = ["figure", figure, "robots.parquet", "--definitions", "robots.toml", "-o", "none.svg"];
        let refused = run(at, &words_of).refused();
        assert!(refused.contains(words), "{refused}");
    }
    let refused = run(at, &["definitions", "sensitivity", "robots.parquet", "--definitions", "robots.toml"]).refused();
    assert!(refused.contains("of the domain `mirror`") && refused.contains("mirrorstats diff"), "{refused}");
    fs::write(
        at.join("other.toml"),
        "include = [\"robots.toml\"]\n[metric.JERKS]\nvalue = \"count(action_change > 0.2)\"\n",
    )
    .unwrap();
    let told = run(at, &["diff", "robots.toml", "other.toml", "robots.parquet"]).done();
    assert!(told.contains("count(action_change > 0.2)") && told.contains("JERKS"), "{told}");
    for model in ["act", "diffusion"] {
        let lines: String = steps()
            .lines()
            .filter(|line| line.contains(&format!("\"model\":\"{model}\"")))
            .collect::<Vec<_>>()
            .join("\n");
        fs::write(at.join("some.jsonl"), lines + "\n").unwrap();
        let out = format!("{model}.parquet");
        run(at, &["import", "some.jsonl", "-o", &out, "--definitions", "robots.toml"]).done();
    }
    let verdict = run(at, &["gate", "act.parquet", "diffusion.parquet", "--definitions", "robots.toml"]).ends(4);
    assert!(verdict.stdout.contains("SUCCESS") && verdict.stdout.contains("2/6"), "{}", verdict.stdout);
}

#[test]
fn definitions_may_name_the_domain_of_the_mirror() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let paper = fixture("paper").display().to_string();
    let outputs = |domain: &str| {
        let text = format!("{domain}include = [\"paper\"]\n[metric.TURNS]\nvalue = \"count(action = 'turn_left')\"\n");
        fs::write(at.join("mine.toml"), text).unwrap();
        let asked = |words: &[&str]| run(at, &[words, &["--definitions", "mine.toml"]].concat()).done();
        [asked(&["score", &paper]), asked(&["definitions", "sql"]), asked(&["stats", &paper, "--json"])]
    };
    let named = outputs("domain = \"mirror\"\n");
    assert_eq!(named, outputs(""));
    assert!(named[0].lines().count() > 800);
}

#[test]
fn the_mirror_domain_file_matches_the_built_in_columns() {
    let text = fs::read_to_string(repository().join("assets/domains/mirror.toml")).unwrap();
    let file: toml::Value = toml::from_str(&text).unwrap();
    let declared = file["column"].as_table().unwrap();
    let schema: Value = run(&repository(), &["trace", "schema", "--json"]).json();
    let columns = schema["columns"].as_array().unwrap();
    let names = |names: Vec<&str>| names.into_iter().map(str::to_owned).collect::<Vec<_>>();
    let known = names(columns.iter().map(|column| column["name"].as_str().unwrap()).collect());
    assert_eq!(known, names(declared.keys().map(String::as_str).collect()));
    for column in columns {
        let of = &declared[column["name"].as_str().unwrap()];
        assert_eq!(column["doc"], of["help"].as_str().unwrap());
        assert_eq!(column["unit"].as_str(), of.get("unit").map(|unit| unit.as_str().unwrap()));
    }
}

#[test]
fn rules_of_the_mirror_apply_only_to_the_mirror() {
    let folder = folder();
    let at = folder.path();
    // The trace carries the definitions that it was imported with.
    run(at, &["score", "robots.parquet", "-o", "scores.csv"]).done();
    let refused = run(at, &["score", "robots.parquet", "-o", "scores.csv", "--definitions", "paper"]).refused();
    assert!(
        refused.contains("`robots.parquet` has no column of the domain `mirror`") && refused.contains("--definitions"),
        "{refused}"
    );
    run(at, &["trace", "validate", "robots.parquet"]).done();
    let told = run(at, &["trace", "validate", "robots.parquet", "--definitions", "paper"]).ends(1);
    assert!(told.stdout.contains("missing-column") && told.stdout.contains("mirror_visible"), "{}", told.stdout);
    let mixed = fixture("paper");
    let refused = run(
        at,
        &["score", "robots.parquet", mixed.to_str().unwrap(), "-o", "scores.csv", "--definitions", "robots.toml"],
    )
    .refused();
    assert!(refused.contains("robots.parquet") && refused.contains("missing-column"), "{refused}");
}

#[test]
fn values_and_types_that_definitions_declare_are_rules() {
    let folder = folder();
    let at = folder.path();
    let with = |values: &str, ty: &str| {
        let text = format!(
            "include = [\"robots.toml\"]\n[column.task]\ntype = \"text\"\nconstant = true\nvalues = {values}\n[column.reward]\ntype = \"{ty}\"\n[metric.PULLS]\nvalue = \"task = 'pull'\"\n"
        );
        fs::write(at.join("strict.toml"), text).unwrap();
    };
    with("[\"push\", \"pulls\"]", "float");
    let refused = run(at, &["definitions", "check", "strict.toml"]).refused();
    assert!(refused.contains("`task` never is 'pull'") && refused.contains("did you mean 'pulls'?"), "{refused}");
    with("[\"pull\", \"pushed\"]", "float");
    let told = run(at, &["trace", "validate", "robots.parquet", "--definitions", "strict.toml"]).ends(1);
    assert!(told.stdout.contains("unknown-value") && told.stdout.contains("did you mean `pushed`?"), "{}", told.stdout);
    let refused = run(at, &["score", "robots.parquet", "-o", "scores.csv", "--definitions", "strict.toml"]).refused();
    assert!(refused.contains("unknown-value"), "{refused}");
    let refused = run(at, &["import", "steps.jsonl", "-o", "again.parquet", "--definitions", "strict.toml"]).refused();
    assert!(refused.contains("expected one of pull, pushed, or null"), "{refused}");
    with("[\"pull\", \"push\"]", "int");
    let told = run(at, &["trace", "validate", "robots.parquet", "--definitions", "strict.toml"]).ends(1);
    assert!(
        told.stdout.contains("wrong-type") && told.stdout.contains("integer, as the definitions declare it"),
        "{}",
        told.stdout
    );
}

#[cfg(feature = "view")]
#[test]
fn the_viewer_shows_the_columns_of_any_domain() {
    let folder = folder();
    let at = folder.path();
    run(at, &["view", "robots.parquet", "--definitions", "robots.toml", "--export", "page"]).done();
    let written = contents(&at.join("page"));
    let of_episode = |bytes: &&Vec<u8>| String::from_utf8_lossy(bytes).contains("\"action_change\"");
    let shown = written.values().filter(of_episode).map(|bytes| String::from_utf8_lossy(bytes)).collect::<Vec<_>>();
    assert_eq!(
        shown.iter().filter(|text| text.contains(r#""values":["7","14","21","28","35","42"]"#)).count(),
        12,
        "{:?}",
        written.keys()
    );
    assert!(shown.iter().all(|text| !text.contains("body_color")));
}

#[test]
fn lines_of_another_shape_are_mapped_on_the_way_in() {
    let folder = folder();
    let at = folder.path();
    let line = |frame: u32| {
        json!({ "episode_index": 7, "frame_index": frame, "eval": { "model": "act", "seeds": [4, 5] }, "reward": 0.5,
                "observation.state": [0.1, 0.2], "success": frame == 1 })
    };
    fs::write(at.join("frames.jsonl"), format!("{}\n\n{}\n", line(0), line(1))).unwrap();
    let mapping = [
        "--map",
        "episode_id=id",
        "--map",
        "model=eval.model",
        "--map",
        "seed=eval.seeds.1",
        "--map",
        "t=frame_index+1",
        "--map",
        "x=observation.state.0",
        "--set",
        "experiment=pusht",
        "--set",
        "run=1",
    ];
    let with = |file: &str, more: &[&str]| {
        let options = [file, "-o", "mapped.parquet", "--definitions", "robots.toml"];
        run(at, &[&["import"], &options[..], &mapping, more].concat())
    };
    let refused = with("frames.jsonl", &[]).refused();
    assert!(refused.contains("frames.jsonl, line 1, key `episode_id`") && refused.contains("found null"), "{refused}");
    let told = with("frames.jsonl", &["--set", "episode_id=e7"]).done();
    assert!(told.starts_with("imported 1 episode, 2 steps") && told.contains("x (float)"), "{told}");
    assert!(!told.contains("frame_index") && told.contains("episode_index (integer)"), "{told}");
    run(
        at,
        &["score", "mapped.parquet", "--definitions", "robots.toml", "-o", "mapped.csv", "--metrics", "SUCCESS,TIME"],
    )
    .done();
    let scores = fs::read_to_string(at.join("mapped.csv")).unwrap();
    assert_eq!(scores.lines().nth(1), Some(&*format!("e7,act,pusht,5,1,1,2,{IMPORTED}")));
    fs::write(at.join("more.jsonl"), format!("{}\n", line(0)).replace("\"reward\"", "\"extra\":[1],\"reward\""))
        .unwrap();
    let answer = with("more.jsonl", &["--set", "episode_id=e7"]).ends(0);
    assert!(answer.stderr.contains("left out: `extra`, a list or an object in 1 lines"), "{}", answer.stderr);
    let refused = run(at, &["import", "frames.jsonl", "-o", "none.parquet", "--map", "model"]).refused();
    assert!(refused.contains("`model`: expected COLUMN=PATH, found no `=`"), "{refused}");
}
