//! From text to sentences of words.

use serde_json::Value;

use crate::lexicon::{Class, Classes, Hue, LEXICON};

/// A word, `,` or `:`.
#[derive(Clone, Debug)]
pub struct Word {
    pub text: String,
    pub classes: Classes,
    pub hue: Option<Hue>,
}

impl Word {
    fn new(text: &str) -> Self {
        Self { text: text.to_owned(), classes: LEXICON.classes(text), hue: LEXICON.hue(text) }
    }

    pub fn is(&self, class: Class) -> bool {
        self.classes.has(class)
    }

    pub fn is_unknown(&self) -> bool {
        self.classes.is_empty() && self.hue.is_none() && self.text.starts_with(char::is_alphanumeric)
    }

    /// The form of `moving` and `painted`.
    pub fn is_participle(&self) -> bool {
        self.hue.is_none() && (self.text.ends_with("ing") || self.text.ends_with("ed"))
    }
}

#[derive(Debug)]
pub struct Sentence {
    pub words: Vec<Word>,
    pub is_question: bool,
    pub is_english: bool,
    /// It has words of another language.
    pub is_foreign: bool,
}

/// The beginning of a sentence in a phrase.
const START: &str = "^";

/// The words of the longest sentence that is read.
const LONGEST: usize = 1000;

/// The sentences of a text, without markup and quotations.
pub fn sentences(text: &str) -> Vec<Sentence> {
    let text = text.to_lowercase().replace(['’', '‘', '`'], "'").replace("\\n", "\n").replace("!=", " is not ");
    // A row of a table: `| other | red |`.
    let row = |line: &str| line.strip_prefix("| ").map_or(line.to_owned(), |row| row.replacen(" | ", ": ", 1)) + "\n";
    let text: String = text.lines().map(row).collect();
    let characters: Vec<char> = without_quotations(&text).chars().chain(['\n']).collect();
    let is_code = text.contains('=');
    let mut sentences = Vec::new();
    let mut words = vec![START.to_owned()];
    let mut word = String::new();
    for (at, c) in characters.iter().copied().enumerate() {
        let before = at.checked_sub(1).map_or(' ', |at| characters[at]);
        let after = characters.get(at + 1).copied().unwrap_or(' ');
        let is_inner = before.is_alphanumeric() && after.is_alphanumeric();
        if c.is_alphanumeric() || is_inner && (c == '\'' || c == '.' && after.is_ascii_digit()) {
            word.push(c);
            continue;
        }
        words.extend((!word.is_empty()).then(|| std::mem::take(&mut word)));
        let mark = match c {
            // "other.color = red"
            '.' if is_inner && is_code => None,
            '.' | '!' | '?' | ';' | '\n' | '。' | '？' => {
                let raw = std::mem::replace(&mut words, vec![START.to_owned()]);
                sentences.extend(sentence(&raw, matches!(c, '?' | '？')));
                None
            }
            '-' | '—' | '–' if after == ' ' && before == ' ' && is_label(&words) => Some(":"),
            '-' if before == ' ' && after == ' ' => Some(","),
            ',' | '(' | ')' | '[' | ']' | '—' | '–' | '|' => Some(","),
            '>' if matches!(before, '-' | '=') => Some(":"),
            ':' | '=' | '→' => Some(":"),
            '/' | '+' if is_inner => Some("or"),
            '&' => Some("and"),
            _ => None,
        };
        if c == '=' && before.is_alphanumeric() && words.iter().any(|word| word == ":") {
            // "self=red other=blue"
            words.insert(words.len() - 1, ",".to_owned());
        }
        words.extend(mark.map(str::to_owned));
    }
    sentences
}

/// Returns true for a few words before a dash: "Robot ahead - red", not "Red - seen in the mirror".
fn is_label(words: &[String]) -> bool {
    let is_plain = |word: &&String| LEXICON.hue(word).is_none() && !LEXICON.classes(word).has(Class::Finite);
    let mut last = words.iter().rev().take_while(|word| *word != "," && *word != START);
    last.clone().count() < 6 && last.all(|word| is_plain(&word))
}

fn sentence(raw: &[String], is_question: bool) -> Option<Sentence> {
    let has_words = raw.iter().any(|word| word.chars().any(char::is_alphabetic));
    // The grammar may take quadratic time.
    let [english, foreign, unknown] = languages(raw);
    // Other languages explain less than half as many words as English does. Colours alone are English.
    let is_english = raw.len() < LONGEST && 2 * foreign <= english && (english > 0 || unknown == 0);
    let words = if is_english { replaced(raw) } else { Vec::new() };
    has_words.then_some(Sentence { words, is_question, is_english, is_foreign: !is_english && foreign > 0 })
}

/// Replaces phrases and contractions, and splits possessives.
fn replaced(raw: &[String]) -> Vec<Word> {
    let mut words = Vec::new();
    let mut at = 0;
    while at < raw.len() {
        if let Some((length, to)) = LEXICON.phrase(&raw[at..]) {
            words.extend(to.iter().map(|word| Word::new(word)));
            at += length;
            continue;
        }
        let ending = [("n't", "not"), ("'s", "'s"), ("'re", "are")];
        let split = ending.iter().find_map(|(end, word)| Some((raw[at].strip_suffix(end)?, *word)));
        let is_verb = |word: &String| LEXICON.classes(word).has_any(&[Class::Me, Class::Not, Class::Preposition]);
        match split {
            // "the red one's me"
            Some((stem, "'s")) if raw.get(at + 1).is_some_and(is_verb) => {
                words.extend([Word::new(stem), Word::new("is")]);
            }
            Some((stem, end)) => words.extend([Word::new(stem), Word::new(end)]),
            None => words.push(Word::new(&raw[at])),
        }
        at += 1;
    }
    words.retain(|word| word.text != START);
    words
}

/// The numbers of English, foreign and unknown words.
fn languages(raw: &[String]) -> [usize; 3] {
    let [mut english, mut foreign, mut unknown] = [0; 3];
    for word in raw.iter().filter(|word| word.chars().any(char::is_alphabetic)) {
        let is_contraction = ["n't", "'m", "'s", "'re", "'ve", "'ll"].iter().any(|end| word.ends_with(end));
        match LEXICON.is_english(word.split('\'').next().unwrap_or(word)) {
            _ if is_contraction => english += 1,
            Some(true) => english += 1,
            Some(false) => foreign += 1,
            None => unknown += 1,
        }
    }
    [english, foreign, unknown]
}

/// Replaces quoted sentences by a word, and drops other quotation marks. In JSON, quotation marks are not quotations.
fn without_quotations(text: &str) -> String {
    if let Ok(value) = serde_json::from_str(text) {
        return flattened("", &value);
    }
    // Markdown strikes text out with `~~`.
    let text: String = text.split("~~").step_by(2).collect();
    let text = text.trim().replace(['“', '”', '«', '»'], "\"");
    let is_whole = text.matches('"').count() == 2 && text.starts_with('"') && text.ends_with('"');
    if is_whole || text.contains('{') {
        return text.replace('"', " ").replace(['{', '}'], ",");
    }
    let addresses = |word: &str| matches!(word, "i" | "you" | "your");
    let is_quotation =
        |piece: &str| piece.split_whitespace().count() > 2 && piece.split(|c: char| !c.is_alphabetic()).any(addresses);
    let pieces = text.split('"').enumerate();
    pieces.map(|(at, piece)| if at % 2 == 1 && is_quotation(piece) { "quotation" } else { piece }).collect()
}

/// Members of JSON as labels: `{"other": {"color": "red"}}` says "other: color: red".
fn flattened(path: &str, value: &Value) -> String {
    let lines: Vec<_> = match value {
        Value::Object(all) => all.iter().map(|(key, value)| flattened(&format!("{path}{key}: "), value)).collect(),
        Value::Array(all) => all.iter().map(|value| flattened(path, value)).collect(),
        Value::String(text) => vec![format!("{path}{text}")],
        Value::Null => vec![format!("{path}none")],
        other => vec![format!("{path}{other}")],
    };
    lines.join("\n")
}
