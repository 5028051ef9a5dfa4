//! Figures in the page: values on hover and by keyboard, and their size.

use crate::html::browser::Browser;
use crate::html::scored::PAPER_PAGE;

const TIP: &str = "document.getElementById('tip').hidden ? '' : document.getElementById('tip').textContent";

#[test]
fn a_mark_tells_its_value_to_pointer_and_keyboard() {
    let mut browser = Browser::open(&PAPER_PAGE);
    let title = browser.text("document.querySelector('#figure-heatmap .mark > title').textContent");
    assert!(title.starts_with("E1 · "), "{title}");
    browser.point_at("#figure-heatmap .mark");
    assert_eq!(browser.text(TIP), title);
    assert!(
        browser.holds("document.querySelector('#figure-heatmap .mark').querySelector('title') === null"),
        "one tip, not two"
    );
    browser.point_at("h1");
    assert_eq!(browser.text(TIP), "");
    browser.value("document.querySelector('#figure-heatmap .sheet').focus()");
    browser.press("ArrowRight");
    assert_eq!(browser.text(TIP), title);
    browser.press("ArrowRight");
    let second = browser.text(TIP);
    assert!(second.starts_with("E1 · ") && second != title, "{second}");
    browser.press("End");
    let last =
        browser.text("[...document.querySelectorAll('#figure-heatmap .mark')].at(-1).getAttribute('aria-label')");
    assert_eq!(browser.text(TIP), last);
    assert_eq!(browser.text("document.querySelector('[aria-live]').textContent"), last);
    browser.press("Tab");
    assert_eq!(browser.text(TIP), "");
    browser.close();
}

#[test]
fn marks_have_the_numbers_of_the_tables() {
    let mut browser = Browser::open(&PAPER_PAGE);
    let differing = "[...document.querySelectorAll('#figure-heatmap .mark[data-metric]')].filter((mark) => { \
        const { experiment, model, metric, value, n } = mark.dataset; \
        const row = [...document.querySelectorAll('#table-main tr')] \
            .find((r) => r.dataset.experiment === experiment && r.dataset.model === model); \
        const cell = [...row.children].find((c) => c.dataset.metric === metric); \
        return cell.dataset.mean !== value || cell.dataset.n !== n; }).length";
    assert_eq!(browser.value(differing), 0);
    assert_eq!(browser.value("document.querySelectorAll('#figure-heatmap .mark[data-metric]').length"), 40 * 6);
    browser.close();
}

#[test]
fn a_figure_grows_and_fits_again() {
    let mut browser = Browser::open(&PAPER_PAGE);
    let width = "document.querySelector('#figure-spider svg').getBoundingClientRect().width";
    let before = browser.value(width).as_f64().unwrap();
    browser.click("#figure-spider [data-zoom=in]");
    let larger = browser.value(width).as_f64().unwrap();
    assert!(larger > before * 1.2, "{before} {larger}");
    browser.click("#figure-spider [data-zoom=out]");
    browser.click("#figure-spider [data-zoom=out]");
    assert!(browser.value(width).as_f64().unwrap() < before);
    browser.click("#figure-spider [data-zoom=fit]");
    assert!((browser.value(width).as_f64().unwrap() - before).abs() < 1.0);
    browser.close();
}
