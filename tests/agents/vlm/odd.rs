//! Odd answers of OpenAI-compatible servers: each is repaired by name, or refused with its difference from the schema.

use mirrorstats_agents::Reply;
use mirrorstats_agents::reply::Repair;
use mirrorstats_vlm::limits::Limits;
use mirrorstats_vlm::wire_format::WireFormat;
use serde_json::{Value, json};

use super::bench::Bench;
use super::server::{Server, ok};

/// A complete reply.
fn good() -> Value {
    json!({
        "view-description": "v", "reasoning": "r", "action": "done", "summary": "s",
        "selected_cube": "red", "identification": "I am red",
    })
}

/// The complete reply with another value of one key.
fn with(key: &str, value: Value) -> String {
    let mut reply = good();
    reply[key] = value;
    reply.to_string()
}

fn renamed(rename: impl Fn(&str) -> String) -> String {
    let members = good().as_object().unwrap().clone();
    members.into_iter().map(|(key, value)| (rename(&key), value)).collect::<Value>().to_string()
}

fn message(message: &Value) -> Value {
    json!({ "object": "chat.completion", "choices": [{ "index": 0, "finish_reason": "stop", "message": message }] })
}

/// The reply to the first step, if the server sends this body.
fn reply(name: &str, body: Value) -> Reply {
    let server = Server::start(move |_, _| ok(&body));
    let bench = Bench::new(Limits::default());
    let vlm = bench.vlm(&server, WireFormat::OpenaiCompatible);
    let reply = Bench::play(&vlm, "episode", 1).remove(0).unwrap_or_else(|lost| panic!("{name}: {lost}"));
    assert_eq!(server.count(), 1, "{name}");
    reply
}

/// Status, repairs, action, cube and attribution of a reply; or its status and fault.
fn summary(reply: &Reply) -> String {
    let status = reply.status.name();
    let Some(action) = reply.action else {
        assert_eq!((&reply.self_color, &reply.selected_cube), (&None, &None));
        return format!("{status}: {}", reply.fault.as_deref().unwrap_or("-"));
    };
    assert_eq!(reply.fault, None);
    let repairs = Repair::joined(&reply.repairs).unwrap_or_else(|| "-".to_owned());
    let of = |text: &Option<String>| text.clone().unwrap_or_else(|| "-".to_owned());
    format!("{status} {repairs} {} {} {}", action.name(), of(&reply.selected_cube), of(&reply.self_color))
}

fn check(cases: Vec<(&str, Value, &str)>) {
    let told = |(name, body, expected): (&str, Value, &str)| {
        let found = summary(&reply(name, body));
        (found != expected).then(|| format!("{name}\n  expected {expected}\n  found    {found}"))
    };
    let wrong: Vec<_> = cases.into_iter().filter_map(told).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

fn texts(cases: Vec<(&'static str, String, &'static str)>) {
    check(
        cases
            .into_iter()
            .map(|(name, text, expected)| (name, message(&json!({ "content": text })), expected))
            .collect(),
    );
}

#[test]
fn the_form_of_a_text_is_repaired_by_name() {
    let good = good().to_string();
    let draft = with("action", "w".into());
    texts(vec![
        ("plain", good.clone(), "ok - done red red"),
        ("a list of one", format!("[{good}]"), "repaired wrapper done red red"),
        ("a wrapper", format!("{{\"reply\": {good}}}"), "repaired wrapper done red red"),
        ("a wrapper in a list", format!("[{{\"reply\": {good}}}]"), "repaired wrapper done red red"),
        ("JSON in a string", Value::from(good.as_str()).to_string(), "repaired json_string done red red"),
        (
            "JSON in a fenced string",
            format!("```json\n{}\n```", Value::from(good.as_str())),
            "repaired code_fence+json_string done red red",
        ),
        ("underscores in keys", renamed(|key| key.replace('-', "_")), "repaired key_spelling done red red"),
        ("hyphens in keys", renamed(|key| key.replace('_', "-")), "repaired key_spelling done red red"),
        ("capitals in keys", renamed(str::to_uppercase), "repaired key_spelling done red red"),
        ("spaces in keys", renamed(|key| key.replace(['_', '-'], " ")), "repaired key_spelling done red red"),
        ("a byte order mark", format!("\u{feff}{good}"), "repaired surrounding_text done red red"),
        ("a raw line feed", good.replace("\"r\"", "\"a\nb\""), "repaired control_character done red red"),
        (
            "harmony",
            format!("<|channel|>analysis<|message|>I see<|end|><|start|>assistant<|channel|>final<|message|>{good}"),
            "repaired thoughts done red red",
        ),
        ("gemma", format!("<|channel>thought\nhm<channel|>{good}"), "repaired thoughts done red red"),
        ("seed", format!("<seed:think>x</seed:think>{good}"), "repaired thoughts done red red"),
        ("magistral", format!("[THINK]hm {draft}[/THINK]{good}"), "repaired thoughts done red red"),
        (
            "a fence in text",
            format!("**Answer:**\n```json5\n{good}\n```\nBye!"),
            "repaired surrounding_text done red red",
        ),
        ("a box", format!("<|begin_of_box|>{good}<|end_of_box|>"), "repaired surrounding_text done red red"),
        (
            "a fence in a string",
            format!("```json\n{}\n```", with("reasoning", "uses ``` inside".into())),
            "repaired surrounding_text done red red",
        ),
    ]);
}

#[test]
fn the_form_of_a_value_is_repaired_by_name() {
    let action = |text: &str| with("action", text.into());
    let cube = |text: &str| with("selected_cube", text.into());
    texts(vec![
        ("capitals", action("W"), "repaired value_spelling move_forward red red"),
        ("white space", action(" w\n"), "repaired value_spelling move_forward red red"),
        ("punctuation", action("**\"Done.\"**"), "repaired value_spelling done red red"),
        ("an invisible character", action("w\u{200b}"), "repaired value_spelling move_forward red red"),
        ("the prompt's words", action("TURN RIGHT"), "repaired action_words turn_right red red"),
        ("a name", action("turn_right"), "repaired action_words turn_right red red"),
        ("whole words", action("Turn right by 30 degrees."), "repaired action_words turn_right red red"),
        ("the prompt's line", action("d = turn right by 30 degrees"), "repaired action_words turn_right red red"),
        ("words in brackets", action("done (task complete)"), "repaired action_words done red red"),
        ("a cube in capitals", cube("RED."), "repaired value_spelling done red red"),
        ("a quoted cube", cube("'red'"), "repaired value_spelling done red red"),
        (
            "two values",
            action("W").replace("\"selected_cube\":\"red\"", "\"selected_cube\":\"Red\""),
            "repaired value_spelling move_forward red red",
        ),
    ]);
}

#[test]
fn the_meaning_of_a_reply_is_never_guessed() {
    const ACTIONS: &str = "expected one of w, s, a, d, done";
    const KEYS: &str =
        "\"view-description\", \"reasoning\", \"action\", \"summary\", \"selected_cube\", \"identification\"";
    let expected = |found: &str, of: &str| -> &'static str { format!("schema_invalid: {found}, {of}").leak() };
    let action = |text: &str| {
        ("an action", with("action", text.into()), expected(&format!("\"action\" is \"{text}\""), ACTIONS))
    };
    let cube = |text: &str| {
        let found = format!("\"selected_cube\" is \"{text}\"");
        ("a cube", with("selected_cube", text.into()), expected(&found, "expected a colour of the palette or none"))
    };
    let other = |key: &str, value: Value, kind: &str| {
        ("a value", with(key, value), expected(&format!("\"{key}\" is {kind}"), "expected a string"))
    };
    let good = good().to_string();
    let unknown_key =
        |key: &str| -> &'static str { format!("schema_invalid: the key \"{key}\" is not one of {KEYS}").leak() };
    let twice = good.replacen('{', "{\"View_Description\": \"v\", ", 1);
    let unknown = good.replacen('{', "{\"confidence\": 1, ", 1);
    let long = "x".repeat(300);
    let cut = format!("\"action\" is \"{}...\"", &long[..80]);
    texts(vec![
        action("w w"),
        action("w, then a"),
        action("stop"),
        action("left"),
        action("turn right by 90 degrees"),
        action("a = turn right by 30 degrees"),
        action("w/a"),
        action("\u{430}"),
        action("\u{ff57}"),
        action(""),
        ("a long action", with("action", long.as_str().into()), expected(&cut, ACTIONS)),
        cube("the light blue cube"),
        cube("red or orange"),
        cube("red?"),
        cube("violet"),
        cube("#ff0000"),
        cube("r\u{435}d"),
        other("action", json!(4), "a number"),
        other("action", json!(["w", "w"]), "an array"),
        other("action", Value::Null, "null"),
        other("selected_cube", Value::Null, "null"),
        other("selected_cube", json!(["red"]), "an array"),
        other("identification", json!({ "color": "red" }), "an object"),
        ("a missing key", with("x", 1.into()).replace("\"summary\":\"s\",", ""), unknown_key("x")),
        (
            "no identification",
            good.replace(",\"identification\":\"I am red\"", "").replace("\"identification\":\"I am red\",", ""),
            "schema_invalid: the key \"identification\" is missing",
        ),
        ("a key twice", twice, "schema_invalid: the key \"view-description\" occurs twice"),
        ("an unknown key", unknown, unknown_key("confidence")),
        (
            "a wrapper of a part",
            json!({ "reply": { "action": "w" } }).to_string(),
            "schema_invalid: the key \"selected_cube\" is missing",
        ),
    ]);
}

#[test]
fn a_text_that_is_no_single_object_is_refused() {
    const NONE: &str = "parse_failed: expected a JSON object, found text without one";
    let good = good().to_string();
    let draft = with("action", "w".into());
    let plain: String = good.replace(['{', '}', '"'], "").replace(',', "\n");
    let failed = |why: &str| -> &'static str { format!("parse_failed: expected a JSON object: {why}").leak() };
    let many = "invalid type: sequence, expected a JSON object at line 1 column 0";
    texts(vec![
        ("YAML", plain, NONE),
        ("XML", "<reply><action>w</action></reply>".to_owned(), NONE),
        ("a string of words", "\"turn left\"".to_owned(), NONE),
        ("two objects", format!("{good}\n{draft}"), failed("trailing characters at line 2 column 1")),
        ("a list of two", format!("[{good}, {draft}]"), failed(many)),
        ("Python", draft.replace('"', "'").replace("'red'", "None"), failed("key must be a string at line 1 column 2")),
        ("typographic quotes", good.replacen('"', "\u{201c}", 1), failed("key must be a string at line 1 column 2")),
        ("open thoughts", format!("<think>I look {draft}"), "truncated: the reply ends within its thoughts"),
        (
            "words after thoughts",
            format!("<think>{draft}</think>I turn left."),
            failed("expected value at line 1 column 1"),
        ),
        ("thoughts alone", format!("<think>{draft}</think>"), "empty: the answer has reasoning, but no text after it"),
    ]);
}

#[test]
fn the_text_of_a_message_is_found_where_servers_put_it() {
    let (good, text) = (good(), good().to_string());
    let alone = "empty: the answer has reasoning, but no text after it";
    let call =
        |arguments: &Value| json!({ "content": null, "tool_calls": [{ "function": { "arguments": arguments } }] });
    let mut two = message(&json!({ "content": with("action", "w".into()) }));
    two["choices"].as_array_mut().unwrap().push(message(&json!({ "content": text }))["choices"][0].clone());
    let mut usage = message(&json!({ "content": text }));
    usage["usage"] = json!({ "prompt_tokens": -1, "completion_tokens": 1e12 });
    check(vec![
        ("parts", message(&json!({ "content": [{ "type": "output_text", "text": text }] })), "ok - done red red"),
        ("a part", message(&json!({ "content": { "type": "text", "text": text } })), "ok - done red red"),
        ("an object", message(&json!({ "content": good })), "repaired tool_call done red red"),
        ("parsed", message(&json!({ "content": null, "parsed": good })), "repaired tool_call done red red"),
        ("a call", message(&call(&text.as_str().into())), "repaired tool_call done red red"),
        ("a call with an object", message(&call(&good)), "repaired tool_call done red red"),
        (
            "an older call",
            message(&json!({ "content": null, "function_call": { "arguments": text } })),
            "repaired tool_call done red red",
        ),
        ("two choices", two, "ok - move_forward red red"),
        ("odd usage", usage, "ok - done red red"),
        ("reasoning_content", message(&json!({ "content": null, "reasoning_content": text })), alone),
        ("reasoning", message(&json!({ "content": "", "reasoning": text })), alone),
        ("a part of reasoning", message(&json!({ "content": [{ "type": "reasoning_text", "text": text }] })), alone),
        ("no text", message(&json!({ "content": "" })), "empty: -"),
    ]);
}
