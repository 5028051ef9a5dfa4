//! The same episodes give the same bytes in traces and logs, however they were made.

use super::recordings::Bench;
use crate::harness::files::assert_same;
use crate::harness::program::succeeds;

const WHOLE: &str = "--agent random --experiment E1,E4..E5 --seeds 2 --runs 2";

#[test]
fn repeats_and_any_number_of_threads_give_the_same_bytes() {
    let bench = Bench::new();
    let once = bench.recorded("once", &format!("{WHOLE} --threads 1"));
    let names: Vec<&str> = once.keys().map(String::as_str).collect();
    let expected = [
        "E1-random.mcap",
        "E1-random.parquet",
        "E4-random.mcap",
        "E4-random.parquet",
        "E5-random.mcap",
        "E5-random.parquet",
    ];
    assert_eq!(names, expected);
    assert_same(&bench.recorded("threads", &format!("{WHOLE} --threads 3")), &once);
    assert_same(&bench.recorded("in-flight", &format!("{WHOLE} --threads 2 --in-flight 5")), &once);
    // A complete recording does not change.
    assert_same(&bench.recorded("once", WHOLE), &once);
}

#[test]
fn shards_give_the_same_bytes() {
    let bench = Bench::new();
    let whole = bench.recorded("whole", WHOLE);
    for share in ["3/3", "1/3", "2/3"] {
        succeeds(&mut bench.record("shares", &format!("{WHOLE} --threads 1 --shard {share}")));
    }
    assert_same(&bench.files("shares"), &whole);
}

#[test]
fn a_recording_grown_in_parts_has_the_same_bytes() {
    let bench = Bench::new();
    let whole = bench.recorded("whole", WHOLE);
    for step in ["--experiment E5 --seeds 1 --runs 1", "--experiment E1..E4 --seeds 1 --runs 2", "--seeds 2 --runs 1"] {
        succeeds(&mut bench.record("grown", &format!("--agent random {step}")));
    }
    let mut grown = bench.recorded("grown", WHOLE);
    grown.retain(|name, _| whole.contains_key(name));
    assert_same(&grown, &whole);
}

#[test]
fn more_shares_than_episodes_leave_some_with_nothing_to_do() {
    let bench = Bench::new();
    let words = "--agent frozen --experiment E1 --seeds 1 --runs 1 --no-log";
    succeeds(&mut bench.record("runs", &format!("{words} --shard 2/2")));
    assert!(!bench.path("runs").exists(), "nothing was recorded");
    succeeds(&mut bench.record("runs", &format!("{words} --shard 1/2")));
    assert_eq!(bench.files("runs").len(), 1);
}
