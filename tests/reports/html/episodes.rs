//! The episodes behind a cell.

use std::collections::BTreeSet;

use mirrorstats_score::tables::table::MetricColumn;
use serde_json::json;

use crate::harness::files::fixture;
use crate::harness::program::{Answer, PROGRAM, run};
use crate::html::browser::Browser;
use crate::html::scored::{PAPER, Report};

/// Every row of the panel: episode, seed, run, value.
const ROWS: &str = "[...document.querySelectorAll('#episodes tbody tr')] \
    .map((r) => [...r.children].map((c) => c.textContent).join(','))";

/// The values of a cell in the episode table.
fn expected(report: &Report, experiment: &str, model: &str, metric: &str) -> BTreeSet<String> {
    let column = report.episodes.metrics.iter().find(|column| column.name == metric).unwrap();
    let keys = report.episodes.keys.iter().zip(column.iter());
    let of_cell = keys.filter(|(key, _)| key.experiment == experiment && key.model == model);
    let row = |value: Option<i64>| value.map_or("--".to_owned(), |value| value.to_string());
    of_cell.map(|(key, value)| format!("{},{},{},{}", key.episode_id, key.seed, key.run, row(value))).collect()
}

#[test]
fn a_click_opens_the_episodes_of_the_cell() {
    let report = Report::bare();
    let mut browser = Browser::open(&report.render().unwrap());
    for (table, experiment, model, metric) in [
        ("main", "E1", "GPT 5.1", "TTD"),
        ("main", "E4", "Ministral 3 14B", "MTATO"),
        ("appendix", "E5", "Qwen 3.6 Plus", "AR_SC"),
    ] {
        browser.click(&format!(
            "#table-{table} tr[data-experiment='{experiment}'][data-model='{model}'] td[data-metric='{metric}']"
        ));
        let rows = browser.texts(ROWS);
        assert_eq!(rows.len(), 21);
        assert_eq!(rows.into_iter().collect::<BTreeSet<_>>(), expected(&report, experiment, model, metric));
        let title = browser.text("document.getElementById('episodes-title').textContent");
        assert_eq!(title, format!("{metric}, {experiment} · {model}"));
        browser.click("#episodes header button");
        assert!(browser.holds("!document.getElementById('episodes').open"));
    }
    browser.close();
}

#[test]
fn episodes_sort_by_value() {
    let report = Report::bare();
    let mut browser = Browser::open(&report.render().unwrap());
    browser.click("#table-main tr[data-experiment='E1'][data-model='GPT 5.1'] td[data-metric='TTD']");
    browser.click("#episodes thead th:nth-child(4) button");
    let values = "[...document.querySelectorAll('#episodes tbody td:last-child')].map((c) => Number(c.textContent))";
    let sorted: Vec<i64> = serde_json::from_value(browser.value(values)).unwrap();
    assert!(sorted.is_sorted() && sorted.first() < sorted.last(), "{sorted:?}");
    browser.press("Escape");
    assert!(browser.holds("document.activeElement.matches('td[data-metric=TTD]')"), "closing leads back");
    browser.close();
}

#[test]
fn integers_that_javascript_would_round_stay_exact() {
    let mut episodes = PAPER.clone();
    let ttd = episodes.metrics.iter_mut().find(|column| column.name == "TTD").unwrap();
    *ttd = MetricColumn::new("TTD", std::iter::once(Some(i64::MAX)).chain(ttd.iter().skip(1)).collect::<Vec<_>>());
    let key = episodes.keys.get(0).to_owned();
    let report = Report::of(episodes, &["experiment", "model"], "default");
    let mut browser = Browser::open(&report.render().unwrap());
    browser.click(&format!(
        "#table-main tr[data-experiment='{}'][data-model='{}'] td[data-metric='TTD']",
        key.experiment, key.model
    ));
    assert!(browser.texts(ROWS).iter().any(|row| row.ends_with(",9223372036854775807")));
    browser.close();
}

#[test]
fn without_its_script_the_page_is_whole() {
    let report = Report::bare();
    let disable = ("Emulation.setScriptExecutionDisabled", json!({"value": true}));
    let mut browser = Browser::open_with(&report.render().unwrap(), &[disable]);
    assert!(browser.holds("document.querySelector('#table-main thead button') === null"), "the script did not run");
    let shown = "[...document.querySelectorAll('td[data-metric]')].filter((c) => c.checkVisibility()).length";
    assert_eq!(browser.value(shown), json!(40 * (6 + 7)));
    let controls = "[...document.querySelectorAll('#theme, #filters, .hint, .zoom')].some((c) => c.checkVisibility())";
    assert!(!browser.holds(controls), "nothing to press that does nothing");
    browser.send("Emulation.setScriptExecutionDisabled", &json!({"value": false}));
    browser.close();
}

#[test]
fn a_row_has_the_command_that_looks_into_its_episode() {
    let folder = tempfile::tempdir().unwrap();
    let traces = folder.path().join("my runs");
    std::fs::create_dir(&traces).unwrap();
    for name in ["E1-gpt-5-1.parquet", "E1-gemma4-26b.parquet"] {
        std::fs::copy(fixture("paper").join(name), traces.join(name)).unwrap();
    }
    let definitions = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/definitions/inclusive.toml");
    std::fs::copy(definitions, folder.path().join("inclusive.toml")).unwrap();
    run(folder.path(), &["report", "my runs", "--definitions", "inclusive.toml", "--out", "out"]).done();
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(!page.contains(folder.path().to_str().unwrap()), "no absolute path");
    let mut browser = Browser::open(&page);
    browser.click("#table-main tr[data-model='GPT 5.1'] td[data-metric='TTD']");
    let commands = "[...document.querySelectorAll('#episodes tbody button.copy')].map((b) => b.dataset.command)";
    let explaining = browser.texts(commands);
    assert_eq!(explaining.len(), 21);
    let expected = "mirrorstats score 'my runs/E1-gemma4-26b.parquet' 'my runs/E1-gpt-5-1.parquet' --definitions inclusive.toml \
                    --explain E1/gpt-5-1/s1/r1";
    assert_eq!(explaining[0], expected);
    let run_by_shell = |command: &str| {
        let own = command.replacen("mirrorstats", PROGRAM, 1);
        let output = std::process::Command::new("bash").args(["-c", &own]).current_dir(folder.path()).output().unwrap();
        Answer::from(output)
    };
    assert!(run_by_shell(&explaining[0]).done().starts_with("E1/gpt-5-1/s1/r1: "));
    let told = "(() => { const c = document.getElementById('command'); c.value = '1'; c.dispatchEvent(new Event('change')); \
        return document.getElementById('command-line').textContent; })()";
    assert!(browser.text(told).ends_with(" --definitions inclusive.toml --episode E1/gpt-5-1/s1/r1"));
    browser.point_at("#episodes tbody tr:nth-of-type(3) th");
    assert!(browser.text("document.getElementById('command-line').textContent").ends_with("/s1/r3"));
    browser.click("#episodes tbody tr:nth-of-type(2) button.copy");
    assert!(browser.holds("new Promise((done) => setTimeout(() => done(true), 200))"));
    let said = browser.text("document.querySelector('#episodes .said').textContent");
    assert!(said.starts_with("Copied") || said.starts_with("Selected"), "{said}");
    browser.close();
    // Scores have no steps to show.
    run(folder.path(), &["report", "out/episodes.parquet", "--out", "again"]).done();
    let page = std::fs::read_to_string(folder.path().join("again/report.html")).unwrap();
    let mut browser = Browser::open(&page);
    browser.click("#table-main tr[data-model='GPT 5.1'] td[data-metric='TTD']");
    assert!(browser.holds("document.querySelector('#episodes .copy, #command') === null"));
    browser.close();
}
