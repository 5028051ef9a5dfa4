//! The tables in a browser: reading, sorting and filtering, by mouse and by keyboard.

use std::collections::BTreeMap;

use mirrorstats_score::cells::KeyValue;

use crate::html::browser::Browser;
use crate::html::scored::{PAPER_PAGE, Report};

/// The visible rows of the main table, in order: experiment, model and mean of TSA.
const ROWS: &str = "[...document.querySelectorAll('#table-main tbody tr[data-group]')].filter((r) => r.checkVisibility()) \
    .map((r) => [r.dataset.experiment, r.dataset.model, r.querySelector('[data-metric=TSA]').dataset.mean].join('|'))";

/// The main table by experiment and then by mean, descending if asked.
fn by_mean(report: &Report, is_descending: bool) -> Vec<String> {
    let tsa = report.cells.metrics.iter().position(|metric| metric == "TSA").unwrap();
    let mut expected = Vec::new();
    for group in &report.tables[0].groups {
        let mut rows: Vec<(f64, &[KeyValue])> = group
            .rows
            .iter()
            .map(|row| {
                let cells = report.cells.groups.iter().find(|cells| cells.key == row.key).unwrap();
                (cells.moments[tsa].mean().unwrap(), &row.key[..])
            })
            .collect();
        rows.sort_by(|a, b| if is_descending { b.0.total_cmp(&a.0) } else { a.0.total_cmp(&b.0) });
        expected.extend(rows.iter().map(|(mean, key)| format!("{}|{}|{mean}", key[0], key[1])));
    }
    expected
}

#[test]
fn a_header_sorts_within_groups_both_ways_and_back() {
    let report = Report::bare();
    let mut browser = Browser::open(&report.render().unwrap());
    let header = "#table-main thead th[data-metric=TSA] button";
    let way = "document.querySelector('#table-main th[data-metric=TSA]').getAttribute('aria-sort') ?? 'none'";
    let original = browser.texts(ROWS);
    assert_eq!(original.len(), 40);
    browser.click(header);
    assert_eq!((browser.text(way).as_str(), browser.texts(ROWS)), ("descending", by_mean(&report, true)));
    browser.click(header);
    assert_eq!((browser.text(way).as_str(), browser.texts(ROWS)), ("ascending", by_mean(&report, false)));
    browser.click(header);
    assert_eq!((browser.text(way).as_str(), browser.texts(ROWS)), ("none", original));
    browser.close();
}

#[test]
fn every_column_sorts_all_rows_as_one_list_with_the_undefined_last() {
    let report = Report::bare();
    let mut browser = Browser::open(&report.render().unwrap());
    browser.click("#grouped");
    for (table, metric) in report.tables.iter().flat_map(|t| t.columns.iter().map(|c| (&t.name, &c.metric))) {
        let header = format!("#table-{table} thead th[data-metric='{metric}'] button");
        let means = format!(
            "[...document.querySelectorAll('#table-{table} td[data-metric=\"{metric}\"]')].map((c) => c.dataset.mean)"
        );
        for _ in 0..2 {
            browser.click(&header);
            let way = browser.text(&format!(
                "document.querySelector('#table-{table} th[data-metric=\"{metric}\"]').getAttribute('aria-sort')"
            ));
            let (defined, undefined) = split(&browser.texts(&means));
            assert_eq!(defined.len() + undefined, 40, "{table} {metric}");
            let is_sorted = defined.is_sorted_by(|a, b| if way == "ascending" { a <= b } else { a >= b });
            assert!(is_sorted, "{table} {metric} {way}: {defined:?}");
        }
    }
    browser.click("#table-main thead th[data-by=name] button");
    let models = "[...document.querySelectorAll('#table-main tbody th')].filter((t) => t.checkVisibility()) \
        .map((t) => t.textContent)";
    let models = browser.texts(models);
    assert!(models.is_sorted_by_key(|name| name.to_lowercase()), "{models:?}");
    browser.close();
}

/// The means before the first undefined one, and the number of undefined ones, which must all come last.
fn split(means: &[String]) -> (Vec<f64>, usize) {
    let defined: Vec<f64> =
        means.iter().take_while(|mean| !mean.is_empty()).map(|mean| mean.parse().unwrap()).collect();
    let rest = &means[defined.len()..];
    assert!(rest.iter().all(String::is_empty), "{means:?}");
    (defined, rest.len())
}

#[test]
fn filters_show_only_the_chosen_rows() {
    let report = Report::bare();
    let mut browser = Browser::open(&report.render().unwrap());
    let status = "document.getElementById('shown').textContent";
    let chip = |key: usize, at: usize| format!("fieldset[data-key='{key}'] label:nth-of-type({}) span", at + 1);
    let counts = |rows: &[String], at: usize| {
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        for row in rows {
            *counts.entry(row.split('|').nth(at).unwrap().to_owned()).or_default() += 1;
        }
        counts
    };
    let all = browser.texts(ROWS);
    assert_eq!(browser.text(status), "all 40 rows");
    browser.click(&chip(0, 2));
    let one = browser.texts(ROWS);
    assert_eq!(counts(&one, 0), BTreeMap::from([("E3".to_owned(), 8)]));
    assert_eq!(browser.text(status), "8 of 40 rows");
    browser.click(&chip(0, 4));
    browser.click(&chip(1, 1));
    assert_eq!(counts(&browser.texts(ROWS), 0), BTreeMap::from([("E3".to_owned(), 1), ("E5".to_owned(), 1)]));
    assert_eq!(counts(&browser.texts(ROWS), 1), BTreeMap::from([("GPT 5.1".to_owned(), 2)]));
    let headings = "[...document.querySelectorAll('#table-appendix .heading')].filter((r) => r.checkVisibility()) \
        .map((r) => r.textContent.trim().slice(0, 2))";
    assert_eq!(browser.texts(headings), ["E3", "E5"]);
    browser.click("#table-main th[data-metric=TSA] button");
    assert_eq!(browser.texts(ROWS).len(), 2, "sorting keeps the filter");
    browser.click("#table-main th[data-metric=TSA] button");
    browser.click("#table-main th[data-metric=TSA] button");
    browser.click("#filters button[type=reset]");
    assert!(browser.holds("new Promise((done) => setTimeout(() => done(true)))"));
    assert_eq!((browser.text(status).as_str(), browser.texts(ROWS)), ("all 40 rows", all));
    browser.close();
}

#[test]
fn a_cell_tells_its_numbers_and_its_definition() {
    let report = Report::bare();
    let mut browser = Browser::open(&report.render().unwrap());
    let cell = "#table-main tr[data-experiment=E1][data-model='GPT 5.1'] td[data-metric=MTATO]";
    assert!(browser.holds("document.getElementById('tip').hidden"));
    browser.point_at(cell);
    let tip = browser.text("document.getElementById('tip').textContent");
    for part in [
        "MTATO, E1 · GPT 5.1",
        "n11 of 21 episodes",
        "count11 of 11",
        "mean1",
        "standard error0",
        "Wilson 95 %0.74116",
        " to 1",
        "Mirror-Then-Action Temporal Ordering. Among successful",
        "undefined for failures.",
        "value = MCR",
        "when = TSA = 1",
    ] {
        assert!(tip.contains(part), "{part} in {tip}");
    }
    let values = "[...document.querySelectorAll('#tip dd')].map((d) => d.textContent)";
    browser.point_at("#table-main tr[data-experiment=E1][data-model='GPT 5.1'] td[data-metric=TSA]");
    let shown = browser.texts(values);
    let of = |name: &str| {
        format!(
            "document.querySelector(\"#table-main tr[data-experiment=E1][data-model='GPT 5.1'] [data-metric=TSA]\").dataset.{name}"
        )
    };
    let [mean, se, low, high] = ["mean", "se", "ciLow", "ciHigh"].map(|name| browser.text(&of(name)));
    assert_eq!(shown, ["21 of 21 episodes", "11 of 21", &mean, &se, &format!("{low} to {high}"), "1/3"]);
    browser.point_at("h1");
    assert!(browser.holds("document.getElementById('tip').hidden"));
    browser.close();
}

#[test]
fn the_keyboard_alone_is_enough() {
    let report = Report::bare();
    let mut browser = Browser::open(&report.render().unwrap());
    browser.press("Tab");
    assert_eq!(browser.text("document.activeElement.textContent"), "Skip to the tables");
    browser.press("Enter");
    let is_cell = "document.activeElement.matches('td[data-metric]')";
    let mut stops = 0;
    while !browser.holds(is_cell) {
        browser.press("Tab");
        stops += 1;
        assert!(stops < 60, "no cell within sixty stops");
    }
    let place = "(() => { const c = document.activeElement; return [c.dataset.metric, c.closest('tr').dataset.model, \
        c.closest('tr').dataset.experiment].join('|'); })()";
    assert_eq!(browser.text(place), "TSA|Claude Sonnet 4.6|E1");
    for (key, expected) in [
        ("ArrowRight", "TTD|Claude Sonnet 4.6|E1"),
        ("ArrowDown", "TTD|GPT 5.1|E1"),
        ("End", "CR|GPT 5.1|E1"),
        ("ArrowRight", "CR|GPT 5.1|E1"),
        ("Home", "TSA|GPT 5.1|E1"),
        ("ArrowUp", "TSA|Claude Sonnet 4.6|E1"),
        ("ArrowUp", "TSA|Claude Sonnet 4.6|E1"),
    ] {
        browser.press(key);
        assert_eq!(browser.text(place), expected, "{key}");
    }
    assert!(browser.text("document.getElementById('tip').textContent").starts_with("TSA, E1 · Claude Sonnet 4.6"));
    assert!(browser.holds("document.activeElement.getAttribute('aria-describedby') === 'tip'"));
    assert!(browser.holds("getComputedStyle(document.activeElement).outlineStyle === 'solid'"));
    browser.press("Enter");
    assert!(browser.holds("document.getElementById('episodes').open"));
    assert!(browser.holds("document.getElementById('episodes').contains(document.activeElement)"));
    browser.press("Escape");
    assert!(browser.holds("!document.getElementById('episodes').open"));
    assert_eq!(browser.text(place), "TSA|Claude Sonnet 4.6|E1", "closing leads back");
    browser.press("Tab");
    assert!(!browser.holds("document.activeElement.closest('#table-main td') !== null"), "a table is one stop");
    browser.close();
}

#[test]
fn closing_a_panel_does_not_steal_the_focus() {
    let report = Report::bare();
    let mut browser = Browser::open(&report.render().unwrap());
    // The browser reports the end of a panel late; the reader may already be elsewhere.
    let goes_on = "new Promise((done) => { \
        const panel = document.getElementById('episodes'); \
        document.querySelector('#table-main td[data-metric]').click(); \
        panel.addEventListener('close', () => setTimeout(() => done(document.activeElement.tagName))); \
        panel.close(); \
        document.querySelector('#filters input[type=search]').focus(); })";
    assert_eq!(browser.text(goes_on), "INPUT");
    let ends = "new Promise((done) => { \
        const panel = document.getElementById('episodes'); \
        document.querySelector('#table-main td[data-metric]').click(); \
        panel.addEventListener('close', () => setTimeout(() => done(document.activeElement.dataset.metric))); \
        panel.close(); \
        document.activeElement.blur(); })";
    assert_eq!(browser.text(ends), "TSA", "and where nothing has it, it is back at the cell");
    browser.close();
}

/// Presses Tab until an expression is true, at most ten times in all.
fn tabs(browser: &mut Browser, so_far: usize, until: &str) -> usize {
    for pressed in so_far + 1..=10 {
        browser.press("Tab");
        if browser.holds(until) {
            return pressed;
        }
    }
    let at = browser.text("document.activeElement.outerHTML.slice(0, 200)");
    panic!("{until} is not reached within ten tabs, but {at}")
}

#[test]
fn everything_is_within_ten_tabs() {
    let mut browser = Browser::open(&PAPER_PAGE);
    for goal in [
        "#filters input[type=search]",
        "#filters fieldset input",
        "#table-main th button",
        "#table-main td[data-metric]",
    ] {
        browser.value("document.activeElement.blur()");
        browser.send("Page.reload", &serde_json::json!({}));
        assert!(browser.holds("new Promise((done) => setTimeout(() => done(true), 300))"));
        tabs(&mut browser, 0, &format!("document.activeElement.matches('{goal}')"));
    }
    browser.close();
    let links = "[...document.querySelectorAll('nav.sections a')].map((a) => a.hash)";
    let mut browser = Browser::open(&PAPER_PAGE);
    let sections = browser.texts(links);
    assert_eq!(sections.len(), 6);
    browser.close();
    for (at, goal) in [
        (1, "#figure-decision-curve .sheet"),
        (2, "#pair select"),
        (3, "#statistics summary"),
        (5, "#provenance summary"),
    ] {
        let mut browser = Browser::open(&PAPER_PAGE);
        let mut pressed = tabs(&mut browser, 0, "document.activeElement.matches('nav.sections a')");
        for _ in 0..at {
            browser.press("ArrowRight");
        }
        browser.press("Enter");
        if goal.starts_with("#figure-") {
            pressed = tabs(&mut browser, pressed, "document.activeElement.matches('.contents a')");
            browser.press("End");
            browser.press("Enter");
        }
        tabs(&mut browser, pressed, &format!("document.activeElement.matches('{goal}')"));
        browser.close();
    }
}

#[test]
fn arrows_go_through_the_filters_line_by_line() {
    let mut browser = Browser::open(&Report::bare().render().unwrap());
    browser.value("document.querySelector('#filters fieldset input').focus()");
    let label = "document.activeElement.parentElement.textContent.trim()";
    for (key, expected) in [
        ("ArrowRight", "E2"),
        ("ArrowDown", "GPT 5.1"),
        ("ArrowUp", "E2"),
        ("Home", "E1"),
        ("ArrowLeft", "E1"),
        ("ArrowDown", "Claude Sonnet 4.6"),
        ("ArrowDown", "Keep groups together"),
    ] {
        browser.press(key);
        assert_eq!(browser.text(label), expected, "{key}");
    }
    browser.press("ArrowUp");
    browser.press(" ");
    assert_eq!(browser.text("document.getElementById('shown').textContent"), "5 of 40 rows");
    browser.close();
}

#[test]
fn headers_stay_in_view() {
    let mut browser = Browser::open(&PAPER_PAGE);
    let top = "document.querySelector('#table-main thead th').getBoundingClientRect().top";
    for width in [1600, 1280, 700, 390] {
        let size = serde_json::json!({"width": width, "height": 700, "deviceScaleFactor": 1, "mobile": false});
        browser.send("Emulation.setDeviceMetricsOverride", &size);
        assert!(
            browser
                .holds("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")
        );
        browser.value("document.querySelector('#table-main tbody:last-of-type tr:last-of-type td').scrollIntoView({block: 'center'})");
        let top = browser.value(top).as_f64().unwrap();
        assert!((-1.0..500.0).contains(&top), "{width}: {top}");
    }
    browser.close();
}
