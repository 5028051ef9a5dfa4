//! Values of a trace of another domain are shown unchanged, and absent ones are not shown.

use std::fs::{self, File};
use std::path::Path;
use std::sync::Arc;

use arrow::array::{
    ArrayRef, BooleanArray, Decimal128Array, Float32Array, Float64Array, Int32Array, Int64Array, RecordBatch,
    StringArray, TimestampNanosecondArray, UInt64Array,
};
use parquet::arrow::ArrowWriter;
use serde_json::{Value, json};

use crate::harness::program::run;
use crate::html::browser::Browser;
use crate::view::Server;
use crate::view::accessible::check;
use crate::view::pages::until;

const DEFINITIONS: &str = r#"
domain = "robots"

[column.success]
type = "bool"
help = "The task is solved at this step."

[column.ticket]
type = "int"
help = "The number of the order."

[metric.SUCCESS]
title = "Success rate"
value = "any(success)"
better = "higher"
help = "The task is solved."

[metric.FAULT]
title = "Fault rate"
value = "not any(success)"
better = "lower"
help = "The task is not solved."

[metric.TICKET]
title = "Ticket"
value = "max(ticket)"
unit = "tickets"
help = "The largest ticket."
"#;

/// Two neighbours that are one number in JavaScript.
const TICKETS: [i64; 2] = [9_007_199_254_740_993, 9_007_199_254_740_992];

/// Two episodes of two steps; the first succeeds.
fn write(folder: &Path) {
    fs::write(folder.join("own.toml"), DEFINITIONS).unwrap();
    let columns: [(&str, ArrayRef); 14] = [
        ("episode_id", Arc::new(StringArray::from(vec!["a", "a", "b", "b"]))),
        ("model", Arc::new(StringArray::from(vec!["act", "act", "bc", "bc"]))),
        ("experiment", Arc::new(StringArray::from(vec!["pusht"; 4]))),
        ("seed", Arc::new(Int32Array::from(vec![1; 4]))),
        ("run", Arc::new(Int32Array::from(vec![1; 4]))),
        ("t", Arc::new(Int32Array::from(vec![1, 2, 1, 2]))),
        ("success", Arc::new(BooleanArray::from(vec![false, true, false, false]))),
        ("ticket", Arc::new(Int64Array::from(vec![TICKETS[0], i64::MIN, TICKETS[1], 0]))),
        ("hash", Arc::new(UInt64Array::from(vec![Some(u64::MAX), None, Some(0), Some(1 << 63)]))),
        ("price", Arc::new(Decimal128Array::from(vec![12_345_678_901_234_567_890_i128, -5, 0, 100]))),
        ("score", Arc::new(Float64Array::from(vec![0.1 + 0.2, 1e-300, f64::NAN, f64::INFINITY]))),
        ("weight", Arc::new(Float32Array::from(vec![0.1, 16_777_216.0, 1e30, -0.5]))),
        ("at", Arc::new(TimestampNanosecondArray::from(vec![1, 1_700_000_000_123_456_789, 0, -1]))),
        ("name", Arc::new(StringArray::from(vec!["007", "red", "1e3", ""]))),
    ];
    let rows = RecordBatch::try_from_iter(columns).unwrap();
    let file = File::create(folder.join("own.parquet")).unwrap();
    let mut writer = ArrowWriter::try_new(file, rows.schema(), None).unwrap();
    writer.write(&rows).unwrap();
    writer.close().unwrap();
}

const ARGUMENTS: [&str; 3] = ["own.parquet", "--definitions", "own.toml"];

fn expected() -> Vec<(&'static str, Value)> {
    vec![
        ("ticket", json!(["9007199254740993", "-9223372036854775808"])),
        ("hash", json!(["18446744073709551615", null])),
        ("price", json!(["1234567890.1234567890", "-0.0000000005"])),
        ("score", json!(["0.30000000000000004", "1e-300"])),
        ("weight", json!(["0.1", "16777216"])),
        ("at", json!(["1970-01-01T00:00:00.000000001", "2023-11-14T22:13:20.123456789"])),
        ("name", json!(["007", "red"])),
    ]
}

#[test]
fn every_value_is_shown_as_it_is_stored() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let server = Server::start(folder.path(), &ARGUMENTS);
    let told = server.get("/api/episode?id=a").json();
    for (name, values) in expected() {
        assert_eq!(told["steps"][name]["values"], values, "{name}");
    }
    assert_eq!(server.get("/api/episode?id=b").json()["steps"]["score"]["values"], json!(["NaN", "inf"]));
    run(folder.path(), &[&["view"], ARGUMENTS.as_slice(), &["--export", "page"]].concat()).done();
    let copy = format!("file://{}/index.html", folder.path().join("page").display());
    for base in [&server.link, &copy] {
        let mut browser = Browser::at(&format!("{base}?view=episode&id=a&t=1"));
        until(&mut browser, "document.querySelector('.panel .step')");
        for (name, values) in expected() {
            let shown = browser.text(&format!("document.querySelector('.step [data-column={name}]').textContent"));
            assert_eq!(json!(shown), values[0], "{base}: {name}");
        }
        browser.close();
    }
}

#[test]
fn large_numbers_are_sorted_and_filtered_exactly() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let server = Server::start(folder.path(), &ARGUMENTS);
    run(folder.path(), &[&["view"], ARGUMENTS.as_slice(), &["--export", "page"]].concat()).done();
    let copy = format!("file://{}/index.html", folder.path().join("page").display());
    for base in [&server.link, &copy] {
        for (query, expected) in [
            ("sort=TICKET", vec!["b", "a"]),
            ("sort=TICKET&order=descending", vec!["a", "b"]),
            ("where=TICKET+%3D+9007199254740993", vec!["a"]),
            ("where=TICKET+%3C+9007199254740993", vec!["b"]),
            ("where=TICKET+in+(9007199254740992,+5)", vec!["b"]),
        ] {
            let mut browser = Browser::at(&format!("{base}?view=episodes&{query}"));
            until(&mut browser, "document.querySelector('.list .rows a')");
            let ids = browser.texts("[...document.querySelectorAll('.list .rows a')].map((row) => row.dataset.id)");
            assert_eq!(ids, expected, "{base} {query}");
            browser.close();
        }
    }
}

#[test]
fn an_episode_of_another_domain_has_no_empty_boxes_and_no_scene() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let server = Server::start(folder.path(), &ARGUMENTS);
    let mut browser = Browser::at(&format!("{}?view=episode&id=a", server.link));
    until(&mut browser, "document.querySelector('.panel .step')");
    assert_eq!(browser.value("document.querySelector('.sights').offsetHeight"), 0);
    let text = browser.text("document.querySelector('main').textContent");
    assert!(text.contains("All 2 of seed 1, run 1") && !text.contains("scene"), "{text}");
    check(&mut browser, "an episode of another domain");
    browser.close();
}

#[test]
fn the_list_tells_pass_from_fail_by_more_than_colour() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let server = Server::start(folder.path(), &ARGUMENTS);
    let mut browser = Browser::at(&format!("{}?view=episodes", server.link));
    until(&mut browser, "document.querySelector('.list .rows a')");
    let signs = "[...document.querySelectorAll('.list .rows a')].map((row) => [...row.querySelectorAll('[role=img]')].map((sign) => sign.ariaLabel + sign.textContent).join(' '))";
    assert_eq!(browser.texts(signs), ["pass✓ pass✓", "fail✗ fail✗"]);
    let values = "[...document.querySelectorAll('.list .rows a')].map((row) => row.lastChild.textContent)";
    assert_eq!(browser.texts(values), TICKETS.map(|ticket| ticket.to_string()));
    check(&mut browser, "a list with signs");
    browser.close();
}

/// A log where recordings write, and no trace.
#[test]
fn a_recording_without_a_finished_episode_is_no_error() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir_all(folder.path().join("runs/.parts")).unwrap();
    fs::copy(Path::new(super::RECORDED).join("E1-guesser.mcap"), folder.path().join("runs/.parts/log")).unwrap();
    let server = Server::start(folder.path(), &["runs"]);
    for query in ["", "?view=episodes"] {
        let mut browser = Browser::at(&format!("{}{query}", server.link));
        until(&mut browser, "document.querySelector('#nothing-yet')");
        assert!(browser.holds("document.querySelector('.notice, [role=alert]') === null"), "{query}");
        check(&mut browser, query);
        browser.close();
    }
    assert_eq!(server.get("/api/episodes").json()["total"], 0);
}
