//! Invalid definition files: every fault is reported at once with its location, and nothing panics.
//!
//! `faults/NAME.toml` is the input, `faults/NAME.snap` the message.

use std::error::Error as _;
use std::fs;
use std::path::Path;

use mirrorstats_metric::definitions::Definitions;
use mirrorstats_metric::file::FileError;
use mirrorstats_score::vocabulary::schema_columns;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

fn check(text: &str) -> Result<Definitions, FileError> {
    Definitions::from_toml("test", text, &schema_columns())
}

/// Definitions with this expression in a `let` that an aggregate uses.
fn with_expression(text: &str) -> Result<Definitions, FileError> {
    let text = serde_json::to_string(text).unwrap();
    check(&format!("[let]\nx = {text}\n[metric.X]\nvalue = \"count(x is not null)\"\n"))
}

#[test]
fn every_fault_is_reported_at_its_location() {
    let folder = "tests/scoring/definitions/faults";
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = entries.filter(|path| path.extension().is_some_and(|ending| ending == "toml")).collect();
    files.sort();
    assert!(files.len() >= 20, "only {} files in {folder}", files.len());
    for file in files {
        let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
        let told = match Definitions::load(file.to_str().unwrap(), &schema_columns()) {
            Ok(_) => panic!("{name} has no fault"),
            Err(error) => error.to_string(),
        };
        let mut settings = insta::Settings::clone_current();
        settings.set_snapshot_path("faults");
        settings.set_prepend_module_to_snapshot(false);
        settings.set_omit_expression(true);
        settings.bind(|| insta::assert_snapshot!(name, told));
    }
}

#[test]
fn an_empty_file_has_no_fault() {
    for text in ["", "\n\n", "# words\n", "[let]\n", "open = true\n", "include = []\n", "[let]\nunused = \"t\"\n"] {
        let definitions = check(text).unwrap_or_else(|error| panic!("{text:?}: {error}"));
        assert!(definitions.catalog.metric.is_empty());
    }
}

#[test]
fn a_literal_that_a_column_may_have_is_accepted() {
    for text in [
        "action = 'turn_left'",
        "'truncated' <> reply_status",
        "action in ('done', null)",
        "at(action, 1) is not distinct from 'done'",
        "coalesce(action, 'none') = 'none'",
        "case when bumped then action else 'stopped' end in ('stopped', 'done')",
        // Any text may be used in an ordering comparison.
        "action between 'turn' and 'turn~'",
        "action >= 'turn'",
        // These columns accept any text.
        "self_color = 'turquoise'",
        "experiment = 'E6'",
        "coalesce(action, summary) = 'jump'",
        "regexp_like(action, '^jump')",
        // No column determines the valid texts here.
        "case when bumped then 'a' else 'b' end = 'c'",
    ] {
        with_expression(text).unwrap_or_else(|error| panic!("{text}: {error}"));
    }
}

#[test]
fn a_file_that_is_not_text_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    };
    let load = |path: &Path| {
        let error = Definitions::load(path.to_str().unwrap(), &schema_columns()).unwrap_err();
        format!("{error}: {}", error.source().map_or_else(String::new, ToString::to_string))
    };
    let told = load(&write("latin.toml", b"[let]\na = \"\xe9\"\n"));
    assert!(told.contains("latin.toml") && told.contains("UTF-8"), "{told}");
    let told = load(folder.path());
    assert!(told.contains("cannot read the definition file"), "{told}");
    let told = load(&write("zero.toml", b"\0\0\0"));
    assert!(told.contains("not TOML"), "{told}");
}

#[test]
fn includes_are_followed_relative_to_the_file_and_later_ones_win() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("below")).unwrap();
    fs::write(folder.path().join("below/base.toml"), "[let]\nx = \"1\"\n[metric.X]\nvalue = \"x\"\n").unwrap();
    let top = folder.path().join("top.toml");
    fs::write(&top, "include = [\"paper\", \"below/base.toml\"]\n[let]\nx = \"2\"\n").unwrap();
    let definitions = Definitions::load(top.to_str().unwrap(), &schema_columns()).unwrap();
    assert_eq!(definitions.catalog.lets["x"], "2");
    assert_eq!(definitions.catalog.metric.keys().last().unwrap(), "X");
    assert_eq!(definitions.catalog.metric.len(), 11);

    // A circular include is reported with its path, without absolute paths beyond the one typed.
    fs::write(folder.path().join("below/base.toml"), "include = [\"../top.toml\"]\n").unwrap();
    let told = Definitions::load(top.to_str().unwrap(), &schema_columns()).unwrap_err().to_string();
    assert!(told.contains("the include leads back to itself"), "{told}");
    assert_eq!(told.matches("error:").count(), 1, "{told}");
}

#[test]
fn depth_and_length_are_refused_and_never_overflow() {
    let nested = |depth: usize| format!("{}t{}", "sum(".repeat(depth), ")".repeat(depth));
    assert!(with_expression(&nested(30)).is_ok(), "what is bound once is bound fast");
    let repeated = |open: &str, close: &str| format!("{}t = 1{}", open.repeat(30_000), close.repeat(30_000));
    for text in [
        nested(3000),
        repeated("(", ")"),
        repeated("not ", ""),
        repeated("- ", ""),
        repeated("case when ", " then true end"),
        repeated("t = 1 and ", ""),
        repeated("any(", ")"),
        "x".repeat(1 << 20),
        "'".repeat(9999),
        "(".repeat(15_000),
        "t+".repeat(7000) + "t",
        "t or ".repeat(3000) + "t",
        format!("t in ({}1)", "1, ".repeat(5000)),
    ] {
        // Long lists are allowed; this only checks that there is an answer.
        let _ = with_expression(&text).map_err(|error| error.to_string());
    }
    // Each definition refers to the next one, so reading the first leads down to the last.
    let chain = |length: usize| {
        let lets: Vec<_> = (0..length).map(|at| format!("a{at} = \"(((a{} + 1)))\"", at + 1)).collect();
        check(&format!("[let]\n{}\na{length} = \"1\"\n[metric.X]\nvalue = \"a0\"\n", lets.join("\n")))
    };
    assert!(chain(100).is_ok());
    let told = chain(5000).map(|_| ()).unwrap_err().to_string();
    assert!(told.contains("nested too deeply"), "{}", &told[..told.len().min(500)]);
    // In the opposite order nothing nests: each definition refers to a known one.
    let lets: Vec<_> = (1..5000).map(|at| format!("a{at} = \"a{} + 1\"", at - 1)).collect();
    assert!(check(&format!("[let]\na0 = \"1\"\n{}\n", lets.join("\n"))).is_ok());
}

/// The words of expressions in random order.
fn soup() -> impl Strategy<Value = String> {
    let words = vec![
        "any",
        "(",
        ")",
        "all",
        "first",
        "case",
        "when",
        "then",
        "else",
        "end",
        "t",
        "'",
        "\"",
        "1",
        "-",
        "=",
        "<",
        "and",
        "or",
        "not",
        "is",
        "null",
        "in",
        ",",
        "between",
        "distinct",
        "from",
        "TSA",
        "\"TSA-C\"",
        "self_color",
        "coalesce",
        "at",
        "length()",
        "'é",
        "--",
        "/*",
        "*/",
        "\n",
        "::",
        "[",
        "]",
        "{",
        "}",
        "::int",
        "select",
        "cast",
        "as",
        "over",
        "interval",
        "exists",
        "$1",
        "?",
        ":x",
        "@",
        "e'\\n'",
        "x'0'",
        "1e9",
        ".5",
        "..",
        "*",
        "/",
        "%",
        "||",
        "true",
        "regexp_like",
        "div",
        "nullif",
        ";",
        "like",
        "escape",
        "collate",
        "at time zone",
        "lambda",
        "->",
        "array",
    ];
    vec((select(words), select(vec!["", " "])), 0..24)
        .prop_map(|words| words.into_iter().flat_map(|(word, gap)| [word, gap]).collect())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn words_in_any_order_are_answered(text in soup()) {
        if let Err(error) = with_expression(&text) {
            prop_assert!(!error.to_string().is_empty());
        }
    }

    #[test]
    fn any_text_is_answered(text in "\\PC*", toml in "[a-z\\[\\]=\"'.,{}\n# é]*") {
        let _ = with_expression(&text).map_err(|error| error.to_string());
        let _ = check(&toml).map_err(|error| error.to_string());
        let _ = check(&text).map_err(|error| error.to_string());
    }

    #[test]
    fn any_bytes_in_a_file_are_answered(bytes in vec(any::<u8>(), 0..200)) {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), &bytes).unwrap();
        let loaded = Definitions::load(file.path().to_str().unwrap(), &schema_columns());
        let _ = loaded.map_err(|error| error.to_string());
    }
}
