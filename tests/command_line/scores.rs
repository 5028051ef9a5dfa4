//! Files of scores in place of traces.

use std::fs;
use std::path::Path;

use crate::{contents, fixture, run, two_files};

const FORMATS: [&str; 3] = ["parquet", "csv", "jsonl"];

fn score(at: &Path, arguments: &[&str], output: &str) {
    run(at, &[&["score"], arguments, &["-o", output]].concat()).done();
}

#[test]
fn scores_and_traces_give_the_same_report() {
    let folder = two_files();
    let at = folder.path();
    run(at, &["report", ".", "--out", "out/traces"]).done();
    let files = |name: &str| {
        let mut files = contents(&at.join("out").join(name));
        // The manifest names other inputs.
        files.remove("manifest.json").unwrap();
        files.retain(|name, _| !name.starts_with("figures") && name != "report.html");
        // Scores do not record reply quality.
        assert_eq!(
            files.keys().filter(|file| file.starts_with("tables/quality")).count(),
            if name == "traces" { 3 } else { 0 }
        );
        files.retain(|name, _| !name.starts_with("tables/quality"));
        // Scores as text do not record losses, nor does the table of a report made from them; it is compared below.
        if ["csv", "jsonl"].contains(&name) {
            files.remove("episodes.parquet").unwrap();
        }
        files
    };
    let expected = files("traces");
    assert!(expected.len() >= 8);
    for format in FORMATS {
        let name = format!("scores.{format}");
        score(at, &["a.parquet", "b.parquet"], &name);
        run(at, &["report", &name, "--out", &format!("out/{format}")]).done();
        let found = files(format);
        let mut expected = expected.clone();
        expected.retain(|name, _| found.contains_key(name));
        assert!(expected.len() >= 7 && found == expected, "{format}");
        score(at, &[&format!("out/{format}/episodes.parquet")], "of-report.csv");
        assert_eq!(
            fs::read(at.join("of-report.csv")).unwrap(),
            run(at, &["score", "[ab].parquet"]).done().into_bytes()
        );
        score(at, &[&name], "again.csv");
        assert_eq!(fs::read(at.join("again.csv")).unwrap(), run(at, &["score", "[ab].parquet"]).done().into_bytes());
    }
}

#[test]
fn partial_score_files_add_up_to_the_whole() {
    let folder = two_files();
    let at = folder.path();
    let expected = run(at, &["score", "a.parquet", "b.parquet"]).done();
    for format in FORMATS {
        let [a, b] = ["a", "b"].map(|part| format!("part-{part}.{format}"));
        score(at, &["a.parquet"], &a);
        score(at, &["b.parquet"], &b);
        assert_eq!(run(at, &["score", &b, &a]).done(), expected);
    }
}

#[test]
fn conditions_and_choices_work_on_scores() {
    let folder = two_files();
    let at = folder.path();
    score(at, &["a.parquet", "b.parquet"], "s.csv");
    for options in [
        ["--where", "TSA = 1 and model = 'ant'"].as_slice(),
        &["--where", "MTATO is null or \"TSA-C\" = 1"],
        &["--where", "run in (1, 3) and TTD between 2 and 3", "--metrics", "TTD,MGD"],
        &["--where", "false"],
    ] {
        let from_traces = run(at, &[&["score", "a.parquet", "b.parquet"], options].concat()).done();
        let from_scores = run(at, &[&["score", "s.csv"], options].concat()).done();
        assert_eq!(from_scores, from_traces, "{options:?}");
    }
}

#[test]
fn scores_of_data_frames_are_read() {
    let folder = two_files();
    let at = folder.path();
    score(at, &["a.parquet"], "s.csv");
    let expected = run(at, &["score", "s.csv"]).done();
    let good = fs::read_to_string(at.join("s.csv")).unwrap();
    let whole = |cell: &str| cell.parse::<i64>().map_or_else(|_| cell.to_owned(), |number| format!("{number}.0"));
    let row = |(at, line): (usize, &str)| match at {
        0 => format!(",{line}\n"),
        _ => format!("{},{}\n", at - 1, line.split(',').map(whole).collect::<Vec<_>>().join(",")),
    };
    let frame: String = good.lines().enumerate().map(row).collect();
    fs::write(at.join("frame.csv"), &frame).unwrap();
    assert_eq!(run(at, &["score", "frame.csv"]).done(), expected);
    let header: Vec<&str> = good.lines().next().unwrap().split(',').collect();
    let tsa = header.iter().position(|name| *name == "TSA").unwrap();
    let truth = |line: &str| {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[tsa] = match cells[tsa] {
            "1" => "True",
            "0" => "False",
            other => other,
        };
        cells.join(",") + "\n"
    };
    fs::write(at.join("truth.csv"), good.lines().map(truth).collect::<String>()).unwrap();
    assert_eq!(run(at, &["score", "truth.csv"]).done(), expected);
    run(at, &["report", "frame.csv", "--out", "frame"]).done();
}

#[test]
fn impossible_scores_are_refused() {
    let folder = two_files();
    let at = folder.path();
    score(at, &["a.parquet"], "s.csv");
    let good = fs::read_to_string(at.join("s.csv")).unwrap();
    let row = good.lines().nth(1).unwrap();
    let header = good.lines().next().unwrap();
    let with = |line: &str| format!("{good}{line}\n");
    for (text, words) in [
        (with(row), ["E1-ant-0", "each episode once"]),
        (with("new,ant,E1,1,1,7,3,1,,0,1,0,1,0,1"), ["`TSA`", "found 7"]),
        (with("new,ant,E1,1,1,-1,3,1,,0,1,0,1,0,1"), ["`TSA`", "found -1"]),
        (with("new,ant,E1,1,1,yes,3,1,,0,1,0,1,0,1"), ["line 10, column `TSA`", "an integer"]),
        (with("new,ant,E1,1,1,1.5,3,1,,0,1,0,1,0,1"), ["line 10, column `TSA`", "1.5"]),
        (with("new,ant,E1,x,1,1,3,1,,0,1,0,1,0,1"), ["line 10, column `seed`", "an integer"]),
        (with(",ant,E1,1,1,1,3,1,,0,1,0,1,0,1"), ["line 10, column `episode_id`", "a value"]),
        (with("new,ant,E9,1,1,1,3,1,,0,1,0,1,0,1"), ["`E9`", "E1, E2, E3, E4, E5"]),
        (with("new,ant"), ["line 10", "2 fields"]),
        (good.replace("TTD", "TSA"), ["`TSA`", "more than one"]),
        (good.replace("episode_id", "episode"), ["`episode_id`", "mirrorstats score"]),
        (String::new(), ["`episode_id`", "no column"]),
        (header.replace(',', ";"), ["`episode_id`", "found the columns"]),
    ] {
        fs::write(at.join("bad.csv"), &text).unwrap();
        for command in [["score", "bad.csv"].as_slice(), &["report", "bad.csv"], &["stats", "bad.csv"]] {
            let message = run(at, command).refused();
            assert!(message.contains("bad.csv"), "{message}");
            assert!(words.iter().all(|word| message.contains(word)), "{words:?}: {message}");
        }
    }
    assert!(!at.join("reports").exists());
    for line in ["{", "[]", "3", "{\"episode_id\": 1}", ""] {
        let lines = run(at, &["score", "a.parquet", "--json"]).done();
        fs::write(at.join("bad.jsonl"), format!("{lines}{line}\n")).unwrap();
        let message = run(at, &["score", "bad.jsonl"]).refused();
        assert!(message.contains("bad.jsonl") && message.contains("line 9"), "{message}");
    }
}

#[test]
fn scores_mixed_with_traces_or_used_for_steps_are_refused() {
    let folder = two_files();
    let at = folder.path();
    score(at, &["a.parquet"], "s.parquet");
    score(at, &["a.parquet"], "s.csv");
    for (arguments, words) in [
        (["report", "s.parquet", "b.parquet"].as_slice(), ["found both", "s.parquet"]),
        (&["report", "b.parquet", "s.csv"], ["found both", "s.csv"]),
        (&["report", "s.csv", "s.parquet"], ["in two files of scores", "leave one out"]),
        (&["score", "s.csv", "--where", "any(mirror_visible)"], ["mirror_visible", "needs the traces"]),
        (&["score", "s.parquet", "--explain", "E1-ant-0"], ["no steps", "give the traces"]),
        (&["report", "s.parquet", "--by", "body_color"], ["`body_color`", "one of experiment, model"]),
        (&["report", "s.parquet", "--definitions", "extended"], ["under `extended`", "score the traces again"]),
        (&["report", "s.parquet", "--metrics", "TSAC"], ["`TSAC`", "TSA-C"]),
    ] {
        let message = run(at, arguments).refused();
        assert!(words.iter().all(|word| message.contains(word)), "{arguments:?}: {message}");
    }
    assert!(!at.join("reports").exists());
}

#[test]
fn truncated_scores_are_refused() {
    let folder = two_files();
    let at = folder.path();
    score(at, &["a.parquet"], "s.parquet");
    let whole = fs::read(at.join("s.parquet")).unwrap();
    for length in [0, 3, 4, 12, whole.len() / 2, whole.len() - 1] {
        fs::write(at.join("cut.parquet"), &whole[..length]).unwrap();
        let message = run(at, &["report", "cut.parquet"]).refused();
        assert!(message.contains("cut.parquet"), "{message}");
    }
    // Damage anywhere gives an error or is harmless; the program never panics.
    for place in (0..whole.len()).step_by(97) {
        let mut bytes = whole.clone();
        bytes[place] ^= 0xff;
        fs::write(at.join("cut.parquet"), &bytes).unwrap();
        let answer = run(at, &["score", "cut.parquet"]);
        assert!(matches!(answer.code, 0 | 2) && !answer.stderr.contains("panicked"), "{place}: {}", answer.stderr);
    }
}

#[test]
fn the_paper_s_fixture_reports_the_same_from_scores() {
    let folder = tempfile::tempdir().unwrap();
    let paper = fixture("paper").display().to_string();
    run(folder.path(), &["score", &paper, "-o", "s.csv"]).done();
    let [traces, scores] = [paper.as_str(), "s.csv"].map(|input| {
        let printed = run(folder.path(), &["report", input, "--style", "paper", "--out", "out"]).done();
        (printed, fs::read(folder.path().join("out/cells.csv")).unwrap())
    });
    assert!(traces == scores);
}
