//! Outputs that are also inputs, and outputs that are not regular files.

use std::fs;
use std::os::unix::fs::{FileTypeExt as _, symlink};
use std::path::Path;
use std::process::Stdio;

use crate::{contents, program, run, two_files};

/// Every name under which `file` can be written: itself, through other folders, a symbolic link and a hard link.
fn aliases(folder: &Path, file: &str) -> Vec<String> {
    fs::create_dir_all(folder.join("sub")).unwrap();
    let ending = Path::new(file).extension().unwrap().to_str().unwrap();
    let (soft, hard) = (format!("soft.{ending}"), format!("hard.{ending}"));
    symlink(folder.join(file), folder.join(&soft)).unwrap();
    fs::hard_link(folder.join(file), folder.join(&hard)).unwrap();
    vec![file.to_owned(), format!("./{file}"), format!("sub/../{file}"), soft, hard]
}

/// Checks that a command refuses to write to its input `file` under any name, and changes no file.
fn check(folder: &Path, file: &str, command: &[&str]) {
    let aliases = aliases(folder, file);
    let before = contents(folder);
    for alias in &aliases {
        let error = run(folder, &[command, &[alias]].concat()).refused();
        let words = format!("`{alias}`: expected another file to write, found ");
        assert!(error.contains(&words), "{command:?} {alias}: {error}");
        assert!(error.contains("help: "), "{error}");
        assert!(contents(folder) == before, "{command:?} {alias} has changed a file");
    }
}

#[test]
fn an_input_trace_is_refused_as_the_output() {
    for command in [
        &["score", "a.parquet", "b.parquet", "-o"][..],
        &["score", ".", "--engine", "native", "-o"],
        #[cfg(feature = "polars")]
        &["query", "SELECT * FROM steps", "a.parquet", "-o"],
        #[cfg(feature = "polars")]
        &["query", "SELECT * FROM steps", "a.parquet", "--format", "table", "-o"],
    ] {
        check(two_files().path(), "a.parquet", command);
    }
}

#[test]
fn input_scores_definitions_and_steps_are_refused_as_outputs() {
    let folder = two_files();
    run(folder.path(), &["score", "a.parquet", "-o", "s.csv"]).done();
    check(folder.path(), "s.csv", &["score", "s.csv", "-o"]);
    let folder = two_files();
    fs::write(folder.path().join("own.csv"), "include = [\"paper\"]\n").unwrap();
    check(folder.path(), "own.csv", &["score", "a.parquet", "--definitions", "own.csv", "-o"]);
    let folder = tempfile::tempdir().unwrap();
    let step = r#"{"episode_id":"a","model":"m","experiment":"E1","seed":1,"run":1,"body_color":"red","t":1,"action":"done","self_color":null,"selected_cube":"none","mirror_visible":false}"#;
    fs::write(folder.path().join("s.jsonl"), step).unwrap();
    check(folder.path(), "s.jsonl", &["import", "s.jsonl", "-o"]);
}

#[test]
fn a_report_does_not_replace_what_it_is_made_of() {
    let folder = two_files();
    run(folder.path(), &["report", "a.parquet", "--no-figures", "--out", "r"]).done();
    let before = contents(folder.path());
    for (input, out) in [("r/episodes.parquet", "r"), ("r/episodes.parquet", "./r/"), ("r/cells.csv", "r")] {
        let error = run(folder.path(), &["report", input, "--no-figures", "--out", out]).refused();
        assert!(error.contains("expected another file to write, found one that is read"), "{error}");
        assert!(contents(folder.path()) == before, "{input}");
    }
    // A trace where the report writes a file of its own, and a trace that would later be read together with the report.
    fs::create_dir(folder.path().join("new")).unwrap();
    for name in ["episodes.parquet", "mine.parquet"] {
        let path = format!("new/{name}");
        fs::copy(folder.path().join("a.parquet"), folder.path().join(&path)).unwrap();
        let answer = run(folder.path(), &["report", &path, "--no-figures", "--out", "new"]);
        assert_eq!(answer.code, 2, "{}", answer.stderr);
        let (trace, now) = (fs::read(folder.path().join("a.parquet")).unwrap(), fs::read(folder.path().join(&path)));
        assert!(now.unwrap() == trace, "{path}");
        fs::remove_file(folder.path().join(&path)).unwrap();
    }
}

#[test]
fn a_copy_of_an_input_may_be_replaced() {
    let folder = two_files();
    fs::copy(folder.path().join("a.parquet"), folder.path().join("copy.parquet")).unwrap();
    run(folder.path(), &["score", "a.parquet", "-o", "copy.parquet"]).done();
    let scores = contents(folder.path());
    assert!(scores["copy.parquet"] != scores["a.parquet"]);
}

/// Draws a figure to `target` with standard output going to `stdout`.
fn figure(folder: &Path, target: &str, stdout: Stdio) -> std::process::Output {
    let words = ["figure", "spider", "a.parquet", "-o", target];
    program(folder).args(words).stdout(stdout).output().unwrap()
}

#[test]
fn standard_output_and_devices_are_written_into() {
    let folder = two_files();
    let expected = run(folder.path(), &["figure", "spider", "a.parquet"]).done();
    // A failure would damage the device itself, so the test uses a link to it.
    symlink("/dev/null", folder.path().join("null.svg")).unwrap();
    let answer = figure(folder.path(), "null.svg", Stdio::piped());
    assert!(answer.status.success() && answer.stdout.is_empty(), "{}", String::from_utf8_lossy(&answer.stderr));
    assert!(fs::metadata(folder.path().join("null.svg")).unwrap().file_type().is_char_device());
    symlink("/dev/stdout", folder.path().join("out.svg")).unwrap();
    let answer = figure(folder.path(), "out.svg", Stdio::piped());
    assert!(answer.stdout == expected.as_bytes(), "{}", String::from_utf8_lossy(&answer.stderr));
    assert!(fs::symlink_metadata(folder.path().join("out.svg")).unwrap().is_symlink());
}

#[test]
fn standard_output_by_its_name_may_be_a_file() {
    let folder = two_files();
    let expected = run(folder.path(), &["figure", "spider", "a.parquet"]).done();
    for (name, before) in [("/dev/fd/1", ""), ("/proc/self/fd/1", "before")] {
        let path = folder.path().join("redirected");
        fs::write(&path, before).unwrap();
        let file = fs::OpenOptions::new().append(true).open(&path).unwrap();
        let answer = figure(folder.path(), name, file.into());
        assert!(answer.status.success(), "{name}: {}", String::from_utf8_lossy(&answer.stderr));
        assert!(fs::read_to_string(&path).unwrap() == format!("{before}{expected}"), "{name}");
    }
}

#[test]
fn a_folder_with_inputs_is_refused_as_the_output() {
    let folder = two_files();
    let runs = folder.path().join("runs");
    fs::create_dir_all(runs.join("deep")).unwrap();
    fs::copy(folder.path().join("a.parquet"), runs.join("deep/a.parquet")).unwrap();
    let before = contents(folder.path());
    for (input, out) in [("runs", "runs"), ("runs/deep/a.parquet", "runs"), ("runs/deep", "runs/../runs/deep/.")] {
        for command in [&["report", "--no-figures"][..], &["definitions", "sensitivity"]] {
            let message = run(folder.path(), &[command, &[input, "--out", out]].concat()).refused();
            assert!(message.contains(&format!("`{out}`: expected a folder for outputs, found an input")), "{message}");
            assert!(message.contains("\n  help: name another folder"), "{message}");
        }
        assert!(contents(folder.path()) == before, "{input}");
    }
    #[cfg(feature = "view")]
    assert!(run(folder.path(), &["view", "runs", "--export", "runs"]).refused().contains("name another one"));
    // The library, and so Python, refuses it too.
    let study = mirrorstats::Study::open([&runs]).unwrap();
    let options = mirrorstats::ReportOptions { figures: false, ..Default::default() };
    let report = mirrorstats::report(&study, &options).unwrap();
    assert!(report.write(&runs).unwrap_err().to_string().contains("expected a folder for outputs"));
    // A new folder inside is allowed, because commands that read traces skip reports.
    run(folder.path(), &["report", "runs", "--no-figures", "--out", "runs/report"]).done();
    run(folder.path(), &["score", "runs"]).done();
}

#[test]
fn scores_go_to_standard_output_and_into_pipes_by_name() {
    let folder = two_files();
    let expected = run(folder.path(), &["score", "a.parquet"]).done();
    for name in ["/dev/stdout", "/dev/fd/1"] {
        assert_eq!(run(folder.path(), &["score", "a.parquet", "-o", name]).done(), expected, "{name}");
    }
    assert_eq!(run(folder.path(), &["score", "a.parquet", "-o", "/dev/null"]).done(), "");
    for pipe in ["pipe", "pipe.jsonl"] {
        let path = folder.path().join(pipe);
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let reader = std::thread::spawn({
            let path = path.clone();
            move || fs::read_to_string(path).unwrap()
        });
        run(folder.path(), &["score", "a.parquet", "-o", pipe]).done();
        let (read, is_csv) = (reader.join().unwrap(), pipe == "pipe");
        assert!(if is_csv { read == expected } else { read.starts_with("{\"episode_id\"") }, "{pipe}: {read}");
        assert!(!fs::metadata(&path).unwrap().is_file(), "{pipe}");
    }
}

#[test]
fn a_folder_of_a_user_is_no_leftover_whatever_its_name() {
    let folder = two_files();
    let notes = folder.path().join(".mirrorstats-notes.backup");
    fs::create_dir(&notes).unwrap();
    fs::write(notes.join("thesis.txt"), "mine").unwrap();
    run(folder.path(), &["score", "a.parquet", "-o", "s.csv"]).done();
    run(folder.path(), &["report", "a.parquet", "--no-figures", "--out", "r"]).done();
    assert_eq!(fs::read(notes.join("thesis.txt")).unwrap(), b"mine");
}

#[test]
fn a_folder_whose_replacement_was_broken_off_is_not_read() {
    let folder = two_files();
    let runs = folder.path().join("runs");
    fs::create_dir(&runs).unwrap();
    fs::copy(folder.path().join("a.parquet"), runs.join("a.parquet")).unwrap();
    fs::write(runs.join(".mirrorstats-unfinished"), "a.parquet").unwrap();
    for input in ["runs", "runs/a.parquet"] {
        let message = run(folder.path(), &["score", input]).refused();
        assert!(message.contains("broken off; run the command again"), "{message}");
    }
}

#[test]
fn running_out_of_open_files_is_no_damage() {
    let folder = two_files();
    for at in 0..20 {
        fs::copy(folder.path().join("a.parquet"), folder.path().join(format!("{at}.parquet"))).unwrap();
    }
    let refused = |limit: usize, words: &str| {
        let script = format!("ulimit -n {limit}; exec {} {words}", crate::harness::program::PROGRAM);
        let output = std::process::Command::new("sh").args(["-c", &script]).current_dir(&folder).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let mut seen = 0;
    for limit in 4..14 {
        for words in ["score a.parquet", "stats a.parquet", "report a.parquet --no-figures --out r"] {
            let (code, said) = refused(limit, words);
            assert!(!said.contains("damaged") && !said.contains("panicked"), "{limit} {words}: {said}");
            // With the lowest limits, not even the linker starts the program.
            if code == Some(2) {
                assert!(said.contains("Too many open files") && said.contains("ulimit -n"), "{limit} {words}: {said}");
                seen += 1;
            }
        }
    }
    assert!(seen > 0, "no limit was too small");
    #[cfg(feature = "sim")]
    for limit in [8, 12, 16] {
        let (code, said) = refused(limit, "record --agent random --experiment E1 --seeds 1 --runs 1 --no-frames");
        assert_eq!(code, Some(2), "{limit}: {said}");
        assert!(said.contains("Too many open files") && said.contains("ulimit -n"), "{limit}: {said}");
        assert!(!said.contains("damaged") && !said.contains("panicked"), "{limit}: {said}");
    }
}

/// Commands that write, and their outputs.
const WRITING: [(&str, &str); 7] = [
    ("score a.parquet -o s.csv", "s.csv"),
    ("score a.parquet -o s.parquet", "s.parquet"),
    ("report a.parquet --no-figures --out r", "r"),
    ("trace seal a.parquet sealed.parquet", "sealed.parquet"),
    ("figure spider a.parquet -o f.svg", "f.svg"),
    ("setup man man", "man"),
    #[cfg(feature = "view")]
    ("view a.parquet --export page", "page"),
    #[cfg(not(feature = "view"))]
    ("score a.parquet -o s.jsonl", "s.jsonl"),
];

#[test]
fn a_file_size_limit_is_reported_as_an_error() {
    let folder = two_files();
    let at = folder.path();
    for (words, output) in WRITING {
        let before = contents(at);
        let mut command = crate::harness::program::limited(at, "ulimit -f 0");
        let told = crate::harness::program::answer(command.args(words.split_whitespace())).refused();
        assert!(told.contains("File too large") && told.contains("writable"), "{words}: {told}");
        assert!(!at.join(output).exists(), "{words}");
        assert!(contents(at) == before, "{words} has left something");
        run(at, &words.split_whitespace().collect::<Vec<_>>()).done();
    }
}
