//! `plan` at the process boundary: answers, registered files, refusals.

use std::fs;
use std::path::Path;

use mirrorstats_analysis::plan::register::RegisteredPlan;

use crate::{assert_shown, run, two_files};

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
}

#[test]
fn conflicting_options_are_refused() {
    for (options, expected) in [
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

#[test]
fn stats_and_report_name_each_departure_from_the_plan() {
    let folder = two_files();
    let at = folder.path();
    let primary = run(at, &["plan", "--runs", "7", "--register", "plan.json", "--primary", "TTD"]);
    primary.done();
    let options = ["stats", ".", "--plan", "plan.json", "--where", "seed = 1", "--confidence", "0.9", "--json"];
    let found = run(at, &options).json();
    let departures: Vec<&str> =
        found["departures"].as_array().unwrap().iter().map(|departure| departure.as_str().unwrap()).collect();
    for words in
        ["plan: ", "models: 8 registered, ", "seeds of a model", "episodes of a model", "filter: none registered"]
    {
        assert!(departures.iter().any(|departure| departure.starts_with(words)), "{words}: {departures:?}");
    }
    for words in [
        "confidence: 0.95 registered, 0.9 found",
        "scenes of a model in an experiment: 21 registered, 0 found",
        "test: pairs of equal scenes registered, episodes that are not all pairs of equal scenes found",
    ] {
        assert!(departures.contains(&words), "{departures:?}");
    }
    let declare = ["--where", "TSA = 1", "--model", "a", "--experiment", "E1", "--experiment", "E9", "--sequential"];
    run(at, &[&["plan", "--runs", "7", "--register", "declared.json"], declare.as_slice()].concat()).done();
    let declared = run(at, &["stats", ".", "--plan", "declared.json"]).done();
    for words in [
        "models: a registered, ",
        "experiments: E1, E9 registered, ",
        "filter: `TSA = 1` registered, none found",
        "looks: any",
    ] {
        assert!(declared.contains(words), "{words}: {declared}");
    }
    assert_eq!(
        (found["answers"][0]["metric"].as_str(), found["answers"][0]["role"].as_str()),
        (Some("TTD"), Some("primary"))
    );
    let text = run(at, &["stats", ".", "--plan", "plan.json"]).done();
    assert!(
        text.contains("Registered plan\n  - plan: ") && text.contains("departures from the registered plan: "),
        "{text}"
    );
    let sequential = run(at, &["stats", ".", "--plan", "plan.json", "--sequential"]).done();
    assert!(sequential.contains("looks: one registered, any number found"), "{sequential}");
    let report = run(at, &["report", ".", "--plan", "plan.json", "--json", "--no-figures"]).json();
    assert!(report["warnings"].to_string().contains("departure from the registered plan: models: 8"), "{report}");
    let changed = fs::read_to_string(at.join("plan.json")).unwrap().replace("\"models\": 8", "\"models\": 2");
    fs::write(at.join("changed.json"), changed).unwrap();
    let message = run(at, &["stats", ".", "--plan", "changed.json"]).refused();
    assert!(message.contains("the plan was changed after it was registered"), "{message}");
    let message = run(at, &["plan", "--runs", "7", "--register", "other.json", "--primary", "TSB"]).refused();
    assert!(message.contains("--primary TSB: expected a metric of the definitions"), "{message}");
}
