//! Each provider is asked in its own language.

use mirrorstats::agent::Status;
use mirrorstats::agent::vlm::OnOutage;
use mirrorstats::agent::vlm::dialect::Dialect;
use mirrorstats::agent::vlm::limits::Limits;
use mirrorstats::trace::episode::Action;

use super::bench::{Bench, KEY};
use super::server::{Server, decision, whole};

#[test]
fn each_provider_is_asked_in_its_language() {
    let openai = format!("authorization: Bearer {KEY}");
    let providers = [
        (Dialect::OpenaiChat, "/v1/chat/completions", openai.clone()),
        (Dialect::OpenaiCompatible, "/v1/chat/completions", openai),
        (Dialect::Gemini, "/v1/models/model-1:generateContent", format!("x-goog-api-key: {KEY}")),
        (Dialect::AnthropicMessages, "/v1/messages", format!("x-api-key: {KEY}")),
    ];
    for (dialect, path, key) in providers {
        let server = Server::start(move |_, _| whole(dialect, &decision("w")));
        let bench = Bench::new(Limits::default());
        let reply = Bench::play(&bench.vlm(&server, dialect, OnOutage::Lose), "episode", 1).remove(0).unwrap();
        assert_eq!((reply.status, reply.action), (Status::Ok, Some(Action::MoveForward)), "{dialect:?}");
        assert_eq!((reply.usage.prompt_tokens, reply.usage.completion_tokens), (Some(1000), Some(100)), "{dialect:?}");
        let request = server.requests().remove(0);
        assert!(request.head.starts_with(&format!("POST {path} ")), "{}", request.head);
        assert!(request.head.contains(&key), "{}", request.head);
        let text = request.json().to_string();
        assert!(text.contains("0.2") && text.contains("You are a robot control agent."), "{dialect:?}");
        assert!(text.contains("selected_cube"), "the schema is asked for: {dialect:?}");
    }
}
