//! An episode's first screen: the questions that it answers, and its cost.

use serde_json::json;

use crate::harness::program::run;
use crate::html::browser::Browser;
use crate::view::pages::until;
use crate::view::{RECORDED, Server};

const EPISODE: &str = "E1/guesser/s1/r1";

fn at(server: &Server, query: &str, width: u32) -> Browser {
    let mut browser = Browser::at(&server.link);
    let size = json!({"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": false});
    browser.send("Emulation.setDeviceMetricsOverride", &size);
    let state = "document.dispatchEvent(new CustomEvent('state', { detail: { replace: false } }))";
    until(&mut browser, "document.documentElement.dataset.shown");
    let shown = browser.text("document.documentElement.dataset.shown");
    browser.value(&format!("history.pushState(null, '', location.pathname + {query:?}); {state}"));
    until(
        &mut browser,
        &format!("document.documentElement.dataset.shown !== '{shown}' && document.querySelector('h1')"),
    );
    browser
}

#[test]
fn the_first_screen_says_what_happened() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    let mut browser = at(&server, &format!("?view=episode&id={EPISODE}"), 1400);
    until(&mut browser, "document.querySelector('svg.map .cube') && document.querySelector('img.frame').complete");
    let verdict = browser.text("document.querySelector('.headline .verdict').textContent");
    assert_eq!(verdict, "chose brown, is brown: right at t = 2; never saw the mirror");
    assert!(
        browser.text("document.querySelector('.clock').textContent").starts_with("t = 2 "),
        "opened at the decision"
    );
    // All of it is inside the window.
    for part in [
        ".verdict",
        "img.frame",
        "svg.map",
        ".timeline",
        ".truth",
        ".step [data-column=reasoning]",
        ".step [data-column=mirror_visible]",
        ".metric[data-metric=AR_SC] h3",
    ] {
        let place = format!(
            "(() => {{ const r = document.querySelector({part:?}).getBoundingClientRect(); \
             return r.top >= 0 && r.bottom <= 900 && r.left >= 0 && r.right <= 1400 && r.height > 0; }})()"
        );
        assert!(browser.holds(&place), "{part}");
    }
    assert_eq!(browser.value("document.documentElement.scrollHeight"), 900, "nothing to scroll");
    let keys = browser.texts("[...document.querySelectorAll('.legend li')].map((item) => item.textContent)");
    for words in ["itself", "mirror", "cube"] {
        assert!(keys.iter().any(|key| key == words), "{keys:?}");
    }
    assert!(keys.iter().any(|key| key.contains("turn left") && key.contains("done")), "{keys:?}");
    let names = browser
        .texts("[...document.querySelectorAll('.strip canvas')].map((canvas) => canvas.getAttribute('aria-label'))");
    assert!(names.iter().any(|name| name == "Cube: brown t = 2"), "{names:?}");
    assert!(names.iter().any(|name| name == "Mirror evidence: at no step"), "{names:?}");
    browser.close();
}

#[test]
fn a_map_is_never_empty() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    let mut browser = at(&server, "?view=episodes", 1400);
    // A map is never empty when it appears in the page.
    browser.value(
        "window.empty = 0; new MutationObserver(() => { const map = document.querySelector('.above'); \
         if (map && map.querySelector('svg > *, p') === null) window.empty += 1; }).observe(document.body, { childList: true, subtree: true })",
    );
    browser.click(".list .rows a[data-id='E1/guesser/s1/r1']");
    until(&mut browser, "document.querySelector('svg.map .cube')");
    assert_eq!(browser.value("window.empty"), 0);
    let body = "[...document.querySelectorAll('svg.map .self')].some((body) => parseFloat(getComputedStyle(body).strokeWidth) > 0)";
    assert!(browser.holds(body), "a body has an edge, whatever its colour");
    browser.close();
}

#[cfg(feature = "sim")]
#[test]
fn the_map_has_the_room_its_bodies_and_the_field_of_view_even_without_a_log() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    let mut browser = at(&server, "?view=episode&id=E4/oracle/s1/r1&t=1", 1400);
    until(&mut browser, "document.querySelector('svg.map .cube')");
    for (kind, least) in [("wall", 4), ("mirror", 1), ("cube", 3), ("other", 1), ("self", 1), ("cone", 1)] {
        let count = browser.value(&format!("document.querySelectorAll('svg.map .{kind}').length"));
        assert!(count.as_u64().is_some_and(|count| count >= least), "{kind}: {count}");
    }
    let keys = browser.texts("[...document.querySelectorAll('.legend li')].map((item) => item.textContent)");
    for words in ["wall", "mirror", "cube", "itself", "another body", "field of view, 125 degrees"] {
        assert!(keys.iter().any(|key| key == words), "{words}: {keys:?}");
    }
    // The cone turns with the agent: the first step of this episode is a turn.
    let cone = "document.querySelector('svg.map .cone').getAttribute('d')";
    let before = browser.text(cone);
    browser.press("ArrowRight");
    until(&mut browser, &format!("{cone} !== {before:?}"));
    assert!(browser.holds("document.querySelector('.clock').textContent.startsWith('t = 2 ')"));
    browser.close();
}

#[test]
fn maps_and_server_memory_stay_small() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    for run in [1, 2] {
        let map = server.get(&format!("/api/map?id=E1/guesser/s1/r{run}"));
        let told = map.json();
        let steps = told["steps"].as_array().unwrap().len();
        assert!(map.body.len() < 2_000 + 200 * steps, "{} bytes for {steps} steps", map.body.len());
        let numbers = told["shapes"].as_array().unwrap().iter().flat_map(|shape| shape.as_array().unwrap());
        assert!(numbers.clone().count() > 0 && numbers.clone().all(serde_json::Value::is_i64));
    }
    let status = std::fs::read_to_string(format!("/proc/{}/status", server.process_id())).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:")).unwrap();
    let kilobytes: u64 = line.trim().strip_suffix(" kB").unwrap().trim().parse().unwrap();
    assert!(kilobytes < 100 << 10, "{kilobytes} kB");
}

#[test]
fn an_episode_exports_as_one_standalone_file() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &["view", RECORDED, "--episode", EPISODE, "--export", "episode.html"]).done();
    let page = std::fs::read_to_string(folder.path().join("episode.html")).unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    let answer = server.get(&format!("/api/file?id={EPISODE}"));
    assert!(answer.head.contains("content-disposition: attachment"), "{}", answer.head);
    assert_eq!(answer.text(), page);
    let mut browser = Browser::open(&page);
    until(
        &mut browser,
        "document.querySelector('img.frame')?.naturalWidth > 0 && document.querySelector('svg.map .cube')",
    );
    assert!(browser.text("document.querySelector('.verdict').textContent").starts_with("chose brown"));
    browser.press("ArrowLeft");
    until(&mut browser, "document.querySelector('.clock').textContent.startsWith('t = 1 ')");
    assert!(browser.holds("document.querySelector('#tabs a') === null"));
    browser.close();
}

#[test]
fn an_unknown_episode_is_not_exported() {
    let folder = tempfile::tempdir().unwrap();
    let refused =
        run(folder.path(), &["view", RECORDED, "--episode", "E1/nobody/s1/r1", "--export", "a.html"]).refused();
    assert!(refused.contains("nobody"), "{refused}");
}

#[test]
fn a_link_is_copied() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    let mut browser = at(&server, &format!("?view=episode&id={EPISODE}&t=2"), 1400);
    browser.value("navigator.clipboard.writeText = async (text) => { window.copied = text; }");
    browser.click("button.copy");
    until(&mut browser, "window.copied && document.querySelector('button.copy').textContent === 'Copied'");
    assert!(browser.text("window.copied").ends_with("&t=2"));
    browser.close();
}
