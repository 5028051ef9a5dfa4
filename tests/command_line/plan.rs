//! `plan` from outside: the answer, the registered file, what is refused.

use std::fs;
use std::path::Path;

use report::plan::register::RegisteredPlan;

use crate::{assert_shown, run};

fn plan(options: &[&str]) -> crate::Answer {
    run(Path::new("."), &[&["plan"], options].concat())
}

#[test]
fn the_first_line_is_the_answer() {
    let text = plan(&["--difference", "0.3", "--chance", "1/3"]).done();
    assert_shown!("plan --difference 0.3 --chance 1/3", text);
    let json = plan(&["--difference", "0.3", "--chance", "1/3", "--json"]).json();
    assert_eq!(json["answer"].as_str(), text.lines().next());
    assert_eq!(json["tests"][0]["episodes"], 96);
    let [episodes, runs] = [["--episodes", "21"], ["--runs", "7"]].map(|given| plan(&given).done());
    assert_eq!(episodes, runs);
}

#[test]
fn what_does_not_go_together_is_refused() {
    for (options, expected) in [
        (vec!["--episodes", "20"], "expected as many episodes for each of 3 seeds"),
        (vec!["--difference", "0.6", "--baseline", "0.5"], "expected rates from 0 to 1, found 1.100"),
        (vec!["--difference", "0.3", "--discordance", "0.2"], "expected a share from 0.300 to 1.000"),
    ] {
        let message = plan(&options).refused();
        assert!(message.contains(expected), "{message}");
    }
    for options in [vec![], vec!["--difference", "0.3", "--runs", "7"], vec!["--difference", "30%"]] {
        plan(&options).ends(2);
    }
}

#[test]
fn a_plan_is_registered_once_and_shows_changes() {
    let folder = tempfile::tempdir().unwrap();
    let register = |file: &str| run(folder.path(), &["plan", "--runs", "7", "--register", file]);
    register("a.json").done();
    register("b.json").done();
    let read = |file: &str| fs::read_to_string(folder.path().join(file)).unwrap();
    assert_eq!(read("a.json"), read("b.json"));
    assert!(register("a.json").refused().contains("a registered plan is not replaced"));
    let mut registered: RegisteredPlan = serde_json::from_str(&read("a.json")).unwrap();
    assert!(registered.is_unchanged());
    assert_eq!((registered.definitions.name.as_str(), registered.definitions.sha256.len()), ("paper", 64));
    registered.plan.request.models = 2;
    assert!(!registered.is_unchanged());
}
