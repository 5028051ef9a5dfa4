//! File names that are not UTF-8: accepted wherever a file is named, and shown escaped, with U+FFFD.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::os::unix::ffi::{OsStrExt as _, OsStringExt as _};
use std::path::PathBuf;

use crate::harness::program::answer;
use crate::{Answer, program, two_files};

/// `b`, an invalid byte, and an escape sequence that colours a terminal red.
const ODD: &[u8] = b"b\xff\x1b[31m";

fn odd(ending: &str) -> OsString {
    let mut name = OsString::from_vec(ODD.to_vec());
    name.push(ending);
    name
}

/// A folder where traces, a definition file and a style have such names.
fn folder() -> tempfile::TempDir {
    let folder = two_files();
    let at = |name: &OsStr| folder.path().join(name);
    fs::create_dir(at(&odd(""))).unwrap();
    for name in ["a.parquet", "b.parquet"] {
        fs::rename(folder.path().join(name), at(&odd("")).join(odd(name))).unwrap();
    }
    fs::write(at(&odd(".toml")), "include = [\"paper\"]\n").unwrap();
    fs::copy("assets/styles/default.toml", at(&odd("-style.toml"))).unwrap();
    fs::write(at(&odd(".jsonl")), STEP).unwrap();
    folder
}

const STEP: &str = r#"{"episode_id":"a","model":"mine","experiment":"E1","seed":1,"run":1,"body_color":"red","t":1,"action":"done","self_color":null,"selected_cube":"red","mirror_visible":false}
"#;

/// Runs the program with words; `@` stands for the odd name, and an ending may follow it.
#[track_caller]
fn run(folder: &tempfile::TempDir, words: &str) -> Answer {
    let argument = |word: &str| word.strip_prefix('@').map_or_else(|| word.into(), odd);
    let mut command = program(folder.path());
    command.args(words.split_whitespace().map(argument));
    let found = answer(&mut command);
    for text in [&found.stdout, &found.stderr] {
        assert!(!text.contains('\u{1b}') && !text.contains("panicked"), "{words}: {text:?}");
    }
    found
}

#[test]
fn a_path_may_be_invalid_utf8() {
    let folder = folder();
    for words in [
        "trace info @",
        "trace info --episodes @",
        "trace info --json @",
        "trace validate @ --definitions @.toml",
        "score @ --definitions @.toml -o @.csv",
        "score @ -o @-scores.parquet",
        "report @ --definitions @.toml --style @-style.toml --out @-report",
        "verify @-report",
        "table rescore @-report --definitions @.toml --style @-style.toml --out @-again",
        "report @-scores.parquet --out @-from-scores",
        "stats @ --definitions @.toml",
        "diff paper @.toml @",
        "diff @-report @-scores.parquet",
        "definitions check @.toml @",
        "definitions explain MCR --definitions @.toml",
        "figure intervals @ --style @-style.toml -o @.svg",
        "import @.jsonl -o @-imported.parquet",
        "definitions sql @",
        "setup man @-man",
    ] {
        run(&folder, words).done();
    }
    let written =
        ["-report/report.html", "-again/cells.csv", ".csv", ".svg", "-imported.parquet", "-man/mirrorstats.1"];
    for name in written {
        let path: PathBuf = folder.path().join(odd(name));
        assert!(path.is_file(), "{}", path.display());
    }
    // The listing shows the name as text.
    let listed = run(&folder, "trace info --episodes @").done();
    assert!(listed.contains("b\u{fffd}\\u{1b}[31m/b\u{fffd}\\u{1b}[31ma.parquet"), "{listed}");
}

#[test]
fn globs_and_lists_find_names_with_invalid_utf8() {
    let folder = folder();
    let expected = run(&folder, "score @").done();
    assert_eq!(expected.lines().count(), 17);
    assert_eq!(run(&folder, "score b*/*.parquet").done(), expected);
    assert_eq!(run(&folder, "score **/*.parquet").done(), expected);
    let mut command = assert_cmd::Command::from_std(program(folder.path()));
    let list = [ODD, b"/", ODD, b"a.parquet\n", ODD, b"/", ODD, b"b.parquet\n"].concat();
    let output = command.args(["score", "-"]).write_stdin(list).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stdout), expected);
}

#[cfg(feature = "polars")]
#[test]
fn polars_reads_paths_with_invalid_utf8() {
    let folder = folder();
    let mut command = program(folder.path());
    command.args(["query", "SELECT COUNT(*) AS n FROM steps", "--format", "csv"]).arg(odd(""));
    assert_eq!(answer(&mut command).done(), "n\n48\n");
}

#[cfg(feature = "sim")]
#[test]
fn recordings_and_experiments_may_have_names_with_invalid_utf8() {
    let folder = folder();
    let mine = fs::read_to_string("assets/experiments/E1.toml").unwrap().replace("experiment.E1", "experiment.mine");
    fs::write(folder.path().join(odd("-mine.toml")), mine).unwrap();
    run(&folder, "experiments check @-mine.toml").done();
    run(&folder, "experiments explain @-mine.toml").done();
    run(&folder, "record --agent frozen --experiment @-mine.toml --seeds 1 --runs 1 --no-frames --out @-runs").done();
    run(&folder, "world replay @-runs").done();
    let [mut trace, mut log] = [folder.path().join(odd("-runs")), folder.path().join(odd("-runs"))];
    trace.push("mine-frozen.parquet");
    log.push("mine-frozen.mcap");
    assert!(trace.is_file() && log.is_file());
    let mut command = program(folder.path());
    command.args(["trace", "recover"]).arg(&log).arg("-o").arg(folder.path().join(odd("-recovered.parquet")));
    answer(&mut command).done();
}

#[test]
fn the_name_of_a_missing_file_is_escaped() {
    let folder = folder();
    for words in [
        "score @-none",
        "report @ --definitions @-none.toml",
        "report @ --style @-none.toml",
        "verify @-none",
        "import @-none -o x.parquet",
        "diff @-none.toml paper @",
    ] {
        let said = run(&folder, words).refused();
        assert!(said.contains("b\u{fffd}\\u{1b}[31m-none"), "{words}: {said}");
    }
    // A word that is not a file name must be UTF-8.
    run(&folder, "score . --where @").refused();
    assert_eq!(OsStr::from_bytes(ODD).to_str(), None);
}
