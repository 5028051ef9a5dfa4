//! Functions of this process as agents: their input, their recordings, and their failures.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use mirrorstats::cli;
use mirrorstats::cli::commands::record::{AnyPlayer, RecordArgs, Recorded};
use mirrorstats_agents::exec::Images;
use mirrorstats_agents::exec::message::Message;
use mirrorstats_agents::function::{Function, FunctionPlayer, Listener};
use serde_json::Value;

use crate::harness::files::write_small_world;
use crate::harness::need;
use crate::harness::traces::{episodes, recording};

const WALK: &str = r#"{"view-description":"a wall","reasoning":"go on","action":"w","summary":"went on","selected_cube":"none","identification":"I am red"}"#;

/// Records an episode of E1 into a folder.
fn record(folder: &Path, images: Images, listeners: impl Fn() -> Listener + Send + Sync + 'static) -> Recorded {
    need::drawing();
    write_small_world(folder, "episode.steps = 20\n");
    let options = serde_json::json!({
        "agent": "function", "experiment": "E1", "seeds": 1, "runs": 1, "threads": 1, "no-log": true,
        "config": folder.join("small.toml"), "out": folder.join("runs"),
    });
    let args: RecordArgs = cli::options_of("record", options.as_object().unwrap()).unwrap();
    let stop = Arc::new(AtomicBool::new(false));
    let player = FunctionPlayer::new(Function {
        model: "walker".to_owned(),
        source: Some("def walk".to_owned()),
        images,
        scratch: folder.join("runs"),
        listeners: Arc::new(move || Ok(listeners())),
        stop: Arc::clone(&stop),
    });
    args.record(args.lock().unwrap(), &AnyPlayer::Other(Box::new(player)), &stop).unwrap()
}

/// Walks, and replies `done` at its third step.
fn walking(heard: &Arc<Mutex<Vec<Value>>>) -> Listener {
    let heard = Arc::clone(heard);
    Box::new(move |message| {
        heard.lock().unwrap().push(serde_json::to_value(message).unwrap());
        Ok(match message {
            Message::Observation(observation) if observation.t == 3 => WALK.replace("\"w\"", "\"done\""),
            _ => WALK.to_owned(),
        })
    })
}

#[test]
fn a_function_gets_the_messages_of_a_program_and_its_replies_are_recorded() {
    let (folder, heard) = (tempfile::tempdir().unwrap(), Arc::default());
    let kept = Arc::clone(&heard);
    let recorded = record(folder.path(), Images::Base64, move || walking(&kept));
    assert_eq!((recorded.answer.recorded, recorded.answer.steps, recorded.gave_up), (1, 3, None));
    let heard = heard.lock().unwrap();
    let kinds: Vec<&str> = heard.iter().map(|message| message["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["task", "observation", "observation", "observation", "end"]);
    assert_eq!((&heard[4]["episode_id"], &heard[4]["reason"]), (&"E1/walker/s1/r1".into(), &"done".into()));
    assert_eq!((heard[3]["last_action"].as_str(), heard[3]["last_thought"].as_str()), (Some("w"), Some("went on")));
    assert!(heard[1]["image"]["base64"].as_str().unwrap().len() > 100);
    let trace = folder.path().join("runs/E1-walker.parquet");
    let rows = &episodes(&trace)[0].steps;
    assert_eq!(rows[0].extra.reply.as_deref(), Some(WALK));
    let agent = &recording(&trace)["agent"];
    assert_eq!((&agent["function"], agent["source"].as_str().map(str::len)), (&"walker".into(), Some(64)));
}

#[test]
fn frame_files_exist_until_the_episode_ends() {
    let folder = tempfile::tempdir().unwrap();
    let seen = Arc::new(Mutex::new(Vec::new()));
    let kept = Arc::clone(&seen);
    record(folder.path(), Images::Path, move || {
        let (kept, mut walk) = (Arc::clone(&kept), walking(&Arc::default()));
        Box::new(move |message| {
            if let Some(path) = serde_json::to_value(message).unwrap()["image"]["path"].as_str() {
                kept.lock().unwrap().push(path.to_owned());
                assert!(kept.lock().unwrap().iter().all(|path| Path::new(path).is_file()));
            }
            walk(message)
        })
    });
    assert_eq!(seen.lock().unwrap().len(), 3);
    assert!(!seen.lock().unwrap().iter().any(|path| Path::new(path).exists()));
}

#[test]
fn a_function_that_fails_loses_its_episode() {
    let folder = tempfile::tempdir().unwrap();
    let recorded = record(folder.path(), Images::Base64, || {
        Box::new(|message| match message {
            Message::Observation(observation) if observation.t == 2 => Err("no legs".to_owned()),
            _ => Ok(WALK.to_owned()),
        })
    });
    assert_eq!((recorded.answer.recorded, recorded.answer.lost.len()), (0, 1));
    assert_eq!(recorded.answer.lost[0].reason, "step 2: no legs");
    assert!(!folder.path().join("runs/E1-walker.parquet").exists());
}
