//! `sensitivity`: its cells equal those of definitions edited by hand; where conclusions change; refusals.

use std::fs;
use std::path::Path;

use mirrorstats::Study;
use mirrorstats_exact::number::Decimal;
use mirrorstats_study::sensitivity::{Thresholds, sensitivity};
use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::write::write_episodes;
use proptest::prelude::*;
use serde_json::{Value, json};

use crate::assert_shown;
use crate::harness::files::{assert_same, contents, fixture};
use crate::harness::traces;
use crate::run;

/// An episode that claims red at t = 2 and decides at t = 3; its own body fills `px` pixels at t = 1.
fn episode(model: &str, experiment: &str, run: i32, px: Option<i32>, status: &str) -> Episode {
    let step = |t: i32| Step {
        action: Some(if t == 3 && status == "ok" { Action::Done } else { Action::TurnLeft }),
        self_color: (t > 1).then(|| "red".into()),
        selected_cube: Some("red".into()),
        mirror_visible: t == 1 && px >= Some(60),
        extra: Extra {
            mirror_self_px: if t == 1 { px } else { Some(0) },
            reply_status: Some(status.into()),
            ..Extra::default()
        },
    };
    Episode {
        model: model.into(),
        experiment: experiment.into(),
        run,
        ..traces::episode(&format!("{experiment}-{model}-{run}"), (1..=3).map(step).collect())
    }
}

/// In E1 `near` fills 100 pixels and `far` 20; in E2 both fill 5. One more episode lost its last reply.
fn write(folder: &Path) {
    let of = |model, experiment, px| (1..=12).map(move |run| episode(model, experiment, run, Some(px), "ok"));
    let all = of("near", "E1", 100).chain(of("far", "E1", 20)).chain(of("near", "E2", 5)).chain(of("far", "E2", 5));
    let lost = episode("near", "E1", 13, Some(500), "server_error");
    let recording = json!({ "kind": "recording", "visibility_threshold_px": 60 });
    write_episodes(&folder.join("a.parquet"), Some(recording), &all.chain([lost]).collect::<Vec<_>>()).unwrap();
    let chance = "include = [\"paper\"]\n[metric.MCR]\ntitle = \"Consultation\"\nbetter = \"higher\"\n\
                  value = \"any(visible and t < finish)\"\nchance = \"1/3\"\n";
    fs::write(folder.join("chance.toml"), chance).unwrap();
}

#[test]
fn a_threshold_that_changes_a_conclusion_is_named_in_sentences() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let arguments = [
        "definitions",
        "sensitivity",
        ".",
        "--definitions",
        "chance.toml",
        "--metrics",
        "MCR,MGD,TSA",
        "--thresholds",
        "1,10,60,101",
    ];
    let answer = run(folder.path(), &arguments);
    assert_eq!(answer.stderr, "note: 1 episode was lost without an answer: in no denominator\n");
    assert_shown!(arguments.join(" "), answer.done());
    let none =
        run(folder.path(), &["definitions", "sensitivity", ".", "--where", "experiment = 'E1'", "--thresholds", "60"])
            .done();
    assert!(none.ends_with("\nNo conclusion changes.\n"), "{none}");
    let filtered = run(
        folder.path(),
        &["definitions", "sensitivity", ".", "--where", "MCR = 1", "--thresholds", "1,60", "--json"],
    );
    assert!(filtered.stderr.contains("note: the filter depends on `visible`"), "{}", filtered.stderr);
    let cells = filtered.json()["cells"].as_array().unwrap().clone();
    let episodes = |threshold: Value| {
        let of = cells.iter().filter(|cell| cell["threshold"] == threshold && cell["metric"] == "MCR");
        of.map(|cell| cell["episodes"].as_u64().unwrap()).sum::<u64>()
    };
    assert_eq!([episodes(Value::Null), episodes(json!(1)), episodes(json!(60))], [12, 48, 12]);
}

#[test]
fn files_are_the_same_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let out = |threads: &str| {
        let out = folder.path().join(threads);
        let arguments = ["definitions", "sensitivity", ".", "--threads", threads, "--out", threads, "--json"];
        let answer = run(folder.path(), &arguments).done();
        (answer, contents(&out))
    };
    let (one, three) = (out("1"), out("3"));
    assert_eq!(one.0, three.0);
    assert_same(&one.1, &three.1);
    let csv = String::from_utf8(one.1["sensitivity.csv"].clone()).unwrap();
    let expected = "experiment,model,threshold,metric,n,sum,mean,se\nE1,far,recorded,MCR,12,0,0,0\n";
    assert!(csv.starts_with(expected), "{csv}");
    for name in ["sensitivity.md", "sensitivity.tex"] {
        let text = String::from_utf8(one.1[name].clone()).unwrap();
        assert!(text.contains("recorded (60 px)") && text.contains("Sensitivity to the threshold"), "{name}: {text}");
    }
}

/// Compares the cells under one threshold with those under the paper's definitions edited by hand.
fn compare(inputs: &str, px: u32) {
    let folder = tempfile::tempdir().unwrap();
    let edited = folder.path().join("edited.toml");
    fs::write(&edited, format!("include = [\"paper\"]\n[let]\nvisible = \"mirror_self_px >= {px}\"\n")).unwrap();
    let by_hand = Study::open([inputs]).unwrap().definitions(edited.to_str().unwrap()).unwrap().cells().unwrap();
    let study = Study::open([inputs]).unwrap();
    let report = sensitivity(&study, &px.to_string().parse::<Thresholds>().unwrap()).unwrap();
    let as_is = study.cells().unwrap();
    assert_eq!(report.found.metrics, ["MCR", "MTATO", "CR", "MGD", "SC", "AR_SC"]);
    let mut compared = 0;
    for (threshold, cells) in [(None, &as_is), (Some(px), &by_hand)] {
        for group in &cells.groups {
            for (metric, moments) in cells.metrics.iter().zip(&group.moments) {
                let found = report.found.cells.iter().find(|cell| {
                    cell.threshold == threshold && cell.metric == *metric && cell.key.values().eq(&group.key)
                });
                assert_eq!(found.is_none(), report.found.independent.contains(metric));
                let Some(found) = found else { continue };
                let se = moments.se(cells.catalog.metric[metric].se);
                assert_eq!(
                    (found.n, found.sum, found.mean, found.se),
                    (moments.n, Decimal::of_units(moments.sum, 0), moments.mean(), se)
                );
                compared += 1;
            }
        }
    }
    assert_eq!(compared, report.found.cells.len());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn cells_equal_those_of_edited_definitions(px in 1_u32..400) {
        compare(fixture("glimpses.parquet").to_str().unwrap(), px);
        compare(fixture("recorded/E*.parquet").to_str().unwrap(), px);
    }
}

#[test]
fn definitions_without_a_threshold_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let text = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    text("none.toml", "[metric.X]\nvalue = \"any(mirror_visible)\"\n");
    text("once.toml", "[let]\nvisible = \"any(mirror_visible)\"\n[metric.X]\nvalue = \"visible\"\n");
    let some = [episode("m", "E1", 1, Some(1), "ok"), episode("m", "E1", 2, None, "ok")];
    write_episodes(&folder.path().join("some.parquet"), None, &some).unwrap();
    run(folder.path(), &["score", "a.parquet", "-o", "scores.parquet"]).done();
    let paper = fixture("paper/E1-gpt-5-1.parquet");
    let cases: [(&[&str], &[&str]); 7] = [
        (&[paper.to_str().unwrap()], &["no trace has it", "mirrorstats record"]),
        (&["some.parquet"], &["1 in 1 of 2 episodes", "`E1-m-2`", "--where \"all(mirror_self_px is not null)\""]),
        (&["scores.parquet"], &["found scores"]),
        (&["a.parquet", "--definitions", "none.toml"], &["none.toml", "found none", "visible = \"mirror_visible\""]),
        (&["a.parquet", "--definitions", "once.toml"], &["found true or false, one value per episode"]),
        (&["a.parquet", "--metrics", "TSA,TTD"], &["found none among TSA, TTD"]),
        (&["a.parquet", "--where", "run = 99"], &["run"]),
    ];
    for (arguments, words) in cases {
        let message = run(folder.path(), &[&["definitions", "sensitivity"], arguments].concat()).refused();
        assert!(words.iter().all(|word| message.contains(word)), "{arguments:?}: {message}");
    }
    let usage = run(folder.path(), &["definitions", "sensitivity", "a.parquet", "--thresholds", "1,0"]).ends(2).stderr;
    assert!(usage.contains("whole numbers of pixels from 1 on"), "{usage}");
    run(folder.path(), &["definitions", "sensitivity", "some.parquet", "--where", "all(mirror_self_px is not null)"])
        .done();
}
