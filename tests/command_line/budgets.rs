//! Inputs that ask for more work than files of their size do. They are refused soon, in little memory; the message
//! names the limit and how to raise it.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use mirrorstats_trace::episodes::episode::{Extra, Step};
use mirrorstats_trace::write::write_episodes;

use crate::harness::bombs::log;
use crate::harness::program::{answer, limited, run_with_input, succeeds};
use crate::{Answer, episode, program, run, two_files};

const SETTING: &str = "MIRRORSTATS_BUDGET";

/// Runs the program within 512 MiB of address space and 60 s of processor time; a child that exceeds them dies.
fn bounded(at: &Path, arguments: &[&str]) -> Answer {
    let mut command = limited(at, "ulimit -t 60 && ulimit -v 524288");
    // Otherwise each thread's arena would reserve memory that is never used.
    answer(command.args(arguments).env("MALLOC_ARENA_MAX", "1"))
}

#[track_caller]
fn over_budget(answer: Answer, limit: &str) {
    let told = answer.refused();
    assert!(told.contains(limit) && told.contains(SETTING), "{told}");
}

#[test]
fn devices_are_refused_without_being_opened() {
    let folder = two_files();
    let at = folder.path();
    succeeds(Command::new("mkfifo").arg(at.join("pipe.parquet")));
    let devices = [("pipe.parquet", "a named pipe"), ("/dev/zero", "a device")];
    for (name, found) in devices {
        for arguments in [
            &["score", name][..],
            &["trace", "info", name],
            &["report", name],
            &["stats", name],
            &["definitions", "check", name],
            &["score", "a.parquet", "--definitions", name],
            &["report", "a.parquet", "--style", name],
            &["report", "a.parquet", "--definitions", name],
            &["table", "audit", "--n", "21", name],
            &["import", name, "-o", "x.parquet"],
        ] {
            let told = bounded(at, arguments).refused();
            assert!(told.contains(found), "{arguments:?}: {told}");
        }
        assert!(bounded(at, &["trace", "validate", name]).ends(1).stdout.contains(found));
    }
}

#[test]
fn piped_input_is_read_within_the_limit() {
    let folder = two_files();
    let at = folder.path();
    let arguments = ["definitions", "check", "/dev/stdin"];
    run_with_input(at, &arguments, "[metric.M]\nvalue = \"1\"\n").done();
    let long = format!("[metric.M]\nvalue = \"1\"\n#{}\n", "x".repeat(1 << 20));
    fs::write(at.join("long.toml"), &long).unwrap();
    let told = run_with_input(at, &arguments, long).refused();
    assert!(told.contains("1048576 bytes of a definition file") && told.contains(SETTING), "{told}");
    let check = |factor: &str| answer(program(at).args(["definitions", "check", "long.toml"]).env(SETTING, factor));
    check("2").done();
    assert!(check("0").refused().contains("expected a whole number from 1"));
}

#[test]
fn exponential_includes_are_limited() {
    let folder = tempfile::tempdir().unwrap();
    for at in 0..40 {
        let text = format!("include = [\"{0}.toml\", \"{0}.toml\"]\n", at + 1);
        fs::write(folder.path().join(format!("{at}.toml")), text).unwrap();
    }
    fs::write(folder.path().join("40.toml"), "[metric.M]\nvalue = \"1\"\n").unwrap();
    over_budget(bounded(folder.path(), &["definitions", "check", "0.toml"]), "at most 256 includes");
    run(folder.path(), &["definitions", "check", "36.toml"]).done();
}

#[test]
fn an_invalid_include_does_not_reveal_its_contents() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("top.toml"), "include = [\"mid.toml\"]\n[metric.M]\nvalue = \"1\"\n").unwrap();
    fs::write(at.join("mid.toml"), "include = [\"secret\"]\n").unwrap();
    for secret in
        ["hunter2 is the word\n", "word = \"hunter2\"\n", "[hunter2]\n", "[metric.hunter2]\nvalue = 3\n", "\n= hunter2"]
    {
        fs::write(at.join("secret"), secret).unwrap();
        for name in ["top.toml", "mid.toml"] {
            let told = bounded(at, &["definitions", "check", name]).refused();
            assert!(!told.contains("hunter2") && told.contains("`secret` is no definition file"), "{told}");
        }
    }
}

#[test]
fn a_statement_is_counted_while_it_is_written() {
    let folder = two_files();
    let at = folder.path();
    let forms: [fn(&str) -> String; 5] = [
        |p| format!("{p} and {p}"),
        |p| format!("{p} is distinct from {p}"),
        |p| format!("coalesce({p}, {p})"),
        |p| format!("{p} in ({p}, {p})"),
        |p| format!("case when mirror_visible then {p} else {p} end"),
    ];
    for form in forms {
        let mut text = "[let]\nx0 = \"t < coalesce(first(action = 'done'), 9)\"\n".to_owned();
        for at in 0..40 {
            writeln!(text, "x{} = \"{}\"", at + 1, form(&format!("x{at}"))).unwrap();
        }
        text += "[metric.M]\nvalue = \"any(x40)\"\n[metric.N]\nvalue = \"at(x40, first(x40))\"\n";
        fs::write(at.join("d.toml"), &text).unwrap();
        for dialect in ["portable", "duckdb", "spark"] {
            let arguments = ["definitions", "sql", "--definitions", "d.toml", "--dialect", dialect];
            over_budget(bounded(at, &arguments), "the statement exceeds 4194304 bytes");
        }
        // The engine computes shared parts once, so this is fast.
        bounded(at, &["score", "a.parquet", "--definitions", "d.toml"]).done();
    }
}

#[test]
fn numbers_of_errors_and_keys_are_limited() {
    let folder = tempfile::tempdir().unwrap();
    let check = |text: String| {
        fs::write(folder.path().join("d.toml"), text).unwrap();
        bounded(folder.path(), &["definitions", "check", "d.toml"])
    };
    let faults = (0..3000).fold("[let]\n".to_owned(), |text, at| text + &format!("name{at} = \"nome{at}\"\n"));
    assert!(check(faults).refused().contains("100 faults or more"));
    let keys = (0..60_000).fold("[let]\n".to_owned(), |text, at| text + &format!("a{at} = \"t\"\n"));
    over_budget(check(keys), "at most 10000 keys");
}

#[test]
fn chunks_are_unpacked_within_a_budget() {
    let folder = tempfile::tempdir().unwrap();
    for (chunks, bytes) in [(1, 200 << 20), (20, 24 << 20)] {
        let log = log(chunks, bytes);
        assert!(log.len() < 100_000, "{}", log.len());
        fs::write(folder.path().join("bomb.mcap"), log).unwrap();
        let told = bounded(folder.path(), &["trace", "recover", "bomb.mcap", "-o", "x.parquet"]).ends(3).stdout;
        assert!(told.contains("is not unpacked: expected at most") && told.contains(SETTING), "{told}");
    }
}

#[test]
fn texts_and_names_of_traces_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_episodes(&at.join("names.parquet"), None, &[episode(&"x".repeat(1025), "E1", 1, "red")]).unwrap();
    over_budget(bounded(at, &["score", "names.parquet"]), "at most 1024 bytes in a name");
    let mut long = episode("m", "E1", 1, "red");
    let step = |at: usize| Step {
        extra: Extra { reasoning: Some(format!("{at}{}", "x".repeat(1 << 20))), ..Extra::default() },
        ..long.steps[0].clone()
    };
    long.steps = (0..160).map(step).collect();
    write_episodes(&at.join("texts.parquet"), None, &[long]).unwrap();
    assert!(fs::metadata(at.join("texts.parquet")).unwrap().len() < 100_000);
    let told = bounded(at, &["trace", "validate", "texts.parquet"]).ends(1).stdout;
    assert!(told.contains("over-budget") && told.contains("bytes inflated") && told.contains(SETTING), "{told}");
    // A command that does not read the texts is not limited by them.
    bounded(at, &["score", "texts.parquet"]).done();
}

#[test]
fn a_report_of_thousands_of_models_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut scores = "episode_id,model,experiment,seed,run,TSA\n".to_owned();
    for at in 0..1000 {
        writeln!(scores, "e{at},m{at},E1,1,{at},1").unwrap();
    }
    fs::write(folder.path().join("s.csv"), scores).unwrap();
    for verb in ["report", "stats"] {
        over_budget(bounded(folder.path(), &[verb, "s.csv"]), "at most 400000 comparisons");
    }
    let columns =
        (0..3000).fold("episode_id,model,experiment,seed,run".to_owned(), |text, at| text + &format!(",c{at}"));
    fs::write(folder.path().join("s.csv"), columns + "\n").unwrap();
    let told = bounded(folder.path(), &["stats", "s.csv"]).refused();
    assert!(told.contains("at most 2000 columns in a file of scores") && told.contains(SETTING), "{told}");
}
