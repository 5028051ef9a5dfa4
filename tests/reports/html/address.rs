//! The address records the reader's choices, and a link shows the same.

use serde_json::json;

use crate::html::browser::Browser;
use crate::html::scored::Report;

/// The visible rows of the main table, in order.
const ROWS: &str = "[...document.querySelectorAll('#table-main tbody tr[data-group]')].filter((r) => r.checkVisibility()) \
    .map((r) => [r.dataset.experiment, r.dataset.model].join('|'))";

fn chip(key: usize, at: usize) -> String {
    format!("fieldset[data-key='{key}'] label:nth-of-type({}) span", at + 1)
}

/// Types into the field at `selector`.
fn write(browser: &mut Browser, selector: &str, text: &str) {
    browser.click(selector);
    browser.send("Input.insertText", &json!({"text": text}));
}

#[test]
fn a_link_shows_the_same_choice() {
    let page = Report::bare().render().unwrap();
    let mut browser = Browser::open(&page);
    browser.click(&chip(0, 0));
    browser.click(&chip(0, 2));
    browser.click(&chip(1, 1));
    browser.click(&chip(1, 3));
    browser.click("#table-main th[data-metric=TTD] button");
    browser.click("#table-appendix th[data-metric='TSA-C'] button");
    let rows = browser.texts(ROWS);
    assert_eq!(rows.len(), 4);
    let address = browser.text("location.search");
    assert!(address.contains("experiment=E1&experiment=E3&model=GPT+5.1"), "{address}");
    let mut again = Browser::open_at(&page, &address);
    assert_eq!(again.texts(ROWS), rows);
    let sorted = "[...document.querySelectorAll('[aria-sort]')].map((h) => h.dataset.metric + ' ' + h.ariaSort)";
    assert_eq!(again.texts(sorted), ["TTD ascending", "TSA-C descending"]);
    assert_eq!(again.text("location.search"), address, "opening a link changes nothing in it");
    again.click("#filters button[type=reset]");
    assert!(again.holds("new Promise((done) => setTimeout(() => done(true)))"));
    assert_eq!(again.text("location.search"), "?sort=main%3Aascending%3ATTD&sort=appendix%3Adescending%3ATSA-C");
    again.close();
    browser.close();
}

#[test]
fn words_are_searched_for_in_rows_and_groups() {
    let page = Report::bare().render().unwrap();
    let mut browser = Browser::open(&page);
    write(&mut browser, "#search", "gpt");
    let one = ["E1|GPT 5.1", "E2|GPT 5.1", "E3|GPT 5.1", "E4|GPT 5.1", "E5|GPT 5.1"];
    assert_eq!(browser.texts(ROWS), one);
    assert_eq!(browser.text("document.getElementById('shown').textContent"), "5 of 40 rows");
    let address = browser.text("location.search");
    assert_eq!(address, "?search=gpt");
    let mut again = Browser::open_at(&page, &address);
    assert_eq!(
        (again.texts(ROWS), again.text("document.getElementById('search').value")),
        (one.map(str::to_owned).to_vec(), "gpt".to_owned())
    );
    write(&mut again, "#search", " no such name");
    assert_eq!(again.texts(ROWS), Vec::<String>::new());
    again.close();
    browser.close();
}

#[test]
fn the_ungrouped_list_and_the_open_cell_are_in_the_address() {
    let page = Report::bare().render().unwrap();
    let mut browser = Browser::open(&page);
    browser.click("#grouped");
    browser.click("#table-main tr[data-experiment=E3][data-model='GPT 5.1'] td[data-metric=CAAL]");
    let (address, title) = (browser.text("location.search"), "document.getElementById('episodes-title').textContent");
    assert!(address.contains("groups=no") && address.contains("cell=CAAL"), "{address}");
    let mut again = Browser::open_at(&page, &address);
    assert_eq!(again.text(title), "CAAL, E3 · GPT 5.1");
    assert!(!again.holds("document.getElementById('grouped').checked"));
    again.press("Escape");
    // A dialog reports a little later that it was closed.
    let closed = "new Promise((done) => { const look = () => location.search.includes('cell=') ? setTimeout(look, 20) \
        : done(location.search.includes('groups=no')); look(); })";
    assert!(again.holds(closed));
    again.close();
    browser.close();
}

#[test]
fn unknown_names_in_the_address_are_ignored() {
    let page = Report::bare().render().unwrap();
    let query = "?model=<script>&experiment=E9&sort=main:sideways:TSA&sort=main:ascending:NONE&sort=x&cell=TSA&of=nobody&a=1&search=%3Cimg%20src%3Dx%3E";
    let mut browser = Browser::open_at(&page, query);
    assert_eq!(browser.text("document.getElementById('search').value"), "<img src=x>");
    browser.click("#filters button[type=reset]");
    assert!(browser.holds("new Promise((done) => setTimeout(() => done(true)))"));
    assert_eq!(browser.texts(ROWS).len(), 40);
    assert!(
        browser.holds("document.querySelector('[aria-sort]') === null && !document.getElementById('episodes').open")
    );
    browser.close();
}
