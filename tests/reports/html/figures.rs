//! Figures in the page: their size, and values on hover and by keyboard.

use serde_json::json;

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

/// The numbers of visible and faded marks in a figure, among those for which an expression over `mark` is true.
fn left(browser: &mut Browser, figure: &str, is_counted: &str) -> (u64, u64) {
    let marks = format!("[...document.querySelectorAll('#figure-{figure} .mark')].filter((mark) => {is_counted})");
    let off = browser.value(&format!("{marks}.filter((mark) => mark.matches('.off')).length")).as_u64().unwrap();
    (browser.value(&format!("{marks}.length")).as_u64().unwrap() - off, off)
}

#[test]
fn figures_show_only_filtered_data() {
    let mut browser = Browser::open_at(&PAPER_PAGE, "?experiment=E1&experiment=E2&model=GPT+5.1");
    let of_gpt = "mark.dataset.model === 'GPT 5.1'";
    let wanted = format!("{of_gpt} && ['E1', 'E2'].includes(mark.dataset.experiment)");
    for figure in ["spider", "heatmap", "scatter", "intervals", "slopes", "decision-curve"] {
        let (shown, faded) = left(&mut browser, figure, &wanted);
        assert!(shown > 0 && faded == 0, "{figure}");
        let others = format!("mark.dataset.model !== undefined && !({wanted})");
        let (shown, faded) = left(&mut browser, figure, &others);
        assert!(shown == 0 && faded > 0, "{figure}: {shown} of other rows");
    }
    // Lines have titles, and fade with their points.
    let line = "mark.dataset.model === undefined && mark.dataset.experiment === undefined";
    assert_eq!(left(&mut browser, "spider", line), (2, 38));
    assert_eq!(left(&mut browser, "slopes", line).0, 1, "from E1 to E2");
    browser.click("#filters button[type=reset]");
    assert!(browser.holds("new Promise((done) => setTimeout(() => done(true)))"));
    assert!(browser.holds("document.querySelector('.mark.off') === null"));
    browser.close();
}

#[test]
fn figures_are_dark_in_the_dark_and_light_on_paper() {
    let mut browser = Browser::open(&PAPER_PAGE);
    let look = "(() => { const sheet = document.querySelector('#figure-heatmap .sheet'); \
        return [getComputedStyle(sheet).backgroundColor, getComputedStyle(sheet.querySelector('svg')).filter.split('(')[0]].join(' '); })()";
    let system = |scheme: &str| json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
    for (scheme, theme, expected) in [
        ("light", "", "rgb(255, 255, 255) none"),
        ("dark", "", "rgb(20, 20, 20) invert"),
        ("dark", "light", "rgb(255, 255, 255) none"),
        ("light", "dark", "rgb(20, 20, 20) invert"),
    ] {
        browser.send("Emulation.setEmulatedMedia", &system(scheme));
        let set = if theme.is_empty() {
            "delete document.documentElement.dataset.theme".to_owned()
        } else {
            format!("document.documentElement.dataset.theme = '{theme}'")
        };
        browser.value(&set);
        assert_eq!(browser.text(look), expected, "{scheme} {theme}");
    }
    browser.send("Emulation.setEmulatedMedia", &json!({"media": "print", "features": []}));
    assert_eq!(browser.text(look), "rgb(255, 255, 255) none");
    browser.close();
}
