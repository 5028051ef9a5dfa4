//! Invalid steps and episodes are refused with file, line and key; no file is written.

use std::fs;

use serde_json::{Value, json};

use super::{imported, lines, run, step, step_with};

/// The message that refuses these lines.
#[track_caller]
fn refused(text: impl Into<Vec<u8>>) -> String {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.jsonl"), text.into()).unwrap();
    let answer = run(folder.path(), &["import", "s.jsonl", "-o", "x.parquet"], "");
    assert_eq!(answer.code, 2, "{}{}", answer.stdout, answer.stderr);
    assert!(answer.stdout.is_empty(), "{}", answer.stdout);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "something was written");
    assert!(!answer.stderr.contains("panicked"), "{}", answer.stderr);
    answer.stderr
}

/// Checks that a second step with this value is refused with these words, at its line and key.
#[track_caller]
fn check(values: Value, expected: &str, found: &str, help: &str) {
    let key = values.as_object().unwrap().keys().next().unwrap().clone();
    let said = refused(lines(&[step("a", 1), step_with("a", 2, values)]));
    let words = format!("error: s.jsonl, line 2, key `{key}`\n  expected {expected}\n  found {found}\n  help: {help}");
    assert!(said.starts_with(&words), "{said}\nfor\n{words}");
}

const SEE: &str = "`mirrorstats trace schema step` prints what a step may hold";
const ACTIONS: &str = "one of move_forward, move_backward, turn_left, turn_right, done, hand_up, hand_down, \
     hand_left, hand_right, hand_forward, hand_backward, or null";

#[test]
fn a_value_of_the_wrong_type_or_range_is_refused() {
    let int32 = "an integer from -2147483648 to 2147483647";
    let t = "an integer from 1 to 2147483647";
    let count = "an integer from 0 to 2147483647, or null";
    let whole = "write a whole number";
    check(json!({ "t": 2.5 }), t, "2.5", whole);
    check(json!({ "t": 0.0 }), t, "0", "number the steps from 1");
    check(json!({ "seed": 1e16 }), int32, "1e16", "correct the number, or use smaller ones");
    check(json!({ "t": 0 }), t, "0", "number the steps from 1");
    check(json!({ "t": "2" }), t, "the text `2`", SEE);
    check(json!({ "t": null }), t, "null", "give the step its value; nothing is filled in");
    check(json!({ "seed": true }), int32, "true", SEE);
    check(json!({ "run": 2_147_483_648_i64 }), int32, "2147483648", "correct the number, or use smaller ones");
    check(json!({ "run": u64::MAX }), int32, "18446744073709551615", "correct the number, or use smaller ones");
    check(json!({ "mirror_visible": 1 }), "true or false", "1", SEE);
    check(json!({ "mirror_visible": "true" }), "true or false", "the text `true`", SEE);
    check(json!({ "latency_ms": -1 }), count, "-1", "correct the number");
    check(json!({ "latency_ms": 1.5 }), count, "1.5", whole);
    check(json!({ "cost_usd": -0.5 }), "a number from 0, or null", "-0.5", "correct the number");
    check(json!({ "pose_x": 1e39 }), "a number, or null", "1e39", "correct the number");
    check(json!({ "pose_x": "NaN" }), "a number, or null", "the text `NaN`", SEE);
    check(
        json!({ "distractors": 128 }),
        "an integer from 0 to 127, or null",
        "128",
        "correct the number, or use smaller ones",
    );
    check(json!({ "reasoning": ["a"] }), "a text, or null", "a list", SEE);
    check(json!({ "model": 4 }), "a text that is not empty", "4", SEE);
}

#[test]
fn an_invalid_name_is_refused() {
    check(json!({ "action": "Done" }), ACTIONS, "the text `Done`", "did you mean `done`?");
    check(json!({ "action": "TURN_LEFT" }), ACTIONS, "the text `TURN_LEFT`", "did you mean `turn_left`?");
    check(json!({ "action": "" }), ACTIONS, "the text ``", SEE);
    check(
        json!({ "self_color": "" }),
        "a text that is not empty, or null",
        "the text ``",
        "give the name, or null where allowed",
    );
    let said = refused(lines(&[step_with("a", 1, json!({ "experiment": "e1" }))]));
    assert!(
        said.contains(
            "key `experiment`\n  expected one of E1, E2, E3, E4, E5\n  found the text `e1`\n  help: did you mean `E1`?"
        ),
        "{said}"
    );
    let said = refused(lines(&[step_with("a", 1, json!({ "episode_id": "" }))]));
    assert!(said.contains("key `episode_id`"), "{said}");
    let said = refused(lines(&[step_with("a", 1, json!({ "reply_status": "OK" }))]));
    assert!(said.contains("did you mean `ok`?"), "{said}");
}

#[test]
fn an_invalid_color_is_refused() {
    let [body, claim, cube] = [
        "the lower-case name of a colour",
        "the lower-case name of a colour, `unknown`, or null",
        "the lower-case name of a colour, `none`, or null",
    ];
    let stated = "the lower-case name of a colour, or null";
    for (key, expected) in
        [("body_color", body), ("self_color", claim), ("selected_cube", cube), ("stated_color", stated)]
    {
        check(json!({ key: "Red" }), expected, "the text `Red`", "did you mean `red`?");
        check(json!({ key: "red\u{a0}" }), expected, "the text `red\\u{a0}`", "did you mean `red`?");
        check(json!({ key: "Dark  Teal" }), expected, "the text `Dark  Teal`", "did you mean `dark teal`?");
    }
    let check = |key: &str, text: &str, expected, help| {
        check(json!({ key: text }), expected, &format!("the text `{text}`"), help);
    };
    check("body_color", "unknown", body, "give the true colour of the body");
    check("self_color", "None", claim, "`unknown`, or null where the reply gave none");
    check("self_color", "UNKNOWN", claim, "did you mean `unknown`?");
    check("selected_cube", "unknown", cube, "`none`, or null where the reply gave none");
    check("stated_color", "none", stated, "null where no colour was stated");
}

#[test]
fn two_spellings_of_one_color_are_refused() {
    let steps = [
        step_with("a", 1, json!({ "body_color": "light blue" })),
        step_with("a", 2, json!({ "body_color": "light blue", "self_color": "lightblue" })),
    ];
    let said = refused(lines(&steps));
    assert!(said.contains("episode `a`, t = 2, column `self_color`\n  expected one spelling"), "{said}");
    assert!(said.contains("found `lightblue`\n  help: did you mean `light blue`?"), "{said}");
}

#[test]
fn a_missing_repeated_or_empty_key_is_refused() {
    let mut bare = step("a", 1);
    bare.as_object_mut().unwrap().remove("self_color");
    bare["self_colour"] = json!("red");
    let said = refused(lines(&[bare]));
    let words = "s.jsonl, line 1, key `self_color`\n  expected a text that is not empty, or null\n  found none, though there \
                 is `self_colour`\n  help: write null where the reply gave none";
    assert!(said.contains(words), "{said}");
    let twice = step("a", 1).to_string().replace('{', r#"{"run":7,"#) + "\n";
    assert!(refused(twice).contains("line 1, key `run`\n  expected each key once\n  found the key twice"));
    assert!(refused(lines(&[step_with("a", 1, json!({ "": 1 }))])).contains("expected a key with a name"));
    let all = refused("{}\n");
    assert_eq!(all.matches("s.jsonl, line 1, key").count(), 4, "{all}");
    assert!(all.contains("and 7 more; nothing was written"), "{all}");
    let cause = "error: this looks like another domain: expected columns of the domain `mirror`, found none of \
                 `body_color`, `action`, `self_color`\n  help: give --definitions a file that says `domain = \"NAME\"`";
    assert!(all.starts_with(cause), "{all}");
    let mut unnamed = step("a", 1);
    unnamed.as_object_mut().unwrap().remove("seed");
    let said = refused(lines(&[unnamed]));
    assert!(said.contains("found none\n  help: name the key that has it with --map, or give it"), "{said}");
    assert!(!said.contains("another domain"), "{said}");
}

#[test]
fn a_line_other_than_a_json_object_is_refused() {
    let good = lines(&[step("a", 1)]);
    for (line, found) in [
        ("[1]", "a list"),
        ("7", "7"),
        ("null", "null"),
        ("{", "EOF while parsing an object at character 1"),
        ("{'t': 1}", "key must be a string at character 2"),
        (r#"{"t": 1,}"#, "trailing comma at character 9"),
        (r#"{"t": 1} // step"#, "trailing characters at character 10"),
        (r#"{"t": 01}"#, "invalid number at character 8"),
        (r#"{"t": 1e999}"#, "number out of range at character 11"),
    ] {
        let said = refused(format!("{good}\n{line}\n"));
        assert!(
            said.starts_with("error: s.jsonl, line 3\n") && said.contains(&format!("found {found}\n")),
            "{line}: {said}"
        );
    }
    let said = refused(format!("{good}{{\"cost_usd\": NaN}}\n"));
    assert!(said.contains("JSON has no NaN and no infinity: write null"), "{said}");
    let said = refused(format!("{good}{}", &step("a", 2).to_string()[..40]));
    assert!(said.contains("line 2\n") && said.contains("the file was cut off"), "{said}");
    let deep = format!("{{\"own\":{}{}}}\n", "[".repeat(200_000), "]".repeat(200_000));
    let said = refused(deep);
    assert!(
        said.contains("line 1, key `own`\n  expected null, true or false, a number or a text\n  found a list"),
        "{said}"
    );
    let mut bytes = good.into_bytes();
    bytes.extend(b"{\"model\": \"\xff\"}\n");
    assert!(refused(bytes).contains("line 2\n  expected text in UTF-8\n"));
}

#[test]
fn a_file_without_steps_is_refused() {
    for text in ["", "\n \r\n", "\u{feff}"] {
        assert!(refused(text).starts_with("error: s.jsonl\n  expected at least one step\n  found none"), "{text:?}");
    }
}

#[test]
fn incomplete_episodes_are_refused() {
    let said = refused(lines(&[step("a", 1), step("a", 2), step("b", 1), step("a", 2)]));
    let words = "s.jsonl, line 4, key `t`\n  expected one line for each t of episode `a`\n  found t = 2 again, as in \
                 s.jsonl, line 2\n";
    assert!(said.contains(words), "{said}");
    let said = refused(lines(&[step("a", 5), step("a", 1), step("a", 2)]));
    let words =
        "s.jsonl, line 1, key `t`\n  expected t = 3 of episode `a`, one more than in s.jsonl, line 3\n  found t = 5\n";
    assert!(said.contains(words), "{said}");
    let said = refused(lines(&[step("a", 2), step("b", 1), step("b", 3)]));
    assert!(said.contains("expected t = 1 as the first of episode `a`\n  found t = 2"), "{said}");
    assert!(said.contains("expected t = 2 of episode `b`, one more than in s.jsonl, line 2\n  found t = 3"), "{said}");
}

#[test]
fn constants_that_change_within_an_episode_are_refused() {
    let first = "as in the episode's first line (s.jsonl, line 1)";
    let help = "correct the lines, or give the episodes ids of their own";
    check(json!({ "model": "other" }), &format!("the text `mine`, {first}"), "the text `other`", help);
    check(json!({ "seed": 2 }), &format!("1, {first}"), "2", help);
    check(json!({ "stated_color": "blue" }), &format!("null, {first}"), "the text `blue`", help);
}

#[test]
fn custom_keys_with_changing_types_are_refused() {
    let said = |one: Value, other: Value| {
        refused(lines(&[step_with("a", 1, json!({ "own": one })), step_with("a", 2, json!({ "own": other }))]))
    };
    let first = "as in s.jsonl, line 1\n  found";
    assert!(said(json!(1), json!("1")).contains(&format!("expected a number, {first} the text `1`")));
    assert!(said(json!(true), json!(1)).contains(&format!("expected true or false, {first} 1\n")));
    assert!(said(json!("x"), json!(false)).contains(&format!("expected a text, {first} false\n")));
    assert!(said(json!(1), json!([1])).contains("found a list\n"));
    assert!(said(json!(1), json!({ "a": 1 })).contains("found an object\n"));
    let large = said(json!(9_007_199_254_740_993_i64), json!(0.5));
    assert!(large.contains("line 1, key `own`\n") && large.contains("found 9007199254740993\n"), "{large}");
    let unheld = "expected an integer of at most 9223372036854775807, or a number that 64-bit floats hold\n  found";
    assert!(said(json!(u64::MAX), json!(1)).contains(&format!("line 1, key `own`\n  {unheld} 18446744073709551615\n")));
    let own = |number: &str| lines(&[step_with("a", 1, json!({ "own": "@" }))]).replace("\"@\"", number);
    for number in ["100000000000000000000000000001", "-9223372036854775809", "9007199254740993.01", "1e-400"] {
        let told = refused(own(number));
        assert!(told.contains(&format!("line 1, key `own`\n  {unheld} {number}\n")), "{told}");
    }
    for number in ["33.18", "0.30000000000000004", "1e29", "9007199254740994.0", "0.10000000000000000555"] {
        imported(own(number));
    }
    let many: serde_json::Map<String, Value> = (0..1001).map(|at| (format!("k{at}"), json!(at))).collect();
    assert!(refused(lines(&[step_with("a", 1, Value::Object(many))])).contains("at most 1000 keys"));
}

#[test]
fn unreadable_inputs_and_unwritable_outputs_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.jsonl"), lines(&[step("a", 1)])).unwrap();
    fs::write(folder.path().join("x.parquet"), "before").unwrap();
    for (arguments, words) in [
        (vec!["none.jsonl", "-o", "x.parquet"], "cannot read none.jsonl"),
        (vec![".", "-o", "x.parquet"], "it is a folder"),
        (vec!["-", "-", "-o", "x.parquet"], "expected standard input once"),
        (vec!["s.jsonl", "-o", "s.jsonl"], "found the steps themselves"),
        (vec!["s.jsonl", "-o", "none/x.parquet"], "cannot write the trace none/x.parquet"),
        (vec!["s.jsonl", "s.jsonl", "-o", "x.parquet"], "again, as in s.jsonl, line 1"),
        (vec!["s.jsonl", "-o", "x.parquet", "--definitions", "none.toml"], "none.toml"),
    ] {
        let answer = run(folder.path(), &[vec!["import"], arguments.clone()].concat(), "");
        assert_eq!(answer.code, 2, "{arguments:?}: {}", answer.stdout);
        assert!(answer.stderr.contains(words), "{arguments:?}: {}", answer.stderr);
        assert_eq!(fs::read(folder.path().join("x.parquet")).unwrap(), b"before");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}
