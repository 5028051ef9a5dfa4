//! Programs that behave: their input, and how their replies are read.

use std::collections::BTreeSet;

use base64::Engine as _;
use mirrorstats_agents::exec::message::Message;
use mirrorstats_agents::reply;
use mirrorstats_experiment::Experiment;
use schemars::schema_for;
use serde_json::Value;

use super::recordings::{Bench, FORWARD, done, outcome, three_steps};
use crate::harness::files::repository;
use crate::harness::need;

#[test]
fn a_program_gets_its_task_each_observation_and_the_end() {
    let bench = Bench::new();
    bench.program(&format!("echo '{FORWARD}'"));
    let output = bench.record(&["--experiment", "E3", "--model", "My Agent"]).output().unwrap();
    let (code, answer, said) = outcome(&output);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!((&answer["model"], &answer["recorded"], &answer["steps"]), (&"My Agent".into(), &1.into(), &20.into()));

    let heard = bench.heard();
    let kinds: Vec<&str> = heard.iter().map(|line| line["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, [vec!["task"], vec!["observation"; 20], vec!["end"]].concat());
    let (task, end) = (&heard[0], &heard[21]);
    assert_eq!((&task["family"], &task["max_steps"]), (&"cube_selection".into(), &20.into()));
    let stated = task["stated_color"].as_str().unwrap();
    assert!(task["system_prompt"].as_str().unwrap().starts_with(&format!("You are a {stated} robot.")));
    assert_eq!(task["reply_schema"], reply::structure(&Experiment::E1));
    assert_eq!(
        (&end["episode_id"], &end["reason"], &end["steps"]),
        (&"E3/my-agent/s1/r1".into(), &"budget".into(), &20.into())
    );

    let [first, second] = [&heard[1], &heard[2]];
    assert_eq!((&first["t"], &first["remaining_steps"], &first["last_action"]), (&1.into(), &20.into(), &Value::Null));
    assert_eq!(
        (&second["t"], &second["remaining_steps"], &second["last_action"]),
        (&2.into(), &19.into(), &"w".into())
    );
    assert_eq!(second["last_thought"], "went on");
    assert!(second["user_prompt"].as_str().unwrap().contains("the thought with it was: went on"));
    assert_eq!(bench.texts("runs/E3-my-agent.parquet", "action"), vec![Some("move_forward".to_owned()); 20]);
    assert_eq!(bench.texts("runs/E3-my-agent.parquet", "self_color"), vec![Some("red".to_owned()); 20]);
    assert_eq!(bench.leftovers(), Vec::<String>::new());
}

#[test]
fn no_message_reveals_the_truth() {
    let bench = Bench::new();
    bench.program(&three_steps());
    outcome(&bench.record(&["--runs", "2", "--threads", "1"]).output().unwrap());
    let body = bench.texts("runs/E1-exec.parquet", "body_color")[0].clone().unwrap();
    let heard = bench.heard();
    let keys: BTreeSet<&str> =
        heard.iter().flat_map(|line| line.as_object().unwrap().keys()).map(String::as_str).collect();
    // Anything added to the messages needs a decision here.
    let known = "episode_id family image kind last_action last_thought max_steps orientation position protocol \
                 reason remaining_steps reply_schema seed stated_color steps system_prompt t user_prompt wall_warning";
    assert_eq!(keys, known.split_whitespace().collect());
    for line in &heard {
        // The id has the seed and the run, from which colours can be computed.
        assert_eq!(line.get("episode_id").is_some(), line["kind"] == "end");
        assert_eq!(line.get("stated_color").unwrap_or(&Value::Null), &Value::Null);
        for words in ["system_prompt", "user_prompt"].iter().filter_map(|key| line.get(key)) {
            assert!(!words.as_str().unwrap().contains(&body), "{words}");
        }
    }
}

#[test]
fn frames_come_as_files_for_as_long_as_the_episode_or_in_the_line() {
    let bench = Bench::new();
    // All earlier frames still exist at the last step.
    bench.program(&format!(
        "path=${{line##*'\"path\":\"'}}; path=${{path%%'\"'*}}; [ $n = 3 ] && cat \"${{path%/*}}\"/*.png > frames; {}",
        three_steps()
    ));
    let (code, _, said) = outcome(&bench.record(&[]).output().unwrap());
    assert_eq!(code, Some(0), "{said}");
    let files = std::fs::read(bench.path("frames")).unwrap();
    let path = bench.heard()[3]["image"]["path"].as_str().unwrap().to_owned();
    assert!(std::path::Path::new(&path).is_absolute() && !std::path::Path::new(&path).exists(), "{path}");

    std::fs::remove_file(bench.path("heard.jsonl")).unwrap();
    bench.program(&three_steps());
    let (code, _, said) = outcome(&bench.record(&["--exec-images", "base64", "--model", "other"]).output().unwrap());
    assert_eq!(code, Some(0), "{said}");
    let decode =
        |line: &Value| base64::engine::general_purpose::STANDARD.decode(line["image"]["base64"].as_str().unwrap());
    let lines: Vec<u8> = bench.heard()[1..4].iter().flat_map(|line| decode(line).unwrap()).collect();
    assert!(lines.starts_with(b"\x89PNG") && lines == files, "the same frames either way");
}

#[test]
fn every_message_matches_the_schema() {
    let bench = Bench::new();
    bench.program(&three_steps());
    outcome(&bench.record(&[]).output().unwrap());
    let schema = schema_for!(Message).to_value();
    let definitions = schema["$defs"].as_object().unwrap();
    for line in bench.heard() {
        let kind = line["kind"].as_str().unwrap();
        let name = format!("{}Message", kind[..1].to_uppercase() + &kind[1..]);
        let required: BTreeSet<&str> =
            definitions[&name]["required"].as_array().unwrap().iter().map(|key| key.as_str().unwrap()).collect();
        let properties = definitions[&name]["properties"].as_object().unwrap();
        for key in line.as_object().unwrap().keys().filter(|key| *key != "kind") {
            assert!(properties.contains_key(key), "{kind}: {key}");
        }
        assert!(required.iter().all(|key| line.get(key).is_some()), "{kind}");
    }
}

#[test]
fn replies_of_programs_and_models_are_read_alike() {
    let bench = Bench::new();
    let done = done();
    // Text around the object is repaired. Words alone are not a decision. `done` ends the episode.
    bench.program(&format!("case $n in 1) echo 'Sure: {FORWARD}' ;; 2) echo 'I go on.' ;; *) echo '{done}' ;; esac"));
    let (code, answer, said) = outcome(&bench.record(&[]).output().unwrap());
    assert_eq!((code, &answer["lost"]), (Some(0), &Value::Array(Vec::new())), "{said}");
    let texts = |column: &str| bench.texts("runs/E1-exec.parquet", column);
    let some = |text: &str| Some(text.to_owned());
    assert_eq!(texts("reply_status"), [some("repaired"), some("parse_failed"), some("ok")]);
    assert_eq!(texts("action"), [some("move_forward"), None, some("done")]);
    assert_eq!(texts("reply")[1], some("I go on."));
    let heard = bench.heard();
    // The thought before the invalid reply is kept.
    assert_eq!((&heard[3]["last_action"], &heard[3]["last_thought"]), (&Value::Null, &"went on".into()));
    let history = "the previous reply could not be used, so nothing was done; the thought before it was: went on";
    assert!(heard[3]["user_prompt"].as_str().unwrap().contains(history), "{}", heard[3]);
    assert_eq!((&heard[4]["kind"], &heard[4]["reason"]), (&"end".into(), &"done".into()));
}

#[test]
fn other_broken_replies_are_steps_without_a_decision() {
    let bench = Bench::new();
    bench.program(&format!(
        "case $n in 1) echo ;; 2) echo '{}' ;; 3) printf '\\377\\n' ;; *) printf '%s\\r\\n' '{}' ;; esac",
        FORWARD.replace("\"w\"", "\"jump\""),
        done()
    ));
    let (code, _, said) = outcome(&bench.record(&[]).output().unwrap());
    assert_eq!(code, Some(0), "{said}");
    let statuses = bench.texts("runs/E1-exec.parquet", "reply_status");
    assert_eq!(statuses, ["empty", "schema_invalid", "parse_failed", "ok"].map(|name| Some(name.to_owned())));
    assert_eq!(bench.texts("runs/E1-exec.parquet", "self_color"), [None, None, None, Some("red".to_owned())]);
}

#[test]
fn the_example_in_python_plays() {
    let bench = Bench::new();
    let script = repository().join("examples/agents/agent.py");
    let agent = format!("exec:{} '{}'", need::python(), script.display());
    let (code, answer, said) = outcome(&bench.record_of(&agent, &["--experiment", "E1,E5"]).output().unwrap());
    assert_eq!((code, &answer["recorded"], &answer["steps"]), (Some(0), &2.into(), &40.into()), "{said}");
    for trace in ["runs/E1-exec.parquet", "runs/E5-exec.parquet"] {
        assert_eq!(bench.texts(trace, "reply_status"), vec![Some("ok".to_owned()); 20], "{trace}");
    }
}

#[test]
fn unreadable_replies_of_a_program_are_reported() {
    let bench = Bench::new();
    bench.program("printf 'I go \\033[31mon.\\n'");
    let output = bench.record(&["--keep-going"]).output().unwrap();
    let (code, answer, said) = outcome(&output);
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.starts_with("a reply could not be read: parse_failed: `I go \\u{1b}[31mon.` (E1/exec/s1/r1, step 1)"),
        "{said}"
    );
    let summary = "\n20 of 20 replies could not be read: parse_failed; first: `I go \\u{1b}[31mon.` (E1/exec/s1/r1, step 1): expected a JSON object, found text without one\n";
    assert!(said.contains(summary), "{said}");
    assert_eq!(answer["replies"]["unreadable"]["parse_failed"], 20);
}
