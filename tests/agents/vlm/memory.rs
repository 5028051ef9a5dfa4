//! Questions and answers are on disk before they take effect, and no question is asked twice.

use std::num::NonZeroU32;
use std::sync::Arc;

use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_vlm::Vlm;
use mirrorstats_vlm::limits::Limits;
use mirrorstats_vlm::models::Model;
use mirrorstats_vlm::wire_format::{Effort, WireFormat};

use super::bench::{Bench, choice};
use super::server::{Server, decision, http, whole};

#[test]
fn answers_are_reused_and_play_without_a_network() {
    let server = Server::start(|at, _| match at {
        1 => http("500 Internal Server Error", "", b""),
        _ => whole(WireFormat::OpenaiChat, &decision(if at % 2 == 0 { "a" } else { "w" })),
    });
    let bench = Bench::new(Limits::default());
    let first: Vec<_> = Bench::play(&bench.vlm(&server, WireFormat::OpenaiChat), "episode", 3)
        .into_iter()
        .map(Result::unwrap)
        .collect();
    assert_eq!(server.count(), 4);
    assert_eq!(first[0].action, Some(Action::TurnLeft));
    assert!((first[0].usage.cost_usd.unwrap() - 0.002).abs() < 1e-12);

    // A line cut off when the process ended has had no effect.
    let journal = bench.folder.path().join("episode.jsonl");
    let mut text = std::fs::read_to_string(&journal).unwrap();
    text.push_str("{\"kind\":\"answer\",\"t\":4,\"att");
    std::fs::write(&journal, text).unwrap();
    let again = Bench::play(&bench.vlm(&server, WireFormat::OpenaiChat), "episode", 3);
    assert_eq!(again.into_iter().map(Result::unwrap).collect::<Vec<_>>(), first);
    assert_eq!(server.count(), 4, "nothing is asked again");

    let cassette = Arc::new(Vlm::cassette(choice(WireFormat::OpenaiChat), bench.folder.path().to_owned()));
    let played = Bench::play(&cassette, "episode", 4);
    assert_eq!(played[..3].iter().cloned().map(Result::unwrap).collect::<Vec<_>>(), first);
    assert!(played[3].as_ref().unwrap_err().cause.contains("no answer for step 4"));

    for change in [
        |model: &mut Model| model.max_output_tokens = NonZeroU32::new(501),
        |model: &mut Model| {
            model.reasoning_effort = Some(Effort::Low);
        },
    ] {
        let mut other = choice(WireFormat::OpenaiChat);
        change(&mut other.model);
        let another = Arc::new(Vlm::cassette(other, bench.folder.path().to_owned()));
        let refused = Bench::play(&another, "episode", 1).remove(0).unwrap_err();
        assert!(refused.cause.contains("belongs to another request"), "{refused}");
    }
}

#[test]
fn the_model_that_answered_is_kept_as_the_provider_names_it() {
    for wire_format in [WireFormat::OpenaiChat, WireFormat::Gemini, WireFormat::AnthropicMessages] {
        let server = Server::start(move |_, _| whole(wire_format, &decision("w")));
        let bench = Bench::new(Limits::default());
        assert!(Bench::play(&bench.vlm(&server, wire_format), "episode", 1)[0].is_ok());
        let answer: serde_json::Value = serde_json::from_str(bench.written().lines().nth(1).unwrap()).unwrap();
        assert_eq!(answer["model"], "model-1-0601", "{wire_format:?}");
    }
}
