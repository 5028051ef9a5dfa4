//! Limits hold over all episodes of a recording and all times that it is started.

use mirrorstats::agent::vlm::OnOutage;
use mirrorstats::agent::vlm::limits::Limits;
use mirrorstats::agent::vlm::wire_format::Dialect;

use super::bench::Bench;
use super::recordings::{Folder, counting};
use super::server::{Server, decision, whole};
use crate::harness::program::stderr;

#[test]
fn limits_stop_before_the_request_over_them() {
    let server = Server::start(|_, _| whole(Dialect::OpenaiChat, &decision("w")));
    let bench = Bench::new(Limits { requests: Some(2), ..Limits::default() });
    let vlm = bench.vlm(&server, Dialect::OpenaiChat, OnOutage::Lose);
    let replies = Bench::play(&vlm, "episode", 3);
    assert!(replies[0].is_ok() && replies[1].is_ok());
    assert!(replies[2].as_ref().unwrap_err().cause.contains("limit of requests is reached: 2 of 2"));
    assert_eq!(server.count(), 2);
}

/// How a start of a recording ended: its exit code and what it said.
fn started(folder: &Folder, server: &Server, words: &str) -> (Option<i32>, String) {
    let words = format!("--seeds 1 --runs 1 --threads 1 --models own.toml {words}");
    let output = folder.record(server, "own", &words).output().unwrap();
    (output.status.code(), stderr(&output))
}

#[test]
fn limits_count_what_earlier_starts_spent() {
    let own = "[model.own]\nbackend = \"compatible\"\nid = \"own-1\"\nprices = { input = 1.0, output = 10.0 }\n";
    // An answer takes 1100 tokens and 0.002 dollars.
    let cases = [
        ("--max-requests 2", "requests is reached: 2 of 2", 2),
        ("--max-tokens 2300", "tokens is reached: 3300 of 2300", 3),
        ("--max-cost 0.002", "cost is reached: 0.0020 US dollars of 0.0020", 1),
    ];
    for (limit, reason, requests) in cases {
        let server = Server::start(|at, request| whole(Dialect::OpenaiCompatible, &counting(request, 4, at)));
        let folder = Folder::new();
        std::fs::write(folder.path().join("own.toml"), own).unwrap();
        for start in 1..=2 {
            let (code, said) = started(&folder, &server, limit);
            assert_eq!(code, Some(2), "{said}");
            assert!(said.contains(reason) && said.contains("higher limit continues"), "{limit}, start {start}: {said}");
            assert_eq!(server.count(), requests, "{limit}, start {start}");
        }
        let (code, said) = started(&folder, &server, "");
        assert_eq!((code, server.count()), (Some(0), 4), "{said}");
    }
}

#[test]
fn a_limit_of_cost_without_prices_is_refused_before_anything_is_sent_or_made() {
    let own = "[model.own]\nbackend = \"compatible\"\nid = \"own-1\"\n";
    let cases = [
        ("", "`own` has no input and no output price"),
        ("prices = { input = 1.0 }\n", "`own` has no output price"),
        ("prices = { output = 1.0 }\n", "`own` has no input price"),
    ];
    for (prices, reason) in cases {
        let server = Server::start(|_, _| whole(Dialect::OpenaiCompatible, &decision("done")));
        let folder = Folder::new();
        std::fs::write(folder.path().join("own.toml"), format!("{own}{prices}")).unwrap();
        let (code, said) = started(&folder, &server, "--max-cost 1");
        assert_eq!((code, server.count()), (Some(2), 0), "{said}");
        assert!(said.contains(reason) && said.contains("--models") && said.contains("[model.\"own\"]"), "{said}");
        assert!(!folder.path().join("runs").exists(), "{said}");
        // Without the limit, and with one that can be held, it records.
        let (code, said) = started(&folder, &server, "--max-requests 200");
        assert_eq!(code, Some(0), "{said}");
    }
    let (server, folder) = (Server::start(|_, _| whole(Dialect::OpenaiCompatible, &decision("done"))), Folder::new());
    let output = folder.record(&server, "unknown-model", "--max-cost 1").output().unwrap();
    assert_eq!((output.status.code(), server.count()), (Some(2), 0), "{}", stderr(&output));
    assert!(stderr(&output).contains("`unknown-model` has no input and no output price"), "{}", stderr(&output));
}

#[test]
fn a_limit_of_cost_is_an_amount() {
    let (server, folder) = (Server::start(|_, _| whole(Dialect::OpenaiCompatible, &decision("done"))), Folder::new());
    for limit in ["nan", "inf", "-1", "much"] {
        let output = folder.record(&server, "own", &format!("--max-cost={limit}")).output().unwrap();
        assert_eq!((output.status.code(), server.count()), (Some(2), 0), "{limit}: {}", stderr(&output));
    }
}
