//! Runs every command line of the README and of the pages in `docs`, and checks what it prints.
//!
//! Blocks of `sh` run in order in one folder with the files they name; repeated lines run once. A block of `text` that
//! begins with `$ mirrorstats` shows the output; `...` on its own line stands for any lines.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use regex::Regex;

use crate::assert_shown;
use crate::harness::files::repository;
use crate::harness::logs;
use crate::harness::need;
use crate::harness::program::{PROGRAM, clean};

/// Prefixes of command lines that are not run, and why.
const NOT_RUN: [(&str, &str); 22] = [
    ("make demo", "builds the program"),
    ("make test", "runs this test"),
    ("scripts/get-mujoco.sh", "downloads a library; `make test` runs it before"),
    ("pip install ", "installs a wheel; `scripts/test-wheel.sh` does"),
    ("mirrorstats view runs  ", "serves until it is ended; `tests/reports/view` opens it"),
    ("mirrorstats view runs --against", "serves until it is ended; `tests/reports/view` opens such a one"),
    ("mirrorstats view runs --label", "serves until it is ended; `tests/reports/view` labels with it"),
    (
        "mirrorstats record --agent oracle --experiment E1 --out runs",
        "takes a minute; `scripts/test-wheel.sh` does as much",
    ),
    (
        "mirrorstats record --agent oracle --experiment reach-mirror",
        "takes minutes; the calibration of agents does as much",
    ),
    (
        "mirrorstats record --agent vlm --model \"GPT 5.1\" --experiment E1 --max-cost",
        "needs a provider; `tests/agents` has servers in its place",
    ),
    (
        "mirrorstats record --agent vlm --model \"Gemma4 31B\" --backend openrouter",
        "needs a provider; `tests/agents` has servers in its place",
    ),
    ("llama-server ", "a server of other people"),
    (
        "mirrorstats record --agent vlm --model gemma-3-4b-it --base-url",
        "needs a provider; `tests/agents` has servers in its place",
    ),
    ("python3 examples/agents/", "serves until it is ended, or trains for minutes; `tests/agents` starts the server"),
    ("mirrorstats record --agent vlm --model seeing", "needs that server; `tests/agents` starts it"),
    ("mirrorstats record --agent human", "waits for people; `tests/reports/view` plays"),
    ("cargo run ", "builds the program"),
    ("mirrorstats record --agent oracle --experiment two-mirrors", "takes minutes; `make calibrate` does as much"),
    ("mirrorstats score --engine spark --master spark://", "needs a cluster; `tests/spark` starts one"),
    ("mirrorstats report scores.parquet", "its scores come from the cluster"),
    ("mirrorstats report by-spark", "its scores come from Spark, by hand"),
    ("mirrorstats report mine.parquet", "its trace has one step of one episode in place of a study"),
];

/// The README, then the pages of `docs` sorted by name.
fn pages() -> Vec<PathBuf> {
    let mut pages: Vec<PathBuf> = ["docs", "docs/how-to", "docs/explanation", "docs/reference", "docs/tutorials"]
        .iter()
        .flat_map(|folder| fs::read_dir(repository().join(folder)).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "md"))
        .collect();
    pages.sort();
    pages.insert(0, repository().join("README.md"));
    pages
}

/// The blocks of one language, in order.
fn blocks(language: &str) -> Vec<String> {
    let opening = format!("```{language}\n");
    // The commands of docs/BENCHMARKS.md take half an hour.
    let short = pages().into_iter().filter(|page| !page.ends_with("docs/BENCHMARKS.md"));
    let texts = short.map(|page| fs::read_to_string(page).unwrap());
    let of_page = |text: String| -> Vec<String> {
        let parts = text.split(&opening).skip(1);
        parts.map(|part| part.split("\n```").next().unwrap().to_owned() + "\n").collect()
    };
    texts.flat_map(of_page).collect()
}

/// The commands of a block of `sh`, one per line; a here-document belongs to the line that begins it.
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

/// A folder with the files that the commands use.
fn bench() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["fixtures", "examples", "assets"] {
        std::os::unix::fs::symlink(repository().join(name), at(name)).unwrap();
    }
    fs::create_dir_all(at("runs")).unwrap();
    // In place of the wheel's command, with the same traces.
    fs::create_dir_all(at("wheel")).unwrap();
    fs::write(at("wheel/mirrorstats-example-runs"), "#!/bin/sh\necho fixtures/paper\n").unwrap();
    fs::set_permissions(at("wheel/mirrorstats-example-runs"), Permissions::from_mode(0o755)).unwrap();
    fs::create_dir_all(at("steps")).unwrap();
    for entry in fs::read_dir(repository().join("fixtures/recorded")).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, at("runs").join(path.file_name().unwrap())).unwrap();
    }
    fs::copy(repository().join("fixtures/published/main_table.csv"), at("table.csv")).unwrap();
    fs::copy(repository().join("examples/definitions/inclusive.toml"), at("mine.toml")).unwrap();
    logs::inspect(&at("logs"));
    let solved = [Some(2), Some(5), None, Some(3), Some(4), Some(2)];
    logs::lerobot_data_set(&at("act"), &solved, true);
    logs::lerobot_data_set(&at("diffusion"), &solved.map(|at| at.filter(|at| *at < 4)), false);
    // Files with contents from the pages.
    let threshold = blocks("toml").into_iter().find(|text| text.contains("mirror_self_px >= 200")).unwrap();
    fs::write(at("stricter.toml"), threshold).unwrap();
    let step = blocks("json").into_iter().find(|text| text.contains("episode_id")).unwrap();
    fs::write(at("steps.jsonl"), &step).unwrap();
    fs::write(at("steps/one.jsonl"), &step).unwrap();
    folder
}

/// Runs a documented command and returns its standard output, then its standard error.
fn output_of(command: &str, folder: &Path) -> String {
    let mut shell = clean(Command::new("sh"), folder);
    // `make bless` sets these variables for the tests.
    shell.env_remove("MIRRORSTATS_WRITE_SCHEMAS").env_remove("MIRRORSTATS_WRITE_REFERENCE");
    // A folder with another build of the program, such as an installed wheel: `make release-check`.
    let installed = std::env::var_os("TEST_PROGRAMS").map(PathBuf::from);
    let programs = installed.unwrap_or_else(|| Path::new(PROGRAM).parent().unwrap().to_owned());
    let path = std::env::var_os("PATH").unwrap_or_default();
    let programs = [programs, folder.join("wheel")];
    let all = std::env::join_paths(programs.into_iter().chain(std::env::split_paths(&path))).unwrap();
    if command.contains("local[2]") {
        shell.env("PYTHONPATH", need::spark());
    }
    let output = shell.args(["-c", command]).env("PATH", all).output().unwrap();
    let (out, said) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let code = output.status.code().unwrap();
    let code = if code == 0 { String::new() } else { format!("[exit code {code}]\n") };
    format!("{out}{said}{code}")
}

/// Removes what varies between runs: durations, progress, and Inspect's ids.
fn lasting(output: &str) -> String {
    let progress = Regex::new(r"(?m)^[0-9]+ of [0-9]+ episodes?, .* a second.*\n").unwrap();
    let output = &progress.replace_all(output, "");
    let took = Regex::new(r"in [0-9.]+ m?s\b( \([^)]*\))?").unwrap();
    let output = &Regex::new(r"\b[1-9A-HJ-NP-Za-km-z]{22}\b").unwrap().replace_all(output, "[an id]");
    // The renderer's name ends with what it uses of the processor, which is another one on other machines.
    let processor = Regex::new(r"x86_64 sse4[a-z0-9 .]*").unwrap();
    let output = &processor.replace_all(output, "[a processor]");
    let others = Regex::new("(?m)^different renderers: .*\n").unwrap();
    let output = &others.replace_all(output, "");
    took.replace_all(output, "in [a time]").into_owned()
}

#[test]
fn documented_command_lines_still_work() {
    need::drawing();
    let folder = bench();
    let mut met = Vec::new();
    let mut shown = String::new();
    let mut run = BTreeSet::new();
    for command in blocks("sh").iter().flat_map(|block| commands(block)) {
        let words = command.split(" #").next().unwrap().trim().to_owned();
        if !run.insert(words) {
            continue;
        }
        writeln!(shown, "$ {command}").unwrap();
        match reason(&command) {
            Some(why) => {
                met.push(why);
                writeln!(shown, "[not run: {why}]").unwrap();
            }
            None => shown += &lasting(&output_of(&command, folder.path())),
        }
    }
    assert_shown!("documented command lines, and what they print", shown);
    for (begins, why) in NOT_RUN {
        assert!(met.contains(&why), "no documented command line begins with `{begins}` any more");
    }
}

#[test]
fn documented_outputs_are_current() {
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
        assert!(rest.is_empty() || expected.ends_with("...\n"), "{command}\nnot in the documentation:\n{rest}");
    }
    assert!(count >= 3, "the documentation shows what commands print");
}

/// The targets of all links and pictures of a page.
fn links(text: &str) -> Vec<String> {
    let link = Regex::new(r"\]\(([^)\s]+)\)").unwrap();
    link.captures_iter(text).map(|found| found[1].to_owned()).collect()
}

/// The anchors that a forge generates for headings.
fn anchors(text: &str) -> BTreeSet<String> {
    let headings = text.lines().filter(|line| line.starts_with('#')).map(|line| line.trim_start_matches('#').trim());
    let kept = |text: &str| {
        text.to_lowercase().replace(|letter: char| !letter.is_alphanumeric() && !" -".contains(letter), "")
    };
    headings.map(|heading| kept(heading).replace(' ', "-")).collect()
}

#[test]
fn documented_links_lead_somewhere() {
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for link in links(&text).iter().filter(|link| !link.contains("://")) {
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if path.is_empty() { page.clone() } else { page.parent().unwrap().join(path) };
            assert!(target.exists(), "{}: {link}: no such file", page.display());
            if !anchor.is_empty() {
                let found = anchors(&fs::read_to_string(&target).unwrap());
                assert!(found.contains(anchor), "{}: {link}: no such heading", page.display());
            }
        }
    }
}

#[test]
fn the_readme_stays_short() {
    let readme = fs::read_to_string(repository().join("README.md")).unwrap();
    assert!(readme.lines().count() <= 200 && readme.split_whitespace().count() <= 1200);
}
