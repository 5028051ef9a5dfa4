//! Identifications as models write them, and how each is read: `docs/explanation/self-attribution.md`.
//!
//! Each line of a set has two readings, made apart, and a text. From set 13 on there is one reading, and the second
//! label repeats it unless the label is arguable. Where the labels differ, the text is contested: no expectation.

use std::collections::BTreeMap;

use mirrorstats_identification::Reading;

/// The set that the grammar was developed on, and the sets that were written after it, in order.
const SETS: [(&str, &str); 26] = [
    ("development", include_str!("identifications/development.txt")),
    ("held-out-1", include_str!("identifications/held-out-1.txt")),
    ("held-out-2", include_str!("identifications/held-out-2.txt")),
    ("held-out-3", include_str!("identifications/held-out-3.txt")),
    ("held-out-4", include_str!("identifications/held-out-4.txt")),
    ("held-out-5", include_str!("identifications/held-out-5.txt")),
    ("held-out-6", include_str!("identifications/held-out-6.txt")),
    ("held-out-7", include_str!("identifications/held-out-7.txt")),
    ("held-out-8", include_str!("identifications/held-out-8.txt")),
    ("held-out-9", include_str!("identifications/held-out-9.txt")),
    ("held-out-10", include_str!("identifications/held-out-10.txt")),
    ("held-out-11", include_str!("identifications/held-out-11.txt")),
    ("held-out-12", include_str!("identifications/held-out-12.txt")),
    ("held-out-13", include_str!("identifications/held-out-13.txt")),
    ("held-out-14", include_str!("identifications/held-out-14.txt")),
    ("held-out-15", include_str!("identifications/held-out-15.txt")),
    ("held-out-16", include_str!("identifications/held-out-16.txt")),
    ("held-out-17", include_str!("identifications/held-out-17.txt")),
    ("held-out-18", include_str!("identifications/held-out-18.txt")),
    ("held-out-19", include_str!("identifications/held-out-19.txt")),
    ("held-out-20", include_str!("identifications/held-out-20.txt")),
    ("held-out-21", include_str!("identifications/held-out-21.txt")),
    ("held-out-22", include_str!("identifications/held-out-22.txt")),
    ("held-out-23", include_str!("identifications/held-out-23.txt")),
    ("held-out-24", include_str!("identifications/held-out-24.txt")),
    ("held-out-25", include_str!("identifications/held-out-25.txt")),
];

/// A text with its two readings.
struct Case {
    readings: [&'static str; 2],
    text: String,
}

fn cases(set: &'static str) -> Vec<Case> {
    let case = |line: &'static str| {
        let [first, second, text] = <[_; 3]>::try_from(line.splitn(3, " | ").collect::<Vec<_>>()).expect(line);
        Case { readings: [first, second], text: text.replace("\\n", "\n") }
    };
    set.lines().filter(|line| !line.starts_with("# ")).map(case).collect()
}

fn name(reading: Reading) -> &'static str {
    match reading {
        Reading::Color(color) => color.name(),
        Reading::Unknown => "unknown",
        Reading::Unreadable => "unreadable",
        Reading::Nothing => "-",
    }
}

/// The rows and columns of the confusion table.
fn kind(name: &str) -> &str {
    if ["unknown", "unreadable", "-"].contains(&name) { name } else { "colour" }
}

#[test]
fn texts_are_read_as_meant() {
    let mut confusion = BTreeMap::<_, usize>::new();
    let mut shown = String::from("set: as meant / agreed, contested\n");
    for (set, text) in SETS {
        let all = cases(text);
        let (agreed, contested): (Vec<_>, Vec<_>) = all.iter().partition(|case| case.readings[0] == case.readings[1]);
        let mut wrong = Vec::new();
        for Case { readings: [expected, _], text } in &agreed {
            let found = name(Reading::of(text));
            let is_other = kind(expected) == "colour" && kind(found) == "colour" && found != *expected;
            let found_kind = if is_other { "another colour" } else { kind(found) };
            *confusion.entry((kind(expected), found_kind)).or_default() += 1;
            assert!(kind(expected) == "colour" || kind(found) != "colour", "taken as one's own: {text:?}, {found}");
            wrong.extend((found != *expected).then(|| format!("{text:?}: expected {expected}, found {found}")));
        }
        let right = agreed.len() - wrong.len();
        assert!(right * 100 >= agreed.len() * 97, "{set}: {right} of {}\n{}", agreed.len(), wrong.join("\n"));
        shown.extend([format!("{set}: {right} / {}, {}\n", agreed.len(), contested.len())]);
    }
    shown += "\nmeant, read: texts\n";
    shown.extend(confusion.iter().map(|((meant, read), count)| format!("{meant}, {read}: {count}\n")));
    insta::assert_snapshot!(shown, @r"
    set: as meant / agreed, contested
    development: 430 / 430, 0
    held-out-1: 257 / 259, 1
    held-out-2: 163 / 163, 0
    held-out-3: 157 / 159, 0
    held-out-4: 143 / 143, 1
    held-out-5: 132 / 132, 0
    held-out-6: 127 / 129, 1
    held-out-7: 120 / 122, 0
    held-out-8: 105 / 106, 0
    held-out-9: 102 / 103, 1
    held-out-10: 99 / 100, 0
    held-out-11: 86 / 88, 0
    held-out-12: 59 / 60, 0
    held-out-13: 192 / 197, 1
    held-out-14: 208 / 211, 0
    held-out-15: 207 / 209, 0
    held-out-16: 203 / 207, 1
    held-out-17: 204 / 210, 0
    held-out-18: 197 / 203, 2
    held-out-19: 207 / 213, 0
    held-out-20: 194 / 199, 1
    held-out-21: 197 / 200, 0
    held-out-22: 193 / 198, 2
    held-out-23: 197 / 198, 0
    held-out-24: 187 / 192, 1
    held-out-25: 133 / 137, 0

    meant, read: texts
    -, -: 44
    colour, colour: 1746
    colour, unknown: 69
    unknown, unknown: 2522
    unreadable, unreadable: 187
    ");
}

#[test]
fn plain_claims_are_read() {
    let missed: Vec<_> = include_str!("identifications/own.txt")
        .lines()
        .filter(|text| Reading::of(text).self_color() != Some("red"))
        .collect();
    assert_eq!(missed, ["It's red, my body.", "I have confirmed my color as red."]);
}

#[test]
fn what_is_said_of_others_is_no_claim() {
    let taken: Vec<_> = include_str!("identifications/others.txt")
        .lines()
        .filter(|text| Reading::of(text) != Reading::Unknown)
        .collect();
    assert_eq!(taken, Vec::<&str>::new());
}

#[test]
fn every_frame_about_another_is_no_claim() {
    let others = [
        "the other robot",
        "the robot in front of me",
        "a robot to my left",
        "the cube",
        "the cube next to me",
        "the distractor",
        "the nearest robot",
        "one of the robots",
        "he",
        "his body",
        "the body of the other robot",
        "the reflection of the other robot",
        "robot 2",
        "the robot that walks past me",
        "the robot I am following",
        "the robot which stands near me",
        "my neighbour",
        "my target cube",
        "the floor around me",
        "the robot facing me",
        "the robot looking back at me",
        "the figure visible on the left",
        "the robot reflected behind me",
        "what I see ahead",
        "the color I am looking for",
        "his own reflection",
        "robot A",
    ];
    let predicates = ["is red", "looks red", "is a red robot", "has a red body", "is painted red", "was red"];
    let frames = [
        "{}",
        "I think {}.",
        "I see that {}",
        "It seems that {}, so I avoid it",
        "In the mirror, {}",
        "I noticed {}",
        "I do not know my color, but {}",
        "I have not seen myself. {}",
        "My color is unknown; {}",
        "I know that {}",
        "I'm certain {}",
        "It looks like {}",
        "Self: unknown, {}",
        "My reflection is not visible. {}",
        "I am exploring and {}",
        "While I move, {}",
        "{} and my color is unknown",
        "{}. I am looking for a mirror",
    ];
    for other in others {
        for predicate in predicates {
            for frame in frames {
                let text = frame.replace("{}", &format!("{other} {predicate}"));
                assert_eq!(Reading::of(&text), Reading::Unknown, "{text}");
            }
        }
    }
}
