//! Checks every page with axe-core for barriers to reading and using it.

use serde_json::{Value, json};

use crate::harness::need;
use crate::harness::program::run;
use crate::html::browser::Browser;
use crate::view::pages::until;
use crate::view::{PAPER, RECORDED, Server};

/// The rules of WCAG 2.2, A and AA.
const RULES: &str = "['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa']";

/// The engine's findings on the current page: each rule, and the elements that break it.
pub fn violations(browser: &mut Browser) -> Vec<String> {
    let engine = std::fs::read_to_string(need::axe()).unwrap();
    browser.value(&format!("{{ {engine} }}; true"));
    let told = "found.violations.map((v) => `${v.id}: ${v.nodes.slice(0, 3).map((n) => `${n.target} ${n.failureSummary}`).join('; ')}`)";
    // Only violations are shown, so nothing else needs a selector.
    let options = format!("{{ runOnly: {{ type: 'tag', values: {RULES} }}, resultTypes: ['violations'] }}");
    browser.texts(&format!("axe.run(document, {options}).then((found) => {told})"))
}

/// Checks a page in light and dark, at desktop and phone widths. The engine takes seconds, so it sees each scheme and
/// each of the two layouts once.
pub fn check(browser: &mut Browser, what: &str) {
    for (scheme, width, is_searched) in
        [("light", 1400, true), ("dark", 390, true), ("light", 820, false), ("light", 390, false)]
    {
        let size = json!({"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": false});
        browser.send("Emulation.setDeviceMetricsOverride", &size);
        let media = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
        browser.send("Emulation.setEmulatedMedia", &media);
        let found = if is_searched { violations(browser) } else { Vec::new() };
        assert!(found.is_empty(), "{what}, {scheme}, {width} px: {found:#?}");
        let beyond = "document.documentElement.scrollWidth - document.documentElement.clientWidth";
        assert_eq!(browser.value(beyond), 0, "{what}, {width} px: the page is wider than the window");
    }
}

#[test]
fn the_engine_finds_violations() {
    let mut browser =
        Browser::open("<!doctype html><html lang=en><title>t</title><main><h1>t</h1><img src='data:,'></main>");
    let found = violations(&mut browser);
    assert!(found.iter().any(|rule| rule.starts_with("image-alt")), "{found:?}");
}

#[test]
fn every_page_of_recordings_is_accessible() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED, "--against", "extended"]);
    for (query, ready) in [
        ("", "document.querySelector('#table-main td[data-metric] a')"),
        ("?model=oracle&is=TSA%3D1&where=MCR+%3D+1", "document.querySelector('.chip')"),
        ("?where=TSA+%3D", "document.querySelector('#where-fault')"),
        ("?view=episodes", "document.querySelector('.list .rows a')"),
        ("?view=episodes&search=mirror", "document.querySelector('.list .rows .words:not(:empty)')"),
        ("?view=episodes&search=nobody-said-this", "document.querySelector('.nothing')"),
        ("?view=episode&id=E1/guesser/s1/r1", "document.querySelector('svg.map .cube')"),
        ("?view=episode&id=E1/oracle/s1/r1", "document.querySelector('.panel .step')"),
        ("?view=compare&a=E1/guesser/s1/r1&b=E1/oracle/s1/r1", "document.querySelectorAll('.side .step').length === 2"),
        ("?view=changes", "document.querySelector('#flips')"),
        ("?view=scene&id=E1/oracle/s1/r1", "document.querySelector('ul.scene')"),
    ] {
        let mut browser = Browser::at(&format!("{}{query}", server.link));
        until(&mut browser, &format!("document.documentElement.dataset.shown && {ready}"));
        check(&mut browser, query);
    }
}

#[test]
fn every_part_of_the_report_is_accessible() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[PAPER]);
    let mut browser = Browser::at(&server.link);
    until(&mut browser, "document.querySelector('#table-main td[data-metric] a')");
    for section in ["figures", "statistics"] {
        browser.click(&format!("#section-{section} summary"));
        until(&mut browser, &format!("document.querySelector('#section-{section} section')"));
    }
    browser.click("details.menu summary");
    until(&mut browser, "document.querySelector('details.menu[open] input')");
    check(&mut browser, "the overview with all that it has");
    run(folder.path(), &["report", PAPER, "--out", "report"]).done();
    let html = std::fs::read_to_string(folder.path().join("report/report.html")).unwrap();
    let mut browser = Browser::open(&html);
    check(&mut browser, "report.html");
}

/// The number of Tab presses that it takes to go through the page.
fn stops(browser: &mut Browser) -> usize {
    browser.value("document.activeElement?.blur()");
    let mut seen = Vec::new();
    for _ in 0..200 {
        browser.press("Tab");
        let at = "[...document.querySelectorAll('*')].indexOf(document.activeElement)";
        let at: Value = browser.value(at);
        if seen.contains(&at) {
            break;
        }
        seen.push(at);
    }
    seen.len()
}

#[test]
fn fifty_models_are_not_fifty_stops_of_the_keyboard() {
    let folder = tempfile::tempdir().unwrap();
    let mut lines = Vec::new();
    for model in 0..50 {
        for (t, action) in [(1, "turn_left"), (2, "done")] {
            lines.push(
                json!({
                    "episode_id": format!("E1/model-{model}/s1/r1"), "model": format!("model-{model}"), "experiment": "E1",
                    "seed": 1, "run": 1, "body_color": "red", "t": t, "action": action, "self_color": "red",
                    "selected_cube": "red", "mirror_visible": true,
                })
                .to_string(),
            );
        }
    }
    std::fs::write(folder.path().join("steps.jsonl"), lines.join("\n")).unwrap();
    run(folder.path(), &["import", "steps.jsonl", "-o", "many.parquet"]).done();
    let server = Server::start(folder.path(), &["many.parquet"]);
    for (query, ready) in [
        ("", "document.querySelector('#table-main td[data-metric] a')"),
        ("?view=episodes", "document.querySelector('.list .rows a')"),
    ] {
        let mut browser = Browser::at(&format!("{}{query}", server.link));
        until(&mut browser, &format!("document.documentElement.dataset.shown && {ready}"));
        check(&mut browser, query);
        let stops = stops(&mut browser);
        assert!((5..50).contains(&stops), "{query}: {stops}");
    }
}
