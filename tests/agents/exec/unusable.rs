//! Programs that cannot answer: the recording stops and says so. Only whole episodes are kept.

use std::fs;

use super::recordings::{Bench, FORWARD, outcome, seed_of, three_steps};
use crate::harness::program::program;

/// The error message for the program of these tests.
fn sentence(in_a_row: u32, last: &str) -> String {
    format!(
        "error: the agent `exec` gave {in_a_row} replies in a row without a decision; the last: {last}\n  \
         help: --max-unusable N allows more in a row, --keep-going any number"
    )
}

#[test]
fn an_agent_whose_every_reply_is_unreadable_ends_its_recording() {
    let bench = Bench::new();
    bench.program("echo 'I cannot see.'");
    let words = ["--runs", "2", "--threads", "1"];
    let (code, answer, said) = outcome(&bench.record(&words).output().unwrap());
    assert_eq!(code, Some(2), "{said}");
    let last = "parse_failed: `I cannot see.` (E1/exec/s1/r1, step 20): expected a JSON object, found text without one";
    assert!(said.contains(&sentence(20, last)), "{said}");
    assert_eq!((&answer["recorded"], &answer["steps"], &answer["stopped"]), (&0.into(), &0.into(), &true.into()));
    assert!(!bench.path("runs/E1-exec.parquet").exists() && bench.lost().is_empty());
    // The program was told, and its episode was not recorded.
    assert_eq!(bench.heard().last().unwrap()["reason"], "stopped");
    assert_eq!(bench.leftovers(), Vec::<String>::new());

    let few = [&words[..], &["--max-unusable", "3"]].concat();
    let (code, _, said) = outcome(&bench.record(&few).output().unwrap());
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains(&sentence(
            3,
            "parse_failed: `I cannot see.` (E1/exec/s1/r1, step 3): expected a JSON object, found text without one"
        )),
        "{said}"
    );

    let all = [&words[..], &["--keep-going"]].concat();
    let (code, answer, said) = outcome(&bench.record(&all).output().unwrap());
    assert_eq!((code, &answer["recorded"], &answer["steps"]), (Some(0), &2.into(), &40.into()), "{said}");
}

#[test]
fn the_message_names_the_difference_of_the_last_reply_from_the_schema() {
    let bench = Bench::new();
    bench.program(&format!("echo '{}'", FORWARD.replace("\"w\"", "\"stop\"")));
    let (code, _, said) = outcome(&bench.record(&["--runs", "1", "--threads", "1"]).output().unwrap());
    assert_eq!(code, Some(2), "{said}");
    let (_, message) =
        said.split_once("gave 20 replies in a row without a decision; the last: schema_invalid: ").unwrap();
    assert!(message.contains("step 20): \"action\" is \"stop\", expected one of w, s, a, d, done\n"), "{said}");
}

#[test]
fn consecutive_replies_count_across_episodes_and_whole_episodes_stay() {
    let bench = Bench::new();
    // The first episode ends with two unusable replies; the second has only unusable ones.
    let first = format!("case $n in 1[0-8]|?) echo '{FORWARD}' ;; *) echo no ;; esac");
    bench.program(&format!("[ $n = 1 ] && echo x >> count; if [ $(wc -l < count) = 1 ]; then {first}; else echo; fi"));
    let words = ["--runs", "3", "--threads", "1", "--max-unusable", "4"];
    let (code, answer, said) = outcome(&bench.record(&words).output().unwrap());
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains(&sentence(4, "empty: no text (E1/exec/s1/r2, step 2)")), "{said}");
    assert_eq!((&answer["recorded"], &answer["steps"]), (&1.into(), &20.into()), "{said}");
    assert_eq!(bench.texts("runs/E1-exec.parquet", "episode_id").len(), 20);
    assert!(said.contains("stopped, 2 episodes to go: the same command continues"), "{said}");
}

#[test]
fn one_failing_episode_among_good_ones_ends_the_recording() {
    let bench = Bench::new();
    // The second episode never gives a usable reply; the first does, slowly.
    bench.program(&format!("if [ \"$run\" = 2 ]; then echo no; else sleep 0.05; echo '{FORWARD}'; fi"));
    let script = fs::read_to_string(bench.path("program.sh")).unwrap();
    let task = format!("case \"$line\" in *'{}'*) run=2 ;; esac\n  case \"$line\" in", seed_of(1, 2));
    fs::write(bench.path("program.sh"), script.replacen("case \"$line\" in", &task, 1)).unwrap();
    let words = ["--runs", "2", "--threads", "1", "--in-flight", "2", "--max-unusable", "6"];
    let (code, _, said) = outcome(&bench.record(&words).output().unwrap());
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains(&sentence(
            6,
            "parse_failed: `no` (E1/exec/s1/r2, step 6): expected a JSON object, found text without one"
        )),
        "{said}"
    );
    assert!(!bench.path("runs/E1-exec.parquet").exists());
}

#[test]
fn a_limit_of_zero_and_a_limit_with_keep_going_are_refused() {
    let bench = Bench::new();
    bench.program(&three_steps());
    for (words, expected) in [
        (&["--max-unusable", "0"][..], "--max-unusable"),
        (&["--max-unusable", "5", "--keep-going"], "cannot be used with"),
    ] {
        let (code, _, said) = outcome(&bench.record(words).output().unwrap());
        assert!(code == Some(2) && said.contains(expected), "{said}");
    }
    // Scripted agents never reach the limit.
    let words = "record --agent frozen --no-frames --no-log --config small.toml --experiment E1 --seeds 1 --runs 1 --max-unusable 1";
    let output = program(bench.folder.path()).args(words.split(' ')).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
}
