//! From text to sentences of words.

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
}

/// The beginning of a sentence in a phrase.
const START: &str = "^";

/// The words of the longest sentence that is read.
const LONGEST: usize = 1000;

/// The sentences of a text, without markup and quotations.
pub fn sentences(text: &str) -> Vec<Sentence> {
    let text = text.to_lowercase().replace(['’', '‘', '`'], "'").replace("\\n", "\n");
    let characters: Vec<char> = without_quotations(&text).chars().chain(['\n']).collect();
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
            '.' | '!' | '?' | ';' | '\n' | '。' | '？' => {
                let raw = std::mem::replace(&mut words, vec![START.to_owned()]);
                sentences.extend(sentence(&raw, matches!(c, '?' | '？')));
                None
            }
            '-' if before == ' ' && after == ' ' => Some(","),
            ',' | '(' | ')' | '[' | ']' | '—' | '–' | '|' => Some(","),
            '>' if matches!(before, '-' | '=') => Some(":"),
            ':' | '=' | '→' => Some(":"),
            '/' | '+' if is_inner => Some("or"),
            '&' => Some("and"),
            _ => None,
        };
        if c == '=' && before.is_alphanumeric() && words.len() > 2 {
            // "self=red other=blue"
            words.insert(words.len() - 1, ",".to_owned());
        }
        words.extend(mark.map(str::to_owned));
    }
    sentences
}

fn sentence(raw: &[String], is_question: bool) -> Option<Sentence> {
    let has_words = raw.iter().any(|word| word.chars().any(char::is_alphabetic));
    // The grammar may take quadratic time.
    let is_english = raw.len() < LONGEST && is_english(raw);
    has_words.then(|| Sentence { words: if is_english { replaced(raw) } else { Vec::new() }, is_question, is_english })
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
        match split {
            Some((stem, end)) => words.extend([Word::new(stem), Word::new(end)]),
            None => words.push(Word::new(&raw[at])),
        }
        at += 1;
    }
    words.retain(|word| word.text != START);
    words
}

/// Returns false if other languages explain at least half as many words as English does. Colours alone are English.
fn is_english(raw: &[String]) -> bool {
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
    2 * foreign <= english && (english > 0 || unknown == 0)
}

/// Replaces quoted sentences by a word, and drops other quotation marks. In JSON, quotation marks are not quotations.
fn without_quotations(text: &str) -> String {
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
