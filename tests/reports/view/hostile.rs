//! Names and texts that look like markup or script or that reorder letters, and texts of megabytes.

use std::path::Path;

use serde_json::json;

use crate::harness::program::run;
use crate::html::browser::Browser;
use crate::view::Server;
use crate::view::pages::until;

const MODEL: &str = "<img src=x onerror=\"window.pwned=1\">\u{202e}fdp.exe</td></a>'\"&lt;{{7*7}}";
const ID: &str = "E1/<script>window.pwned=1</script>\u{2067}#?&%2e%2e/s1/r1";
const PIECE: &str = "</p></script><script>window.pwned = 1</script>\u{202e}txt.exe & <b>bold</b>\n";
/// This many pieces make more than three megabytes.
const PIECES: usize = 45_000;

/// A trace of one episode with too long a text.
fn write(folder: &Path) {
    let step = |t: u64, action: &str, reasoning: String| {
        json!({
            "episode_id": ID, "model": MODEL, "experiment": "E1", "seed": 1, "run": 1, "body_color": "red", "t": t,
            "action": action, "self_color": "red", "selected_cube": if action == "done" { "red" } else { "none" },
            "mirror_visible": true, "pose_x": 0.5, "pose_y": t, "pose_yaw": 90, "reasoning": reasoning,
            "identification": PIECE, "reply_status": "ok", "summary": "\u{7}\u{1b}[31mred\u{0}",
        })
    };
    let lines = [step(1, "turn_left", PIECE.repeat(PIECES)), step(2, "done", String::new())];
    std::fs::write(folder.join("steps.jsonl"), lines.map(|line| line.to_string()).join("\n")).unwrap();
    run(folder, &["import", "steps.jsonl", "-o", "hostile.parquet"]).done();
}

/// A text of [`PIECE`]s as the reader sees it.
fn shown(pieces: usize) -> String {
    let piece = PIECE.trim_end().replace('\u{202e}', "\\u{202e}");
    vec![piece; pieces].join("\n")
}

fn looked_at(browser: &mut Browser) {
    until(browser, "document.querySelector('#table-main tbody th')");
    let model = browser.text("document.querySelector('#table-main tbody th[scope=row]').textContent");
    assert_eq!(model, MODEL.replace('\u{202e}', "\\u{202e}"));
    browser.click("#table-main td[data-metric] a");
    until(browser, "document.querySelector('.list .rows a')");
    browser.click(".list .rows a");
    until(browser, "document.querySelector('svg.map .here')");
    browser.press("Home");
    until(browser, "document.querySelector('.step [data-column=reasoning]')");
    let head = browser.text("document.querySelector('h1').textContent");
    assert_eq!(head, ID.replace('\u{2067}', "\\u{2067}"));
    let said = "document.querySelector('.step [data-column=reasoning]').textContent";
    let whole = shown(PIECES);
    assert!(whole.starts_with(&browser.text(said)));
    if browser.holds("document.querySelector('.words button') !== null") {
        browser.click(".words button");
        until(browser, &format!("{said}.length > 3000000"));
    }
    assert!(browser.text(said) == whole, "the whole text as text");
    assert_eq!(browser.text("document.querySelector('.step [data-column=identification]').textContent"), shown(1));
    browser.press("ArrowRight");
    until(browser, "document.querySelector('.clock').textContent.startsWith('t = 2 ')");
    let notes = browser.text("document.querySelector('.step [data-column=summary]').textContent");
    assert_eq!(notes, r"\u{7}\u{1b}[31mred\u{0}");
    assert!(browser.holds(
        "window.pwned === undefined && document.querySelector('.step b, .step script, main img[src=x]') === null"
    ));
}

#[test]
fn hostile_names_and_huge_texts_are_shown_as_text() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let server = Server::start(folder.path(), &["hostile.parquet"]);
    let mut browser = Browser::at(&server.link);
    looked_at(&mut browser);
    browser.close();
}

#[test]
fn a_copy_shows_hostile_names_and_huge_texts_as_text() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    run(folder.path(), &["view", "hostile.parquet", "--export", "page"]).done();
    let mut browser = Browser::at(&format!("file://{}/index.html", folder.path().join("page").display()));
    looked_at(&mut browser);
    browser.close();
}
