//! Importing CSV, Parquet of any shape, LeRobot and inspect-robots.

use std::fs;
#[cfg(feature = "polars")]
use std::path::Path;

use arrow::datatypes::{DataType, Field, Schema};
use serde_json::{Value, json};

use crate::harness::logs;
use crate::harness::program::run;
use crate::harness::traces::{recording, write_rows};

const DEFINITIONS: &str = r#"
domain = "arms"
[column.success]
type = "bool"
[metric.SOLVED]
value = "any(success)"
[metric.STEPS]
value = "length()"
"#;

/// Identity columns that the rows of these tests lack.
const SET: [&str; 6] = ["--set", "model=act", "--set", "experiment=reach", "--set", "seed=1"];

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("arms.toml"), DEFINITIONS).unwrap();
    folder
}

fn import<'a>(file: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["import", file, "-o", "x.parquet", "--definitions", "arms.toml"], more].concat()
}

/// The trace's rows with these columns, as CSV without the header.
#[cfg(feature = "polars")]
fn queried(at: &Path, columns: &str) -> Vec<String> {
    let sql = format!("select {columns} from steps order by episode_id, t");
    let asked = ["query", &sql, "x.parquet", "--definitions", "arms.toml", "--format", "csv"];
    run(at, &asked).done().lines().skip(1).map(str::to_owned).collect()
}

#[test]
fn a_csv_column_has_the_type_that_fits_all_cells() {
    let folder = folder();
    let at = folder.path();
    let rows = "\u{feff}episode,frame,success,reward,code,note,nothing\n\
                7,0,False,0.5,007,\"a, \"\"b\"\"\",\n7,1,True,1,12,,\n7,2,,nan,1e3,x,\n";
    fs::write(at.join("rows.csv"), rows).unwrap();
    let identity = ["--map", "episode_id=episode", "--map", "t=frame+1", "--map", "run=episode"];
    let told = run(at, &import("rows.csv", &[&SET[..], &identity].concat())).done();
    assert!(told.contains("imported 1 episode, 3 steps"), "{told}");
    for column in ["success (bool", "reward (float", "code (string", "note (string", "nothing (null in every line"] {
        assert!(told.contains(column), "{column}: {told}");
    }
    #[cfg(feature = "polars")]
    assert_eq!(
        queried(at, "episode_id, t, run, success, reward, code, note"),
        ["7,1,7,false,0.5,007,\"a, \"\"b\"\"\"", "7,2,7,true,1.0,12,", "7,3,7,,NaN,1e3,x"]
    );
    let declared = recording(&at.join("x.parquet"));
    assert_eq!(declared["formats"], json!(["csv"]));
    assert_eq!(declared["mapping"]["map"]["t"], "frame+1");
    assert_eq!(declared["mapping"]["set"]["seed"], 1);
    let hash = mirrorstats_exact::hash::of_bytes(rows.as_bytes());
    assert_eq!(declared["sources"], json!([hash]), "the hash is that of the file");
}

#[test]
fn whole_numbers_with_a_point_are_integers() {
    let folder = folder();
    let at = folder.path();
    let as_integers = "frame,episode,success,latency_ms,seed\n0,7,true,120,3\n1,7,true,,3\n";
    let as_floats = "frame,episode,success,latency_ms,seed\n0.0,7,true,120.0,3.0\n1.0,7,true,,3.0\n";
    let json = "{\"t\":1.0,\"episode_id\":\"7\",\"success\":true,\"latency_ms\":120.0,\"seed\":3.0,\"run\":7.0}\n\
                {\"t\":2e0,\"episode_id\":\"7\",\"success\":true,\"latency_ms\":null,\"seed\":3,\"run\":7}\n";
    let set = ["--set", "model=act", "--set", "experiment=reach"];
    let mapped = ["--map", "episode_id=episode", "--map", "t=frame+1", "--map", "run=episode"];
    let trace = |file: &str, text: &str, more: &[&str]| {
        fs::write(at.join(file), text).unwrap();
        run(at, &import(file, &[&set[..], more].concat())).done();
        run(at, &["score", "x.parquet", "--definitions", "arms.toml"]).done()
    };
    let expected = trace("integers.csv", as_integers, &mapped);
    assert!(expected.contains("act") && expected.contains(",3,7,"), "{expected}");
    assert_eq!(trace("floats.csv", as_floats, &mapped), expected);
    assert_eq!(trace("floats.jsonl", json, &[]), expected);
}

#[test]
fn csv_that_is_not_a_table_is_refused_with_its_line() {
    let folder = folder();
    let at = folder.path();
    for (rows, words) in [
        ("a,b\n1,2\n1\n", &["rows.csv, line 3", "found record with 1 fields"][..]),
        ("a,a\n1,2\n", &["rows.csv, line 1", "found `a` twice"]),
        ("a,b\n", &["rows.csv", "expected at least one step"]),
        ("episode_id,t\nx,1.5\n", &["rows.csv, row 1, key `t`", "found 1.5"]),
    ] {
        fs::write(at.join("rows.csv"), rows).unwrap();
        let told = run(at, &import("rows.csv", &SET)).refused();
        assert!(words.iter().all(|word| told.contains(word)), "{told}");
    }
}

#[test]
fn parquet_of_any_shape_is_mapped() {
    let folder = folder();
    let at = folder.path();
    let meta = DataType::Struct(vec![Field::new("id", DataType::Utf8, true)].into());
    let schema = Schema::new(vec![
        Field::new("meta", meta, true),
        Field::new("frame", DataType::Int32, false),
        Field::new("state", DataType::new_list(DataType::Float64, true), true),
        Field::new("success", DataType::Boolean, true),
        Field::new("score", DataType::Float64, true),
    ]);
    let row = |frame: u32| json!({ "meta": { "id": "e" }, "frame": frame, "state": [0.5, 2.0], "success": frame == 1 });
    write_rows(&at.join("rows.parquet"), &[logs::batch(schema, &[row(0), row(1)])], None);
    let identity = ["--map", "episode_id=meta.id", "--map", "t=frame+1", "--set", "run=1"];
    let answer = run(at, &import("rows.parquet", &[&SET[..], &identity].concat())).ends(0);
    assert!(answer.stderr.contains("left out: `state`, a list or an object in 2 lines"), "{}", answer.stderr);
    assert!(answer.stdout.contains("score (null in every line)"), "{}", answer.stdout);
    let state = ["--map", "x=state.1"];
    let answer = run(at, &import("rows.parquet", &[&SET[..], &identity, &state].concat())).ends(0);
    assert_eq!(answer.stderr, "");
    #[cfg(feature = "polars")]
    assert_eq!(queried(at, "episode_id, t, x, success"), ["e,1,2.0,false", "e,2,2.0,true"]);
    fs::write(at.join("rows.parquet"), "PAR1 and no more").unwrap();
    let told = run(at, &import("rows.parquet", &SET)).refused();
    assert!(told.contains("rows.parquet\n  expected a footer at the end, closed with `PAR1`"), "{told}");
}

#[test]
fn evaluations_of_lerobot_have_a_row_per_episode() {
    let folder = folder();
    let at = folder.path();
    logs::lerobot_evaluation(&at.join("eval_info.json"), &[true, false, true]);
    let set = &SET[..4];
    run(at, &import("eval_info.json", set)).done();
    #[cfg(feature = "polars")]
    assert_eq!(
        queried(at, "substr(episode_id, 10), t, seed, run, success, sum_reward, max_reward"),
        ["0,1,1000,1,true,1.5,", "1,1,1001,2,false,0.5,", "2,1,1002,3,true,1.5,"]
    );
    let info = json!({ "per_task": [{ "task_group": "libero", "task_id": 3, "metrics": {
        "sum_rewards": [1.0, 0.0], "max_rewards": [1.0, 0.0], "successes": [true, false], "video_paths": [] } }],
        "overall": {} });
    fs::write(at.join("eval_info.json"), info.to_string()).unwrap();
    let told = run(at, &import("eval_info.json", set)).refused();
    assert!(told.contains("key `seed`") && told.contains("found none"), "{told}");
    run(at, &import("eval_info.json", &SET)).done();
    #[cfg(feature = "polars")]
    assert_eq!(
        queried(at, "substr(episode_id, 10), run, task, success"),
        ["libero/3/0,1,libero/3,true", "libero/3/1,2,libero/3,false"]
    );
    fs::write(at.join("other.json"), "{\"rows\": []}").unwrap();
    let told = run(at, &import("other.json", &["--from", "lerobot"])).refused();
    assert!(told.contains("expected an evaluation of LeRobot") && told.contains("found no list `per_task`"), "{told}");
}

#[test]
fn frames_of_a_lerobot_data_set_are_steps() {
    let folder = folder();
    let at = folder.path();
    logs::lerobot_data_set(at, &[Some(2), None], false);
    let file = "data/chunk-000/file-000.parquet";
    let answer = run(at, &import(file, &[&SET[..], &["--from", "lerobot"]].concat())).ends(0);
    assert!(answer.stdout.starts_with("imported 2 episodes, 16 steps"), "{}", answer.stdout);
    assert!(answer.stderr.contains("left out: `action`") && answer.stderr.contains("`observation.state`"));
    #[cfg(feature = "polars")]
    assert_eq!(
        queried(at, "substr(episode_id, 10), run, t, success, done, action_change > 4.0")[..4],
        ["0,1,1,false,false,", "0,1,2,false,false,true", "0,1,3,true,false,true", "0,1,4,false,false,true"]
    );
    logs::lerobot_evaluation(&at.join("eval_info.json"), &[true]);
    let told = run(at, &import(file, &["--from", "inspect"])).refused();
    assert!(told.contains("expected a log of Inspect"), "{told}");
}

#[test]
fn the_folder_of_a_lerobot_data_set_is_imported_with_its_tasks() {
    let folder = folder();
    let at = folder.path();
    logs::lerobot_data_set(&at.join("pusht"), &[Some(2), None, Some(5)], false);
    let answer = run(at, &import("pusht", &SET)).ends(0);
    assert!(answer.stdout.starts_with("imported 3 episodes, 24 steps"), "{}", answer.stdout);
    #[cfg(feature = "polars")]
    assert_eq!(
        queried(at, "substr(episode_id, 10), run, t, success, task, fps, robot_type")[..3],
        [
            "0,1,1,false,Push the block,10,so100",
            "0,1,2,false,Push the block,10,so100",
            "0,1,3,true,Push the block,10,so100"
        ]
    );
    // Another copy has the same ids. A copy with one different frame has other ids.
    let ids = |name: &str| {
        run(at, &import(name, &SET)).ends(0);
        run(at, &["trace", "info", "x.parquet", "--episodes"]).done()
    };
    logs::lerobot_data_set(&at.join("copy"), &[Some(2), None, Some(5)], false);
    logs::lerobot_data_set(&at.join("other"), &[Some(2), None, Some(6)], false);
    assert_eq!(ids("pusht"), ids("copy"));
    assert_ne!(ids("pusht"), ids("other"));

    let frames = at.join("pusht/data/chunk-000/file-000.parquet");
    logs::lerobot_data_set(&at.join("short"), &[Some(2), None], false);
    fs::copy(at.join("short/data/chunk-000/file-000.parquet"), &frames).unwrap();
    let told = run(at, &import("pusht", &SET)).refused();
    assert!(told.contains("pusht, data\n  expected the frames of episode 2, as `meta/episodes` counts them"), "{told}");
    assert!(told.contains("found 8 fewer"), "{told}");
    fs::write(&frames, "PAR1").unwrap();
    let told = run(at, &import("pusht", &SET)).refused();
    assert!(
        told.contains("pusht/data/chunk-000/file-000.parquet\n  expected a footer at the end, closed with `PAR1`"),
        "{told}"
    );
    let info = at.join("other/meta/info.json");
    let text = fs::read_to_string(&info).unwrap().replace("v3.0", "v1.6");
    fs::write(&info, text).unwrap();
    let told = run(at, &import("other", &SET)).refused();
    assert!(told.contains("other, meta/info.json") && told.contains("found version v1.6"), "{told}");
    fs::remove_file(info).unwrap();
    let told = run(at, &import("other", &SET)).refused();
    assert!(told.contains("it is a folder; name the files in it"), "{told}");
}

#[test]
fn a_lerobot_data_set_of_version_2_has_its_tasks_and_counts_in_lines() {
    let folder = folder();
    let at = folder.path();
    logs::lerobot_data_set(&at.join("pusht"), &[Some(2), None], false);
    let expected = run(at, &import("pusht", &SET)).done();
    let meta = at.join("pusht/meta");
    let info = fs::read_to_string(meta.join("info.json")).unwrap().replace("v3.0", "v2.1");
    fs::write(meta.join("info.json"), info).unwrap();
    fs::remove_file(meta.join("tasks.parquet")).unwrap();
    fs::remove_dir_all(meta.join("episodes")).unwrap();
    fs::write(meta.join("tasks.jsonl"), "{\"task_index\": 0, \"task\": \"Push the block\"}\n").unwrap();
    let line = |episode| format!("{{\"episode_index\": {episode}, \"tasks\": [], \"length\": 8}}\n");
    fs::write(meta.join("episodes.jsonl"), line(0) + &line(1)).unwrap();
    assert_eq!(run(at, &import("pusht", &SET)).done(), expected);
    #[cfg(feature = "polars")]
    assert_eq!(queried(at, "task, fps")[0], "Push the block,10");
    // The folder is read where a trace is, with a definition file for the columns that the data set lacks.
    let mapping = "[import]\nformat = \"lerobot\"\n[import.columns]\nmodel = { value = \"act\" }\nseed = 1\n\
                   experiment = { value = \"reach\" }\n";
    fs::write(at.join("with.toml"), format!("{DEFINITIONS}{mapping}")).unwrap();
    let scores = |input| run(at, &["report", input, "--definitions", "with.toml", "--no-figures"]).done();
    assert_eq!(
        scores("pusht").lines().take(9).collect::<Vec<_>>(),
        scores("x.parquet").lines().take(9).collect::<Vec<_>>()
    );
    fs::write(meta.join("episodes.jsonl"), line(0) + &line(1) + &line(2)).unwrap();
    let told = run(at, &import("pusht", &SET)).refused();
    assert!(told.contains("expected the frames of episode 2") && told.contains("found 8 fewer"), "{told}");
}

#[test]
fn results_of_mirrorbench_score_as_their_own_metrics_say() {
    let folder = folder();
    let at = folder.path();
    let write = |place: &str, distances: &[f64], unreadable: u64| {
        let path = at.join("results").join(place);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let log = json!({ "track": "Human", "tag": "20260105-120000", "steps": distances.len() - 1, "sir": 0.5,
                          "improvement_steps": 1, "bad_response": unreadable, "distances": distances });
        fs::write(path, log.to_string()).unwrap();
    };
    // Two of three steps are nearer, the last one within one step of the hand; as 32-bit floats write the numbers.
    write("level1/gpt-4o/male_0-mano_white-splash/a.json", &[0.3, 0.200_000_002_98, 0.3, 0.099_999_99], 0);
    write("level2/gpt-4o/male_0-mano_white-splash/b.json", &[0.5, 0.5, 0.4, 0.5], 1);
    let scored = |inputs: &[&str]| {
        run(at, &[&["score"], inputs, &["-o", "s.csv"]].concat()).done();
        let text = fs::read_to_string(at.join("s.csv")).unwrap();
        let rows = text.lines().skip(1).map(|row| row.split(',').take(11).collect::<Vec<_>>().join(","));
        rows.collect::<Vec<_>>()
    };
    let expected = [
        "level1/gpt-4o/male_0-mano_white-splash/a,gpt-4o,level1,1,1,male_0-mano_white-splash,1,666667,1000000,1000000,0",
        "level2/gpt-4o/male_0-mano_white-splash/b,gpt-4o,level2,1,1,male_0-mano_white-splash,0,333333,0,250000,1",
    ];
    assert_eq!(scored(&["results"]), expected);
    let files = [
        "results/level1/gpt-4o/male_0-mano_white-splash/a.json",
        "results/level2/gpt-4o/male_0-mano_white-splash/b.json",
    ];
    let answer = run(at, &[&["import"], &files[..], &["-o", "x.parquet"]].concat()).ends(0);
    assert!(answer.stderr.contains("left out: 2 rows whose `#` is 0"), "{}", answer.stderr);
    assert_eq!(scored(&["x.parquet", "--definitions", "reach"]), expected);
    assert!(run(at, &["trace", "validate", "x.parquet"]).done().contains("0 errors"));
    fs::write(at.join("own.toml"), "[import]\nabsent = [\"episode_id\"]\n").unwrap();
    let told = run(at, &["import", files[0], "--from", "own.toml", "-o", "y.parquet"]).refused();
    assert!(told.contains("`absent` with `episode_id`, which every trace has"), "{told}");
    // The model and the level are in the folders.
    fs::copy(at.join(files[0]), at.join("a.json")).unwrap();
    let told = run(at, &["import", "a.json", "-o", "y.parquet"]).refused();
    assert!(told.contains("key `model`") && told.contains("key `experiment`"), "{told}");
}

#[test]
fn logs_of_inspect_robots_have_a_row_per_trial() {
    let folder = folder();
    let at = folder.path();
    logs::inspect_robots(&at.join("logs"));
    let both = ["logs/scripted.json", "logs/random.json", "-o", "x.parquet", "--definitions", "arms.toml"];
    let mapped = ["--map", "hertz=eval.embodiment_info.control_hz"];
    let answer = run(at, &[&["import"], &both[..], &mapped].concat()).ends(0);
    assert!(answer.stdout.starts_with("imported 8 episodes, 8 steps"), "{}", answer.stdout);
    assert!(answer.stderr.contains("left out: `sample`"), "{}", answer.stderr);
    #[cfg(feature = "polars")]
    {
        let rows = queried(at, "model, experiment, seed, run, scene, score_success_at_end, termination, hertz");
        assert_eq!(rows[0], "random,cubepick-reach,1,1,scene-0,0.0,max_steps,10.0");
        assert!(rows[4].starts_with("scripted,cubepick-reach,1,1,scene-0,1.0,"), "{rows:?}");
    }
    let text = fs::read_to_string(at.join("logs/random.json")).unwrap();
    let mut log: Value = serde_json::from_str(&text).unwrap();
    log["version"] = json!(2);
    fs::write(at.join("new.json"), log.to_string()).unwrap();
    let told = run(at, &import("new.json", &[])).refused();
    assert!(told.contains("expected an EvalLog of inspect-robots, version 1") && told.contains("version 2"), "{told}");
}
