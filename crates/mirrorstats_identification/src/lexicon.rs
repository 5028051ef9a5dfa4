//! The words of the grammar, from `assets/trace/identification.toml`.

use std::cmp::Reverse;
use std::collections::HashMap;
use std::sync::LazyLock;

use serde::Deserialize;

use mirrorstats_trace::schema::colors::Color;

/// A colour of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hue {
    Palette(Color),
    Outside,
}

macro_rules! classes {
    ($($name:ident $key:literal),+ $(,)?) => {
        /// A class of words; a word may be in several.
        #[derive(Clone, Copy, Debug)]
        pub enum Class { $($name),+ }

        const NAMES: &[(&str, Class)] = &[$(($key, Class::$name)),+];
    };
}

classes! {
    Me "me", I "i", My "my", Article "article", Definite "definite", This "this", Anaphor "anaphor", Its "its",
    Stranger "stranger", Strange "strange", Owned "owned", Feature "feature", Part "part", Reflection "reflection",
    Answer "answer", Guess "guess", Agent "agent", FirstPerson "first_person", Thing "thing", Place "place",
    Away "away", Mirror "mirror", Source "source", Copula "copula", Finite "finite", Past "past", Are "are",
    Aux "aux", Weak "weak", Possess "possess", Unreal "unreal", Future "future", Not "not", See "see", Show "show",
    Report "report", Believe "believe", Believed "believed", Sure "sure", Doubt "doubt", Seek "seek", Match "match",
    Control "control", Identify "identify", Confirm "confirm", Mimic "mimic", Move "move", Act "act", Dress "dress",
    But "but", And "and", Or "or", So "so", If "if", Whether "whether", As "as", Step "step",
    Preposition "preposition", Plain "plain", Near "near", Worn "worn", Like "like", In "in", Per "per",
    Except "except", Adverb "adverb", Basic "basic", Earlier "earlier", Hearsay "hearsay", Turn "turn", Wrong "wrong",
}

/// A set of classes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Classes(u128);

impl Classes {
    pub fn has(self, class: Class) -> bool {
        self.0 & (1 << class as u128) != 0
    }

    pub fn has_any(self, classes: &[Class]) -> bool {
        classes.iter().any(|class| self.has(*class))
    }

    pub fn add(&mut self, other: Self) {
        self.0 |= other.0;
    }

    pub fn put(&mut self, class: Class) {
        self.0 |= 1 << class as u128;
    }

    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
}

#[derive(Deserialize)]
struct Words {
    colors: HashMap<String, String>,
    phrases: HashMap<String, String>,
    classes: HashMap<String, String>,
    languages: HashMap<String, String>,
}

/// Words and their replacement.
type Phrase = (Vec<String>, Vec<String>);

pub struct Lexicon {
    hues: HashMap<String, Hue>,
    classes: HashMap<String, Classes>,
    /// By their first word, the longest first.
    phrases: HashMap<String, Vec<Phrase>>,
    /// True for a word of English.
    languages: HashMap<String, bool>,
}

pub static LEXICON: LazyLock<Lexicon> = LazyLock::new(|| {
    let text = include_str!("../../../assets/trace/identification.toml");
    Lexicon::new(&toml::from_str(text).expect("the built-in words are well-formed: a test reads them"))
});

fn split(text: &str) -> Vec<String> {
    text.split_whitespace().map(str::to_owned).collect()
}

impl Lexicon {
    fn new(words: &Words) -> Self {
        let mut classes: HashMap<String, Classes> = HashMap::new();
        for (name, class) in NAMES {
            for word in split(&words.classes[*name]) {
                classes.entry(word).or_default().put(*class);
            }
        }
        let mut phrases: HashMap<String, Vec<_>> = HashMap::new();
        for (from, to) in &words.phrases {
            let from = split(from);
            phrases.entry(from[0].clone()).or_default().push((from, split(to)));
        }
        for all in phrases.values_mut() {
            all.sort_by_key(|(from, _)| Reverse(from.len()));
        }
        let hue = |name: &str| Color::named(name).map_or(Hue::Outside, Hue::Palette);
        let hues =
            words.colors.iter().flat_map(|(name, all)| split(all).into_iter().map(move |word| (word, hue(name))));
        let known = |name: &str, is| split(&words.languages[name]).into_iter().map(move |word| (word, is));
        let languages = known("english", true).chain(known("foreign", false)).collect();
        Self { hues: hues.collect(), classes, phrases, languages }
    }

    pub fn classes(&self, word: &str) -> Classes {
        self.classes.get(word).copied().unwrap_or_default()
    }

    /// The colour of a word, also of `reddish` and `redcolored`.
    pub fn hue(&self, word: &str) -> Option<Hue> {
        let stems = ["", "ish", "colored", "coloured"].into_iter().filter_map(|suffix| word.strip_suffix(suffix));
        stems.filter(|stem| stem.len() > 2).find_map(|stem| self.hues.get(stem).copied())
    }

    /// The longest phrase that begins these words: its length and its replacement.
    pub fn phrase(&self, words: &[String]) -> Option<(usize, &[String])> {
        let (from, to) = self.phrases.get(words.first()?)?.iter().find(|(from, _)| words.starts_with(from))?;
        Some((from.len(), to))
    }

    /// Returns false for a word of another language, and `None` for an unknown word.
    pub fn is_english(&self, word: &str) -> Option<bool> {
        let in_class = || (self.classes.contains_key(word) || self.hue(word).is_some()).then_some(true);
        let is_ascii = || (!word.is_ascii()).then_some(false);
        self.languages.get(word).copied().or_else(in_class).or_else(is_ascii)
    }
}
