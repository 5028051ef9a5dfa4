//! Names that look like markup or script, or that reorder letters.

use mirrorstats_score::tables::builder::TableBuilder;
use mirrorstats_score::tables::table::{EpisodeTable, KeyRef};

use crate::html::browser::Browser;
use crate::html::document::tags;
use crate::html::scored::{PAPER, Report};

const HOSTILE: [&str; 8] = [
    "<script>window.pwned = 1</script>",
    "</script><script>window.pwned = 1</script><!--",
    "\" onmouseover=\"window.pwned = 1\" x=\"",
    "'><img src=x onerror=window.pwned=1>",
    "{{ 7 * 7 }}{% include 'page.html' %}",
    "=HYPERLINK(\"http://evil.invalid\")&amp;&#x3c;",
    "a\u{2028}b\u{202e}c\u{0}d\n</td></table>",
    "__proto__",
];

/// The bundled episodes with eight models under these names, and matching ids.
fn renamed(names: [&str; 8]) -> EpisodeTable {
    let mut models: Vec<&str> = PAPER.keys.iter().map(|key| key.model).collect();
    models.sort_unstable();
    models.dedup();
    let mut episodes = TableBuilder::new(PAPER.header());
    for (row, key) in PAPER.keys.iter().enumerate() {
        let at = models.binary_search(&key.model).unwrap();
        let (model, episode_id) = (format!("{at}{}", names[at]), format!("{}{}", key.episode_id, names[at]));
        let key = KeyRef { model: &model, episode_id: &episode_id, ..key };
        let labels = PAPER.labels.iter().map(|label| label.values.get(row));
        episodes.push(key, labels, PAPER.metrics.iter().map(|metric| metric.get(row)));
    }
    episodes.finish()
}

fn page(names: [&str; 8]) -> String {
    Report::of(renamed(names), &["experiment", "model"], "default").render().unwrap()
}

#[test]
fn hostile_names_make_no_tag() {
    assert_eq!(tags(&page(HOSTILE)), tags(&page(["plain"; 8])));
}

/// Characters that reorder or hide text, at least one of each kind.
const HIDDEN: [char; 14] = [
    '\u{ad}',
    '\u{61c}',
    '\u{180e}',
    '\u{200b}',
    '\u{200e}',
    '\u{2028}',
    '\u{202e}',
    '\u{2067}',
    '\u{3164}',
    '\u{e000}',
    '\u{feff}',
    '\u{fffb}',
    '\u{e0041}',
    '\u{e0100}',
];

#[test]
fn no_character_of_a_name_reorders_or_hides_text_of_the_page() {
    let names = HIDDEN.map(|c| format!("a{c}b"));
    for names in names.chunks(7) {
        let name = |at: usize| names.get(at).map_or("plain", String::as_str);
        let page = page([0, 1, 2, 3, 4, 5, 6, 7].map(name));
        for (c, name) in HIDDEN.iter().zip(&HIDDEN.map(|c| format!("a{c}b"))) {
            assert!(!page.contains(*c), "{name:?} is in the page as it is");
        }
        for name in names {
            let code = name.chars().nth(1).unwrap().escape_unicode();
            assert!(page.contains(&format!("a{code}b")), "{name:?} is not in the page");
        }
    }
}

#[test]
fn names_in_any_script_are_in_the_page_as_they_are() {
    let names = ["日本", "עברית", "می\u{200c}خواهم", "👩🏽\u{200d}🚀", "❤\u{fe0f}", "é", "ไทย", "Ж"];
    let page = page(names);
    for name in names {
        assert!(page.contains(&format!("data-model=\"{}{name}\"", names.iter().position(|n| *n == name).unwrap())));
    }
}

#[test]
fn hostile_names_are_shown_and_do_nothing() {
    let mut browser = Browser::open(&page(HOSTILE));
    let names = browser.texts(
        "[...document.querySelectorAll('#table-main tbody:nth-of-type(1) th[scope=row]')].map((t) => t.textContent)",
    );
    let spelled: Vec<String> = HOSTILE.iter().enumerate().map(|(at, name)| format!("{at}{name}")).collect();
    assert_eq!(names[..6], spelled[..6]);
    assert_eq!(names[6], "6a\\u{2028}b\\u{202e}c\\u{0}d\\u{a}</td></table>");
    assert_eq!(names[7], "7__proto__");
    for (at, name) in names.iter().enumerate() {
        let cell = format!("#table-main tbody:nth-of-type(1) tr:nth-of-type({}) td[data-metric=TTD]", at + 2);
        browser.point_at(&cell);
        browser.click(&cell);
        let first = browser.text("document.querySelector('#episodes tbody th').textContent");
        assert!(first.starts_with("E1/") && first.contains(&name[1..]), "{first}");
        browser.press("Escape");
    }
    browser.click("fieldset[data-key='1'] label:nth-of-type(2) span");
    assert!(browser.holds("window.pwned === undefined"));
    browser.close();
}
