//! Every command line of the README, run as it stands there, and what it prints.
//!
//! Blocks of `sh` run in their order in one folder, which has what they name. A block of `text` that begins with `$ mirrorstats`
//! shows the output itself; `...` on a line of its own stands for any lines.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use regex::Regex;

use crate::assert_shown;
use crate::harness::files::repository;
use crate::harness::need;
use crate::harness::program::{PROGRAM, clean};

/// Command lines that are not run, by how they begin, and why.
const NOT_RUN: [(&str, &str); 16] = [
    ("make demo", "builds the program"),
    ("make test", "runs this test"),
    ("scripts/get-mujoco.sh", "downloads a library; `make test` runs it before"),
    ("pip install ", "installs a wheel; `scripts/test-wheel.sh` does"),
    ("mirrorstats report \"$(", "a command of the wheel; `scripts/test-wheel.sh` runs it"),
    ("mirrorstats view runs  ", "serves until it is ended; `tests/reports/view` opens it"),
    ("mirrorstats view runs --against", "serves until it is ended; `tests/reports/view` opens such a one"),
    (
        "mirrorstats record --agent oracle --experiment E1 --out runs",
        "takes a minute; `scripts/test-wheel.sh` does as much",
    ),
    (
        "mirrorstats record --agent oracle --experiment reach-mirror",
        "takes minutes; the calibration of agents does as much",
    ),
    ("mirrorstats record --agent human", "waits for people; `tests/reports/view` plays"),
    ("cargo run ", "builds the program"),
    ("mirrorstats record --agent oracle --experiment two-mirrors", "takes minutes; `make calibrate` does as much"),
    ("mirrorstats score --engine spark", "needs a cluster; `tests/spark` starts one"),
    ("mirrorstats report scores.parquet", "its scores come from the cluster"),
    ("mirrorstats report by-spark", "its scores come from Spark, by hand"),
    ("mirrorstats report mine.parquet", "its trace has one step of one episode in place of a study"),
];

/// The blocks of the README of one language, in their order.
fn blocks(language: &str) -> Vec<String> {
    let readme = fs::read_to_string(repository().join("README.md")).unwrap();
    let opening = format!("```{language}\n");
    let parts = readme.split(&opening).skip(1);
    parts.map(|part| part.split("\n```").next().unwrap().to_owned() + "\n").collect()
}

/// The commands of a block of `sh`: lines, those of a here-document with the line that begins it.
fn commands(block: &str) -> Vec<String> {
    let mut commands: Vec<String> = Vec::new();
    let mut in_document = false;
    for line in block.lines() {
        match commands.last_mut().filter(|_| in_document) {
            Some(last) => {
                let _ = write!(last, "\n{line}");
            }
            None => commands.push(line.to_owned()),
        }
        in_document = (in_document || line.contains("<<'END'")) && line != "END";
    }
    commands
}

fn reason(command: &str) -> Option<&'static str> {
    NOT_RUN.iter().find(|(begins, _)| command.starts_with(begins)).map(|(_, why)| *why)
}

/// What the README's commands name.
fn bench() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["fixtures", "examples", "assets"] {
        std::os::unix::fs::symlink(repository().join(name), at(name)).unwrap();
    }
    fs::create_dir_all(at("runs")).unwrap();
    fs::create_dir_all(at("steps")).unwrap();
    for entry in fs::read_dir(repository().join("fixtures/recorded")).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, at("runs").join(path.file_name().unwrap())).unwrap();
    }
    fs::copy(repository().join("fixtures/published/main_table.csv"), at("table.csv")).unwrap();
    fs::copy(repository().join("examples/definitions/inclusive.toml"), at("mine.toml")).unwrap();
    // The README's own files.
    let threshold = blocks("toml").into_iter().find(|text| text.contains("mirror_self_px >= 200")).unwrap();
    fs::write(at("stricter.toml"), threshold).unwrap();
    let step = blocks("json").into_iter().find(|text| text.contains("episode_id")).unwrap();
    fs::write(at("steps.jsonl"), &step).unwrap();
    fs::write(at("steps/one.jsonl"), &step).unwrap();
    folder
}

/// Runs a command of the README and gives what it prints, standard error behind standard output.
fn output_of(command: &str, folder: &Path) -> String {
    let mut shell = clean(Command::new("sh"), folder);
    let programs = Path::new(PROGRAM).parent().unwrap();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let all = std::env::join_paths([programs.to_owned()].into_iter().chain(std::env::split_paths(&path))).unwrap();
    let output = shell.args(["-c", command]).env("PATH", all).output().unwrap();
    let (out, said) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let code = output.status.code().unwrap();
    let code = if code == 0 { String::new() } else { format!("[exit code {code}]\n") };
    format!("{out}{said}{code}")
}

/// Without what is another one each time: how long a recording took, and how far it was meanwhile.
fn lasting(output: &str) -> String {
    let progress = Regex::new(r"(?m)^[0-9]+ of [0-9]+ episodes?, .* a second.*\n").unwrap();
    let output = &progress.replace_all(output, "");
    let took = Regex::new(r"in [0-9.]+ m?s( \([^)]*\))?").unwrap();
    let shares = Regex::new(r"(?m)^time: .*$").unwrap();
    shares.replace_all(&took.replace_all(output, "in [a time]"), "time: [shares]").into_owned()
}

#[test]
fn every_command_line_of_the_readme_does_what_it_did() {
    need::drawing();
    let folder = bench();
    let mut met = Vec::new();
    let mut shown = String::new();
    for command in blocks("sh").iter().flat_map(|block| commands(block)) {
        writeln!(shown, "$ {command}").unwrap();
        match reason(&command) {
            Some(why) => {
                met.push(why);
                writeln!(shown, "[not run: {why}]").unwrap();
            }
            None => shown += &lasting(&output_of(&command, folder.path())),
        }
    }
    assert_shown!("the command lines of the README, and what they print", shown);
    for (begins, why) in NOT_RUN {
        assert!(met.contains(&why), "no command line of the README begins with `{begins}` any more");
    }
}

#[test]
fn the_readme_prints_what_the_program_prints() {
    let folder = bench();
    let shown = blocks("text").into_iter().filter(|text| text.starts_with("$ mirrorstats"));
    let mut count = 0;
    for block in shown {
        count += 1;
        let (command, expected) = block.split_once('\n').unwrap();
        let found = output_of(&command[2..], folder.path());
        let mut rest = found.as_str();
        for (at, part) in expected.split("...\n").enumerate() {
            let from = rest.find(part).unwrap_or_else(|| panic!("{command}\nexpected\n{part}\nfound\n{found}"));
            assert!(at > 0 || from == 0, "{command}\nexpected first\n{part}\nfound\n{found}");
            rest = &rest[from + part.len()..];
        }
        assert!(rest.is_empty() || expected.ends_with("...\n"), "{command}\nnot in the README:\n{rest}");
    }
    assert!(count >= 3, "the README shows what commands print");
}
