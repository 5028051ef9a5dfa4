//! Episodes whose experiments need different definitions, in one list: each is scored by its own.

use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::write::write_episodes;
use serde_json::{Value, json};

use crate::harness::program::run;
use crate::harness::traces::episode;
use crate::view::Server;

fn write(folder: &std::path::Path, experiment: &Value, episode: Episode) {
    let name = experiment["name"].as_str().unwrap().to_owned();
    let file = folder.join(format!("{name}.parquet"));
    write_episodes(&file, Some(json!({ "experiment": experiment })), &[Episode { experiment: name, ..episode }])
        .unwrap();
}

#[test]
fn each_episode_is_scored_by_the_definitions_of_its_experiment() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let step =
        |action, extra| Step { action: Some(action), selected_cube: Some("red".to_owned()), extra, ..Step::default() };
    let mark = Extra {
        mark_color: Some("green".to_owned()),
        mirror_mark_px: Some(30),
        mark_report: Some("green".to_owned()),
        ..Extra::default()
    };
    let marked = Episode {
        decision: Some("mark_report".to_owned()),
        ..episode("a", vec![step(Action::TurnLeft, mark.clone()), step(Action::Done, mark)])
    };
    write(at, &json!({ "name": "mark", "definitions": "battery" }), marked);
    write(at, &json!({ "name": "E1" }), episode("b", vec![step(Action::Done, Extra::default())]));
    let near = Extra { target_distance: Some(100), ..Extra::default() };
    let reached = Episode {
        decision: Some("target_distance".to_owned()),
        start_distance: Some(300),
        ..episode("c", vec![Step { selected_cube: None, ..step(Action::MoveForward, near) }])
    };
    let absent = ["self_color", "selected_cube"];
    write(at, &json!({ "name": "reach-hand", "definitions": "reach", "absent": absent }), reached);

    let server = Server::start(at, &["."]);
    let list = server.get("/api/episodes").json();
    let metrics: Vec<&str> = list["metrics"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    let value = |id: &str, metric: &str| {
        let row = list["rows"].as_array().unwrap().iter().find(|row| row["id"] == id).unwrap();
        row["values"][metrics.iter().position(|name| *name == metric).unwrap()].clone()
    };
    assert_eq!(list["total"], 3);
    for (id, metric, expected) in [
        ("a", "TSA", json!("1")),
        ("a", "MARK_REPORT", json!("1")),
        ("a", "SUCCESS", json!(null)),
        ("b", "TSA", json!("1")),
        ("c", "TSA", json!(null)),
        ("c", "TTD", json!(null)),
        ("c", "SUCCESS", json!("1")),
    ] {
        assert_eq!(value(id, metric), expected, "{id} {metric}");
    }
    for path in ["study", "overview", "figures", "statistics", "episode?id=a", "episode?id=c", "compare?a=a&b=c"] {
        assert_eq!(
            server.get(&format!("/api/{path}")).status,
            200,
            "{path}: {}",
            server.get(&format!("/api/{path}")).text()
        );
    }
    let some = server.get("/api/episodes?where=SUCCESS+%3D+1").json();
    assert_eq!((&some["total"], &some["rows"][0]["id"]), (&json!(1), &json!("c")));
    let study = server.get("/api/study").json();
    assert_eq!(study["definitions"]["name"], "battery+reach");
    run(at, &["view", ".", "--export", "page"]).done();
    let refused = run(at, &["view", ".", "--definitions", "paper", "--no-open", "--port", "0"]).refused();
    assert!(refused.contains("expected definitions that score it"), "{refused}");
}
