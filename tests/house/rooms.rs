//! The rooms of the house: who may import from whom, and what each may do, read off the sources.
//!
//! A path counts wherever it stands, in a `use` or in the code: `crate::a::b`, `super` chains and `use` groups are
//! resolved to the module that they name. Comments and tests do not count.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use regex::Regex;

/// From the top to the bottom: a room imports only from the rooms below it.
const ROOMS: [&str; 17] = [
    "cli",
    "view",
    "study",
    "record",
    "replay",
    "agent",
    "sim",
    "log",
    "report",
    "figures",
    "engine",
    "stats",
    "score",
    "experiment",
    "metric",
    "trace",
    "base",
];

/// The rooms between a trace and a report, which know nothing of how episodes come about.
const ANALYSIS: [&str; 8] = ["study", "report", "figures", "engine", "stats", "score", "metric", "trace"];

/// One source file: its place, its tokens without comments, strings and tests, and its texts.
struct Source {
    path: String,
    module: Vec<String>,
    tokens: Vec<String>,
    strings: Vec<String>,
}

impl Source {
    /// Every source file below `src/ROOM`.
    fn of_room(room: &str) -> Vec<Self> {
        let checkout = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut paths = Vec::new();
        walk(&checkout.join("src").join(room), &mut paths);
        assert!(!paths.is_empty(), "the room {room} is empty");
        paths.sort();
        let is_test = |path: &PathBuf| path.ends_with("tests.rs") || path.iter().any(|part| part == "tests");
        paths.iter().filter(|path| !is_test(path)).map(|path| Self::read(checkout, path)).collect()
    }

    fn read(root: &Path, path: &Path) -> Self {
        let name = path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
        Self::parse(&name, &fs::read_to_string(path).unwrap())
    }

    /// A file at `path`, such as `src/report/html/page.rs`, with this text.
    fn parse(path: &str, text: &str) -> Self {
        let inside = path.strip_prefix("src/").unwrap().strip_suffix(".rs").unwrap();
        let module = inside.split('/').filter(|part| *part != "mod").map(str::to_owned).collect();
        let (tokens, strings) = without_tests(&tokens(text));
        Self { path: path.to_owned(), module, tokens, strings }
    }

    /// Every path into the crate, resolved: the segments behind `crate`.
    fn paths(&self) -> BTreeSet<Vec<String>> {
        let mut found = BTreeSet::new();
        let (mut module, mut depth, mut inner) = (self.module.clone(), 0, Vec::new());
        let mut at = 0;
        while let Some(token) = self.tokens.get(at) {
            let begins = at == 0 || self.tokens[at - 1] != "::";
            match token.as_str() {
                "{" => {
                    depth += 1;
                    if at >= 2 && self.tokens[at - 2] == "mod" {
                        module.push(self.tokens[at - 1].clone());
                        inner.push(depth);
                    }
                }
                "}" => {
                    if inner.last() == Some(&depth) {
                        module.pop();
                        inner.pop();
                    }
                    depth -= 1;
                }
                "crate" | "super" | "self" if begins => {
                    at = tree(&self.tokens, at, &module, &[], &mut found);
                    continue;
                }
                _ => {}
            }
            at += 1;
        }
        found
    }

    /// Which of `words` are in its code: words, or several with `::` between them.
    fn words<'w>(&self, words: &[&'w str]) -> Vec<&'w str> {
        let is_there = |word: &str| {
            let spelled = tokens(word);
            self.tokens.windows(spelled.len()).any(|window| window == spelled)
        };
        words.iter().filter(|word| is_there(word)).copied().collect()
    }
}

fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            walk(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

/// Words, `::`, other signs one by one, and texts as `"..."`.
fn tokens(text: &str) -> Vec<String> {
    let pattern = concat!(
        r###"(?s)//[^\n]*|/\*.*?\*/|(?<raw>b?r#+".*?"#+|b?r"[^"]*")|(?<text>b?"(?:[^"\\]|\\.)*")"###,
        r"|b?'(?:[^'\\]|\\.[^']*)'|(?<word>[A-Za-z_][A-Za-z0-9_]*)|(?<path>::)|(?<sign>[^\s0-9])",
    );
    let pattern = Regex::new(pattern).unwrap();
    let kept = |found: regex::Captures<'_>| {
        let token = ["raw", "text", "word", "path", "sign"].iter().find_map(|name| found.name(name));
        token.map(|token| token.as_str().to_owned())
    };
    pattern.captures_iter(text).filter_map(kept).collect()
}

/// The tokens that are code, and the texts; what follows `#[cfg(test)]` is left out.
fn without_tests(all: &[String]) -> (Vec<String>, Vec<String>) {
    const CFG_TEST: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];
    let (mut tokens, mut strings) = (Vec::new(), Vec::new());
    let mut at = 0;
    while at < all.len() {
        if all[at..].iter().map(String::as_str).take(CFG_TEST.len()).eq(CFG_TEST) {
            at = end_of_item(all, at + CFG_TEST.len());
            continue;
        }
        let is_text = all[at].ends_with('"') || all[at].ends_with("\"#");
        if is_text {
            strings.push(all[at].clone());
        } else {
            tokens.push(all[at].clone());
        }
        at += 1;
    }
    (tokens, strings)
}

/// Behind the item that begins at `at`: behind its `;`, or its braces.
fn end_of_item(all: &[String], mut at: usize) -> usize {
    let mut depth = 0;
    while at < all.len() {
        match all[at].as_str() {
            "{" => depth += 1,
            "}" => depth -= 1,
            ";" if depth == 0 => return at + 1,
            _ => {}
        }
        at += 1;
        if depth == 0 && all[at - 1] == "}" {
            return at;
        }
    }
    at
}

/// Follows the path that begins at a token; gives the place behind it.
fn tree(
    tokens: &[String],
    mut at: usize,
    module: &[String],
    before: &[String],
    found: &mut BTreeSet<Vec<String>>,
) -> usize {
    let mut path = before.to_vec();
    loop {
        match tokens.get(at).map(String::as_str) {
            Some("crate") => path.clear(),
            Some("self") if before.is_empty() && path.is_empty() => path = module.to_vec(),
            Some("super") if path.is_empty() => path = parent(module),
            Some("super") => path = parent(&path),
            Some("self" | "*") => {}
            Some("{") => {
                at += 1;
                while tokens.get(at).is_some_and(|token| token != "}") {
                    at = if tokens[at] == "," { at + 1 } else { tree(tokens, at, module, &path, found) };
                }
                return at + 1;
            }
            Some(word) if word.starts_with(|c: char| c.is_alphabetic() || c == '_') => path.push(word.to_owned()),
            _ => break,
        }
        at += 1;
        if tokens.get(at).is_none_or(|token| token != "::") {
            break;
        }
        at += 1;
    }
    found.insert(path);
    // `as name` within a group.
    if tokens.get(at).is_some_and(|token| token == "as") { at + 2 } else { at }
}

fn parent(module: &[String]) -> Vec<String> {
    module[..module.len().saturating_sub(1)].to_vec()
}

/// What in `room` names a room above it, or a thing of the library that is in no room.
fn upward(room: &str, source: &Source) -> Vec<String> {
    let own = ROOMS.iter().position(|known| *known == room).unwrap();
    let is_wrong = |path: &Vec<String>| match path.first() {
        None => false,
        Some(first) => ROOMS.iter().position(|known| known == first).is_none_or(|at| at < own),
    };
    source.paths().iter().filter(|path| is_wrong(path)).map(|path| told(source, path)).collect()
}

fn told(source: &Source, path: &[String]) -> String {
    format!("{}: crate::{}", source.path, path.join("::"))
}

/// Every path of these rooms of which `is_wrong` says so.
fn paths_where(rooms: &[&str], is_wrong: impl Fn(&[String]) -> bool) -> Vec<String> {
    let sources: Vec<Source> = rooms.iter().flat_map(|room| Source::of_room(room)).collect();
    let wrong = |source: &Source| {
        source.paths().iter().filter(|path| is_wrong(path)).map(|path| told(source, path)).collect::<Vec<_>>()
    };
    sources.iter().flat_map(wrong).collect()
}

/// Every file of these rooms that has one of these words, but for those that begin with one of `exceptions`.
fn words_in(rooms: &[&str], words: &[&str], exceptions: &[&str]) -> Vec<String> {
    let sources = rooms.iter().flat_map(|room| Source::of_room(room));
    let bound = sources.filter(|source| !exceptions.iter().any(|place| source.path.starts_with(place)));
    bound
        .flat_map(|source| {
            let found = source.words(words);
            found.into_iter().map(|word| format!("{}: {word}", source.path)).collect::<Vec<_>>()
        })
        .collect()
}

const NOTHING: Vec<String> = Vec::new();

#[test]
fn a_room_imports_only_from_rooms_below() {
    for room in ROOMS {
        let found: Vec<String> = Source::of_room(room).iter().flat_map(|source| upward(room, source)).collect();
        assert_eq!(found, NOTHING);
    }
}

#[test]
fn every_folder_of_the_sources_is_a_room() {
    let folders = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).unwrap();
    let folders = folders.map(|entry| entry.unwrap()).filter(|entry| entry.path().is_dir());
    let found: BTreeSet<String> = folders.map(|entry| entry.file_name().into_string().unwrap()).collect();
    assert_eq!(found, ROOMS.iter().map(ToString::to_string).collect());
}

#[test]
fn reports_figures_and_statistics_see_no_trace_and_no_plan() {
    let is_wrong = |path: &[String]| {
        path.first().is_some_and(|room| room == "trace") || path.starts_with(&["metric".to_owned(), "plan".to_owned()])
    };
    assert_eq!(paths_where(&["report", "figures", "stats"], is_wrong), NOTHING);
}

#[test]
fn analysis_never_imports_recording() {
    let is_wrong = |path: &[String]| path.first().is_some_and(|room| ["record", "agent", "sim"].contains(&&**room));
    assert_eq!(paths_where(&ANALYSIS, is_wrong), NOTHING);
}

#[test]
fn the_world_draws_with_the_kit_alone() {
    let is_wrong = |path: &[String]| {
        path.first().is_some_and(|room| room == "figures") && path.get(1).is_none_or(|at| at != "kit")
    };
    assert_eq!(paths_where(&["record", "agent", "sim"], is_wrong), NOTHING);
}

#[test]
fn definitions_know_no_arrow() {
    assert_eq!(words_in(&["metric"], &["arrow", "parquet"], &[]), NOTHING);
}

#[test]
fn scoring_opens_no_file_and_starts_no_thread() {
    let words = ["fs", "File", "OpenOptions", "tempfile", "thread", "mpsc", "in_order", "Instant", "SystemTime"];
    assert_eq!(words_in(&["score"], &words, &[]), NOTHING);
}

/// What replaces files, and what opens those that a user names.
const FILES_OF_BASE: [&str; 2] = ["src/base/replace/", "src/base/input.rs"];

/// What another room may not do, it may not do by way of `base`.
#[test]
fn base_knows_no_arrow_starts_no_thread_and_opens_files_in_two_places() {
    assert_eq!(words_in(&["base"], &["arrow", "parquet", "thread", "mpsc"], &[]), NOTHING);
    assert_eq!(words_in(&["base"], &["fs", "File", "OpenOptions", "tempfile"], &FILES_OF_BASE), NOTHING);
}

/// Files outside `trace` that open files, or read Parquet; none of them opens a trace.
const OPENS_OTHER_FILES: [&str; 18] = [
    // Files that appear whole or not at all.
    "src/base/replace/",
    // What others open files by.
    "src/base/input.rs",
    // Logs.
    "src/log/frames.rs",
    "src/log/messages.rs",
    "src/log/recover.rs",
    // What Spark writes: scores.
    "src/engine/spark/answer.rs",
    // Scores as Parquet, out of bytes.
    "src/score/format/parquet.rs",
    // Which of two kinds a file is; scores; hashes of what was read.
    "src/study/inputs.rs",
    "src/study/input_hashes.rs",
    "src/study/provenance.rs",
    "src/study/rescore.rs",
    "src/study/scores.rs",
    // Whether a trace is still the file that was read; locks.
    "src/record/",
    // The files that an agent's command names, for their hashes.
    "src/agent/exec/files.rs",
    // Experiments and prompts, of bounded length.
    "src/experiment/load.rs",
    "src/experiment/prompt.rs",
    // Answers of models, and of people.
    "src/agent/vlm/journal.rs",
    "src/agent/human/journal.rs",
];

#[test]
fn only_the_trace_room_opens_traces() {
    let rooms: Vec<&str> = ROOMS.into_iter().filter(|room| *room != "trace").collect();
    let words = [
        "File::open",
        "input::open",
        "File::options",
        "OpenOptions",
        "ParquetRecordBatchReader",
        "ParquetRecordBatchReaderBuilder",
    ];
    assert_eq!(words_in(&rooms, &words, &OPENS_OTHER_FILES), NOTHING);
}

#[test]
fn only_the_command_line_prints() {
    let words = ["println", "eprintln", "print", "eprint", "dbg", "stdout", "stderr"];
    let found: Vec<String> = ROOMS[1..]
        .iter()
        .flat_map(|room| Source::of_room(room))
        .flat_map(|source| {
            let pairs = source.tokens.windows(2);
            let prints = pairs.filter(|pair| words.contains(&&*pair[0]) && ["!", "("].contains(&&*pair[1]));
            // A process that is started has these names as settings; a macro or a function of the standard library has none
            // before it but a path.
            prints.map(|pair| format!("{}: {}", source.path, pair[0])).collect::<Vec<_>>()
        })
        .collect();
    assert_eq!(
        found.into_iter().filter(|at| !STARTS_PROCESSES.iter().any(|file| at.starts_with(file))).collect::<Vec<_>>(),
        NOTHING
    );
}

/// Files that say where a program's output goes, or call something of their own `print`.
const STARTS_PROCESSES: [&str; 3] = ["src/agent/exec/", "src/engine/spark/", "src/score/physical/"];

/// Files that round a float to text themselves.
const ROUNDS_ITSELF: [&str; 2] = [
    // Twelve digits of a quantile, read back as a float at once: no text comes out.
    "src/stats/quantile.rs",
    // Words of a scripted agent, in recordings that are compared byte for byte.
    "src/agent/scripted/words.rs",
];

#[test]
fn only_base_formats_floats() {
    let precision = Regex::new(r"\{[A-Za-z0-9_]*:[^{}]*\.(?:[0-9]+|\*|[a-z_]+\$)[^{}]*\}").unwrap();
    let rooms = ROOMS.iter().filter(|room| **room != "base").flat_map(|room| Source::of_room(room));
    let bound = rooms.filter(|source| !ROUNDS_ITSELF.contains(&&*source.path));
    let found: Vec<String> = bound
        .flat_map(|source| {
            let texts = source.strings.iter().filter(|text| precision.is_match(text));
            texts.map(|text| format!("{}: {text}", source.path)).collect::<Vec<_>>()
        })
        .collect();
    assert_eq!(found, NOTHING);
}

/// Files that may look at a clock: what they learn from it goes to standard error, into a wait, or into the latency of a
/// reply, and nowhere else.
const MAY_LOOK_AT_A_CLOCK: [&str; 12] = [
    "src/agent/exec/mod.rs",
    "src/agent/function.rs",
    "src/agent/human/hub.rs",
    "src/agent/vlm/failure.rs",
    "src/agent/vlm/provider.rs",
    "src/cli/commands/record.rs",
    "src/cli/recording.rs",
    "src/engine/spark/submit.rs",
    "src/record/rollout.rs",
    "src/record/run.rs",
    "src/record/shares.rs",
    "src/view/live.rs",
];

#[test]
fn no_clock_reaches_an_output() {
    assert_eq!(words_in(&ROOMS, &["SystemTime", "Instant", "chrono"], &MAY_LOOK_AT_A_CLOCK), NOTHING);
}

#[test]
fn every_exception_is_needed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let all = OPENS_OTHER_FILES.iter().chain(&MAY_LOOK_AT_A_CLOCK).chain(&ROUNDS_ITSELF).chain(&STARTS_PROCESSES);
    let gone: Vec<&&str> = all.filter(|path| !root.join(path).exists()).collect();
    assert_eq!(gone, Vec::<&&str>::new());
}

/// What the checker itself finds in made-up sources.
mod checker {
    use super::{Source, upward};

    fn check(path: &str, text: &str, expected: &[&str]) {
        let source = Source::parse(path, text);
        let found: Vec<String> = source.paths().iter().map(|path| path.join("::")).collect();
        assert_eq!(found, expected, "{path}: {text}");
    }

    #[test]
    fn a_super_chain_out_of_a_room_is_found() {
        check("src/stats/power.rs", "fn f() { super::super::trace::open::f() }", &["trace::open::f"]);
        check("src/report/html/page.rs", "use super::super::super::trace;", &["trace"]);
        check("src/report/html/mod.rs", "use super::super::trace::open;", &["trace::open"]);
        check("src/stats/power.rs", "use super::holm::level;", &["stats::holm::level"]);
        check("src/stats/power.rs", "mod inner { use super::super::cell; } use super::cell;", &["stats::cell"]);
        check("src/stats/power.rs", "mod inner { fn f() -> super::super::super::trace::A {} }", &["trace::A"]);
    }

    #[test]
    fn groups_and_code_are_found_and_comments_texts_and_tests_are_not() {
        let groups = "use crate::{base, study::{self, diff as other}, trace::*};";
        check("src/stats/cell.rs", groups, &["base", "study", "study::diff", "trace"]);
        check("src/stats/cell.rs", "fn f(x: &crate::trace::A<crate::sim::B>) {}", &["sim::B", "trace::A"]);
        check("src/stats/cell.rs", "use self::inner::A;", &["stats::cell::inner::A"]);
        let hidden = [
            "// crate::trace",
            "/* crate::trace */",
            "const A: [&str; 2] = [\"crate::trace\", r#\"crate::trace \"x\"\"#];",
            "const B: char = '\"';",
            "#[cfg(test)]",
            "mod tests { use crate::trace; fn f() { { } } }",
            "use crate::base;",
        ]
        .join("\n");
        check("src/stats/cell.rs", &hidden, &["base"]);
    }

    #[test]
    fn a_room_above_and_a_name_of_no_room_are_upward() {
        let source = Source::parse("src/stats/cell.rs", "use crate::{base, report::style}; fn f() -> crate::Study {}");
        assert_eq!(
            upward("stats", &source),
            ["src/stats/cell.rs: crate::Study", "src/stats/cell.rs: crate::report::style"]
        );
    }
}
