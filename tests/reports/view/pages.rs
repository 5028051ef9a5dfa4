//! The page in use.

use crate::harness::program::run;
use crate::html::browser::Browser;
use crate::view::{PAPER, RECORDED, Server};

/// Waits until an expression is true in the page.
pub fn until(browser: &mut Browser, expression: &str) {
    let wait = format!(
        "new Promise((done) => {{ const look = () => {{ let is = false; try {{ is = Boolean({expression}); }} catch {{ }} \
         if (is) done(true); else setTimeout(look, 20); }}; look(); }})"
    );
    browser.value(&wait);
}

#[test]
fn links_lead_from_the_report_to_the_deciding_step() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    let mut browser = Browser::at(&server.link);
    until(&mut browser, "document.querySelector('#table-main td[data-metric=MCR] a')");
    browser.click("#table-main tr[data-experiment='E1'][data-model='guesser'] td[data-metric='MCR'] a");
    until(&mut browser, "document.querySelector('.list .rows a')");
    let address = browser.text("location.search");
    assert!(address.contains("view=episodes") && address.contains("model=guesser"), "{address}");
    browser.click(".list .rows a");
    until(&mut browser, "document.querySelector('.metric') && document.querySelector('img.frame').complete");
    assert!(browser.holds("document.querySelector('img.frame').naturalWidth > 0"));
    until(&mut browser, "document.querySelectorAll('svg.map .cube').length > 0");
    browser.press("Home");
    browser.press("ArrowRight");
    assert!(browser.text("location.search").contains("t=2"));
    let t = browser.text("document.querySelector('.metric button.jump').dataset.t");
    browser.click(".metric button.jump");
    assert!(browser.text("document.querySelector('.clock').textContent").starts_with(&format!("t = {t} ")));
    let address = browser.text("location.href");
    let mut again = Browser::at(&address);
    until(&mut again, "document.querySelector('.clock')");
    assert!(again.text("document.querySelector('.clock').textContent").starts_with(&format!("t = {t} ")));
    again.close();
    browser.close();
}

#[test]
fn filters_are_in_the_address_and_faults_are_shown() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[PAPER]);
    let mut browser =
        Browser::at(&format!("{}?view=episodes&experiment=E1&where=TSA+%3D+0+and+MCR+%3D+1", server.link));
    until(&mut browser, "document.querySelector('.list .rows a')");
    let expected = server.get("/api/episodes?experiment=E1&where=TSA+%3D+0+and+MCR+%3D+1").json()["total"].to_string();
    assert!(browser.text("document.querySelector('#count').textContent").starts_with(&format!("{expected} of 840")));
    assert!(browser.holds("document.querySelector('input[name=experiment][value=E1]').checked"));
    let rows = "document.querySelectorAll('.list .rows a').length";
    assert!(browser.value(rows).as_u64().unwrap() < 100, "what is out of view is not drawn");
    browser.press("/");
    assert!(browser.holds("document.activeElement.name === 'search'"));
    browser.close();
}

#[test]
fn two_episodes_are_compared_at_their_first_difference() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[PAPER]);
    let ids = ["E1/gpt-5-1/s1/r1", "E1/qwen-3-6-plus/s1/r1"];
    let told = server.get(&format!("/api/compare?a={}&b={}", ids[0], ids[1])).json();
    let first = told["first"]["t"].to_string();
    let mut browser = Browser::at(&format!("{}?view=compare&a={}&b={}", server.link, ids[0], ids[1]));
    until(&mut browser, "document.querySelectorAll('.side .step').length === 2");
    assert!(browser.text("document.querySelector('.clock').textContent").starts_with(&format!("t = {first} ")));
    assert!(browser.holds("document.querySelectorAll('.differs').length > 0"));
    browser.close();
}

#[test]
fn two_episodes_are_called_alike_nowhere() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    let (a, b) = ("E1/oracle/s1/r1", "E1/guesser/s1/r1");
    let told = server.get(&format!("/api/compare?a={a}&b={b}")).json();
    let (long, short) = (told["a"]["length"].as_u64().unwrap(), told["b"]["length"].as_u64().unwrap());
    assert!(long > short, "the guesser is done before the oracle");
    assert_eq!((told["ended"]["side"].as_str(), told["ended"]["t"].as_u64()), (Some("b"), Some(short)));
    let columns = |t: u64| {
        let steps = |side: &str| told[side]["steps"].as_object().unwrap().clone();
        let (a, b) = (steps("a"), steps("b"));
        let at = usize::try_from(t - 1).unwrap();
        let names: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
        let value = |of: &serde_json::Map<String, serde_json::Value>, name: &str| {
            of.get(name).map(|column| column["values"][at].clone()).unwrap_or_default()
        };
        names.into_iter().filter(|name| value(&a, name) != value(&b, name)).count()
    };
    let listed = told["differences"].as_array().unwrap();
    let acts = listed.iter().filter(|found| !found["columns"].as_array().unwrap().is_empty()).count() as u64;
    assert_eq!(told["differing"].as_u64().unwrap(), acts + long - short);
    let mut browser = Browser::at(&format!("{}?view=compare&a={a}&b={b}", server.link));
    until(&mut browser, "document.querySelectorAll('.side .step').length === 2");
    browser.press("Home");
    for t in 1..=long {
        until(&mut browser, &format!("document.querySelector('.clock').textContent.startsWith('t = {t} ')"));
        let said = "document.querySelector('.parted').textContent";
        if t <= short {
            until(&mut browser, &format!("/frames (are equal|differ|cannot)/.test({said})"));
        }
        let words = browser.text(said);
        assert!(!words.contains("alike"), "t = {t}: {words}");
        if t > short {
            assert_eq!(words, format!("B ended at t = {short}; A goes on."), "t = {t}");
        } else {
            assert_eq!(words.starts_with("Here no recorded column differs"), columns(t) == 0, "t = {t}: {words}");
            let same = server.get(&format!("/api/same_frame?a={a}&b={b}&t={t}")).json()["is_same"].clone();
            let frame = |id: &str| server.get(&format!("/api/frame?id={id}&t={t}")).body;
            let expected = if frame(a) == frame(b) { "equal" } else { "differ" };
            assert!(words.contains(expected), "t = {t}: {words}");
            assert_eq!(same, frame(a) == frame(b));
        }
        browser.press("ArrowRight");
    }
    let count = browser.text("document.querySelector('#differing').textContent");
    assert!(count.ends_with(&format!("differs at {} of {long} steps.", told["differing"])), "{count}");
    browser.close();
}

#[test]
fn episodes_are_aligned_by_what_happened_in_them() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &["view", RECORDED, "--where", "experiment = 'E1'", "--export", "page"]).done();
    let server = Server::start(folder.path(), &[RECORDED]);
    let (a, b) = ("E1/oracle/s1/r1", "E1/guesser/s1/r1");
    let told = server.get(&format!("/api/compare?a={a}&b={b}&align=decision")).json();
    let length = |side: &str| told[side]["length"].as_u64().unwrap();
    let lead = length("a") - length("b");
    assert_eq!((&told["leads"]["a"], &told["leads"]["b"]), (&0.into(), &lead.into()), "both end with their decision");
    assert!(told["ended"].is_null());
    let steps = told["differences"].as_array().unwrap();
    assert!(steps.iter().all(|step| step["t"].as_u64().unwrap() > lead));
    let acts = steps.iter().filter(|step| !step["columns"].as_array().unwrap().is_empty()).count() as u64;
    assert_eq!(told["differing"], acts + lead, "steps of one alone differ too");
    assert!(
        server.get(&format!("/api/compare?a={a}&b={b}&align=sight")).json()["aligned"].is_null(),
        "B never sees it"
    );
    let page = format!("file://{}/index.html", folder.path().join("page").display());
    for base in [server.link.as_str(), page.as_str()] {
        let mut browser = Browser::at(&format!("{base}?view=compare&a={a}&b={b}&align=decision"));
        until(&mut browser, "document.querySelectorAll('.side .step').length === 2");
        let count = browser.text("document.querySelector('#differing').textContent");
        assert!(
            count.ends_with(&format!("differs at {} of {} steps.", told["differing"], length("a"))),
            "{base}: {count}"
        );
        browser.press("Home");
        until(&mut browser, "document.querySelector('.parted').textContent === 'B has not begun.'");
        browser.press("End");
        until(&mut browser, "document.querySelector('.parted').textContent.startsWith('Here')");
        let places = browser.texts("[...document.querySelectorAll('.side')].map((side) => side.textContent)");
        let said = [length("a"), length("b")].map(|t| format!("t = {t}"));
        assert!(places.iter().zip(&said).all(|(place, words)| place.contains(words)), "{places:?}");
        browser.close();
    }
}

#[test]
fn every_model_on_one_scene_is_a_grid() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &["view", RECORDED, "--where", "experiment = 'E1'", "--export", "page"]).done();
    let server = Server::start(folder.path(), &[RECORDED]);
    let page = format!("file://{}/index.html", folder.path().join("page").display());
    let mut told = Vec::new();
    for base in [server.link.as_str(), page.as_str()] {
        let mut browser = Browser::at(&format!("{base}?view=episode&id=E1/oracle/s1/r1"));
        until(&mut browser, "document.querySelector('.turn a[href*=scene]')");
        browser.click(".turn a[href*=scene]");
        until(&mut browser, "document.querySelectorAll('.scene > li').length > 1");
        told.push(browser.texts("[...document.querySelectorAll('.scene > li')].map((own) => `${own.querySelector('h2').textContent} ${own.querySelector('.verdict').textContent}`)"));
        browser.close();
    }
    assert_eq!(told[0].len(), 7, "{told:?}");
    assert!(told[0].iter().any(|own| own == "guesser chose brown, is brown: right at t = 2; never saw the mirror"));
    assert_eq!(told[0], told[1], "the copy shows the same");
}

#[test]
fn every_flip_of_other_definitions_leads_to_its_episode() {
    let folder = tempfile::tempdir().unwrap();
    let inclusive = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/definitions/inclusive.toml");
    let server = Server::start(folder.path(), &[PAPER, "--against", inclusive]);
    let mut browser = Browser::at(&format!("{}?view=changes", server.link));
    until(&mut browser, "document.querySelector('#flips tbody tr')");
    assert_eq!(browser.value("document.querySelectorAll('#flips tbody tr').length"), 32);
    browser.click("#flips tbody a");
    until(&mut browser, "document.querySelector('.metric .flipped')");
    browser.close();
}

#[test]
fn the_order_of_a_table_is_in_the_address() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[PAPER]);
    let mut browser = Browser::at(&server.link);
    until(&mut browser, "document.querySelector('#table-main th[data-metric=TTD] button')");
    browser.click("#table-main th[data-metric=TTD] button");
    let address = browser.text("location.href");
    assert!(address.ends_with("?tables=main%3Aascending%3ATTD"), "{address}");
    let means = "[...document.querySelectorAll('#table-main tbody:nth-of-type(1) td[data-metric=TTD]')].map((c) => c.dataset.mean)";
    let sorted = browser.texts(means);
    assert!(sorted.iter().map(|mean| mean.parse::<f64>().unwrap()).is_sorted(), "{sorted:?}");
    let mut again = Browser::at(&address);
    until(&mut again, "document.querySelector('#table-main th[aria-sort]')");
    assert_eq!(again.texts(means), sorted);
    // The list has its own order.
    again.click("#tabs a:nth-of-type(2)");
    until(&mut again, "document.querySelector('.list .rows a')");
    again.close();
    browser.close();
}

#[test]
fn a_link_to_an_episode_is_printed_and_opened() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED, "--episode", "E1/guesser/s1/r2"]);
    assert!(server.link.ends_with("/?view=episode&id=E1/guesser/s1/r2"), "{}", server.link);
    let mut browser = Browser::at(&server.link);
    until(&mut browser, "document.querySelector('h1').textContent === 'E1/guesser/s1/r2'");
    browser.close();
    let refused = run(folder.path(), &["view", RECORDED, "--episode", "E1/nobody/s1/r1"]).refused();
    assert!(refused.contains("`E1/nobody/s1/r1`") && refused.contains("info --episodes"), "{refused}");
}
