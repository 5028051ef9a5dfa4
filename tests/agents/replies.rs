//! Replies as models write them, and how each is read.

use mirrorstats_agents::reply::{self, Ending, Repair};
use mirrorstats_agents::{Reply, Status};
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::episodes::episode::Action;

const GOOD: &str = r#"{"view-description": "a wall", "reasoning": "it's a \"wall\"", "action": "a", "summary": "turned, {so far}", "selected_cube": "none", "identification": "unknown"}"#;

fn read(raw: &str) -> Reply {
    reply::read(raw, &Experiment::E1, Ending::Whole)
}

#[test]
fn a_valid_reply_is_taken_as_it_is() {
    let reading = read(GOOD);
    assert_eq!((reading.status, reading.action), (Status::Ok, Some(Action::TurnLeft)));
    assert_eq!((reading.selected_cube.as_deref(), reading.self_color.as_deref()), (Some("none"), Some("unknown")));
    assert_eq!(reading.words.reasoning.as_deref(), Some("it's a \"wall\""));
    assert_eq!(reading.fault, None);
    assert_eq!(read(&format!("\n  {GOOD}\t\n")), reading);
}

#[test]
fn an_unreadable_identification_is_a_fault_of_a_decision() {
    let reading = read(&GOOD.replace("unknown", "Ich bin rot"));
    assert_eq!((reading.status, reading.action, reading.self_color), (Status::Ok, Some(Action::TurnLeft), None));
    assert_eq!(reading.fault.as_deref(), Some("unreadable identification: Ich bin rot"));
}

#[test]
fn the_exploration_family_has_no_cube() {
    let without = GOOD.replace(r#" "selected_cube": "none","#, "");
    let reading = reply::read(&without, &Experiment::E5, Ending::Whole);
    assert_eq!((reading.status, reading.selected_cube), (Status::Ok, None));
    assert_eq!(reply::read(GOOD, &Experiment::E5, Ending::Whole).status, Status::SchemaInvalid);
    assert_eq!(read(&without).status, Status::SchemaInvalid);
}

#[test]
fn a_cube_in_other_letters_is_a_repair() {
    for (text, cube) in [
        ("Red", "red"),
        ("RED.", "red"),
        (" red ", "red"),
        ("red\u{a0}", "red"),
        ("\\nred\\t", "red"),
        ("None", "none"),
        (" NONE", "none"),
    ] {
        let reading = read(&GOOD.replace("\"selected_cube\": \"none\"", &format!("\"selected_cube\": \"{text}\"")));
        assert_eq!((reading.status, reading.repairs), (Status::Repaired, vec![Repair::ValueSpelling]), "{text:?}");
        assert_eq!(reading.selected_cube.as_deref(), Some(cube), "{text:?}");
    }
    for text in ["unknown", "Mauve", "", "red cube", "r ed"] {
        let reading = read(&GOOD.replace("\"selected_cube\": \"none\"", &format!("\"selected_cube\": \"{text}\"")));
        assert_eq!((reading.status, reading.selected_cube), (Status::SchemaInvalid, None), "{text:?}");
    }
}

#[test]
fn repairs_are_named_and_change_no_word() {
    use Repair::{CodeFence, SingleQuotes, SurroundingText, TrailingComma};
    let comma = GOOD.replace("\"unknown\"}", "\"unknown\" ,\n }");
    let single = r#"{'view-description': 'a wall', 'reasoning': 'it\'s a "wall"', 'action': 'a', 'summary': 'turned, {so far}', 'selected_cube': 'none', 'identification': 'unknown'}"#;
    let cases: Vec<(String, Vec<Repair>)> = vec![
        (format!("```json\n{GOOD}\n```"), vec![CodeFence]),
        (format!("```\n{GOOD}```"), vec![CodeFence]),
        (format!("```{GOOD}```"), vec![CodeFence]),
        (format!("Here is it: {GOOD}"), vec![SurroundingText]),
        (format!("{GOOD}\nThat's all."), vec![SurroundingText]),
        (format!("Sure!\n```json\n{GOOD}\n```\nDone."), vec![SurroundingText]),
        (comma.clone(), vec![TrailingComma]),
        (format!("```json\n{comma}\n```"), vec![CodeFence, TrailingComma]),
        (format!("so: {comma}"), vec![SurroundingText, TrailingComma]),
        (single.to_owned(), vec![SingleQuotes]),
        (single.replace(r"it\'s", "it's"), vec![SingleQuotes]),
        (format!("I'd say {}", single.replace("'}", "',}")), vec![SurroundingText, TrailingComma, SingleQuotes]),
    ];
    let words = read(GOOD).words;
    for (raw, repairs) in cases {
        let reading = read(&raw);
        assert_eq!((reading.status, &reading.repairs), (Status::Repaired, &repairs), "{raw}");
        assert_eq!(reading.words, words, "{raw}");
        assert_eq!(reading.action, Some(Action::TurnLeft), "{raw}");
    }
}

#[test]
fn a_lone_surrogate_is_repaired_and_a_pair_is_kept() {
    use Repair::{CodeFence, SingleQuotes, Surrogate, SurroundingText};
    let with = |escape: &str| GOOD.replace("a wall", &format!("a wall {escape}!"));
    let seen = |raw: &str| {
        let reading = read(raw);
        assert_eq!((reading.action, reading.fault), (Some(Action::TurnLeft), None), "{raw}");
        (reading.status, reading.repairs, reading.words.view_description.unwrap())
    };
    let repaired = |repairs: Vec<Repair>, text: &str| (Status::Repaired, repairs, text.to_owned());
    for escape in [r"\ud800", r"\uDBFF", r"\udc00", r"\udfff"] {
        assert_eq!(seen(&with(escape)), repaired(vec![Surrogate], "a wall \u{fffd}!"), "{escape}");
    }
    assert_eq!(seen(&with(r"\ude00\ud83d")), repaired(vec![Surrogate], "a wall \u{fffd}\u{fffd}!"));
    assert_eq!(seen(&with(r"\ud83d\ud83d\ude00")), repaired(vec![Surrogate], "a wall \u{fffd}\u{1f600}!"));
    assert_eq!(seen(&with(r"\ud83d\ude00")), (Status::Ok, Vec::new(), "a wall \u{1f600}!".to_owned()));
    assert_eq!(seen(&with(r"\\ud83d")), (Status::Ok, Vec::new(), r"a wall \ud83d!".to_owned()));
    let cut = with(r"\ud83d");
    for (raw, repairs) in [
        (format!("```json\n{cut}\n```"), vec![CodeFence, Surrogate]),
        (format!("I see: {cut}"), vec![SurroundingText, Surrogate]),
        (cut.replace('"', "'"), vec![SingleQuotes, Surrogate]),
    ] {
        assert_eq!(seen(&raw), repaired(repairs, "a wall \u{fffd}!"), "{raw}");
    }
    assert_eq!(Repair::joined(&[CodeFence, Surrogate]).as_deref(), Some("code_fence+surrogate"));
    // An invalid escape does not make an unreadable reply readable.
    assert_eq!(read(r"I see \ud83d").status, Status::ParseFailed);
}

#[test]
fn an_action_in_other_letters_is_a_repair() {
    use Repair::{CodeFence, ValueSpelling};
    for (name, action) in
        [("A", Action::TurnLeft), (" a ", Action::TurnLeft), ("DONE", Action::Done), ("Done\\n", Action::Done)]
    {
        let raw = GOOD.replace("\"action\": \"a\"", &format!("\"action\": \"{name}\""));
        let reading = read(&raw);
        assert_eq!((reading.status, reading.repairs), (Status::Repaired, vec![ValueSpelling]), "{name:?}");
        assert_eq!(reading.action, Some(action), "{name:?}");
    }
    let fenced = format!("```json\n{}\n```", GOOD.replace("\"a\"", "\"A\""));
    assert_eq!(read(&fenced).repairs, [CodeFence, ValueSpelling]);
    for name in ["left", "wa", "don e", "1", "\u{430}"] {
        let raw = GOOD.replace("\"action\": \"a\"", &format!("\"action\": \"{name}\""));
        assert_eq!((read(&raw).status, read(&raw).action), (Status::SchemaInvalid, None), "{name:?}");
    }
}

#[test]
fn raw_control_characters_and_comments_are_repairs() {
    use Repair::{CodeFence, Comment, ControlCharacter, SurroundingText, TrailingComma};
    let feed = GOOD.replace("a wall", "a wall\r\n\tand more");
    let line = GOOD.replace("\"action\":", "// I \"turn\", it's left\n \"action\":");
    let block = GOOD.replace("\"unknown\"}", "\"unknown\", /* not \"red\" } */ }");
    let cases: Vec<(String, Vec<Repair>, &str)> = vec![
        (feed.clone(), vec![ControlCharacter], "a wall\r\n\tand more"),
        (format!("```json\n{feed}\n```"), vec![CodeFence, ControlCharacter], "a wall\r\n\tand more"),
        (line.clone(), vec![Comment], "a wall"),
        (format!("```json\n{line}\n```"), vec![CodeFence, Comment], "a wall"),
        (format!("So: {line}"), vec![SurroundingText, Comment], "a wall"),
        (block, vec![Comment, TrailingComma], "a wall"),
        // Comments inside strings stay.
        (format!("```{}```", GOOD.replace("a wall", "see http://a /* b */")), vec![CodeFence], "see http://a /* b */"),
    ];
    for (raw, repairs, view) in cases {
        let reading = read(&raw);
        assert_eq!((reading.status, reading.repairs), (Status::Repaired, repairs), "{raw}");
        assert_eq!(reading.words.view_description.as_deref(), Some(view), "{raw}");
        assert_eq!(reading.action, Some(Action::TurnLeft), "{raw}");
    }
    assert_eq!(read(&"/*".repeat(1_000_000)).status, Status::ParseFailed);
}

#[test]
fn a_call_of_a_function_with_the_right_arguments_is_a_repair() {
    use Repair::{SurroundingText, ToolCall, ValueSpelling, Wrapper};
    let call = format!("{{\"name\": \"reply\", \"arguments\": {GOOD}}}");
    let cases = [
        (call.clone(), vec![ToolCall]),
        (call.replace("arguments", "parameters"), vec![ToolCall]),
        (format!("<tool_call>\n{call}\n</tool_call>"), vec![SurroundingText, ToolCall]),
        (call.replace("\"a\"", "\"A\""), vec![ToolCall, ValueSpelling]),
        (call.replace("\"name\": \"reply\", ", ""), vec![Wrapper]),
    ];
    for (raw, repairs) in cases {
        let reading = read(&raw);
        assert_eq!((reading.status, reading.repairs), (Status::Repaired, repairs), "{raw}");
        assert_eq!((reading.words, reading.action), (read(GOOD).words, Some(Action::TurnLeft)), "{raw}");
    }
    for raw in [
        call.replace("\"reply\"", "1"),
        call.replace("\"action\"", "\"move\""),
        call.replace("\"action\"", "\"action\": \"w\", \"action\""),
        r#"{"name": "reply", "arguments": "{}"}"#.to_owned(),
    ] {
        assert_eq!(read(&raw).status, Status::SchemaInvalid, "{raw}");
    }
}

/// A complete reply with another decision than [`GOOD`].
fn draft() -> String {
    GOOD.replace("\"action\": \"a\"", "\"action\": \"w\"")
}

#[test]
fn objects_inside_thoughts_are_not_taken_as_the_reply() {
    use Repair::{CodeFence, SurroundingText, Thoughts, TrailingComma};
    let (draft, comma) = (draft(), GOOD.replace("\"unknown\"}", "\"unknown\",}"));
    let cases: Vec<(String, Vec<Repair>)> = vec![
        (format!("<think>A wall.</think>{GOOD}"), vec![Thoughts]),
        (format!("<think>\nA wall: {draft}\n</think>\n\n{GOOD}"), vec![Thoughts]),
        (format!("<think></think>\n{GOOD}"), vec![Thoughts]),
        // Servers whose prompt ends with the opening tag send only the closing one.
        (format!("A wall: {draft}\n</think>\n{GOOD}"), vec![Thoughts]),
        (format!("{{ an open brace </think>{GOOD}"), vec![Thoughts]),
        (format!("<think>a</think><think>{draft}</think>{GOOD}"), vec![Thoughts]),
        (format!("<think>hm</think>```json\n{GOOD}\n```"), vec![Thoughts, CodeFence]),
        (format!("```json\n<think>hm</think>{GOOD}\n```"), vec![CodeFence, Thoughts]),
        (format!("<think>{draft}</think>Here it is: {GOOD}"), vec![Thoughts, SurroundingText]),
        (format!("<think>hm</think>{comma}"), vec![Thoughts, TrailingComma]),
        // Tags inside a string are plain text.
        (format!("```\n{}\n```", GOOD.replace("a wall", "a <think> or a </think>")), vec![CodeFence]),
    ];
    for (raw, repairs) in cases {
        let reading = read(&raw);
        assert_eq!((reading.status, reading.repairs), (Status::Repaired, repairs), "{raw}");
        assert_eq!((reading.action, reading.fault), (Some(Action::TurnLeft), None), "{raw}");
    }
    assert_eq!(Repair::joined(&[Thoughts, CodeFence]).as_deref(), Some("thoughts+code_fence"));
    let tags = GOOD.replace("a wall", "a <think> or a </think>");
    assert_eq!((read(&tags).status, read(&tags).action), (Status::Ok, Some(Action::TurnLeft)));
}

#[test]
fn thoughts_without_an_answer_are_no_decision() {
    let draft = draft();
    let cases = [
        (format!("<think>A wall: {draft}"), Status::Truncated),
        ("<think>".to_owned(), Status::Truncated),
        (format!("Well. <think>{draft}"), Status::Truncated),
        (format!("<think>a</think><think>{draft}"), Status::Truncated),
        (format!("<think>{draft}</think>"), Status::Empty),
        (format!("{draft}</think> \n"), Status::Empty),
        (format!("<think>{draft}</think>I turn left."), Status::ParseFailed),
        (format!("<think>{draft}</think>[]"), Status::ParseFailed),
        (format!("<think>{draft}</think>{{}}"), Status::SchemaInvalid),
        (format!("<think>hm</think>{GOOD}{GOOD}"), Status::ParseFailed),
    ];
    for (raw, status) in cases {
        let reading = read(&raw);
        assert_eq!((reading.status, reading.action, reading.self_color), (status, None, None), "{raw}");
    }
}

#[test]
fn an_invalid_reply_is_no_decision() {
    let nested = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    let cases = [
        ("I turn left.", Status::ParseFailed),
        ("[]", Status::ParseFailed),
        ("\"a\"", Status::ParseFailed),
        ("{", Status::ParseFailed),
        (&GOOD[..GOOD.len() - 20], Status::ParseFailed),
        (&format!("{GOOD}{GOOD}"), Status::ParseFailed),
        (&GOOD.replace("\"a wall\"", "NaN"), Status::ParseFailed),
        (&GOOD.replace("\"a wall\"", &nested), Status::ParseFailed),
        (&nested, Status::ParseFailed),
        ("{}", Status::SchemaInvalid),
        (&GOOD.replace("\"a wall\"", "null"), Status::SchemaInvalid),
        (&GOOD.replace("\"a wall\"", "[[1]]"), Status::SchemaInvalid),
        (&GOOD.replace("\"action\": \"a\"", "\"action\": \"jump\""), Status::SchemaInvalid),
        (&GOOD.replace("\"action\": \"a\"", "\"action\": \"\""), Status::SchemaInvalid),
        (&GOOD.replace("\"action\": \"a\"", "\"action\": \"a\", \"action\": \"w\""), Status::SchemaInvalid),
        (&GOOD.replace("\"none\"", "\"mauve\""), Status::SchemaInvalid),
        (&GOOD.replace("}\n", "").replace("\"unknown\"}", "\"unknown\", \"extra\": 1}"), Status::SchemaInvalid),
        (&GOOD.replace("\"view-description\"", "\"view\""), Status::SchemaInvalid),
        ("", Status::Empty),
        (" \n\t", Status::Empty),
    ];
    for (raw, status) in cases {
        let reading = read(raw);
        assert_eq!(reading.status, status, "{}", &raw[..raw.len().min(300)]);
        assert_eq!((reading.action, reading.self_color, reading.selected_cube), (None, None, None));
        assert_eq!(reading.fault.is_some(), status != Status::Empty);
    }
}

#[test]
fn a_whole_object_before_white_space_is_taken_although_the_limit_was_reached() {
    for (text, repairs) in [
        (GOOD.to_owned(), vec![]),
        (format!("{GOOD}{}", "\n\t ".repeat(500)), vec![]),
        (format!("<think>hm</think>{GOOD}\n\n"), vec![Repair::Thoughts]),
        (format!("```json\n{GOOD}\n```\n\n"), vec![Repair::CodeFence]),
    ] {
        let reading = reply::read(&text, &Experiment::E1, Ending::Truncated);
        assert_eq!((reading.action, reading.repairs), (Some(Action::TurnLeft), repairs), "{text}");
    }
}

/// The marks around thoughts, as servers leave them in a reply: before the thoughts, after them, and after the answer.
const MARKS: [[&str; 3]; 22] = [
    ["<think>", "</think>", ""],
    ["<THINK>", "</THINK>", ""],
    ["<think effort=\"high\">", "</think >", ""],
    ["<thinking>", "</thinking>", ""],
    ["<thought>", "</thought>", ""],
    ["<reasoning>", "</reasoning>", ""],
    ["<seed:think>", "</seed:think>", ""],
    ["[THINK]", "[/THINK]", ""],
    ["\u{25c1}think\u{25b7}", "\u{25c1}/think\u{25b7}", ""],
    ["<|begin_of_thought|>", "<|end_of_thought|>\n<|begin_of_solution|>", "<|end_of_solution|>"],
    ["<|START_THINKING|>", "<|END_THINKING|><|START_RESPONSE|>", "<|END_RESPONSE|>"],
    ["<|inner_prefix|>", "<|inner_suffix|>", ""],
    ["<|channel>thought\n", "<channel|>", ""],
    ["<|channel>thought\n", "<channel|>", "<turn|>"],
    ["<|channel|>analysis<|message|>", "<|end|>", ""],
    ["<|channel|>analysis<|message|>", "<|end|>", "<|end|>"],
    ["<|channel|>analysis<|message|>", "<|end|><|start|>assistant<|channel|>final<|message|>", "<|return|>"],
    ["<|channel|>analysis<|message|>", "<|start|>assistant<|channel|>final <|constrain|>json<|message|>", "<|end|>"],
    ["<|start|>assistant<|channel|>analysis<|message|>", "<|end|><|start|>assistant<|channel|>final<|message|>", ""],
    ["<|channel|>commentary<|message|>", "<|end|><|start|>assistant<|channel|>final<|message|>", ""],
    ["analysisWe think. ", "assistantfinal", ""],
    ["<unused94>thought\n", "<unused95>", ""],
];

#[test]
fn thoughts_in_any_marks_are_no_answer_and_the_answer_behind_them_is_taken() {
    let draft = draft();
    for [opening, closing, end] in MARKS {
        let thoughts = format!("{opening}A draft: {draft} but I should look first.");
        for none in
            [thoughts.clone(), format!("{thoughts}{closing}"), format!("{opening}{draft}"), format!("\n{thoughts}")]
        {
            let reading = read(&none);
            assert_eq!(reading.action, None, "{none}");
            assert!([Status::Empty, Status::Truncated].contains(&reading.status), "{none}: {:?}", reading.status);
        }
        for answered in [format!("{thoughts}{closing}{GOOD}{end}"), format!("{opening}{closing}\n{GOOD}{end}\n")] {
            let reading = read(&answered);
            assert_eq!(reading.action, Some(Action::TurnLeft), "{answered}: {:?}", reading.fault);
            assert_eq!(reading.repairs, [Repair::Thoughts], "{answered}");
        }
    }
}

#[test]
fn an_ending_counts_before_the_text() {
    for cut in [&GOOD[..GOOD.len() - 1], &format!("{GOOD} and"), &format!("{GOOD}{GOOD}"), &format!("<think>{GOOD}")] {
        assert_eq!(reply::read(cut, &Experiment::E1, Ending::Truncated).status, Status::Truncated, "{cut}");
    }
    assert_eq!(reply::read(GOOD, &Experiment::E1, Ending::Refused).status, Status::Refusal);
    assert_eq!(reply::read("", &Experiment::E1, Ending::Truncated).status, Status::Truncated);
}

#[test]
fn the_raw_text_is_kept_whatever_it_is() {
    let raw = "no JSON at all";
    let reply = read(raw).with_text(raw.to_owned(), mirrorstats_agents::Usage::default());
    assert_eq!((reply.status, reply.raw.as_deref()), (Status::ParseFailed, Some(raw)));
}

#[test]
fn answers_of_an_experiment_are_read_by_their_types() {
    let experiment = Experiment::parse("contingency").unwrap();
    let with = |side: &str| {
        let reply =
            format!(r#"{{"view-description": "", "reasoning": "", "action": "w", "summary": "", "side": {side}}}"#);
        reply::read(&reply, &experiment, Ending::Whole)
    };
    for (written, status, read) in [
        (r#""left""#, Status::Ok, Some("left")),
        (r#"" LEFT. ""#, Status::Repaired, Some("left")),
        (r#""unknown""#, Status::Ok, Some("unknown")),
        (r#""""#, Status::Ok, None),
    ] {
        let reading = with(written);
        let side = reading.answers.get("side").map(mirrorstats_trace::episodes::answers::Answered::text);
        assert_eq!((reading.status, side.as_deref()), (status, read), "{written}");
    }
    for (written, fault) in [
        (r#""above""#, "\"side\" is \"above\", expected one of left, middle, right, unknown"),
        ("2", "\"side\" is a number, expected one of left, middle, right, unknown"),
    ] {
        let reading = with(written);
        assert_eq!((reading.status, reading.fault.as_deref()), (Status::SchemaInvalid, Some(fault)));
    }
    let structure = reply::structure(&experiment);
    assert_eq!(structure["properties"]["side"], serde_json::json!({ "type": "string" }));
    assert_eq!(
        structure["required"],
        serde_json::json!(["view-description", "reasoning", "action", "summary", "side"])
    );
}
