//! The server's answers, and who may read them.

use std::io::{Read as _, Write as _};
use std::path::Path;

use crate::harness::program::wait_for;
use crate::view::{PAPER, RECORDED, Server};

#[test]
fn requests_of_other_hosts_and_sites_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    let host = format!("127.0.0.1:{}", server.port);
    assert_eq!(server.get("/").status, 200);
    for headers in [
        vec![("Host", "mirror.invalid")],
        vec![("Host", "mirror.invalid:80")],
        vec![("Host", host.as_str()), ("Origin", "http://mirror.invalid")],
        vec![("Host", host.as_str()), ("Sec-Fetch-Site", "cross-site"), ("Sec-Fetch-Mode", "cors")],
    ] {
        for path in ["/", "/api/study", "/api/episodes", "/assets/main.js"] {
            let answer = server.ask("GET", path, &headers, "");
            assert_eq!(answer.status, 403, "{path} {headers:?}");
            assert!(!answer.text().contains("E1"));
        }
    }
    for method in ["POST", "PUT", "DELETE", "OPTIONS"] {
        let status = server.ask(method, "/api/study", &[("Host", &host)], "").status;
        assert!([403, 405].contains(&status), "{method}: {status}");
    }
}

#[test]
fn every_response_has_the_security_headers() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    for path in ["/", "/assets/main.js", "/assets/view.css", "/api/study", "/api/nothing", "/nowhere", "/robots.txt"] {
        let head = server.get(path).head;
        let policy = head.lines().find(|line| line.starts_with("content-security-policy:")).unwrap();
        assert!(policy.contains("default-src 'none'") && policy.contains("script-src 'self';"), "{policy}");
        assert!(head.contains("x-content-type-options: nosniff"), "{path}");
        assert!(head.contains("referrer-policy: no-referrer"), "{path}");
    }
    assert!(!server.get("/").text().contains("<script>"), "no script stands in the page");
}

#[test]
fn an_id_is_looked_up_and_never_a_path() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("secret.parquet"), "a secret").unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    for path in [
        "/assets/../../../../etc/passwd",
        "/assets/..%2f..%2fCargo.toml",
        "/../Cargo.toml",
        "/api/../Cargo.toml",
        "/api/episode?id=../secret",
        "/api/episode?id=%2Fetc%2Fpasswd",
        "/api/frame?id=..%2Fsecret&t=1",
        "/api/frame?id=E1/guesser/s1/r1&t=99999999999999999999",
        "/api/map?id=file:///etc/passwd",
        "/secret.parquet",
    ] {
        let answer = server.get(path);
        assert!([400, 404].contains(&answer.status), "{path}: {}", answer.status);
        assert!(!answer.text().contains("secret") || answer.text().contains("no episode"), "{path}: {}", answer.text());
    }
}

#[test]
fn the_link_has_a_token_and_nothing_is_answered_without_it() {
    let folder = tempfile::tempdir().unwrap();
    let [one, other] = [(); 2].map(|()| Server::start_by_link(folder.path(), &[RECORDED]));
    let token_of = |server: &Server| server.link.split_once("?token=").unwrap().1.to_owned();
    assert!(token_of(&one).len() >= 32 && token_of(&one) != token_of(&other));
    assert_eq!([one.get("/").status, one.get("/api/study").status], [401; 2]);
    assert_eq!(one.get(&format!("/api/study?token={}", token_of(&one))).status, 200);
    let refused = crate::harness::program::run(folder.path(), &["view", RECORDED, "--host", "0.0.0.0", "--no-token"]);
    assert!(refused.refused().contains("--no-token"));
    let short = crate::harness::program::run(folder.path(), &["view", RECORDED, "--token", "short"]);
    assert!(short.refused().contains("16"));
    let token = "0123456789abcdef";
    let server = Server::start_by_link(folder.path(), &[RECORDED, "--host", "127.0.0.1", "--token", token]);
    assert!(server.link.ends_with("?token=0123456789abcdef"), "{}", server.link);
    let host = format!("127.0.0.1:{}", server.port);
    assert_eq!(server.get("/").status, 401);
    assert_eq!(server.get("/api/study").status, 401);
    assert_eq!(server.get("/api/study?token=0123456789abcdeX").status, 401);
    let page = server.get(&format!("/?token={token}"));
    assert_eq!(page.status, 200);
    let cookie = page.head.lines().find_map(|line| line.strip_prefix("set-cookie: ")).unwrap();
    assert!(cookie.contains("httponly") && cookie.contains("samesite=strict"), "{cookie}");
    let cookie = format!("mirrorstats-{}={token}", server.port);
    assert_eq!(server.ask("GET", "/api/study", &[("Host", &host), ("Cookie", &cookie)], "").status, 200);
}

#[test]
fn many_half_sent_requests_do_not_keep_others_out_for_long() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED]);
    let threads = || std::fs::read_dir(format!("/proc/{}/task", server.process_id())).unwrap().count();
    let mut open = Vec::new();
    for _ in 0..100 {
        let mut stream = std::net::TcpStream::connect(("127.0.0.1", server.port)).unwrap();
        stream.write_all(b"GET / HTTP/1.1\r\nHost: ").unwrap();
        open.push(stream);
    }
    assert_eq!(server.get("/api/study").status, 200);
    assert!(threads() <= 12, "{}", threads());
    for mut stream in open {
        stream.set_read_timeout(Some(std::time::Duration::from_secs(40))).unwrap();
        // The server closes the connection, with or without an answer.
        let mut rest = Vec::new();
        let _ = stream.read_to_end(&mut rest);
        assert!(!String::from_utf8_lossy(&rest).contains(" 200 "));
    }
}

#[test]
fn the_list_has_the_values_that_score_writes() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[PAPER]);
    let scores = crate::harness::program::run(folder.path(), &["score", PAPER, "--json"]).done();
    let scores: Vec<serde_json::Value> = scores.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let list = server.get("/api/episodes?limit=500&offset=500").json();
    assert_eq!((list["total"].as_u64(), list["rows"].as_array().unwrap().len()), (Some(840), 340));
    for (row, score) in list["rows"].as_array().unwrap().iter().zip(&scores[500..]) {
        assert_eq!(row["id"], score["episode_id"]);
        for (metric, value) in list["metrics"].as_array().unwrap().iter().zip(row["values"].as_array().unwrap()) {
            let own = &score[metric.as_str().unwrap()];
            let own = if own.is_null() { serde_json::Value::Null } else { own.to_string().into() };
            assert_eq!(*value, own, "{metric}");
        }
    }
    let some =
        server.get("/api/episodes?experiment=E1&model=GPT%205.1&where=TSA%20%3D%200%20and%20MCR%20%3D%201").json();
    let is_wanted = |score: &&serde_json::Value| {
        (&score["experiment"], &score["model"]) == (&"E1".into(), &"GPT 5.1".into())
            && score["TSA"] == 0
            && score["MCR"] == 1
    };
    assert_eq!(some["total"], scores.iter().filter(is_wanted).count());
    let fault = server.get("/api/episodes?where=TSAA%20%3D%200");
    assert_eq!(fault.status, 400);
    assert!(fault.text().contains("TSA"), "{}", fault.text());
}

#[test]
fn an_episode_is_explained_as_score_explains_it() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[RECORDED, "--against", "extended"]);
    let id = server.get("/api/episodes?limit=1&model=guesser").json()["rows"][0]["id"].as_str().unwrap().to_owned();
    let told = server.get(&format!("/api/episode?id={id}")).json();
    let explained =
        crate::harness::program::run(folder.path(), &["score", RECORDED, "--explain", &id, "--json"]).json();
    for (own, expected) in told["metrics"].as_array().unwrap().iter().zip(explained["metrics"].as_array().unwrap()) {
        assert_eq!((&own["name"], &own["timesteps"]), (&expected["metric"], &expected["timesteps"]));
    }
    assert!(told["against"].as_array().unwrap().len() > told["metrics"].as_array().unwrap().len());
    assert_eq!(told["frames"], true);
    let frame = server.get(&format!("/api/frame?id={id}&t=1"));
    assert!(frame.status == 200 && frame.body.starts_with(b"\x89PNG"));
    assert_eq!(server.get(&format!("/api/frame?id={id}&t=100000")).status, 404);
    let map = server.get(&format!("/api/map?id={id}")).json();
    assert_eq!(map["steps"].as_array().unwrap().len() as u64, told["length"].as_u64().unwrap());
}

/// A folder with an episode in progress: a log where recordings write, and no trace.
fn begun(folder: &Path) {
    std::fs::create_dir_all(folder.join("runs/.parts")).unwrap();
    std::fs::copy(Path::new(RECORDED).join("E1-guesser.mcap"), folder.join("runs/.parts/log")).unwrap();
}

#[test]
fn an_unknown_name_is_reported_beside_a_recording_in_progress() {
    let folder = tempfile::tempdir().unwrap();
    begun(folder.path());
    let server = Server::start(folder.path(), &["runs"]);
    assert_eq!(server.get("/api/live").json()["running"].as_array().unwrap().len(), 1);
    let refused =
        crate::harness::program::run(folder.path(), &["view", "--no-open", "--port", "0", "runs", "nosuch.parquet"]);
    assert!(refused.refused().contains("nosuch.parquet"));
}

#[test]
fn a_removed_folder_is_reported_and_the_page_stays() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    std::fs::create_dir(&runs).unwrap();
    let trace = Path::new(RECORDED).join("E1-oracle.parquet");
    std::fs::copy(&trace, runs.join("E1-oracle.parquet")).unwrap();
    let server = Server::start(folder.path(), &["runs"]);
    assert!(server.get("/api/live").json()["fault"].is_null());
    let fault = || server.get("/api/live").json()["fault"].as_str().map(str::to_owned);
    std::fs::rename(&runs, folder.path().join("away")).unwrap();
    let words = wait_for("the fault", fault);
    assert!(words.contains("runs"), "{words}");
    assert_eq!(server.get("/api/episodes").json()["total"], 2);
    std::fs::rename(folder.path().join("away"), &runs).unwrap();
    wait_for("no fault", || fault().is_none().then_some(()));
}

/// Small recordings that ask for much work: each answer stays within the budget or is a refusal.
#[cfg(target_os = "linux")]
#[test]
fn no_question_takes_more_than_the_budget() {
    use crate::harness::bombs::{MEMORY, long_episode, long_texts, many_episodes, peak};
    let folder = tempfile::tempdir().unwrap();
    long_episode(&folder.path().join("long.parquet"), 4_000_000);
    long_texts(&folder.path().join("texts.parquet"), 1_000_000);
    many_episodes(&folder.path().join("many.parquet"), 0..290_000);
    for (name, id, refused) in [("long", "e", true), ("texts", "e", true), ("many", "0000007", false)] {
        let server = Server::start(folder.path(), &[&format!("{name}.parquet")]);
        for question in ["study", "overview", "episodes?sort=TSA&limit=500", "live"] {
            let answer = server.get(&format!("/api/{question}"));
            assert_eq!(answer.status, 200, "{name}, {question}: {}", answer.text());
        }
        for question in [
            format!("episode?id={id}"),
            format!("text?id={id}&column=action&t=1"),
            format!("compare?a={id}&b={id}"),
            format!("map?id={id}"),
        ] {
            let answer = server.get(&format!("/api/{question}"));
            assert_eq!(answer.status == 200, !refused, "{name}, {question}: {}", answer.status);
            let is_told =
                || answer.text().contains("at most 2000000 steps") && answer.text().contains("MIRRORSTATS_BUDGET");
            assert!(!refused || is_told(), "{name}, {question}: {}", answer.text());
        }
        let most = peak(server.process_id());
        assert!(most > 0 && most < MEMORY, "{name}: {} MB", most >> 10);
    }
}
