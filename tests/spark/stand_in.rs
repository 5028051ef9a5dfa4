//! A script in place of `spark-submit`: its input, and the handling of its answers.

use std::fs;
use std::net::TcpListener;
use std::path::Path;

use mirrorstats_trace::write::{OptionalColumns, write_episodes};

use super::{Answer, answer, episode, program, write};

/// A folder with a trace and a Spark with this script as `spark-submit`; `$place` is the submission's folder.
fn folder(script: &str) -> tempfile::TempDir {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("home/bin/spark-submit");
    fs::create_dir_all(program.parent().unwrap()).unwrap();
    fs::write(&program, format!("#!/bin/sh\nfor last; do :; done\nplace=$(dirname \"$last\")\n{script}\n")).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    let episodes = [episode("a", "E1", 1)];
    write(&folder.path().join("a.parquet"), &episodes, OptionalColumns::used_by(&episodes));
    folder
}

fn score(folder: &Path, arguments: &[&str]) -> Answer {
    let mut command = program(folder);
    answer(command.env("SPARK_HOME", folder.join("home")).args(["score", "--engine", "spark"]).args(arguments))
}

/// A script that gives this answer.
fn answering(json: &str) -> String {
    format!("cat >\"$place/answer.json\" <<'END'\n{json}\nEND")
}

#[test]
fn the_drivers_answers_become_messages() {
    for (json, words) in [
        (
            r#"{"refused": {"rows": {"expected": 4, "found": 0}}}"#,
            "expected 4 rows by the footers of the traces, Spark read 0",
        ),
        (r#"{"refused": {"empty": "s3a://k:s@b/x"}}"#, "`s3a://b/x`: expected Parquet files"),
        (r#"{"refused": {"rule": {"fault": null, "faults": 0}}}"#, "no-episodes: a.parquet"),
        (
            r#"{"refused": {"rule": {"fault": {"episode": "x", "rule": 0, "found": "null"}, "faults": 3}}}"#,
            "null-in-required: a.parquet, episode `x`, column `episode_id`\n  expected a value\n  found null",
        ),
        (
            r#"{"refused": {"rule": {"fault": {"episode": "x", "rule": 0, "found": "null"}, "faults": 3}}}"#,
            "and 2 more",
        ),
        (
            r#"{"refused": {"rule": {"fault": {"episode": "x", "rule": 999, "found": ""}, "faults": 1}}}"#,
            "cannot read what",
        ),
        (
            r#"{"failed": {"name": "SparkException", "message": "[X] no\nCaused by: a.b.C: disk full"}}"#,
            "Spark: disk full",
        ),
        (r#"{"failed": {"name": "SparkException", "message": ""}}"#, "Spark: SparkException"),
        (r#"{"late": {}}"#, "has not answered in 9 s"),
        ("{", "cannot read what the driver on Spark answered"),
    ] {
        let folder = folder(&answering(json));
        let message = score(folder.path(), &["a.parquet", "--spark-timeout", "9"]).refused();
        assert!(message.contains(words), "{json}: no `{words}` in {message}");
    }
}

#[test]
fn a_spark_that_never_gets_to_the_driver_is_explained() {
    for (script, words) in [
        ("echo 'JAVA_HOME is not set' >&2; exit 1", "no Java that it can run on"),
        (
            "echo \"Exception in thread \\\"main\\\" x.Y: Could not parse Master URL: 'q'\"; exit 1",
            "Spark: Could not parse",
        ),
        ("exit 7", "ended without a word"),
    ] {
        let folder = folder(script);
        let message = score(folder.path(), &["a.parquet", "-o", "out.csv"]).refused();
        assert!(message.contains(words), "{message}");
        assert!(!folder.path().join("out.csv").exists());
    }
}

#[test]
fn an_invalid_table_is_refused() {
    let done = answering(r#"{"done": {"episodes": 1}}"#);
    for line in [
        "[1]",
        r#"["a", "m", "E1", 1, 1]"#,
        r#"["a", "m", "E1", 1, 1, [0], []]"#,
        r#"["a", "m", null, 1, 1, [0, 1], []]"#,
        "no json",
    ] {
        let folder = folder(&format!("{done}\necho '{line}' >\"$place/table.jsonl\""));
        let message = score(folder.path(), &["a.parquet", "--metrics", "TSA,TTD"]).refused();
        assert!(message.contains("cannot read what the driver"), "{message}");
    }
    let folder = folder(&format!("{done}\necho '[\"a\", \"m\", \"E1\", 1, 2, [null, 7], []]' >\"$place/table.jsonl\""));
    let scores = score(folder.path(), &["a.parquet", "--metrics", "TSA,TTD"]).done();
    assert_eq!(scores, "episode_id,model,experiment,seed,run,TSA,TTD\na,m,E1,1,2,,7\n");
}

#[test]
fn secrets_are_on_no_command_line_and_in_no_message() {
    let folder =
        folder("printf '%s\\n' \"$@\" >told; ls -ld \"$place\" >>told; cat \"$last\" >request; echo refused hush >&2");
    let settings = ["--spark-conf", "spark.hadoop.fs.s3a.secret.key=hush", "--spark-conf", "spark.a=b c"];
    let message = score(folder.path(), &[&["a.parquet", "--master", "local[1]"], &settings[..]].concat()).refused();
    assert!(message.contains("Spark: refused ***"), "{message}");
    let told = fs::read_to_string(folder.path().join("told")).unwrap();
    assert!(told.contains("--master\nlocal[1]\n") && told.contains("--conf\nspark.a=b c\n") && !told.contains("hush"));
    assert!(told.contains("drwx------"), "{told}");
    assert!(fs::read_to_string(folder.path().join("request")).unwrap().contains("hush"));
}

#[test]
fn uris_are_passed_on_as_typed_and_checked_against_the_schema() {
    let folder = folder("cat \"$last\" >request");
    score(folder.path(), &["s3a://bucket/{a,b}/*.parquet", "hdfs:/runs"]).refused();
    let request = fs::read_to_string(folder.path().join("request")).unwrap();
    let request: serde_json::Value = serde_json::from_str(&request).unwrap();
    assert_eq!(request["sources"][0]["paths"], serde_json::json!(["s3a://bucket/{a,b}/*.parquet", "hdfs:/runs"]));
    assert_eq!((&request["inspect"], &request["rows"]), (&true.into(), &serde_json::Value::Null));
    fs::remove_file(folder.path().join("request")).unwrap();
    fs::write(folder.path().join("bad.toml"), "[metric.M]\nvalue = \"count(mirror_visable)\"\n").unwrap();
    let message = score(folder.path(), &["s3a://bucket/x", "--definitions", "bad.toml"]).refused();
    assert!(message.contains("mirror_visible") && !folder.path().join("request").exists(), "{message}");
}

#[test]
fn bad_usage_is_refused_before_anything_is_submitted() {
    let folder = folder("touch submitted");
    let at = folder.path();
    fs::create_dir(at.join("there")).unwrap();
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let nobody = format!("spark://{free}");
    for (arguments, words) in [
        (&["a.parquet", "s3a://b/x"][..], "found both"),
        (&["a.parquet", "-o", "there"], "`there` already exists"),
        (&["a.parquet", "--explain", "a"], "--explain looks into the steps"),
        (&["a.parquet", "--spark-conf", "spark.x"], "expected `spark.key=value`"),
        (&["a.parquet", "--spark-conf", "spark.submit.deployMode=cluster"], "cannot be set"),
        (&["a.parquet", "--master", &nobody], "cannot connect to the master `spark://127.0.0.1:"),
        (&["a.parquet", "--master", "spark://nonsense"], "cannot connect to the master"),
        (&["none.parquet"], "no such file"),
    ] {
        let answer = score(at, arguments);
        assert_eq!(answer.code, 2, "{arguments:?}");
        assert!(answer.stderr.contains(words), "{arguments:?}: {}", answer.stderr);
    }
    let native = |arguments: &[&str]| answer(program(at).args(arguments)).refused();
    assert!(native(&["score", "a.parquet", "--master", "local"]).contains("add --engine spark"));
    assert!(native(&["report", "s3a://b/x"]).contains("Spark alone can read"));
    assert!(!at.join("submitted").exists());
}

#[test]
fn a_missing_spark_is_reported_with_the_remedy() {
    let folder = folder("");
    let mut command = program(folder.path());
    command.env("PATH", "").args(["score", "--engine", "spark", "a.parquet"]);
    assert!(answer(&mut command).refused().contains("pip install pyspark"));
    command.env("SPARK_HOME", "/no/such/place");
    assert!(answer(&mut command).refused().contains("SPARK_HOME is `/no/such/place`"));
}

#[test]
fn experiments_declared_by_the_traces_are_checked() {
    let folder = folder("cat \"$last\" >request");
    let at = folder.path();
    let declared =
        serde_json::json!({ "experiment": { "name": "E6", "title": "Delayed", "chance": { "TSA": "1/5" } } });
    write_episodes(&at.join("six.parquet"), Some(declared), &[episode("b", "E6", 1)]).unwrap();
    score(at, &["a.parquet", "six.parquet"]).refused();
    let request: serde_json::Value = serde_json::from_str(&fs::read_to_string(at.join("request")).unwrap()).unwrap();
    assert!(request["check"].as_str().unwrap().contains("NOT IN ('E1', 'E2', 'E3', 'E4', 'E5', 'E6')"));
    let definitions = request["metadata"]["mirrorstats.definitions"].as_str().unwrap();
    let definitions: serde_json::Value = serde_json::from_str(definitions).unwrap();
    assert_eq!(definitions["experiment"]["E6"]["title"], "Delayed");
}
