//! The page in dark mode, on a phone, and on paper.

use serde_json::json;

use crate::html::browser::Browser;
use crate::html::scored::{PAPER_PAGE, Report};

#[test]
fn dark_and_light_follow_the_system_until_told_otherwise() {
    let report = Report::bare();
    let mut browser = Browser::open(&report.render().unwrap());
    let ground = "getComputedStyle(document.body).backgroundColor";
    let system = |scheme: &str| json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
    browser.send("Emulation.setEmulatedMedia", &system("light"));
    let light = browser.text(ground);
    browser.send("Emulation.setEmulatedMedia", &system("dark"));
    let dark = browser.text(ground);
    assert_ne!(light, dark);
    let pressed = "document.getElementById('theme').getAttribute('aria-pressed')";
    assert_eq!(browser.text(pressed), "true");
    browser.click("#theme");
    assert_eq!((browser.text(ground), browser.text(pressed)), (light.clone(), "false".to_owned()));
    browser.send("Emulation.setEmulatedMedia", &system("light"));
    browser.click("#theme");
    assert_eq!(browser.text(ground), dark);
    browser.close();
}

/// The minimum contrast of WCAG 2.2 for body text.
const LEAST_CONTRAST: f64 = 4.5;

#[test]
fn text_stands_out_from_its_ground_in_both_themes() {
    let report = Report::bare();
    let mut browser = Browser::open(&report.render().unwrap());
    let contrast = "(() => { \
        const light = (c) => c.match(/[0-9.]+/g).slice(0, 3).map(Number) \
            .map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)) \
            .reduce((sum, v, at) => sum + v * [0.2126, 0.7152, 0.0722][at], 0); \
        const ground = (e) => { for (; e; e = e.parentElement) { const c = getComputedStyle(e).backgroundColor; \
            if (c !== 'rgba(0, 0, 0, 0)') return c; } return 'rgb(255, 255, 255)'; }; \
        const texts = [...document.querySelectorAll('h1, p, dt, dd, a, caption, th, td, td small, li, summary, code, legend, output')]; \
        return Math.min(...texts.filter((e) => e.checkVisibility()).map((e) => { \
            const [a, b] = [light(getComputedStyle(e).color), light(ground(e))]; \
            return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05); })); })()";
    for theme in ["light", "dark"] {
        browser.value(&format!("document.documentElement.dataset.theme = '{theme}'"));
        let least = browser.value(contrast).as_f64().unwrap();
        assert!(least >= LEAST_CONTRAST, "{theme}: {least}");
    }
    browser.close();
}

#[test]
fn a_narrow_window_scrolls_tables_and_never_the_page() {
    let mut browser = Browser::open(&PAPER_PAGE);
    let narrow = json!({"width": 400, "height": 800, "deviceScaleFactor": 1, "mobile": false});
    browser.send("Emulation.setDeviceMetricsOverride", &narrow);
    let overflow = "document.documentElement.scrollWidth - document.documentElement.clientWidth";
    assert_eq!(browser.value(overflow), 0);
    browser.click("#table-main td[data-metric=TSA]");
    assert!(browser.holds("document.getElementById('episodes').getBoundingClientRect().left >= 0"));
    browser.close();
}

#[test]
fn paper_has_everything_but_the_controls() {
    let mut browser = Browser::open(&PAPER_PAGE);
    browser.value("document.documentElement.dataset.theme = 'dark'");
    browser.send("Emulation.setEmulatedMedia", &json!({"media": "print"}));
    let controls = "[...document.querySelectorAll('button:not(thead button), nav, #filters, .skip')] \
        .filter((c) => c.checkVisibility()).map((c) => c.outerHTML)";
    assert_eq!(browser.texts(controls), Vec::<String>::new());
    assert_eq!(browser.text("getComputedStyle(document.body).color"), "rgb(28, 31, 33)");
    browser.send("Emulation.setEmulatedMedia", &json!({"media": ""}));
    let pdf = browser.send("Page.printToPDF", &json!({}));
    assert!(pdf["data"].as_str().unwrap().starts_with("JVBER"));
    assert!(!browser.holds("document.querySelector('details').open"), "what was folded is folded again");
    browser.close();
}

#[test]
fn unbreakable_parts_fit_half_a_printed_page() {
    let mut browser = Browser::open(&PAPER_PAGE);
    // A4 without its margins: 186 mm x 269 mm, at 96 px per inch.
    let size = json!({"width": 703, "height": 1017, "deviceScaleFactor": 1, "mobile": false});
    browser.send("Emulation.setDeviceMetricsOverride", &size);
    browser.send("Emulation.setEmulatedMedia", &json!({"media": "print"}));
    browser.value("dispatchEvent(new Event('beforeprint'))");
    let large = "[...document.querySelectorAll('body *')].filter((e) => e.checkVisibility() \
        && getComputedStyle(e).breakInside === 'avoid' && e.getBoundingClientRect().height > 1017 / 2) \
        .map((e) => `${e.tagName} ${e.id} ${e.getBoundingClientRect().height}`)";
    assert_eq!(browser.texts(large), Vec::<String>::new());
    let text = "[...document.querySelectorAll('pre')].filter((e) => e.checkVisibility()).map((e) => e.textContent.slice(0, 40))";
    assert_eq!(browser.texts(text), Vec::<String>::new(), "text of fixed width stays folded");
    browser.close();
}

/// Episodes of many models, as in a large study.
fn of_many(models: usize, experiments: usize, runs: usize) -> Vec<mirrorstats_trace::episodes::episode::Episode> {
    let step = |action, right: bool| mirrorstats_trace::episodes::episode::Step {
        action: Some(action),
        self_color: Some(if right { "red" } else { "blue" }.into()),
        selected_cube: Some(if right { "red" } else { "blue" }.into()),
        mirror_visible: right,
        ..mirrorstats_trace::episodes::episode::Step::default()
    };
    let episode = |model: usize, experiment: usize, run: usize| {
        let right = (model * 31 + run * 17 + experiment) % 50 < model;
        mirrorstats_trace::episodes::episode::Episode {
            episode_id: format!("E{experiment}/vendor-model-{model:02}/s{}/r{}", 1 + run / 7, 1 + run % 7),
            model: format!("vendor-model-{model:02}"),
            experiment: format!("E{experiment}"),
            seed: i32::try_from(1 + run / 7).unwrap(),
            run: i32::try_from(1 + run % 7).unwrap(),
            body_color: "red".into(),
            steps: vec![
                step(mirrorstats_trace::episodes::episode::Action::TurnLeft, right),
                step(mirrorstats_trace::episodes::episode::Action::Done, right),
            ],
            ..mirrorstats_trace::episodes::episode::Episode::default()
        }
    };
    let of_model =
        |model| (1..=experiments).flat_map(move |experiment| (0..runs).map(move |run| episode(model, experiment, run)));
    (0..models).flat_map(of_model).collect()
}

#[test]
fn ten_thousand_episodes_of_fifty_models_are_four_megabytes() {
    let folder = tempfile::tempdir().unwrap();
    mirrorstats_trace::write::write_episodes(&folder.path().join("many.parquet"), None, &of_many(50, 5, 40)).unwrap();
    let written = crate::harness::program::run(folder.path(), &["report", "many.parquet", "--out", "report"]);
    written.done();
    let page = std::fs::read_to_string(folder.path().join("report/report.html")).unwrap();
    assert!(page.len() <= 4_000_000, "{} bytes", page.len());
    assert!(page.contains("The best 12 of 50 models by TSA."), "figures say that they leave models out");
    let mut browser = Browser::open(&page);
    assert!(browser.holds("document.querySelectorAll('#pair tbody tr').length > 0"));
    assert!(
        browser
            .holds("/further metrics and experiments are left out/.test(document.querySelector('#pair').textContent)")
    );
    browser.close();
}
