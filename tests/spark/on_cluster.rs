//! A real master with two workers. Scores equal those of the native engine to the last byte, even if a worker is killed
//! halfway. Invalid traces are refused. No process outlives the program.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use mirrorstats_trace::episodes::episode::{Episode, Extra};
use mirrorstats_trace::write::OptionalColumns;
use serde_json::Value;

use super::cluster::{Cluster, get, word_after};
use super::{Answer, answer, episode, fixture, program, write};
use crate::harness::program::{Running, wait_for};

/// Features that engines may implement differently: texts, patterns, 64 bits, nested windows, reserved words.
const DEFINITIONS: &str = r#"
include = ["paper"]
[let]
said = "first(regexp_like(reasoning, '(?i)\\b(STRASSE|straße|me)\\b'))"
[metric.ORDER]
value = "count(regexp_like(reasoning, '^line1.line2'))"
[metric.END]
value = "count(regexp_like(reasoning, 'maybe$'))"
[metric.SAID]
value = "coalesce(said, 0) + count(reasoning = 'line1\rline2 \\ ''x''')"
[metric.BIG]
value = "2147483647 + case when any(mirror_visible) then 2147483647 else 0 end"
[metric.DIV]
value = "div(9007199254740993 * run, 1) + div(0 - sum(mirror_self_px), 7) % 5"
[metric.FLOATS]
value = "count(pose_x > 100) * 10 + count(pose_x = 0)"
[metric.NESTED]
value = "last(t < coalesce(first(self_color = at(selected_cube, first(mirror_visible))), 99) and self_color is distinct from at(self_color, last(action = 'done') - 1))"
"#;

/// Settings that keep a cluster of tests small, and its processes quick to start.
const SMALL: [&str; 8] = [
    "spark.driver.memory=512m",
    "spark.executor.memory=512m",
    "spark.driver.extraJavaOptions=-XX:TieredStopAtLevel=1 -XX:+UseSerialGC",
    "spark.executor.extraJavaOptions=-XX:TieredStopAtLevel=1 -XX:+UseSerialGC",
    "spark.driver.host=127.0.0.1",
    "spark.driver.bindAddress=127.0.0.1",
    "spark.sql.shuffle.partitions=2",
    "spark.sql.codegen.wholeStage=false",
];

fn on(cluster: &Cluster, folder: &Path, arguments: &[&str]) -> Command {
    let mut command = program(folder);
    command.env("PYTHONPATH", &cluster.packages).env("SPARK_LOCAL_IP", "127.0.0.1");
    command.args(["score", "--engine", "spark", "--master", &cluster.master]).args(arguments);
    for setting in SMALL {
        command.args(["--spark-conf", setting]);
    }
    command
}

fn spark(cluster: &Cluster, folder: &Path, arguments: &[&str]) -> Answer {
    answer(&mut on(cluster, folder, arguments))
}

fn native(folder: &Path, arguments: &[&str]) -> String {
    answer(program(folder).arg("score").args(arguments)).done()
}

#[test]
fn a_cluster_gives_the_scores_of_the_native_engine() {
    let mut cluster = Cluster::start();
    texts_and_patterns_from_a_uri_into_a_folder(&cluster);
    an_episode_in_two_files_is_refused(&cluster);
    nothing_runs_on_when_the_program_is_gone(&cluster);
    a_worker_may_be_killed(&mut cluster);
}

#[test]
#[ignore = "soak: a cluster of its own, three more statements"]
fn soak_a_cluster_gives_the_native_scores_and_refuses_unreadable_traces() {
    let cluster = Cluster::start();
    what_a_uri_does_not_give_is_refused(&cluster);
    the_scores_of_files_are_the_native_ones(&cluster);
}

fn texts_and_patterns_from_a_uri_into_a_folder(cluster: &Cluster) {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::create_dir_all(at.join("runs/more")).unwrap();
    let some = OptionalColumns::named(&["mirror_self_px", "pose_x", "reasoning"]).unwrap();
    write(&at.join("runs/a b.parquet"), &[episode("é'1\\", "E1", 1), episode("b", "E5", 2)], OptionalColumns::all());
    write(&at.join("runs/more/[c]%20.parquet"), &[episode("c", "E1", 3)], some);
    fs::write(at.join("runs/README.md"), "not a trace").unwrap();
    fs::write(at.join("mine.toml"), DEFINITIONS).unwrap();
    let uri = format!("file://{}/runs", at.display());
    spark(cluster, at, &[&uri, "--definitions", "mine.toml", "-o", "out"]).done();
    let expected = native(at, &["runs", "--definitions", "mine.toml"]);
    assert_eq!(native(at, &["out", "--definitions", "mine.toml"]), expected);
    // The folder of scores contains the definitions.
    assert_eq!(native(at, &["out"]), expected);
    assert!(spark(cluster, at, &[&uri, "-o", "out"]).refused().contains("`out` already exists"));
}

/// A folder with `a.parquet`, and `b.parquet` with one of the same episodes and no optional columns.
fn overlapping() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (one, other) = (episode("one", "E1", 1), episode("other", "E1", 2));
    write(&at.join("a.parquet"), &[one.clone(), other], OptionalColumns::all());
    let mut bare = Episode { stated_color: None, ..one };
    bare.steps.iter_mut().for_each(|step| step.extra = Extra::default());
    write(&at.join("b.parquet"), &[bare], OptionalColumns::NONE);
    folder
}

fn an_episode_in_two_files_is_refused(cluster: &Cluster) {
    let folder = overlapping();
    let at = folder.path();
    let twice = spark(cluster, at, &["a.parquet", "b.parquet", "-o", "out.csv"]).refused();
    for words in ["t-duplicate: ", "episode `one`", "8 rows of 4 timesteps", "help: "] {
        assert!(twice.contains(words), "no `{words}` in {twice}");
    }
    assert!(!at.join("out.csv").exists());
}

fn what_a_uri_does_not_give_is_refused(cluster: &Cluster) {
    let folder = overlapping();
    let at = folder.path();
    fs::write(at.join("mine.toml"), "[metric.M]\nvalue = \"count(reasoning is null)\"\n").unwrap();
    let uri = format!("file://{}/*.parquet", at.display());
    let absent = spark(cluster, at, &[&uri, "--definitions", "mine.toml"]).refused();
    assert!(
        absent.contains("column `reasoning` of ") && absent.contains("b.parquet: expected text, found no such column")
    );
    let none = spark(cluster, at, &[&format!("file://{}/none", at.display())]).refused();
    assert!(none.contains("[PATH_NOT_FOUND]") && none.lines().count() == 2, "{none}");
}

fn the_scores_of_files_are_the_native_ones(cluster: &Cluster) {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let traces = fixture("paper");
    spark(cluster, at, &[traces.to_str().unwrap(), "-o", "spark.parquet"]).done();
    native(at, &[traces.to_str().unwrap(), "-o", "native.parquet"]);
    assert!(fs::read(at.join("spark.parquet")).unwrap() == fs::read(at.join("native.parquet")).unwrap());
}

fn nothing_runs_on_when_the_program_is_gone(cluster: &Cluster) {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--spark-log", "log", "--spark-conf", "spark.sql.shuffle.partitions=2000"];
    let mut child =
        started(&mut on(cluster, folder.path(), &[&[fixture("paper").to_str().unwrap()], &arguments[..]].concat()));
    let running = || cluster.state()["activeapps"].as_array().is_some_and(|apps| !apps.is_empty());
    wait_for("the application", || running().then_some(()));
    let driver = || word_after(&folder.path().join("log"), "Successfully started service 'SparkUI' on port ");
    wait_for("the driver", driver);
    child.0.kill().unwrap();
    child.0.wait().unwrap();
    wait_for("the end of the application", || (!running()).then_some(()));
}

fn a_worker_may_be_killed(cluster: &mut Cluster) {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let events = cluster.folder().join("events");
    fs::create_dir(&events).unwrap();
    let traces = fixture("paper");
    let mut arguments = vec![traces.to_str().unwrap(), "-o", "out.parquet", "--spark-log", "log"];
    // Many small tasks, and a log of their outcomes.
    let directory = format!("spark.eventLog.dir=file://{}", events.display());
    for setting in [
        &directory,
        "spark.eventLog.enabled=true",
        "spark.eventLog.compress=false",
        "spark.eventLog.rolling.enabled=false",
        "spark.sql.adaptive.enabled=false",
        "spark.sql.autoBroadcastJoinThreshold=-1",
    ] {
        arguments.extend(["--spark-conf", setting]);
    }
    let mut command = on(cluster, at, &arguments);
    command.args(["--spark-conf", "spark.sql.shuffle.partitions=30"]);
    let mut child = started(&mut command);
    let page = wait_for("the driver's page", || {
        word_after(&at.join("log"), "Successfully started service 'SparkUI' on port ")
    });
    let page = format!("http://127.0.0.1:{page}/api/v1/applications");
    wait_for("tasks on both workers", || in_the_middle(&page).then_some(()));
    cluster.kill_a_worker();
    assert!(child.0.wait().unwrap().success(), "{}", fs::read_to_string(at.join("log")).unwrap());
    native(at, &[traces.to_str().unwrap(), "-o", "native.parquet"]);
    assert!(fs::read(at.join("out.parquet")).unwrap() == fs::read(at.join("native.parquet")).unwrap());
    let log = fs::read_dir(&events).unwrap().next().unwrap().unwrap().path();
    work_was_done_again(&fs::read_to_string(log).unwrap());
}

/// Returns true if both executors have finished tasks of the statement and tasks remain.
fn in_the_middle(page: &str) -> bool {
    let look = || {
        let id = get(page)?[0]["id"].as_str()?.to_owned();
        let executors = get(&format!("{page}/{id}/executors"))?;
        let done = |executor: &Value| executor["id"] != "driver" && executor["completedTasks"].as_u64() > Some(30);
        let both = executors.as_array()?.iter().filter(|executor| done(executor)).count() == 2;
        let stages = get(&format!("{page}/{id}/stages?status=active"))?;
        let left =
            stages.as_array()?.iter().any(|stage| stage["numTasks"].as_u64() > stage["numCompleteTasks"].as_u64());
        Some(both && left)
    };
    look().unwrap_or(false)
}

/// Checks in the event log that an executor was lost while tasks remained, and that its work was repeated.
fn work_was_done_again(log: &str) {
    let events: Vec<Value> = log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let is = |event: &Value, name: &str| event["Event"] == format!("SparkListener{name}");
    let lost = events.iter().position(|event| is(event, "ExecutorRemoved")).expect("an executor was lost");
    let after = events[lost..].iter().filter(|event| is(event, "TaskEnd")).count();
    assert!(after > 0, "every task was over when the executor was lost");
    let failed = |event: &&Value| is(event, "TaskEnd") && event["Task End Reason"]["Reason"] != "Success";
    let again =
        |event: &&Value| is(event, "StageSubmitted") && event["Stage Info"]["Stage Attempt ID"].as_u64() > Some(0);
    let (failed, again) = (events.iter().filter(failed).count(), events.iter().filter(again).count());
    assert!(failed + again > 0, "nothing was submitted again");
}

/// Starts a command without output.
fn started(command: &mut Command) -> Running {
    Running(command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
}
