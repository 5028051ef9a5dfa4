//! Names that would affect a terminal, a table or a shell if they were not escaped.

use std::fs;

use mirrorstats_trace::write::write_episodes;

use crate::pairs::missing;
use crate::{Answer, contents, episode, run};

const NAMES: [&str; 8] = [
    "\u{1b}[31mred\u{1b}[0m",
    "bell\u{7}\rover\u{8}\u{8}",
    "line\nbreak\ttab",
    "right\u{202e}tfel",
    "=cmd|' /C calc'!A0",
    "a,b\"c'd|e&f_%#$\\{}~^<script>",
    "soft\u{ad}zero\u{200b}mark\u{61c}\u{200e}line\u{2028}",
    "tags\u{e0041}\u{e007f}bom\u{feff}note\u{fff9}filler\u{3164}selector\u{fe0f}private\u{e000}",
];

/// Characters of [`NAMES`] that are not control characters but must be escaped too.
const HIDDEN: [char; 13] = [
    '\u{202e}',
    '\u{ad}',
    '\u{200b}',
    '\u{61c}',
    '\u{200e}',
    '\u{2028}',
    '\u{e0041}',
    '\u{e007f}',
    '\u{feff}',
    '\u{fff9}',
    '\u{3164}',
    '\u{fe0f}',
    '\u{e000}',
];

/// Returns true if the text has no control or hidden characters, except the program's own line breaks.
fn is_tame(text: &str) -> bool {
    text.chars().all(|c| c == '\n' || !(c.is_control() || HIDDEN.contains(&c)))
}

#[track_caller]
fn check(answer: &Answer) {
    assert!(is_tame(&answer.stdout) && is_tame(&answer.stderr), "{:?}\n{:?}", answer.stdout, answer.stderr);
    assert!(!answer.stderr.contains("panicked"), "{}", answer.stderr);
}

#[test]
fn names_of_models_and_episodes_cannot_reach_the_terminal_raw() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let episodes: Vec<_> =
        NAMES.iter().flat_map(|name| [episode(name, "E1", 0, "red"), episode(name, "E1", 1, "blue")]).collect();
    write_episodes(&at.join("a.parquet"), None, &episodes).unwrap();
    for arguments in [
        ["report", "a.parquet"].as_slice(),
        &["report", "a.parquet", "--style", "paper"],
        &["report", "a.parquet", "--by", "episode_id,model"],
        &["stats", "a.parquet", "--metric", "all"],
        &["stats", "a.parquet", "--sequential", "--metric", "all"],
        &["trace", "info", "a.parquet"],
        &["trace", "validate", "a.parquet"],
        &["score", "a.parquet", "--explain", "E1-\u{1b}[31mred\u{1b}[0m-0"],
        &["diff", "paper", "extended", "a.parquet"],
    ] {
        let answer = run(at, arguments);
        assert_eq!(answer.code, 0, "{arguments:?}: {}", answer.stderr);
        check(&answer);
    }
    for (path, bytes) in contents(&at.join("reports/latest")) {
        let is_shown = [".md", ".tex", ".html", ".svg"].iter().any(|ending| path.ends_with(ending));
        let text = String::from_utf8_lossy(&bytes);
        assert!(!is_shown || !text.contains(HIDDEN), "{path}");
    }
    for arguments in [
        ["score", "a.parquet", "--explain", "\u{1b}[31mnone"].as_slice(),
        &["score", "a.parquet", "--metrics", "\u{1b}[31mTSA"],
        &["score", "a.parquet", "--where", "\"\u{1b}[31m\" = 1"],
        &["score", "\u{1b}[31m.parquet"],
        &["report", "a.parquet", "--by", "\u{1b}[31mmodel"],
        &["report", "a.parquet", "--style", "\u{1b}[31m"],
        &["score", "a.parquet", "--definitions", "\u{1b}[31m"],
        &["score", "a.parquet", "--\u{1b}[31m"],
        &["\u{1b}[31m\u{202e}"],
        &["score", "a.parquet", "--threads", "\u{1b}[31m\u{202e}\r"],
        &["setup", "completions", "\u{1b}]0;title\u{7}"],
        &["diff", "paper", "\u{1b}[31m", "a.parquet"],
        &["definitions", "check", "\u{1b}[31m"],
        &["verify", "\u{1b}[31m"],
        &["import", "\u{1b}[31m", "-o", "b.parquet"],
        &["trace", "recover", "\u{1b}[31m", "-o", "b.parquet"],
    ] {
        let answer = run(at, arguments);
        check(&answer);
        answer.refused();
    }
    check(&run(at, &["--errors", "json", "score", "\u{1b}[31m\u{202e}"]));
    // A file of scores reads back unchanged, whatever the names.
    run(at, &["score", "a.parquet", "-o", "s.csv"]).done();
    run(at, &["score", "a.parquet", "-o", "s.jsonl"]).done();
    let scores = fs::read_to_string(at.join("s.csv")).unwrap();
    assert_eq!(run(at, &["score", "s.csv"]).done(), scores);
    assert_eq!(run(at, &["score", "s.jsonl"]).done(), scores);
}

/// Every verb that shows names of a trace, in every format for people.
const SHOWN: [&str; 29] = [
    "report a.parquet b.parquet",
    "stats a.parquet --metric all",
    "figure intervals a.parquet -o figure.svg",
    "diff paper extended a.parquet",
    "gate a.parquet b.parquet",
    "gate a.parquet b.parquet --format md",
    "gate a.parquet b.parquet --format github",
    "gate a.parquet b.parquet --format junit",
    "import a.parquet -o c.parquet",
    "score a.parquet -o scores.csv",
    "query SELECT+model+FROM+episodes a.parquet --format table",
    "trace info a.parquet",
    "trace info a.parquet --episodes",
    "trace labels a.parquet",
    "trace validate a.parquet",
    "trace check a.parquet --max-unreadable 0.05",
    "trace seal a.parquet sealed.parquet",
    "trace recover a.parquet -o x.parquet",
    "table compare a.parquet --published table.csv",
    "table audit table.csv --n 21",
    "publish a.parquet -o bundle",
    "verify bundle",
    "verify reports/latest",
    "table rescore reports/latest --definitions extended --out again",
    "definitions sensitivity a.parquet",
    "world replay a.parquet",
    "world filmstrip x a.parquet -o strip.png",
    "view a.parquet --export page",
    "participants remove x .",
];

/// Verbs whose output has no name of a trace.
const NOT_SHOWN: [&str; 18] = [
    "plan",
    "record",
    "trace schema",
    "definitions check",
    "definitions explain",
    "definitions show",
    "definitions sql",
    "experiments check",
    "experiments explain",
    "experiments show",
    "style show",
    "style check",
    "world config",
    "world scene",
    "world visibility",
    "world sheet",
    "setup completions",
    "setup man",
];

#[test]
fn no_verb_and_no_format_for_people_prints_a_name_raw() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (file, choices) in [("a.parquet", ["red", "blue"]), ("b.parquet", ["blue", "red"])] {
        let episodes: Vec<_> = NAMES
            .iter()
            .flat_map(|name| (0..).zip(choices).map(move |(run, choice)| episode(name, "E1", run, choice)))
            .collect();
        write_episodes(&at.join(file), None, &episodes).unwrap();
    }
    let rows = NAMES.map(|name| format!("E1,\"{}\",TSA,0.57,0.15,\n", name.replace('"', "\"\"")));
    fs::write(at.join("table.csv"), format!("experiment,model,metric,mean,se,emphasis\n{}", rows.concat())).unwrap();
    for words in SHOWN {
        let arguments: Vec<String> = words.split_whitespace().map(|word| word.replace('+', " ")).collect();
        let answer = run(at, &arguments.iter().map(String::as_str).collect::<Vec<_>>());
        check(&answer);
        let is_cut = words.contains("github") && !answer.stdout.contains("\\u{1b}");
        assert!(!is_cut, "the flipped episodes are named: {}", answer.stdout);
    }
    let missing = missing(&SHOWN.into_iter().chain(NOT_SHOWN));
    assert!(missing.is_empty(), "no trace with hostile names: {missing:?}");
}

#[test]
fn values_of_an_invalid_trace_are_escaped() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for name in NAMES {
        write_episodes(&at.join("a.parquet"), None, &[episode("m", name, 1, "red")]).unwrap();
        let answer = run(at, &["report", "a.parquet"]);
        check(&answer);
        assert!(answer.refused().contains("unknown-experiment"));
        check(&run(at, &["trace", "validate", "a.parquet"]));
    }
    assert_eq!(contents(at).len(), 1);
}

#[test]
fn the_name_of_a_file_is_escaped() {
    let folder = tempfile::tempdir().unwrap();
    let name = "\u{1b}[31mred.parquet";
    write_episodes(&folder.path().join(name), None, &[episode("m", "E9", 1, "red")]).unwrap();
    for command in [&["score"][..], &["trace", "validate"], &["trace", "info"], &["report"]] {
        check(&run(folder.path(), &[command, &["."]].concat()));
    }
}
