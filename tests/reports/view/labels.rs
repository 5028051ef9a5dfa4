//! Labels and notes: entered in the page, stored beside the traces, shown in the list and in a copy.

use std::path::Path;

use serde_json::{Value, json};

use crate::harness::program::{run, wait_for};
use crate::html::browser::Browser;
use crate::view::accessible::check;
use crate::view::pages::until;
use crate::view::{RECORDED, Response, Server};

const ID: &str = "E1/guesser/s1/r1";

/// Copies the recorded episodes of E1 into a writable folder.
fn runs(folder: &Path) {
    std::fs::create_dir(folder.join("runs")).unwrap();
    for entry in std::fs::read_dir(RECORDED).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap();
        if name.to_string_lossy().starts_with("E1-") {
            std::fs::copy(&path, folder.join("runs").join(name)).unwrap();
        }
    }
}

fn list(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("runs/labels.jsonl")).unwrap_or_default()
}

fn post(server: &Server, label: &Value) -> Response {
    let host = format!("127.0.0.1:{}", server.port);
    server.ask("POST", "/label", &[("Host", &host), ("Origin", &format!("http://{host}"))], &label.to_string())
}

#[test]
fn a_label_persists_after_a_reload_and_in_a_copy() {
    let folder = tempfile::tempdir().unwrap();
    runs(folder.path());
    let server = Server::start(folder.path(), &["runs", "--label", "ann"]);
    let page = format!("{}?view=episode&id={ID}&t=2", server.link);
    let mut browser = Browser::at(&page);
    until(&mut browser, "document.querySelector('.labels .put')");
    browser.press("l");
    until(&mut browser, "document.querySelector('dialog#label[open]')");
    check(&mut browser, "the box of labels");
    browser.send("Emulation.clearDeviceMetricsOverride", &json!({}));
    browser.value("document.querySelector('#label [name=label]').value = 'confabulates'");
    browser.value("document.querySelector('#label [name=note]').value = 'names a colour that <b>nobody</b> saw'");
    browser.click("#label input[value=step]");
    browser.click("#label button[type=submit]");
    until(&mut browser, "document.querySelector('.marks li')");
    let marks = "[...document.querySelectorAll('.marks li')].map((mark) => mark.textContent)";
    let expected = ["confabulates t = 2 names a colour that <b>nobody</b> saw ann×"];
    assert_eq!(browser.texts(marks), expected);
    check(&mut browser, "an episode with a label");
    browser.close();
    let line: Value = serde_json::from_str(list(folder.path()).trim_end()).unwrap();
    let note = "names a colour that <b>nobody</b> saw";
    assert_eq!(line, json!({"coder": "ann", "episode_id": ID, "step": 2, "label": "confabulates", "note": note}));
    let mut again = Browser::at(&page);
    until(&mut again, "document.querySelector('.marks li')");
    assert_eq!(again.texts(marks), expected);
    // The box refuses an invalid word.
    again.press("l");
    until(&mut again, "document.querySelector('dialog#label[open]')");
    assert_eq!(
        again.texts("[...document.querySelectorAll('#label-words option')].map((own) => own.value)"),
        ["confabulates"]
    );
    again.press("Escape");
    until(&mut again, "document.querySelector('dialog[open]') === null");
    again.close();
    run(folder.path(), &["view", "runs", "--export", "page"]).done();
    let mut copy =
        Browser::at(&format!("file://{}/index.html?view=episode&id={ID}", folder.path().join("page").display()));
    until(&mut copy, "document.querySelector('.marks li')");
    assert_eq!(
        copy.texts(marks),
        ["confabulates t = 2 names a colour that <b>nobody</b> saw ann"],
        "no button to remove it"
    );
    assert!(copy.holds("document.querySelector('.labels .put') === null"));
    copy.press("l");
    assert!(copy.holds("document.querySelector('dialog[open]') === null"), "a copy only shows");
    copy.close();
}

#[test]
fn the_list_counts_labels_and_filters_by_them() {
    let folder = tempfile::tempdir().unwrap();
    runs(folder.path());
    let server = Server::start(folder.path(), &["runs", "--label", "ann"]);
    for (id, label) in [(ID, Some("confabulates")), ("E1/guesser/s1/r2", Some("loops")), ("E1/oracle/s1/r1", None)] {
        assert_eq!(post(&server, &json!({"id": id, "label": label})).status, 200);
    }
    let total = |filter: &str| server.get(&format!("/api/episodes?{filter}")).json()["total"].clone();
    assert_eq!(total("is=label_confabulates%3Dtrue"), 1);
    assert_eq!(total("is=label_confabulates%3Dfalse"), 2);
    assert_eq!(total("where=label_confabulates"), 1);
    assert_eq!(total("where=label_loops%20%3D%20false%20and%20any(t%20%3D%201)"), 2, "one that needs the steps");
    let undefined = total("is=label_confabulates%3D");
    run(folder.path(), &["view", "runs", "--export", "page"]).done();
    let page = format!("file://{}/index.html", folder.path().join("page").display());
    for base in [server.link.as_str(), page.as_str()] {
        let mut browser = Browser::at(&format!("{base}?view=episodes"));
        until(&mut browser, "document.querySelector('.list .rows a')");
        let shown = browser.text("document.documentElement.dataset.shown");
        let boxes = "[...document.querySelectorAll('input[name=label_confabulates]')].map((own) => own.parentElement.textContent)";
        assert_eq!(
            browser.texts(boxes),
            [format!("not coded {undefined}"), "not put 2".into(), "put 1".into()],
            "{base}"
        );
        browser.value("document.querySelector('input[name=label_confabulates][value=true]').click()");
        until(&mut browser, &format!("document.documentElement.dataset.shown !== '{shown}'"));
        assert_eq!(browser.text("document.querySelector('.chip').firstChild.textContent"), "Label confabulates: put");
        let rows = "[...document.querySelectorAll('.list .rows a')].map((row) => `${row.dataset.id} ${row.querySelector('.put').textContent}`)";
        assert_eq!(browser.texts(rows), [format!("{ID} confabulates")], "{base}");
        if base == server.link {
            check(&mut browser, "the list by a label");
        }
        browser.close();
        let mut browser = Browser::at(&format!("{base}?view=episodes&where=label_loops+%3D+false+and+run+%3D+1"));
        until(&mut browser, "document.querySelector('.list .rows a')");
        assert!(browser.text("document.querySelector('#count').textContent").starts_with("2 of"), "{base}");
        browser.close();
    }
    assert_eq!(post(&server, &json!({"id": ID, "label": "confabulates", "removed": true})).json(), json!([]));
    assert_eq!(server.get("/api/episodes?limit=1").json()["rows"][0]["put"], json!([]));
    assert!(server.get("/api/study").text().contains("label_loops"));
    assert!(!server.get("/api/study").text().contains("label_confabulates"), "nobody puts it any more");
    assert_eq!(list(folder.path()).lines().count(), 4, "a removal is a line");
}

#[test]
fn only_the_page_of_a_coder_may_write() {
    let folder = tempfile::tempdir().unwrap();
    runs(folder.path());
    let label = json!({"id": ID, "label": "loops"});
    let reader = Server::start(folder.path(), &["runs"]);
    assert_eq!(post(&reader, &label).status, 405);
    let server = Server::start_by_link(folder.path(), &["runs", "--label", "ann"]);
    let host = format!("127.0.0.1:{}", server.port);
    let (own, token) = (format!("http://{host}"), server.link.split_once("?token=").unwrap().1.to_owned());
    for (path, headers, status) in [
        ("/label".to_owned(), vec![("Host", host.as_str()), ("Origin", own.as_str())], 401),
        (format!("/label?token={token}"), vec![("Host", host.as_str())], 405),
        (format!("/label?token={token}"), vec![("Host", &host), ("Origin", "http://mirror.invalid")], 403),
        (format!("/label?token={token}"), vec![("Host", "mirror.invalid"), ("Origin", &own)], 403),
        (format!("/api/study?token={token}"), vec![("Host", &host), ("Origin", &own)], 405),
    ] {
        assert_eq!(server.ask("POST", &path, &headers, &label.to_string()).status, status, "{path} {headers:?}");
    }
    for (label, status, words) in [
        (json!({"id": "../secret", "label": "loops"}), 404, "no whole episode"),
        (json!({"id": ID, "label": "Loops!"}), 400, "lowercase letters"),
        (json!({"id": ID, "label": "loops", "step": 100_000}), 400, "a step from 1 to"),
        (json!({"id": ID, "label": "loops", "note": "x".repeat(2001)}), 400, "at most 2000 characters"),
        (json!({"id": ID, "label": "loops", "coder": "bob"}), 400, "unknown field `coder`"),
        (json!({"id": ID, "note": "x".repeat(100_000)}), 413, ""),
    ] {
        let headers = [("Host", host.as_str()), ("Origin", own.as_str())];
        let answer = server.ask("POST", &format!("/label?token={token}"), &headers, &label.to_string());
        assert_eq!(answer.status, status, "{}", answer.text());
        assert!(answer.text().contains(words), "{}", answer.text());
    }
    assert!(list(folder.path()).is_empty(), "nothing was written");
    let refused = run(folder.path(), &["view", "runs", "--label", " "]).refused();
    assert!(refused.contains("a coder's name"), "{refused}");
}

#[test]
fn labels_of_another_coder_appear_and_a_bad_line_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    runs(folder.path());
    let server = Server::start(folder.path(), &["runs"]);
    assert_eq!(server.get(&format!("/api/episode?id={ID}")).json()["labels"], json!([]));
    let path = folder.path().join("runs/labels.jsonl");
    let good = format!("{{\"coder\":\"bob\",\"episode_id\":\"{ID}\",\"label\":\"loops\"}}\n");
    std::fs::write(&path, &good).unwrap();
    let labels = || {
        server.get("/api/live");
        let told = server.get(&format!("/api/episode?id={ID}")).json()["labels"].clone();
        (told != json!([])).then_some(told)
    };
    let told = wait_for("the label of bob", labels);
    assert_eq!(told, json!([{"coder": "bob", "step": null, "label": "loops", "note": null}]));
    std::fs::write(&path, good + "{\"coder\":\"bob\"}\n").unwrap();
    let fault = || server.get("/api/live").json()["fault"].as_str().map(str::to_owned);
    let fault = wait_for("the fault", fault);
    assert!(fault.contains("labels.jsonl, line 2: expected a label"), "{fault}");
    let refused = run(folder.path(), &["view", "runs", "--no-open"]).refused();
    assert!(refused.contains("labels.jsonl, line 2: expected a label") && refused.contains("help:"), "{refused}");
}

/// The memory of a million labels, compared with an empty list.
#[cfg(target_os = "linux")]
#[test]
fn a_million_labels_take_less_than_a_hundred_megabytes() {
    use crate::harness::bombs::peak;
    use std::fmt::Write as _;
    let folder = tempfile::tempdir().unwrap();
    runs(folder.path());
    let without = Server::start(folder.path(), &["runs"]);
    without.get("/api/study");
    let mut lines = String::new();
    for at in 0..1_000_000_u32 {
        let (episode, step) = (at % 2000, at / 2000 + 1);
        let _ = writeln!(
            lines,
            "{{\"coder\":\"c{}\",\"episode_id\":\"E1/guesser/s{episode}/r1\",\"step\":{step},\"label\":\"l{}\"}}",
            at % 3,
            at % 7
        );
    }
    std::fs::write(folder.path().join("runs/labels.jsonl"), lines).unwrap();
    let with = Server::start(folder.path(), &["runs", "--label", "ann"]);
    assert_eq!(post(&with, &json!({"id": ID, "label": "loops"})).status, 200);
    let told = with.get(&format!("/api/episode?id={ID}")).json();
    assert_eq!(told["labels"].as_array().unwrap().len(), 501);
    let more = peak(with.process_id()).saturating_sub(peak(without.process_id())) >> 10;
    assert!(more < 100, "{more} MB");
}
