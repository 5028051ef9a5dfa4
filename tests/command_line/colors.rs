//! Colours are checked by every command that reads their values: refusals, their messages, and notes.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanArray, Int32Array, RecordBatch, StringArray};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use serde_json::{Value, json};

use crate::harness::traces::write_rows;
use crate::{Answer, fixture, run};

/// The colour columns of a trace with one episode of four steps.
#[derive(Clone, Copy)]
struct Colors {
    episode: &'static str,
    body: [&'static str; 4],
    claims: [Option<&'static str>; 4],
    cubes: [Option<&'static str>; 4],
    stated: Option<&'static str>,
}

/// Colours that every rule accepts.
const SOUND: Colors = Colors {
    episode: "e",
    body: ["red"; 4],
    claims: [None, Some("unknown"), Some("red"), Some("red")],
    cubes: [Some("none"), None, Some("blue"), Some("red")],
    stated: Some("blue"),
};

/// The sound colours with a text in one column: in all rows if the column is constant, else at t = 3.
fn with(column: &str, text: &'static str) -> Colors {
    let mut colors = SOUND;
    match column {
        "body_color" => colors.body = [text; 4],
        "self_color" => colors.claims[2] = Some(text),
        "selected_cube" => colors.cubes[2] = Some(text),
        "stated_color" => colors.stated = Some(text),
        _ => panic!("no column of colours: {column}"),
    }
    colors
}

/// Writes a trace with these colours, valid or not; `recording` goes into the footer.
fn write(path: &Path, colors: Colors, recording: Option<&str>) {
    let texts = |text: &str| -> ArrayRef { Arc::new(StringArray::from(vec![text; 4])) };
    let cells = |cells: [Option<&str>; 4]| -> ArrayRef { Arc::new(StringArray::from(cells.to_vec())) };
    let ints = |values: [i32; 4]| -> ArrayRef { Arc::new(Int32Array::from(values.to_vec())) };
    let seen: ArrayRef = Arc::new(BooleanArray::from(vec![false, true, true, false]));
    let columns = [
        ("episode_id", texts(colors.episode)),
        ("model", texts("m")),
        ("experiment", texts("E1")),
        ("seed", ints([1; 4])),
        ("run", ints([1; 4])),
        ("body_color", cells(colors.body.map(Some))),
        ("t", ints([1, 2, 3, 4])),
        ("action", cells([Some("turn_left"), Some("turn_left"), Some("move_forward"), Some("done")])),
        ("self_color", cells(colors.claims)),
        ("selected_cube", cells(colors.cubes)),
        ("mirror_visible", seen),
        ("stated_color", cells([colors.stated; 4])),
    ];
    let batch = RecordBatch::try_from_iter_with_nullable(columns.map(|(name, values)| (name, values, true))).unwrap();
    let pair = recording.map(|text| vec![KeyValue::new("mirrorstats.recording".to_owned(), text.to_owned())]);
    let properties = WriterProperties::builder().set_key_value_metadata(pair).build();
    write_rows(path, &[batch], Some(properties));
}

/// The findings of `validate --json`, and its exit code.
fn findings(folder: &Path, traces: &[&str]) -> (i32, Vec<Value>) {
    let answer = run(folder, &[&["trace", "validate", "--json"], traces].concat());
    let report: Value = serde_json::from_str(&answer.stdout).unwrap();
    (answer.code, report["findings"].as_array().unwrap().clone())
}

/// The message of the commands that read the traces' values, which must be the same for all.
fn refused(folder: &Path, traces: &[&str]) -> String {
    let by = ["--by", "experiment,model,stated_color"];
    let of = |before: &[&str], after: &[&str]| run(folder, &[before, traces, after].concat()).refused();
    let message = of(&["report", "--out", "out"], &by);
    for (before, after) in [(&["stats"][..], &by[..]), (&["report", "--out", "out", "--threads", "1"], &by)] {
        assert_eq!(of(before, after), message, "{before:?}");
    }
    assert!(!folder.join("out").exists());
    message
}

/// Misspelled colours: the text, how messages show it, and the help.
const MISSPELLED: [(&str, &str, &str); 12] = [
    ("r\u{435}d", "`r\u{435}d`", "did you mean `red`? its `\u{435}` is U+0435, which only looks like `e`"),
    ("t\u{435}al", "`t\u{435}al`", "did you mean `teal`? its `\u{435}` is U+0435, which only looks like `e`"),
    (
        "\u{433}\u{435}\u{501}",
        "`\u{433}\u{435}\u{501}`",
        "did you mean `red`? its `\u{433}` is U+0433, which only looks like `r`",
    ),
    ("Red", "`Red`", "did you mean `red`?"),
    ("BLUE", "`BLUE`", "did you mean `blue`?"),
    (" red", "` red`", "did you mean `red`?"),
    ("red ", "`red `", "did you mean `red`?"),
    ("red\u{a0}", "`red\\u{a0}`", "did you mean `red`?"),
    ("re d", "`re d`", "did you mean `red`?"),
    ("Dark  Teal", "`Dark  Teal`", "did you mean `dark teal`?"),
    ("dark\u{a0}teal", "`dark\\u{a0}teal`", "did you mean `dark teal`?"),
    ("\u{200b}red\n", "`\\u{200b}red\\u{a}`", "did you mean `red`?"),
];

/// Words that are invalid in a column, and the help.
const MISPLACED: [(&str, &str, &str); 11] = [
    ("body_color", "none", "give the true colour of the body"),
    ("body_color", "unknown", "give the true colour of the body"),
    ("body_color", "Unknown", "give the true colour of the body"),
    ("stated_color", "none", "null where no colour was stated"),
    ("stated_color", "UNKNOWN", "null where no colour was stated"),
    ("self_color", "none", "`unknown`, or null where the reply gave none"),
    ("self_color", "None", "`unknown`, or null where the reply gave none"),
    ("self_color", "Unknown", "did you mean `unknown`?"),
    ("selected_cube", "unknown", "`none`, or null where the reply gave none"),
    ("selected_cube", "Unknown", "`none`, or null where the reply gave none"),
    ("selected_cube", "NONE", "did you mean `none`?"),
];

/// Checks the messages of `validate` and of every command that scores, for one text in one column.
fn check(column: &str, text: &'static str, shown: &str, help: &str) {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("a.parquet"), with(column, text), None);
    let (code, found) = findings(folder.path(), &["a.parquet"]);
    assert_eq!((code, found.len()), (1, 1), "{column} {text:?}: {found:?}");
    let constant = ["body_color", "stated_color"].contains(&column);
    let (t, more) = if constant { (1, " (and 3 more rows of the episode break this rule)") } else { (3, "") };
    assert_eq!(found[0]["code"], "invalid-color");
    assert_eq!(found[0]["severity"], "error");
    assert_eq!((&found[0]["episode"], &found[0]["t"], &found[0]["column"]), (&json!("e"), &json!(t), &json!(column)));
    assert_eq!(found[0]["found"], format!("{shown}{more}"));
    assert_eq!(found[0]["help"], help);
    let message = refused(folder.path(), &["a.parquet"]);
    let words = format!("invalid-color: a.parquet, row group 0, episode `e`, t = {t}, column `{column}`\n  expected");
    let end = format!("\n  found {shown}{more}\n  help: {help}\n");
    assert!(message.contains(&words) && message.ends_with(&end), "{message}");
    if column != "stated_color" {
        // The paper's metrics read the other three columns.
        assert_eq!(run(folder.path(), &["score", "a.parquet"]).refused(), message);
    }
}

#[test]
fn a_color_in_another_spelling_is_refused_in_every_column() {
    for column in ["body_color", "self_color", "selected_cube", "stated_color"] {
        for (text, shown, help) in MISSPELLED {
            check(column, text, shown, help);
        }
    }
}

#[test]
fn a_special_word_is_refused_in_other_columns() {
    for (column, text, help) in MISPLACED {
        check(column, text, &format!("`{text}`"), help);
    }
}

#[test]
fn an_empty_text_is_refused_in_every_column() {
    for column in ["body_color", "self_color", "selected_cube", "stated_color"] {
        let folder = tempfile::tempdir().unwrap();
        write(&folder.path().join("a.parquet"), with(column, ""), None);
        let (code, found) = findings(folder.path(), &["a.parquet"]);
        assert_eq!((code, &found[0]["code"], found.len()), (1, &json!("empty-string"), 1), "{column}");
        assert!(refused(folder.path(), &["a.parquet"]).contains("empty-string: a.parquet"), "{column}");
    }
}

#[test]
fn colors_of_another_palette_are_taken() {
    let folder = tempfile::tempdir().unwrap();
    let foreign = Colors { body: ["dark teal"; 4], stated: Some("grün"), ..SOUND };
    write(&folder.path().join("a.parquet"), foreign, None);
    assert_eq!(findings(folder.path(), &["a.parquet"]), (0, Vec::new()));
    run(folder.path(), &["score", "a.parquet"]).done();
    // The invalid column is not read, so the command succeeds.
    write(&folder.path().join("b.parquet"), with("self_color", "Red"), None);
    run(folder.path(), &["score", "b.parquet", "--metrics", "MCR"]).done();
}

#[test]
fn one_color_has_one_spelling_in_all_inputs() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let body = Colors { body: ["light blue"; 4], claims: [None; 4], ..SOUND };
    write(&at.join("a.parquet"), body, None);
    let claim = Colors { episode: "f", claims: [None, Some("lightblue"), None, Some("lightblue")], ..SOUND };
    write(&at.join("b.parquet"), claim, None);
    let (code, found) = findings(at, &["a.parquet", "b.parquet"]);
    assert_eq!((code, found.len()), (1, 1), "{found:?}");
    assert_eq!((&found[0]["code"], &found[0]["file"]), (&json!("invalid-color"), &json!("b.parquet")));
    assert_eq!((&found[0]["episode"], &found[0]["t"]), (&json!("f"), &json!(2)));
    assert_eq!(
        (&found[0]["found"], &found[0]["help"]),
        (&json!("`lightblue` (in 2 rows)"), &json!("did you mean `light blue`?"))
    );
    for traces in [["a.parquet", "b.parquet"], ["b.parquet", "a.parquet"]] {
        let message = refused(at, &traces);
        assert!(message.contains("b.parquet, row group 0, episode `f`, t = 2, column `self_color`"), "{message}");
        assert_eq!(run(at, &[&["score"][..], &traces].concat()).refused(), message);
    }
    // Neither trace alone has a contradiction.
    for trace in ["a.parquet", "b.parquet"] {
        run(at, &["score", trace]).done();
    }
}

#[test]
fn a_claimed_color_that_nothing_has_is_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let claims = Colors { claims: [Some("unknown"), Some("teal"), Some("teal"), Some("red")], ..SOUND };
    write(&at.join("a.parquet"), claims, None);
    let more = Colors { episode: "f", claims: [Some("teal"), None, None, Some("gren")], ..SOUND };
    write(&at.join("b.parquet"), more, None);
    let (code, found) = findings(at, &["a.parquet", "b.parquet"]);
    let told: Vec<_> = found
        .iter()
        .map(|found| {
            assert_eq!((&found["code"], &found["severity"]), (&json!("unseen-color"), &json!("note")));
            let place = ["file", "episode", "column", "found"].map(|key| found[key].as_str().unwrap());
            (place, found["t"].as_i64().unwrap())
        })
        .collect();
    assert_eq!(code, 0);
    let expected = [
        (["a.parquet", "e", "self_color", "`teal` in 3 rows, first in this one"], 2),
        (["b.parquet", "f", "self_color", "`gren` in 1 row, first in this one"], 4),
    ];
    assert_eq!(told, expected);
    let text = run(at, &["trace", "validate", "a.parquet", "b.parquet"]).done();
    assert!(text.contains("unseen-color: a.parquet, row group 0, episode `e`, t = 2, column `self_color`"), "{text}");
    assert!(text.ends_with("0 errors, 2 notes\n"), "{text}");
    // A body of that colour in any input is enough.
    write(&at.join("c.parquet"), Colors { episode: "g", body: ["teal"; 4], claims: [None; 4], ..SOUND }, None);
    let (_, found) = findings(at, &["a.parquet", "b.parquet", "c.parquet"]);
    assert_eq!(found.len(), 1, "{found:?}");
    run(at, &["score", "a.parquet", "b.parquet"]).done();
}

#[test]
fn only_colors_declared_in_the_footer_are_valid() {
    let palette = r#"{"palette":["teal","magenta"],"seeds":[1]}"#;
    let sound = Colors {
        body: ["teal"; 4],
        claims: [None, Some("unknown"), Some("magenta"), Some("teal")],
        cubes: [Some("none"), None, None, Some("teal")],
        stated: None,
        ..SOUND
    };
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(&at.join("a.parquet"), sound, Some(palette));
    assert_eq!(findings(at, &["a.parquet"]), (0, Vec::new()));
    let scores = run(at, &["score", "a.parquet"]).done();
    for (claim, help) in [
        ("Teal", "did you mean `teal`?"),
        ("magneta", "did you mean `magenta`?"),
        ("red", "use a name of the palette, or add the colour to the palette"),
        ("none", "`unknown`, or null where the reply gave none"),
    ] {
        write(&at.join("b.parquet"), Colors { claims: [None, None, None, Some(claim)], ..sound }, Some(palette));
        let (code, found) = findings(at, &["b.parquet"]);
        assert_eq!((code, found.len(), &found[0]["code"]), (1, 1, &json!("invalid-color")), "{claim}");
        assert_eq!(found[0]["expected"], "a colour of the palette (teal, magenta), `unknown`, or null");
        assert_eq!(found[0]["help"], help);
        let message = refused(at, &["b.parquet"]);
        assert!(message.contains(&format!("found `{claim}`\n  help: {help}")), "{message}");
        assert_eq!(run(at, &["score", "b.parquet"]).refused(), message);
    }
    // A palette applies to its own file only.
    write(&at.join("c.parquet"), Colors { episode: "c", ..SOUND }, None);
    assert_eq!(findings(at, &["a.parquet", "c.parquet"]), (0, Vec::new()));
    assert!(run(at, &["score", "a.parquet", "c.parquet"]).done().starts_with(scores.lines().next().unwrap()));
    write(&at.join("d.parquet"), sound, Some(r#"{"palette":["Teal"]}"#));
    let message = run(at, &["score", "d.parquet"]).refused();
    assert!(
        message.contains("invalid-metadata: d.parquet\n  expected `palette` in `mirrorstats.recording`"),
        "{message}"
    );
    assert_eq!(findings(at, &["d.parquet"]).1[0]["code"], "invalid-metadata");
}

/// A file whose dictionary has the entry `Red`, which no row uses: the bitwise AND of two files that differ only in the
/// row with `Red`.
fn with_unused_entry(folder: &Path, colors: &[Colors; 2]) -> Vec<u8> {
    let [one, other] = (*colors).map(|colors| {
        let path = folder.join("part.parquet");
        write(&path, colors, None);
        fs::read(&path).unwrap()
    });
    assert!(one != other && one.len() == other.len());
    one.iter().zip(&other).map(|(a, b)| a & b).collect()
}

#[test]
fn an_entry_of_a_dictionary_that_no_row_has_is_not_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let plain = Colors { claims: [Some("red"); 4], cubes: [Some("red"); 4], ..SOUND };
    let body = |row: usize| {
        let mut body = ["red"; 4];
        body[row] = "Red";
        Colors { body, ..plain }
    };
    let cells = |row: usize| {
        let mut cells = [Some("red"); 4];
        cells[row] = Some("Red");
        cells
    };
    write(&at.join("plain.parquet"), plain, None);
    let scores = run(at, &["score", "plain.parquet"]).done();
    for (column, colors) in [
        ("body_color", [1, 2].map(body)),
        ("self_color", [1, 2].map(|row| Colors { claims: cells(row), ..plain })),
        ("selected_cube", [1, 2].map(|row| Colors { cubes: cells(row), ..plain })),
    ] {
        let bytes = with_unused_entry(at, &colors);
        assert!(bytes.windows(3).any(|text| text == b"Red"), "{column}: the entry is gone");
        fs::write(at.join("unused.parquet"), bytes).unwrap();
        assert_eq!(findings(at, &["unused.parquet"]), (0, Vec::new()), "{column}");
        assert_eq!(run(at, &["score", "unused.parquet"]).done(), scores, "{column}");
    }
}

#[test]
fn the_fixtures_keep_the_rules() {
    let Answer { code, stdout, .. } =
        run(&fixture(""), &["trace", "validate", "paper", "recorded", "glimpses.parquet"]);
    assert_eq!(code, 0, "{stdout}");
    assert!(stdout.ends_with("0 errors, 0 notes\n"), "{stdout}");
}
