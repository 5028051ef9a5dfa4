//! A copy of the page, opened from disk.

use crate::harness::program::run;
use crate::html::browser::Browser;
use crate::view::pages::until;
use crate::view::{RECORDED, Server};

#[test]
fn a_copy_shows_the_same_from_a_disk() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &["view", RECORDED, "--where", "model = 'guesser'", "--export", "page"]).done();
    let page = folder.path().join("page");
    assert!(std::fs::read_to_string(page.join("robots.txt")).unwrap().contains("Disallow: /"));
    assert!(page.join("NOTICE.txt").is_file());
    let mut browser = Browser::at(&format!("file://{}/index.html", page.display()));
    until(&mut browser, "document.querySelector('#table-main td[data-metric] a')");
    browser.click("#table-main td[data-metric] a");
    until(&mut browser, "document.querySelector('.list .rows a')");
    browser.click(".list .rows a");
    until(&mut browser, "document.querySelector('img.frame')?.naturalWidth > 0");
    until(&mut browser, "document.querySelectorAll('svg.map .cube').length > 0");
    browser.close();
}

/// Recordings as large as in a study: each log has more steps than a reader looks at.
#[test]
fn a_copy_is_few_files_with_every_frame_once() {
    let folder = tempfile::tempdir().unwrap();
    let written = run(folder.path(), &["view", RECORDED, "--export", "page"]);
    written.done();
    let page = folder.path().join("page");
    let files: Vec<_> =
        ["data", "assets", "."].iter().flat_map(|inside| std::fs::read_dir(page.join(inside)).unwrap()).collect();
    assert!(files.len() <= 33 + 20, "one file per episode: {}", files.len());
    assert!(!page.join("frames").exists());
    let list = std::fs::read_to_string(page.join("data/list.js")).unwrap();
    let list: serde_json::Value =
        serde_json::from_str(list.split_once(", ").unwrap().1.trim_end().trim_end_matches(");")).unwrap();
    let at = list["rows"].as_array().unwrap().iter().position(|row| row["id"] == "E1/guesser/s1/r1").unwrap();
    let part = std::fs::read_to_string(page.join(format!("data/episode-{at}.js"))).unwrap();
    let part: serde_json::Value =
        serde_json::from_str(part.split_once(", ").unwrap().1.trim_end().trim_end_matches(");")).unwrap();
    let hashes: std::collections::BTreeSet<_> =
        part["frame_hashes"].as_array().unwrap().iter().map(|hash| hash.as_str().unwrap()).collect();
    assert_eq!(part["images"]["png"].as_array().unwrap().len(), hashes.len());
    // The pictures are those of the log, encoded differently.
    let server = Server::start(folder.path(), &[RECORDED]);
    for (t, image) in part["images"]["of"].as_array().unwrap().iter().enumerate() {
        let text = part["images"]["png"][usize::try_from(image.as_u64().unwrap()).unwrap()].as_str().unwrap();
        let copied = base64::Engine::decode(&base64::engine::general_purpose::STANDARD, text).unwrap();
        let frame = server.get(&format!("/api/frame?id=E1/guesser/s1/r1&t={}", t + 1)).body;
        assert!(copied.len() <= frame.len());
        let pixels = |bytes: &[u8]| resvg::tiny_skia::Pixmap::decode_png(bytes).unwrap();
        assert!(pixels(&copied) == pixels(&frame), "t = {}", t + 1);
    }
}

#[test]
fn a_copy_replaces_a_copy_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let export = ["view", RECORDED, "--where", "model = 'oracle'", "--export", "page"];
    run(folder.path(), &export).done();
    let old = folder.path().join("page/data/episode-999.js");
    std::fs::write(&old, "").unwrap();
    run(folder.path(), &export).done();
    assert!(!old.exists(), "what the new copy does not have is gone");
    let other = folder.path().join("other");
    std::fs::create_dir(&other).unwrap();
    std::fs::write(other.join("thesis.txt"), "mine").unwrap();
    let refused = run(folder.path(), &["view", RECORDED, "--export", "other"]).refused();
    assert!(refused.contains("other files"), "{refused}");
    assert_eq!(std::fs::read_dir(&other).unwrap().count(), 1);
}

/// Shows the view of this query in an open page.
fn look(browser: &mut Browser, query: &str) {
    let shown = browser.text("document.documentElement.dataset.shown");
    let state = "document.dispatchEvent(new CustomEvent('state', { detail: { replace: false } }))";
    browser.value(&format!("history.pushState(null, '', location.pathname + {query:?}); {state}"));
    until(browser, &format!("document.documentElement.dataset.shown !== '{shown}'"));
}

/// The list of a copy under a filter: its count, or the notice in place of episodes.
fn listed(browser: &mut Browser, filter: &str) -> (String, String) {
    look(browser, &format!("?view=episodes&{filter}"));
    let text = |selector: &str| format!("document.querySelector('{selector}')?.textContent ?? ''");
    let found = (browser.text(&text("#count")), browser.text(&text(".notice")));
    if !found.1.is_empty() {
        assert!(browser.holds("document.querySelector('.list .rows a') === null"), "{filter}");
    }
    found
}

#[test]
fn a_copy_filters_as_the_server_does_or_says_that_it_cannot() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &["view", RECORDED, "--where", "experiment = 'E1'", "--export", "page"]).done();
    let page = format!("file://{}/index.html", folder.path().join("page").display());
    let server = Server::start(folder.path(), &[RECORDED, "--where", "experiment = 'E1'"]);
    let mut browser = Browser::at(&page);
    until(&mut browser, "document.documentElement.dataset.shown");
    for filter in [
        "where=TSA+%3D+0",
        "where=TSA+%3D+0+and+MCR+%3D+1",
        "where=model+%3D+'oracle'",
        "where=(model+in+('oracle',+'random')+or+TTD+>%3D+100)+and+run+%3D+1",
        "where=MTATO+is+null",
        "where=MTATO+is+not+null+and+MTATO+<>+1",
        "where=scene+%3D+'7ecf958fd2506cc0'",
        "where=scene+is+null",
        "where=TSA+%3D+1&model=oracle",
        "where=seed+%3D+1&search=guess",
        "search=as+good+as+another",
        "search=I+HOLD+my+body",
        "is=TSA%3D0&is=seed%3D1",
        "is=SC%3D&model=oracle",
        "model=oracle&model=mimic",
    ] {
        let expected = server
            .get(&format!("/api/episodes?{}", filter.replace('>', "%3E").replace('<', "%3C").replace('\'', "%27")))
            .json();
        let (total, all) = (&expected["total"], &expected["all"]);
        let (count, notice) = listed(&mut browser, filter);
        let words = if total == all { format!("{all} episodes") } else { format!("{total} of {all} episodes") };
        assert_eq!((count, notice), (words, String::new()), "{filter}");
    }
    for filter in [
        "where=any(mirror_visible)",
        "where=TSA+%2B+1+%3D+2",
        "where=not+TSA+%3D+1",
        "where=NOPE+%3D+1",
        "where=TSA+%3D+'1'",
    ] {
        let (count, notice) = listed(&mut browser, filter);
        assert!(
            count.is_empty() && notice.contains("cannot filter by") && notice.contains("mirrorstats view"),
            "{filter}: {notice}"
        );
    }
    look(&mut browser, "?where=TSA+%3D+0");
    assert!(browser.holds("(({ value, offsetWidth }) => value === 'TSA = 0' && offsetWidth > 0)(document.querySelector('input[name=where]'))"));
    let words = browser.text("document.querySelector('#overview-head .notice').textContent");
    assert!(words.contains("TSA = 0") && browser.holds("document.querySelector('table.results') === null"), "{words}");
    look(&mut browser, "?model=oracle");
    let rows = "[...document.querySelectorAll('#table-main tbody tr[data-group]')].filter((row) => !row.hidden).every((row) => row.dataset.model === 'oracle')";
    assert!(browser.holds(rows));
    browser.click("#section-statistics summary");
    until(&mut browser, "document.querySelector('#section-statistics .notice')");
    browser.close();
}

#[test]
fn a_copy_and_the_server_align_two_episodes_alike() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &["view", RECORDED, "--where", "model in ('guesser', 'gullible')", "--export", "page"]).done();
    let page = format!("file://{}/index.html", folder.path().join("page").display());
    let server = Server::start(folder.path(), &[RECORDED]);
    for (a, b) in [("E1/guesser/s1/r1", "E1/guesser/s1/r2"), ("E1/guesser/s1/r1", "E1/gullible/s1/r1")] {
        let mut told = Vec::new();
        for base in [page.as_str(), server.link.as_str()] {
            let mut browser = Browser::at(&format!("{base}?view=compare&a={a}&b={b}"));
            until(&mut browser, "document.querySelectorAll('.side .step').length === 2");
            told.push(browser.texts("['#differing', '.clock', '#first-difference', 'main > p.quiet'].map((one) => document.querySelector(one).textContent)"));
            drop(browser);
        }
        assert_eq!(told[0], told[1], "{a}, {b}");
    }
}
