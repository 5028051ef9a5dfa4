//! The copy of the page, from a disk.

use crate::harness::program::run;
use crate::html::browser::Browser;
use crate::view::RECORDED;
use crate::view::pages::until;

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
