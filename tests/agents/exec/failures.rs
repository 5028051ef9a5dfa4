//! Programs that fail: the episode is lost, named and counted, and the same command records it later.

use std::fs;
use std::time::Instant;

use super::recordings::{Bench, FORWARD, done, outcome, seed_of, three_steps};
use crate::harness::files::{assert_same, contents};
use crate::harness::program::run;
use crate::harness::traces::recording;

/// Checks that a program which runs `answer` at its second observation loses its episode, and why.
fn loses(answer: &str, words: &[&str], expected: &[&str]) {
    let bench = Bench::new();
    bench.program(&format!("if [ $n = 1 ]; then echo '{FORWARD}'; else {answer}; fi"));
    let (code, found, said) = outcome(&bench.record(words).output().unwrap());
    assert_eq!((code, &found["recorded"]), (Some(1), &0.into()), "{answer}: {said}");
    let reason = found["lost"][0]["reason"].as_str().unwrap();
    assert_eq!(found["lost"][0]["episode_id"], "E1/exec/s1/r1");
    for expected in expected {
        assert!(reason.contains(expected), "{answer}: expected `{expected}` in {reason}");
    }
    assert!(!bench.path("runs/E1-exec.parquet").exists(), "{answer}: a lost episode is in no trace");
    assert_eq!(bench.leftovers(), ["lost.jsonl"], "{answer}");
    assert_eq!(bench.lost(), [found["lost"][0].clone()], "{answer}");
    assert_eq!((&found["lost"][0]["step"], &found["lost"][0]["run"]), (&2.into(), &1.into()), "{answer}");

    // Once the program is fixed, the same command records the lost episode.
    bench.program(&three_steps());
    let (code, found, said) = outcome(&bench.record(words).output().unwrap());
    assert_eq!((code, &found["recorded"]), (Some(0), &1.into()), "{answer}: {said}");
    // This time the program wrote nothing to standard error.
    assert!(!bench.path("runs/stderr/E1-exec-s1-r1.log").exists(), "{answer}");
}

#[test]
fn the_end_of_a_program_is_reported_with_its_code_and_last_output() {
    loses("echo 'no such layer: 12' >&2; exit 3", &[], &["ended (exit status: 3)", "no such layer: 12"]);
    loses("kill -9 $$", &[], &["the program ended ("]);
    loses("exit 0", &[], &["ended (exit status: 0)"]);
    loses("printf '{\"action\": \"w'; exit 1", &[], &["ended (exit status: 1)"]);
}

#[test]
fn a_program_that_hangs_is_ended_in_time() {
    let start = Instant::now();
    loses("sleep 600", &["--exec-timeout", "1"], &["no reply within 1 s", "--exec-timeout"]);
    assert!(start.elapsed().as_secs() < 300, "it was waited for");
}

#[test]
fn a_program_that_closes_its_output_loses_the_episode() {
    // `exec` replaces the shell, which would otherwise keep the output open.
    let bench = Bench::new();
    bench.program("exec >&-; sleep 600");
    let (code, found, said) = outcome(&bench.record_of("exec:exec sh program.sh", &[]).output().unwrap());
    assert_eq!(code, Some(1), "{said}");
    let reason = found["lost"][0]["reason"].as_str().unwrap();
    assert!(reason.contains("closed its standard output"), "{reason}");
}

#[test]
fn an_endless_line_loses_the_episode() {
    loses("head -c 3000000 /dev/zero | tr '\\0' x; sleep 600", &[], &["longer than 1048576 bytes"]);
}

#[test]
fn an_unrequested_line_loses_the_episode() {
    // Two lines for one observation: the second would be read as the answer to the next observation.
    let bench = Bench::new();
    bench.program(&format!("printf '%s\\n%s\\n' '{FORWARD}' 'loading the model'"));
    let (code, found, said) = outcome(&bench.record(&[]).output().unwrap());
    assert_eq!(code, Some(1), "{said}");
    let reason = found["lost"][0]["reason"].as_str().unwrap();
    assert!(reason.contains("an unrequested line: `loading the model`; the previous line"), "{reason}");
    // People must decide which of the two was the reply.
    assert!(
        reason.contains("taken for its reply: `{\"view-description\"") && reason.contains("standard error"),
        "{reason}"
    );
}

#[test]
fn a_banner_read_as_a_reply_is_named() {
    // The banner comes before the reply, in one write. At the second observation the program can tell the two apart.
    let bench = Bench::new();
    let first = format!("printf '%s\\n%s\\n' 'loading the model' '{FORWARD}'");
    bench.program(&format!("if [ $n = 1 ]; then {first}; else echo '{FORWARD}'; fi"));
    let (code, found, said) = outcome(&bench.record(&[]).output().unwrap());
    assert_eq!(code, Some(1), "{said}");
    let lost = &found["lost"][0];
    let reason = lost["reason"].as_str().unwrap();
    assert!(
        reason.starts_with("step 1: the program wrote `loading the model` where its reply was expected"),
        "{reason}"
    );
    assert!(reason.contains("its reply would have come after it: `{\"view-description\""), "{reason}");
    assert_eq!(lost["step"], 1);
}

#[test]
fn a_traceback_keeps_its_lines() {
    let bench = Bench::new();
    bench.program("printf 'Traceback:\\n  File \"a.py\", line 4\\n\\033[31mValueError\\n' >&2; exit 1");
    let (_, found, said) = outcome(&bench.record(&[]).output().unwrap());
    let reason = found["lost"][0]["reason"].as_str().unwrap();
    assert!(
        reason.ends_with("its last words:\n    Traceback:\n      File \"a.py\", line 4\n    \u{1b}[31mValueError"),
        "{reason}"
    );
    // The terminal shows its lines escaped.
    assert!(said.contains("\n      File \"a.py\", line 4\n    \\u{1b}[31mValueError\n"), "{said}");
}

#[test]
fn a_line_before_the_first_question_is_named() {
    let early = "the program wrote a line before it was asked for its first reply: `loading the model`";
    // The banner comes before the program reads anything, at once or later, or between task and first observation.
    let before = "sleep 0.2; echo 'loading the model'";
    let between =
        "read -r task; printf '%s\\n' \"$task\" >> heard.jsonl; sleep 0.2; echo 'loading the model'; sleep 600";
    for banner in ["echo 'loading the model'", before, between] {
        let bench = Bench::new();
        bench.program(&three_steps());
        let script = fs::read_to_string(bench.path("program.sh")).unwrap();
        fs::write(bench.path("program.sh"), format!("{banner}\n{script}")).unwrap();
        let (code, found, said) = outcome(&bench.record(&[]).output().unwrap());
        assert_eq!(code, Some(1), "{banner}: {said}");
        let lost = &found["lost"][0];
        assert_eq!(lost["step"], 1, "{banner}: {said}");
        assert!(lost["reason"].as_str().unwrap().starts_with(&format!("step 1: {early}")), "{banner}: {said}");

        // Standard error is not read as a reply.
        let quiet = banner.replace("'loading the model'", "'loading the model' >&2").replace("sleep 600", "n=0");
        fs::write(bench.path("program.sh"), format!("{quiet}\n{script}")).unwrap();
        let (code, _, said) = outcome(&bench.record(&[]).output().unwrap());
        assert_eq!(code, Some(0), "{banner}: {said}");
        let kept = fs::read_to_string(bench.path("runs/stderr/E1-exec-s1-r1.log")).unwrap();
        assert_eq!(kept, "loading the model\n");
    }
}

#[test]
fn a_late_line_is_not_taken_as_the_next_reply() {
    // The second line comes while the next observation is being sent.
    let bench = Bench::new();
    bench.program(&format!("echo '{FORWARD}'; [ $n = 1 ] && {{ sleep 0.3; echo 'all well'; sleep 600; }}"));
    let (code, found, said) = outcome(&bench.record(&[]).output().unwrap());
    assert_eq!(code, Some(1), "{said}");
    let reason = found["lost"][0]["reason"].as_str().unwrap();
    assert!(reason.starts_with("step 2: the program wrote an unrequested line: `all well`"), "{reason}");
}

#[test]
fn standard_error_is_kept_for_recorded_and_lost_episodes() {
    let bench = Bench::new();
    let speak = "printf '\\033[1mstep %s of %s\\033[0m\\r\\n' $n $MY_API_KEY >&2";
    let fails = "grep -c 'kind\":\"task' heard.jsonl | grep -q 2 && [ $n = 2 ] && exit 3";
    bench.program(&format!("{speak}; {fails}; {}", three_steps()));
    let words = ["--runs", "2", "--threads", "1"];
    let output = bench.record(&words).env("MY_API_KEY", "sk-loopback-0123456789").output().unwrap();
    let (code, answer, said) = outcome(&output);
    assert_eq!((code, &answer["recorded"]), (Some(1), &1.into()), "{said}");
    let kept = |run: u32| fs::read_to_string(bench.path(&format!("runs/stderr/E1-exec-s1-r{run}.log"))).unwrap();
    let line = |n: u32| format!("\u{1b}[1mstep {n} of [key]\u{1b}[0m\r\n");
    assert_eq!(kept(1), [line(1), line(2), line(3)].concat());
    assert_eq!(kept(2), [line(1), line(2)].concat());
    // A report ignores the folder of standard errors.
    run(bench.folder.path(), &["trace", "validate", "runs"]).done();
}

#[test]
fn a_missing_command_ends_the_recording_at_once() {
    let bench = Bench::new();
    let command = bench.record_of("exec:no-such-program --fast", &["--runs", "9", "--threads", "1"]).output().unwrap();
    let (code, _, said) = outcome(&command);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("cannot be run") && said.contains("no-such-program"), "{said}");
    assert_eq!(said.matches("lost E1/exec").count(), 1, "{said}");
    let (code, _, said) = outcome(&bench.record_of("exec: ", &[]).output().unwrap());
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("needs a command"), "{said}");
}

#[test]
fn another_command_cannot_continue_the_recording() {
    let bench = Bench::new();
    bench.program(&three_steps());
    assert_eq!(outcome(&bench.record(&[]).output().unwrap()).0, Some(0));
    let (code, _, said) = outcome(&bench.record_of("exec:sh ./program.sh", &["--runs", "2"]).output().unwrap());
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("agent.command"), "{said}");
}

#[test]
fn an_edited_program_is_another_agent() {
    let bench = Bench::new();
    bench.program(&three_steps());
    assert_eq!(outcome(&bench.record(&["--runs", "2", "--shard", "1/2"]).output().unwrap()).0, Some(0));
    let script = fs::read(bench.path("program.sh")).unwrap();
    let before = contents(&bench.path("runs"));
    let footer = recording(&bench.path("runs/E1-exec.parquet"))["agent"].clone();
    // One line: the position of the word and the hash of the file's contents.
    let hash = |bytes: &[u8]| mirrorstats_exact::hash::of_bytes(bytes);
    assert_eq!(footer["files"], hash(format!("2 {}\n", hash(&script)).as_bytes()));
    assert!(!footer.to_string().contains("program.sh"), "{footer}");

    bench.program(&format!(": edited; {}", three_steps()));
    for more in [&["--runs", "2"][..], &["--runs", "2", "--dry-run"]] {
        let (code, _, said) = outcome(&bench.record(more).output().unwrap());
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains("the program's files changed since `runs/E1-exec.parquet` was recorded (agent.files: "));
        assert!(said.contains("help: put the files back as they were, or record into another folder"), "{said}");
        assert_same(&contents(&bench.path("runs")), &before);
    }
    // With the original files the recording continues.
    fs::write(bench.path("program.sh"), script).unwrap();
    let (code, answer, said) = outcome(&bench.record(&["--runs", "2"]).output().unwrap());
    assert_eq!((code, &answer["found"], &answer["recorded"]), (Some(0), &1.into(), &1.into()), "{said}");
}

#[test]
fn keys_of_the_environment_are_removed_from_program_output() {
    let bench = Bench::new();
    let key = "sk-loopback-0123456789";
    let said_back = |reply: &str| reply.replace("went on", "'\"$MY_API_KEY\"'");
    for (third, expected) in
        [("echo \"bad key $MY_API_KEY\" >&2; exit 1", 1), (&*format!("echo '{}'", said_back(&done())), 0)]
    {
        bench.program(&format!("if [ $n -lt 3 ]; then echo '{}'; else {third}; fi", said_back(FORWARD)));
        let output = bench.record(&[]).env("MY_API_KEY", key).output().unwrap();
        let (code, answer, said) = outcome(&output);
        assert_eq!(code, Some(expected), "{said}");
        assert!(!said.contains(key) && !answer.to_string().contains(key), "{said}");
        if expected == 1 {
            assert!(answer["lost"][0]["reason"].as_str().unwrap().contains("bad key [key]"), "{answer}");
        }
    }
    assert_eq!(bench.texts("runs/E1-exec.parquet", "summary"), vec![Some("[key]".to_owned()); 3]);
    assert!(bench.texts("runs/E1-exec.parquet", "reply").iter().flatten().all(|reply| !reply.contains(key)));
}

#[test]
fn lost_episodes_are_listed_until_they_are_recorded_and_disturb_no_report() {
    let bench = Bench::new();
    // An episode fails at its first step if the last task in `heard.jsonl` is that of one of these runs.
    let fails = |runs: &[u64]| {
        let seeds: Vec<String> = runs.iter().map(|run| format!("-e '{}'", seed_of(1, *run))).collect();
        let seeds = seeds.join(" ");
        let task = format!("grep '\"kind\":\"task\"' heard.jsonl | tail -n 1 | grep -q {seeds} && exit 7");
        format!("case \"$line\" in *'\"t\":1,'*) {task} ;; esac; {}", three_steps())
    };
    bench.program(&fails(&[2, 4]));
    let words = ["--runs", "4", "--threads", "1"];
    // No word names the program's file, so a changed file is the same agent.
    let record = |words: &[&str]| bench.record_of("exec:sh -c '. ./program.sh'", words).output().unwrap();
    let (code, answer, said) = outcome(&record(&words));
    assert_eq!((code, &answer["recorded"]), (Some(1), &2.into()), "{said}");
    assert!(said.contains("lost 2 episodes") && said.contains("lost.jsonl"), "{said}");
    let runs = |bench: &Bench| bench.lost().iter().map(|lost| lost["run"].as_i64().unwrap()).collect::<Vec<_>>();
    assert_eq!(runs(&bench), [2, 4]);
    let first = &bench.lost()[0];
    assert_eq!((&first["episode_id"], &first["status"]), (&"E1/exec/s1/r2".into(), &"server_error".into()));

    let validation = run(bench.folder.path(), &["trace", "validate", "runs", "--json"]).done();
    assert!(!validation.contains("lost.jsonl"), "{validation}");

    // One of them is recorded and the other lost again. A run without these episodes does not change the list.
    bench.program(&fails(&[4]));
    assert_eq!(outcome(&record(&words)).0, Some(1));
    assert_eq!(runs(&bench), [4]);
    assert_eq!(outcome(&record(&["--runs", "1"])).0, Some(0));
    assert_eq!(runs(&bench), [4]);
    bench.program(&three_steps());
    assert_eq!(outcome(&record(&words)).0, Some(0));
    assert_eq!(bench.leftovers(), Vec::<String>::new());
}
