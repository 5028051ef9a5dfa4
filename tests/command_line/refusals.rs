//! Bad input and bad usage: exit code 2 (1 for a failed check), a clear message, and no files written.

use std::fs;
use std::path::Path;

use crate::assert_shown;
use crate::{contents, fixture, run, run_with_input, two_files};

/// Damage in columns that the paper's definitions do not read; only `validate` finds it.
const UNREAD: [&str; 2] = ["negative-count.parquet", "unknown-reply-status.parquet"];

/// The damaged files; a pair that is only damaged together is one case.
fn damaged() -> Vec<Vec<String>> {
    let mut cases = Vec::new();
    for entry in fs::read_dir(fixture("damaged")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        match name.strip_suffix("-1.parquet") {
            Some(pair) => cases.push(vec![name.clone(), format!("{pair}-2.parquet")]),
            None if name.ends_with("-2.parquet") || !name.ends_with(".parquet") => {}
            None => cases.push(vec![name]),
        }
    }
    cases.sort();
    assert!(cases.len() >= 25, "{} damaged files", cases.len());
    cases
}

#[test]
fn every_damaged_trace_is_refused_by_every_command_that_scores() {
    let folder = tempfile::tempdir().unwrap();
    let damaged_folder = fixture("damaged");
    let mut told = String::new();
    for case in damaged() {
        let paths: Vec<String> = case.iter().map(|name| damaged_folder.join(name).display().to_string()).collect();
        let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
        let with = |before: &[&'static str]| [before.to_vec(), paths.clone()].concat();
        if UNREAD.contains(&case[0].as_str()) {
            let scores = run(folder.path(), &with(&["score"])).done();
            assert!(
                scores.contains("E1-m-1-1,m,E1,1,1,") && scores.contains(",1,4,1,1,1,0,1,2,,0"),
                "{case:?}: {scores}"
            );
        } else {
            let message = run(folder.path(), &with(&["score"])).refused();
            assert!(message.contains(case.last().unwrap()) && message.contains("help: "), "{case:?}: {message}");
            assert!(!message.contains(env!("CARGO_MANIFEST_DIR")), "an absolute path: {message}");
            for command in [["report", "--out", "out"].as_slice(), &["stats"], &["score", "-o", "out.csv"]] {
                assert_eq!(run(folder.path(), &with(command)).refused(), message, "{command:?} {case:?}");
            }
            told.push_str(&message);
            told.push('\n');
        }
        let checked = run(folder.path(), &with(&["trace", "validate"]));
        assert_eq!((checked.code, checked.stderr.as_str()), (1, ""), "{case:?}");
        assert!(!checked.stdout.contains("panicked") && checked.stdout.contains(case.last().unwrap()), "{case:?}");
    }
    assert_shown!("damaged", "mirrorstats score with each of fixtures/damaged, in the order of their names", told);
    assert!(contents(folder.path()).is_empty(), "something was written: {:?}", contents(folder.path()).keys());
}

/// Arguments, and the required parts of the message.
type Case<'a> = (&'a [&'a str], &'a [&'a str]);

fn check(folder: &Path, cases: &[Case]) {
    let before = contents(folder);
    for (arguments, words) in cases {
        let message = run(folder, arguments).refused();
        for word in *words {
            assert!(message.contains(word), "{arguments:?}: no `{word}` in\n{message}");
        }
        assert!(!message.contains(".mirrorstats-"), "a temporary name: {message}");
        let because = message.lines().filter_map(|line| line.trim_start().strip_prefix("caused by: "));
        assert!(because.into_iter().all(|words| message.matches(words).count() == 1), "told twice: {message}");
    }
    assert_eq!(contents(folder), before, "something was written");
}

#[test]
fn bad_usage_has_a_problem_and_a_remedy() {
    let folder = two_files();
    let at = folder.path();
    fs::create_dir(at.join("empty")).unwrap();
    fs::write(at.join("file"), "x").unwrap();
    fs::write(at.join("cycle.toml"), "[metric.A]\nvalue = \"B\"\n[metric.B]\nvalue = \"A\"\n").unwrap();
    fs::write(at.join("overflow.toml"), "[metric.A]\nvalue = \"length() * 9223372036854775807\"\n").unwrap();
    fs::write(at.join("rate.toml"), "[metric.A]\nunit = \"rate\"\nvalue = \"length()\"\n").unwrap();
    fs::write(at.join("column.toml"), "[column.grip]\ntype = \"int\"\n[metric.A]\nvalue = \"max(grip)\"\n").unwrap();
    check(
        at,
        &[
            (&["score"], &["<TRACES>", "--help"]),
            (&["nothing"], &["unrecognized subcommand", "nothing"]),
            (&["score", "c.parquet"], &["c.parquet", "no such file"]),
            (&["score", "a.parquet", "c.parquet"], &["c.parquet", "no such file"]),
            (&["score", "c*.parquet"], &["c*.parquet", "matches no trace"]),
            (&["score", "empty"], &["`empty`", "without any *.parquet"]),
            (&["score", "-"], &["`-`", "standard input"]),
            (&["score", "file"], &["file", "Parquet"]),
            (&["score", "a.parquet", "--threads", "0"], &["--threads", "0"]),
            (&["score", "a.parquet", "--threads", "many"], &["--threads", "many"]),
            (&["score", "a.parquet", "-o", "x.txt"], &["x.txt", ".parquet, .csv or .jsonl"]),
            (&["score", "a.parquet", "-o", "no/such/x.csv"], &["no/such/x.csv", "folder"]),
            (&["score", "a.parquet", "-o", "x.csv", "--json"], &["--json", "--output"]),
            (&["score", "a.parquet", "--metrics", "TSAC"], &["`TSAC`", "did you mean `TSA-C`?"]),
            (&["score", "a.parquet", "--metrics", "zzz"], &["`zzz`", "metrics are TSA, TTD"]),
            (&["score", "a.parquet", "--metrics", ""], &["metrics are TSA, TTD"]),
            (&["score", "a.parquet", "--where", "TSAA = 1"], &["--where:1:1", "^^^^", "did you mean `TSA`?"]),
            (&["score", "a.parquet", "--where", "TSA ="], &["--where:1", "expected: an expression"]),
            (&["score", "a.parquet", "--where", "mirror_visible"], &["one value per step", "any(...)"]),
            (&["score", "a.parquet", "--where", "seed"], &["true or false", "an integer"]),
            (&["score", "a.parquet", "--where", "model = \"ant\""], &["unknown name `ant`", "'ant'"]),
            (
                &["score", "a.parquet", "--where", "any(mirror_px > 3)"],
                &["`--where` reads", "mirror_px", "no trace has it"],
            ),
            (&["score", "a.parquet", "--definitions", "papre"], &["papre", "did you mean the built-in `paper`?"]),
            (&["score", "a.parquet", "--definitions", "no.toml"], &["no.toml", "No such file", "paper, extended"]),
            (&["score", "a.parquet", "--definitions", "empty"], &["`empty`"]),
            (&["score", "a.parquet", "--definitions", "cycle.toml"], &["cycle.toml:", "leads back", "A -> B -> A"]),
            (
                &["score", "a.parquet", "--definitions", "overflow.toml"],
                &["a.parquet", "`A`", "64-bit", "smaller numbers"],
            ),
            (&["score", "a.parquet", "--definitions", "rate.toml"], &["a.parquet", "`A`", "has 3", "0 or 1"]),
            (
                &["score", "a.parquet", "--definitions", "column.toml"],
                &["`A` reads", "`grip`", "no trace has it", "--metrics"],
            ),
            (&["score", "a.parquet", "--definitions", "extended"], &["`SRR` reads", "`reasoning`", "no trace has it"]),
            (&["score", "a.parquet", "--explain", "E1-ant-9"], &["`E1-ant-9`", "did you mean `E1-ant-"]),
            (&["score", "a.parquet", "--explain", "zzz"], &["`zzz`", "among the 8", "mirrorstats score"]),
            (&["report", "a.parquet", "--out", "file"], &["file", "not a folder", "--out"]),
            (&["report", "a.parquet", "--out", "file/below"], &["file", "writable"]),
            (&["report", "a.parquet", "--out", "/proc/mirrorstats"], &["/proc", "writable", "os error"]),
            (&["report", "a.parquet", "--style", "papre"], &["`papre`", "did you mean `paper`?"]),
            (&["report", "a.parquet", "--style", "file"], &["file"]),
            (&["report", "a.parquet", "--by", "modle"], &["`modle`", "did you mean `model`?"]),
            (&["report", "a.parquet", "--by", "t"], &["`t`", "from step to step"]),
            (&["report", "a.parquet", "--by", "distractors"], &["`distractors`", "no trace has it"]),
            (&["report", "a.parquet", "--by", "model,model"], &["`model` twice"]),
            (&["report", "a.parquet", "--by", ""], &["group by"]),
            (&["stats", "a.parquet", "--metric", "TSAA"], &["`TSAA`", "did you mean `TSA`?"]),
            (&["stats", "a.parquet", "--confidence", "95"], &["between 0 and 1", "95"]),
            (&["stats", "a.parquet", "--sequential", "--metric", "TTD"], &["no rate is named `TTD`", "TSA"]),
            (&["table", "compare", "a.parquet"], &["--published"]),
            (&["table", "compare", "a.parquet", "--published", "no.csv"], &["no.csv", "No such file"]),
            (&["table", "compare", "a.parquet", "--published", "file"], &["file"]),
            (&["trace", "info", "c.parquet"], &["c.parquet", "no such file"]),
            (&["trace", "validate", "c.parquet"], &["c.parquet", "no such file"]),
            (&["definitions", "check", "cycle.toml"], &["cycle.toml:", "leads back"]),
            (&["definitions", "check", "no.toml"], &["no.toml", "No such file"]),
            (&["definitions", "explain", "TSAA"], &["`TSAA`", "did you mean `TSA`?"]),
            (&["definitions", "show", "zzz"], &["`zzz`", "paper, extended"]),
        ],
    );
}

#[test]
fn a_report_that_is_refused_leaves_the_one_before_as_it_was() {
    let folder = two_files();
    run(folder.path(), &["report", "a.parquet", "--out", "out"]).done();
    let before = contents(folder.path());
    let damaged = fixture("damaged/t-gap.parquet").display().to_string();
    run(folder.path(), &["report", "a.parquet", &damaged, "--out", "out"]).refused();
    run(folder.path(), &["report", "a.parquet", "--definitions", "extended", "--out", "out"]).refused();
    assert_eq!(contents(folder.path()), before);
}

#[test]
fn the_first_fault_is_the_same_for_any_number_of_threads() {
    let folder = two_files();
    let damaged = fixture("damaged").display().to_string();
    let told = |threads: &str, list: &str| {
        run_with_input(folder.path(), &["score", "-", "--threads", threads], list).refused()
    };
    let files =
        ["t-gap", "t-order", "unknown-action", "null-in-required"].map(|name| format!("{damaged}/{name}.parquet"));
    let mut backwards = files.to_vec();
    backwards.reverse();
    let expected = told("1", &files.join("\n"));
    assert!(expected.contains("null-in-required.parquet"), "the first by name: {expected}");
    for threads in ["1", "2", "8"] {
        assert_eq!(told(threads, &backwards.join("\n")), expected);
    }
}
