//! Names that would like to be markup, script or an order of letters.

use mirrorstats::score::table::EpisodeTable;

use crate::browser::Browser;
use crate::document::tags;
use crate::scored::{PAPER, Report};

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

/// The bundled episodes of eight models under these names, and ids to match.
fn renamed(names: [&str; 8]) -> EpisodeTable {
    let mut episodes = PAPER.clone();
    let mut models: Vec<String> = episodes.keys.iter().map(|key| key.model.clone()).collect();
    models.sort_unstable();
    models.dedup();
    for key in &mut episodes.keys {
        let at = models.binary_search(&key.model).unwrap();
        key.model = format!("{at}{}", names[at]);
        key.episode_id = format!("{}{}", key.episode_id, names[at]);
    }
    episodes.sorted()
}

fn page(names: [&str; 8]) -> String {
    Report::of(renamed(names), &["experiment", "model"], "default").render().unwrap()
}

#[test]
fn hostile_names_make_no_tag() {
    assert_eq!(tags(&page(HOSTILE)), tags(&page(["plain"; 8])));
}

#[test]
fn hostile_names_are_shown_and_do_nothing() {
    let Some(mut browser) = Browser::open("hostile names", &page(HOSTILE)) else { return };
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
