//! The visible effect of each option.

use std::fs;
use std::io::Read as _;
use std::process::Stdio;

use crate::{contents, fixture, program, run, run_with_input, two_files};

/// A column of CSV, without the header.
fn column(csv: &str, name: &str) -> Vec<String> {
    let at = csv.lines().next().unwrap().split(',').position(|column| column == name).unwrap();
    csv.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().to_owned()).collect()
}

#[test]
fn traces_are_named_in_four_ways() {
    let folder = two_files();
    let at = folder.path();
    let expected = run(at, &["score", "a.parquet", "b.parquet"]).done();
    assert_eq!(expected.lines().count(), 17);
    assert_eq!(run(at, &["score", "b.parquet", "a.parquet"]).done(), expected);
    assert_eq!(run(at, &["score", "."]).done(), expected);
    assert_eq!(run(at, &["score", "*.parquet"]).done(), expected);
    assert_eq!(run(at, &["score", "[ab].parquet"]).done(), expected);
    assert_eq!(run_with_input(at, &["score", "-"], "b.parquet\na.parquet\n").done(), expected);
    assert_eq!(run_with_input(at, &["score", "-"], "b.parquet\r\n\r\na.parquet").done(), expected);
    assert_eq!(run_with_input(at, &["score", "-", "a.parquet", "."], "b.parquet\n").done(), expected);
    assert_eq!(run(at, &["score", at.to_str().unwrap()]).done(), expected);
}

#[test]
fn a_condition_keeps_the_episodes_where_it_holds() {
    let folder = two_files();
    let score = |condition: &str| run(folder.path(), &["score", ".", "--where", condition]).done();
    assert_eq!(
        column(&score("model = 'bee' and run >= 2"), "episode_id"),
        ["E1-bee-2", "E1-bee-3", "E5-bee-2", "E5-bee-3"]
    );
    assert!(column(&score("TSA = 1"), "TSA").iter().all(|value| value == "1"));
    assert!(column(&score("TSA"), "TSA").iter().all(|value| value == "1"), "a rate is a condition by itself");
    assert_eq!(score("MTATO is null").lines().count(), 1 + score("TSA = 0").lines().skip(1).count());
    assert_eq!(score("any(self_color = body_color)"), score("CAAL = 1"));
    assert_eq!(score("null is not null").lines().count(), 1, "the header alone");
    // A null condition keeps no episode.
    assert_eq!(score("MTATO = 1 or MTATO = 0"), score("TSA"));
}

#[test]
fn metrics_are_chosen_and_keep_their_order() {
    let folder = two_files();
    let header = |metrics: &str| {
        let scores = run(folder.path(), &["score", "a.parquet", "--metrics", metrics]).done();
        scores.lines().next().unwrap().to_owned()
    };
    assert_eq!(header("TSA-C,TSA"), "episode_id,model,experiment,seed,run,TSA,TSA-C");
    assert_eq!(header("MTATO"), "episode_id,model,experiment,seed,run,MTATO");
    // Columns that only other metrics read are not required.
    run(folder.path(), &["score", "a.parquet", "--definitions", "extended", "--metrics", "TSA,STD"]).done();
}

#[test]
fn groups_follow_the_keys() {
    let folder = two_files();
    let keys = |by: &str| {
        run(folder.path(), &["report", ".", "--by", by, "--metrics", "TTD", "--out", "out"]).done();
        let cells = fs::read_to_string(folder.path().join("out/cells.csv")).unwrap();
        let mut lines = cells.lines().map(|line| line.split(",TTD,").next().unwrap().to_owned());
        assert!(lines.next().unwrap().starts_with(&format!("{by},metric,n,sum,sum_sq,mean,se,ci_low,ci_high")));
        lines.collect::<Vec<_>>()
    };
    assert_eq!(keys("experiment"), ["E1", "E5"]);
    assert_eq!(keys("model"), ["ant", "bee"]);
    assert_eq!(keys("run"), ["0", "1", "2", "3"]);
    assert_eq!(keys("body_color"), ["blue", "red"]);
    assert_eq!(keys("body_color,model"), ["blue,ant", "blue,bee", "red,ant", "red,bee"]);
    assert_eq!(keys("experiment,model,seed"), ["E1,ant,1", "E1,bee,1", "E5,ant,1", "E5,bee,1"]);
    assert_eq!(keys("episode_id").len(), 16);
}

#[test]
fn definitions_of_one_s_own_include_the_paper_s() {
    let folder = two_files();
    fs::create_dir(folder.path().join("own")).unwrap();
    fs::write(folder.path().join("own/base.toml"), "include = [\"paper\"]\n[let]\nfinish = \"length()\"\n").unwrap();
    let text = "include = [\"base.toml\"]\n[metric.LATE]\nvalue = \"MCR and not any(mirror_visible and t < 2)\"\n";
    fs::write(folder.path().join("own/late.toml"), text).unwrap();
    let scores = run(folder.path(), &["score", "a.parquet", "--definitions", "own/late.toml"]).done();
    assert_eq!(column(&scores, "LATE"), vec!["1"; 8]);
    assert!(scores.starts_with("episode_id,model,experiment,seed,run,TSA,"));
    let checked = run(folder.path(), &["definitions", "check", "own/late.toml"]).done();
    assert!(checked.contains("no fault") && checked.contains("LATE"), "{checked}");
}

#[test]
fn an_unknown_experiment_is_accepted_by_open_definitions() {
    let folder = tempfile::tempdir().unwrap();
    let episodes = [crate::episode("ant", "E9", 1, "red")];
    mirrorstats_trace::write::write_episodes(&folder.path().join("a.parquet"), None, &episodes).unwrap();
    let message = run(folder.path(), &["score", "a.parquet"]).refused();
    assert!(message.contains("`E9`") && message.contains("one of E1, E2, E3, E4, E5"), "{message}");
    assert!(message.contains("[experiment.NAME]") && message.contains("open = true"), "{message}");
    fs::write(folder.path().join("open.toml"), "include = [\"paper\"]\nopen = true\n").unwrap();
    fs::write(folder.path().join("named.toml"), "include = [\"paper\"]\n[experiment.E9]\n").unwrap();
    for definitions in ["open.toml", "named.toml"] {
        let scores = run(folder.path(), &["score", "a.parquet", "--definitions", definitions]).done();
        assert_eq!(column(&scores, "experiment"), ["E9"]);
        let checked = run(folder.path(), &["trace", "validate", "a.parquet", "--definitions", definitions]);
        assert_eq!(checked.code, 0, "{}", checked.stdout);
    }
}

#[test]
fn an_episode_is_explained_by_its_timesteps() {
    let folder = two_files();
    let text = run(folder.path(), &["score", ".", "--explain", "E1-ant-1"]).done();
    assert!(text.contains("E1-ant-1: 3 steps") && text.contains("TTD = 3"), "{text}");
    let json = run(folder.path(), &["score", ".", "--explain", "E1-ant-1", "--json"]).done();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let of = |name: &str| json["metrics"].as_array().unwrap().iter().find(|metric| metric["metric"] == name).unwrap();
    assert_eq!((&of("MGD")["value"], &of("MGD")["timesteps"]), (&1.into(), &serde_json::json!([2])));
    assert_eq!((&of("TTD")["value"], &of("TTD")["timesteps"]), (&3.into(), &serde_json::json!([3])));
    assert_eq!(of("MTATO")["value"], serde_json::Value::Null, "the wrong cube was chosen");
    // The evidence agrees with the scores.
    let scores = run(folder.path(), &["score", ".", "--where", "episode_id = 'E1-ant-1'"]).done();
    for metric in json["metrics"].as_array().unwrap() {
        let value = metric["value"].as_i64().map_or_else(String::new, |value| value.to_string());
        assert_eq!(column(&scores, metric["metric"].as_str().unwrap()), [value]);
    }
}

#[test]
fn json_is_json_wherever_it_is_offered() {
    let folder = two_files();
    let published = fixture("published/main_table.csv").display().to_string();
    for (arguments, code) in [
        (["trace", "info", "."].as_slice(), 0),
        (&["trace", "validate", "."], 0),
        (&["trace", "schema"], 0),
        (&["stats", "."], 0),
        (&["stats", ".", "--sequential"], 0),
        (&["report", ".", "--out", "out"], 0),
        (&["table", "compare", ".", "--published", &published], 1),
        (&["definitions", "check", "paper"], 0),
        (&["definitions", "explain", "SC"], 0),
        (&["score", ".", "--explain", "E5-bee-0"], 0),
    ] {
        let answer = run(folder.path(), &[arguments, &["--json"]].concat());
        assert_eq!(answer.code, code, "{arguments:?}: {}", answer.stderr);
        let json: serde_json::Value =
            serde_json::from_str(&answer.stdout).unwrap_or_else(|e| panic!("{arguments:?}: {e}"));
        assert!(json.is_object(), "{arguments:?}");
        assert!(!answer.stdout.contains(folder.path().to_str().unwrap()), "{arguments:?}: an absolute path");
    }
    let lines = run(folder.path(), &["score", ".", "--json"]).done();
    assert_eq!(lines.lines().count(), 16);
    assert!(lines.lines().all(|line| serde_json::from_str::<serde_json::Value>(line).unwrap().is_object()));
}

#[test]
fn faults_of_definitions_are_json_too() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.toml"), "[metric.A]\nvalue = \"any(mirror_visble)\"\n").unwrap();
    let answer = run(folder.path(), &["definitions", "check", "a.toml", "--json"]);
    assert_eq!(answer.code, 2, "{}", answer.stderr);
    let json: serde_json::Value = serde_json::from_str(&answer.stdout).unwrap();
    let fault = &json["faults"][0];
    assert_eq!((&json["ok"], &fault["file"], &fault["line"]), (&false.into(), &"a.toml".into(), &2.into()));
    assert_eq!(fault["text"], "mirror_visble");
    assert!(fault["help"].as_str().unwrap().contains("mirror_visible"));
}

#[test]
fn the_same_arguments_write_the_same_bytes() {
    let folder = two_files();
    for out in ["one", "two"] {
        run(folder.path(), &["report", ".", "--style", "paper", "--out", out]).done();
    }
    let [one, two] = ["one", "two"].map(|out| contents(&folder.path().join(out)));
    assert!(one.len() >= 9 && one == two);
}

#[test]
fn a_closed_pipe_is_no_error() {
    // More output than a buffer holds, and less.
    let traces = fixture("paper");
    let traces = traces.to_str().unwrap();
    let published = fixture("published/main_table.csv");
    let folder = two_files();
    for arguments in [
        ["score", "."].as_slice(),
        &["score", traces],
        &["score", ".", "--json"],
        &["score", traces, "--json"],
        &["score", ".", "--explain", "E1-ant-0"],
        &["report", "."],
        &["stats", ".", "--metric", "all"],
        &["stats", traces, "--json"],
        &["figure", "heatmap", "."],
        &["table", "compare", traces, "--published", published.to_str().unwrap(), "--json"],
        &["diff", "paper", "extended", ".", "--json"],
        &["definitions", "sql", "--dialect", "duckdb"],
        &["trace", "schema"],
        &["trace", "schema", "--json"],
        &["trace", "info", "."],
        &["trace", "info", ".", "--json"],
        &["trace", "validate", "."],
        &["definitions", "show"],
        &["definitions", "check", "extended"],
        &["definitions", "explain", "TSA"],
        &["--help"],
        &["report", "--help"],
    ] {
        let mut command = program(folder.path());
        let mut child = command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let mut said = String::new();
        child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(0), "{arguments:?}: {said}");
        assert!(!said.contains("error"), "{arguments:?}: {said}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_behind_standard_output_is_an_error() {
    let traces = fixture("paper");
    let folder = two_files();
    for arguments in [
        ["score", "."].as_slice(),
        &["score", traces.to_str().unwrap()],
        &["score", ".", "--json"],
        &["report", "."],
        &["stats", "."],
        &["figure", "heatmap", "."],
        &["definitions", "sql"],
        &["trace", "schema"],
        &["trace", "info", "."],
        &["trace", "validate", "."],
        &["definitions", "show"],
        &["definitions", "explain", "TSA"],
        &["--help"],
    ] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = program(folder.path()).args(arguments).stdout(full).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains("error: cannot write the output\n  caused by: No space left"), "{arguments:?}: {said}");
    }
}
