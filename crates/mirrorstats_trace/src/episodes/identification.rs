//! Converts the free text of `identification` to an attribution: a colour of the palette, `unknown`, or none.
//!
//! Rules, in this order, on the text in lower case, split into words:
//!
//! 1. Blank text is no attribution.
//! 2. A clause in the first person ("I am red", "my body is red", "self: red") decides if it names one colour that is
//!    neither denied nor hearsay; clauses end at `. ; ! ? ,` and at "but", "while", "whereas", "although", "though".
//! 3. Words of uncertainty ("unknown", "not sure", "cannot tell", ...) give `unknown`, whatever the colours beside.
//! 4. A single colour that is not denied is the attribution, "probably" or not; two or more give `unknown`.
//! 5. Colours that are all denied ("not red") give `unknown`.
//! 6. Text without colours, or only with colours outside the palette, is no attribution.
//!
//! Only English is read. [`VERSION`] changes with every change of meaning. Recordings contain it, and the column can be
//! derived from the texts again at any time.

use serde_json::{Map, Value};

use crate::episodes::palette::Color;

pub const VERSION: &str = "1";

const VERSION_KEY: &str = "identification_version";

/// The attribution if the agent says that it does not know.
pub const UNKNOWN: &str = "unknown";

/// The normal form of an identification; `None` if it has no attribution.
///
/// ```
/// use mirrorstats_trace::episodes::identification::normal_form;
///
/// assert_eq!(normal_form("I am the crimson robot."), Some("red"));
/// assert_eq!(normal_form("not red"), Some("unknown"));
/// assert_eq!(normal_form("a humanoid"), None);
/// ```
pub fn normal_form(identification: &str) -> Option<&'static str> {
    let clauses = clauses(identification);
    let all = clauses.iter().flatten().map(String::as_str).collect::<Vec<_>>();
    let own = clauses.iter().filter(|clause| is_about_oneself(clause) && !is_ignorance(clause)).collect::<Vec<_>>();
    if let [color] = affirmed(own.into_iter())[..] {
        return Some(color.name());
    }
    if is_ignorance(&all) {
        return Some(UNKNOWN);
    }
    match affirmed(clauses.iter())[..] {
        [color] => Some(color.name()),
        [] if !all.iter().any(|word| color(word).is_some()) => None,
        _ => Some(UNKNOWN),
    }
}

/// Sets the version of the rule where a recording has it, else beside its other keys; returns the previous version.
pub fn put_version(recording: &mut Value) -> Option<String> {
    let text = |value: Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    if let Some(place) = find(recording) {
        return Some(text(std::mem::replace(place, VERSION.into())));
    }
    recording[VERSION_KEY] = VERSION.into();
    None
}

fn find(value: &mut Value) -> Option<&mut Value> {
    let members: &mut Map<String, Value> = value.as_object_mut()?;
    if members.contains_key(VERSION_KEY) {
        return members.get_mut(VERSION_KEY);
    }
    members.iter_mut().find_map(|(_, inner)| find(inner))
}

fn clauses(text: &str) -> Vec<Vec<String>> {
    let mut clauses = vec![Vec::new()];
    for piece in text.to_lowercase().split_inclusive(|c: char| !c.is_alphanumeric() && !matches!(c, '\'' | '’')) {
        let word = piece.trim_end_matches(|c: char| !c.is_alphanumeric()).replace(['\'', '’'], "");
        let ends = piece.ends_with(['.', ';', '!', '?', ',', '\n']);
        if TURNS.contains(&word.as_str()) {
            clauses.push(Vec::new());
        } else if !word.is_empty() {
            clauses.last_mut().expect("there is a clause from the start").push(word);
        }
        if ends {
            clauses.push(Vec::new());
        }
    }
    clauses.retain(|clause| !clause.is_empty());
    clauses
}

/// Words that begin another thought.
const TURNS: [&str; 6] = ["but", "while", "whereas", "although", "though", "however"];

fn affirmed<'a>(clauses: impl Iterator<Item = &'a Vec<String>>) -> Vec<Color> {
    let mut found = Vec::new();
    for clause in clauses {
        let mut is_denied = false;
        for (at, word) in clause.iter().enumerate() {
            is_denied |= denies(clause, at);
            match color(word) {
                Some(color) if !is_denied && !found.contains(&color) => found.push(color),
                _ => {}
            }
        }
    }
    found
}

fn denies(clause: &[String], at: usize) -> bool {
    let after = clause.get(at + 1).map(String::as_str);
    match clause[at].as_str() {
        "not" | "no" | "never" | "neither" | "nor" | "without" | "isnt" | "arent" | "wasnt" | "non" | "excluding"
        | "except" | "unlike" => after != Some("only"),
        "rather" | "other" | "different" => matches!(after, Some("than" | "from")),
        "instead" => after == Some("of"),
        _ => false,
    }
}

fn is_about_oneself(clause: &[String]) -> bool {
    if clause.iter().any(|word| HEARSAY.contains(&word.as_str())) {
        return false;
    }
    clause.iter().any(|word| matches!(word.as_str(), "i" | "im" | "my" | "me" | "self" | "myself" | "ego" | "own"))
}

/// Words that introduce statements of others.
const HEARSAY: [&str; 9] = ["told", "say", "says", "said", "stated", "states", "claimed", "claims", "prompt"];

fn is_ignorance(words: &[impl AsRef<str>]) -> bool {
    let has = |phrase: &str| {
        let length = phrase.split(' ').count();
        words.windows(length).any(|window| window.iter().map(AsRef::as_ref).eq(phrase.split(' ')))
    };
    IGNORANCE.split(", ").any(has)
        || matches!(words, [one] if matches!(one.as_ref(), "none" | "na" | "null" | "nothing"))
}

const IGNORANCE: &str = "\
    unknown, unsure, uncertain, unclear, undetermined, indeterminate, unidentified, unverified, unconfirmed, \
    undecided, not sure, not certain, not clear, not known, not yet, not determined, not identified, not confirmed, \
    not visible, not been, no idea, no evidence, no information, no identification, dont know, do not know, cannot, \
    cant, can not, could not, couldnt, unable, have not, havent, has not, hasnt, to be determined, tbd, n a, pending";

fn color(word: &str) -> Option<Color> {
    let stem = word.strip_suffix("ish").filter(|stem| stem.len() > 2).unwrap_or(word);
    let stem = if stem == "redd" { "red" } else { stem };
    let in_full = |stem: &str| {
        let shade = || SYNONYMS.into_iter().find(|(_, shades)| shades.split(' ').any(|shade| shade == stem));
        Color::named(stem).or_else(|| shade().map(|(color, _)| color))
    };
    in_full(stem).or_else(|| in_full(word.strip_suffix("colored").or_else(|| word.strip_suffix("coloured"))?))
}

/// The colours of the palette, with the names of shades that people would assign to them.
const SYNONYMS: [(Color, &str); 10] = [
    (Color::Blue, "azure blu cobalt navy sapphire"),
    (Color::Brown, "auburn bronze chocolate rust sienna tan"),
    (Color::Cyan, "aqua aquamarine teal turquoise"),
    (Color::Green, "emerald lime olive"),
    (Color::Orange, "amber tangerine"),
    (Color::Pink, "fuchsia magenta rose rosy salmon"),
    (Color::Purple, "amethyst indigo lavender lilac mauve plum purpl violet"),
    (Color::Red, "burgundy cherry crimson maroon ruby scarlet vermilion"),
    (Color::White, "ivory whit"),
    (Color::Yellow, "gold golden lemon"),
];

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::{VERSION, put_version};

    #[test]
    fn the_version_is_replaced_where_it_stands() {
        let mut recording = json!({ "version": 1, "agent": { "vlm": { "id": "x", "identification_version": "0" } } });
        assert_eq!(put_version(&mut recording), Some("0".to_owned()));
        assert_eq!(recording["agent"]["vlm"]["identification_version"], VERSION);
        assert_eq!(recording.as_object().unwrap().len(), 2);
    }

    #[test]
    fn a_recording_without_a_version_gets_one() {
        let mut recording = json!({ "kind": "import" });
        assert_eq!(put_version(&mut recording), None);
        assert_eq!(recording, json!({ "kind": "import", "identification_version": VERSION }));
        assert_eq!(put_version(&mut recording), Some(VERSION.to_owned()));
    }
}
