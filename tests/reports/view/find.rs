//! Finding episodes: by words, by filters, by a faulty condition, and without a result.

use crate::harness::program::run;
use crate::html::browser::Browser;
use crate::view::pages::until;
use crate::view::{PAPER, RECORDED, Server};

#[test]
fn words_are_found_in_what_was_said() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    let told = server.get("/api/episodes?search=one%20is%20as%20GOOD%20as%20another&limit=500").json();
    assert_eq!(told["total"], 2, "both of the guesser: {told}");
    let said = &told["rows"][0]["said"];
    assert_eq!((&said["column"], &said["t"]), (&"reasoning".into(), &1.into()), "{said}");
    assert!(said["excerpt"].as_str().unwrap().contains("One is as good as another"), "{said}");
    // A name is found even without matching text.
    assert_eq!(server.get("/api/episodes?search=frozen").json()["total"], 1);
    let mut browser = Browser::at(&server.link);
    until(&mut browser, "document.querySelector('#table-main')");
    browser.press("/");
    browser.value("document.activeElement.value = 'as good as another'");
    browser.press("Enter");
    until(&mut browser, "document.querySelector('.list .rows a .words:not(:empty)')");
    browser.click(".list .rows a");
    until(&mut browser, "document.querySelector('.clock')");
    assert!(browser.text("location.search").contains("t=1"), "the step that has the words");
    browser.close();
}

#[test]
fn filters_by_click_are_chips_that_remove_them() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[PAPER]);
    let mut browser = Browser::at(&format!("{}?view=episodes", server.link));
    until(&mut browser, "document.querySelector('.list .rows a')");
    let first = browser.text("document.querySelector('input[name=model]').value");
    for (input, total) in [
        ("input[name=TSA][value='0']", "is=TSA%3D0"),
        ("input[name=seed][value='2']", "is=TSA%3D0&is=seed%3D2"),
        ("input[name=model]", "is=TSA%3D0&is=seed%3D2&model={first}"),
    ] {
        let shown = browser.text("document.documentElement.dataset.shown");
        browser.value(&format!("document.querySelector(\"{input}\").click()"));
        until(&mut browser, &format!("document.documentElement.dataset.shown !== '{shown}'"));
        let expected = server
            .get(&format!("/api/episodes?{}", total.replace("{first}", &first.replace(' ', "%20"))))
            .json()["total"]
            .to_string();
        let count = browser.text("document.querySelector('#count').textContent");
        assert!(count.starts_with(&format!("{expected} of 840")), "{input}: {count}, expected {expected}");
    }
    let address = browser.text("location.search");
    assert!(address.contains("is=TSA%3D0") && address.contains("is=seed%3D2"), "{address}");
    let chips = "[...document.querySelectorAll('.chip')].map((chip) => chip.firstChild.textContent)";
    assert_eq!(browser.texts(chips), [format!("Model: {first}").as_str(), "TSA: 0", "Seed: 2"]);
    browser.click(".chip:nth-of-type(2)");
    until(&mut browser, "document.querySelectorAll('.chip').length === 2");
    assert!(!browser.text("location.search").contains("TSA"));
    // Chosen values give the same episodes as the same condition in the language of definitions.
    for (chosen, condition) in
        [("is=TSA%3D1&is=MCR%3D0", "TSA%20%3D%201%20and%20MCR%20%3D%200"), ("is=SC%3D", "SC%20is%20null")]
    {
        let total = |query: &str| server.get(&format!("/api/episodes?{query}")).json()["total"].clone();
        assert_eq!(total(chosen), total(&format!("where={condition}")), "{chosen}");
    }
    assert_eq!(server.get("/api/episodes?is=NOPE%3D1").status, 400);
    browser.close();
}

#[test]
fn an_invalid_condition_stays_with_its_error() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    for view in ["overview", "episodes"] {
        let mut browser = Browser::at(&format!("{}?view={view}&where=TSB+%3D+1&model=oracle", server.link));
        until(&mut browser, "document.querySelector('#where-fault')");
        let fault = browser.text("document.querySelector('#where-fault').textContent");
        assert!(fault.contains("TSB") && fault.contains("TSA"), "what is wrong and what was meant: {fault}");
        assert!(browser.holds(
            "(({ value, ariaInvalid }) => value === 'TSB = 1' && ariaInvalid === 'true')(document.querySelector('input[name=where]'))"
        ));
        assert!(
            browser.holds("document.querySelector('input[name=model][value=oracle]').checked"),
            "the rest stays too"
        );
    }
}

#[test]
fn an_empty_result_offers_to_remove_each_filter() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    for view in ["overview", "episodes"] {
        let mut browser =
            Browser::at(&format!("{}?view={view}&model=frozen&experiment=E5&where=TSA+%3D+1", server.link));
        until(&mut browser, "document.querySelector('.nothing')");
        let ways = browser.texts("[...document.querySelectorAll('.nothing a')].map((way) => way.textContent)");
        assert_eq!(ways, ["without Experiment: E5", "without Model: frozen", "without TSA = 1", "all episodes"]);
        browser.click(".nothing li:last-child a");
        until(&mut browser, "document.querySelector('.nothing') === null && document.querySelector('.chip') === null");
        browser.close();
    }
}

#[test]
fn models_are_in_an_order_over_all_experiments() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[PAPER]);
    let told = server.get("/api/overview").json()["ranking"].clone();
    assert_eq!((&told["metric"], told["rows"].as_array().unwrap().len()), (&"TSA".into(), 8));
    let cells = run(folder.path(), &["report", PAPER, "--out", "report", "--no-figures"]);
    cells.done();
    let cells = std::fs::read_to_string(folder.path().join("report/cells.csv")).unwrap();
    let mean = |model: &str| {
        let rows = cells.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let means: Vec<f64> =
            rows.filter(|row| row[1] == model && row[2] == "TSA").map(|row| row[6].parse().unwrap()).collect();
        means.iter().sum::<f64>() / 5.0
    };
    let rows = told["rows"].as_array().unwrap();
    for row in rows {
        let (name, shown) = (row["model"].as_str().unwrap(), row["mean"].as_str().unwrap());
        assert!((mean(name) - shown.parse::<f64>().unwrap()).abs() < 6e-4, "{name}: {shown}, {}", mean(name));
    }
    let means: Vec<f64> = rows.iter().map(|row| row["mean"].as_str().unwrap().parse().unwrap()).collect();
    assert!(means.is_sorted_by(|a, b| a >= b), "{means:?}");
    let mut browser = Browser::at(&server.link);
    until(&mut browser, "document.querySelectorAll('#ranking-table tbody tr').length === 8");
    browser.close();
}
