//! From words to noun phrases, verbs, prepositions and links.

use crate::lexicon::Class::{
    self, Act, Adverb, Agent, Anaphor, And, Answer, Article, As, Aux, Away, Believe, But, Confirm, Control, Copula,
    Definite, Doubt, Dress, Earlier, Feature, Finite, FirstPerson, Hearsay, Identify, If, Match, Me, Mimic, Mirror,
    Move, My, Not, Or, Owned, Place, Possess, Preposition, Reflection, Report, See, Seek, Show, So, Source, Strange,
    Stranger, Thing, This, Turn, Unreal, Whether,
};
use crate::lexicon::{Classes, Hue, LEXICON};
use crate::tokens::Word;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    Start,
    Comma,
    Colon,
    And,
    Or,
    But,
    So,
    That,
    Relative,
    If,
    Whether,
    /// A clause that follows its governing verb without a link: "I think I am red".
    Implicit,
    /// The rest of a clause behind a relative clause.
    Resumed,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Owner {
    #[default]
    Nobody,
    Me,
    /// What `it` means.
    It,
    Other,
}

/// A noun phrase.
#[derive(Clone, Debug, Default)]
pub struct Noun {
    pub owner: Owner,
    pub hues: Vec<Hue>,
    /// The classes of its head; empty without a known one.
    pub head: Classes,
    /// The classes of all its words, and `Not` if it is negated.
    pub all: Classes,
    /// It has a noun behind its colours, known or not.
    pub has_head: bool,
    pub has_unknown: bool,
}

impl Noun {
    /// Only colours: "red", "dark red".
    pub fn is_bare(&self) -> bool {
        !self.hues.is_empty() && !self.has_head && !self.is_strange() && self.owner == Owner::Nobody
    }

    pub fn is_pronoun(&self) -> bool {
        !self.has_head && self.hues.is_empty() && self.all.has_any(&[Me, Anaphor, Stranger])
    }

    /// A phrase for another body or for a thing.
    pub fn is_strange(&self) -> bool {
        let is_placed = self.head.has(Agent) && self.all.has(Away);
        self.all.has_any(&[Strange, Thing]) || is_placed || self.is_pronoun() && self.all.has(Stranger)
    }

    /// A phrase for the author or a part of it.
    pub fn is_own(&self) -> bool {
        let is_known =
            self.has_head && !self.head.has_any(&[Place, Source, Mirror]) || !self.has_unknown && !self.has_head;
        let is_first_person =
            self.head.has(FirstPerson) && self.hues.is_empty() && (self.all.has(Definite) || !self.all.has(Article));
        let is_named = is_first_person
            || self.head.has_any(&[Agent, Feature]) && self.all.has(This) && self.hues.is_empty()
            || self.all.has(Owned);
        !self.is_strange() && (self.owner == Owner::Me && is_known || self.owner == Owner::Nobody && is_named)
    }

    /// "my stated color"
    pub fn is_reported(&self) -> bool {
        self.all.has(Hearsay)
    }

    pub fn is_named(&self) -> bool {
        self.has_head || self.all.has(Article) || !self.hues.is_empty()
    }
}

/// Consecutive verbs: "have not been able to see".
#[derive(Clone, Debug, Default)]
pub struct Verb {
    chain: Vec<Classes>,
    /// The classes of all its words.
    pub all: Classes,
    pub is_finite: bool,
    /// "painted", which is no finite verb behind its noun.
    pub is_past: bool,
}

impl Verb {
    pub fn main(&self) -> Classes {
        self.chain.last().copied().unwrap_or_default()
    }

    /// "want to be" has a wish before its main verb.
    pub fn has_inner(&self, classes: &[Class]) -> bool {
        self.chain.iter().rev().skip(1).any(|one| one.has_any(classes))
    }

    /// Returns true if a word is the next verb of a chain: "can see", "want to be".
    fn continues(&self, word: &Word, after_to: bool) -> bool {
        let last = self.main();
        let is_lexical = !last.has_any(&[Aux, Copula, Unreal]);
        let is_like = word.text == "like" && !last.has(Unreal);
        let is_other = is_noun(word) || word.classes.has_any(&[Preposition, As]);
        if word.hue.is_some() || is_like || !(is_verb(word) || word.is_unknown() && word.is_participle()) {
            return false;
        }
        if is_adverb(word) && !word.is(Match) && !after_to {
            return false;
        }
        let is_new = is_lexical && !after_to && (word.is(Finite) || !word.text.ends_with("ing"));
        !is_new && (!is_other || after_to || last.has_any(&[Aux, Unreal]) || word.is_participle())
    }

    /// "am told", "is described".
    pub fn is_passive(&self) -> bool {
        self.chain.windows(2).any(|pair| pair[0].has(Copula) && pair[1].has(Report))
    }
}

#[derive(Clone, Debug)]
pub enum Chunk {
    Link(Link),
    Noun(Noun),
    Verb(Verb),
    Preposition(Word),
    /// The classes of an adverb or a link, or of a lone negation.
    Mark(Classes),
}

const NOUNS: [Class; 8] = [Feature, Reflection, Answer, Agent, Thing, Place, Mirror, Source];
const VERBS: [Class; 19] = [
    Copula, Aux, Possess, Unreal, See, Show, Report, Believe, Doubt, Seek, Match, Control, Identify, Confirm, Mimic,
    Move, Act, Dress, Finite,
];
pub const LINKS: [Class; 6] = [But, And, Or, So, If, Whether];

pub fn is_verb(word: &Word) -> bool {
    word.hue.is_none() && word.classes.has_any(&VERBS)
}

pub fn is_noun(word: &Word) -> bool {
    word.classes.has_any(&NOUNS)
}

pub fn is_adverb(word: &Word) -> bool {
    let is_known = word.classes.has_any(&[Adverb, Hearsay, Earlier, Turn]) && !word.classes.has_any(&LINKS);
    is_known || word.is_unknown() && word.text.len() > 4 && word.text.ends_with("ly")
}

pub fn chunks(words: &[Word]) -> Vec<Chunk> {
    let mut chunker = Chunker { words, at: 0, chunks: Vec::new(), is_negated: false };
    while chunker.at < words.len() {
        chunker.step();
    }
    chunker.chunks
}

pub struct Chunker<'a> {
    pub words: &'a [Word],
    at: usize,
    chunks: Vec<Chunk>,
    is_negated: bool,
}

impl Chunker<'_> {
    fn step(&mut self) {
        let word = &self.words[self.at];
        if let Some(link) = self.link(word) {
            if std::mem::take(&mut self.is_negated) {
                self.mark(Not);
            }
            self.chunks.extend([Chunk::Link(link), Chunk::Mark(word.classes)]);
        } else if word.text == "back" && matches!(self.last(), Some(Chunk::Verb(_))) {
            // "looks back", which is no part of a body
        } else if word.text == "no" && self.is_next(self.at, |next| next.text == ",") {
            self.mark(Turn);
        } else if word.is(Not) {
            self.is_negated = true;
        } else if self.begins_verb(word) {
            return self.verb();
        } else if word.classes.has_any(&[As, Preposition]) {
            self.chunks.push(Chunk::Preposition(word.clone()));
        } else if self.is_expletive(self.at) {
            let mut noun = Noun::default();
            noun.all.put(Stranger);
            self.chunks.push(Chunk::Noun(noun));
        } else if is_adverb(word) && !word.classes.has_any(&[Thing, Source]) && word.hue.is_none() {
            self.chunks.push(Chunk::Mark(word.classes));
        } else if let Some((mut noun, next)) = self.noun(self.at) {
            if std::mem::take(&mut self.is_negated) {
                noun.all.put(Not);
            }
            self.chunks.push(Chunk::Noun(noun));
            self.at = next;
            return;
        }
        self.at += 1;
    }

    fn mark(&mut self, class: Class) {
        let mut classes = Classes::default();
        classes.put(class);
        self.chunks.push(Chunk::Mark(classes));
    }

    pub fn is_next(&self, at: usize, is: impl Fn(&Word) -> bool) -> bool {
        self.words.get(at + 1).is_some_and(is)
    }

    pub fn precedes_noun(&self, at: usize) -> bool {
        self.is_next(at, |next| next.hue.is_some() || is_noun(next))
    }

    /// "there is"
    fn is_expletive(&self, at: usize) -> bool {
        matches!(self.words[at].text.as_str(), "there" | "here") && self.is_next(at, |next| next.is(Finite))
    }

    fn last(&self) -> Option<&Chunk> {
        self.chunks.iter().rev().find(|chunk| !matches!(chunk, Chunk::Mark(_)))
    }

    fn link(&self, word: &Word) -> Option<Link> {
        let noun = match self.last() {
            Some(Chunk::Noun(noun)) => Some(noun),
            _ => None,
        };
        let is_of_body = noun.is_some_and(|noun| noun.head.has_any(&[Agent, Feature, Thing]) && !noun.head.has(Source));
        let starts = |next: &Word| next.classes.has_any(&[Me, My, Article, Anaphor, Stranger]);
        match word.text.as_str() {
            "," => Some(Link::Comma),
            ":" => Some(Link::Colon),
            "that" if self.is_next(self.at, is_verb) => noun.map(|_| Link::Relative),
            "that" if is_of_body => self.is_next(self.at, starts).then_some(Link::Relative),
            "that" => {
                let is_object = matches!(self.last(), Some(Chunk::Verb(_)));
                let starts = |next: &Word| starts(next) || is_object && next.is(Preposition) && next.text != "of";
                self.is_next(self.at, starts).then_some(Link::That)
            }
            // "tell which of them is me"
            "which" | "who" if matches!(self.last(), Some(Chunk::Verb(_))) => Some(Link::Whether),
            "which" | "who" => (!self.chunks.is_empty()).then_some(Link::Relative),
            "before" => {
                let is_place = |next: &Word| matches!(next.text.as_str(), "me" | "my" | "the" | "a" | ",");
                self.is_next(self.at, |next| !is_place(next)).then_some(Link::Whether)
            }
            "should" => self.chunks.is_empty().then_some(Link::If),
            // Adverbs beside a verb.
            "still" | "yet" if matches!(self.last(), Some(Chunk::Noun(_) | Chunk::Verb(_))) => None,
            _ => [
                (But, Link::But),
                (And, Link::And),
                (Or, Link::Or),
                (So, Link::So),
                (If, Link::If),
                (Whether, Link::Whether),
            ]
            .into_iter()
            .find_map(|(class, link)| word.is(class).then_some(link)),
        }
    }

    fn begins_verb(&self, word: &Word) -> bool {
        let after_noun = matches!(self.last(), Some(Chunk::Noun(noun)) if noun.has_head || noun.is_pronoun());
        let is_link = word.classes.has_any(&[As, Preposition]);
        match (is_verb(word), is_noun(word)) {
            _ if word.hue.is_some() => false,
            _ if word.text == "to" => self.is_next(self.at, |next| is_verb(next) && !next.is(Mirror)),
            (true, _) if is_link && !after_noun => false,
            (true, true) => after_noun || self.is_negated && !word.is(Answer) && self.words[self.at - 1].text != "no",
            (true, false) => after_noun || !is_adverb(word),
            (false, true) => false,
            (false, false) if is_link || is_adverb(word) => false,
            (false, false) if word.is_unknown() && after_noun => true,
            (false, false) => {
                let is_object = matches!(self.last(), Some(Chunk::Verb(_)));
                let is_free = word.is_unknown() || word.is(Strange);
                is_free
                    && word.is_participle()
                    && (is_object || self.at == 0 && word.text.ends_with("ing") || !self.precedes_noun(self.at))
            }
        }
    }

    fn verb(&mut self) {
        let first = &self.words[self.at];
        let is_finite = !first.text.ends_with("ing") && !matches!(first.text.as_str(), "to" | "be" | "been");
        let mut verb = Verb { is_finite, ..Verb::default() };
        if std::mem::take(&mut self.is_negated) {
            verb.all.put(Not);
        }
        let mut after_to = false;
        while let Some(word) = self.words.get(self.at) {
            if word.text == "to" {
                if !self.is_next(self.at, |next| is_verb(next) && !next.is(Mirror)) {
                    break;
                }
                after_to = true;
            } else if verb.chain.is_empty() || verb.continues(word, after_to) {
                verb.all.add(word.classes);
                verb.chain.push(if is_verb(word) { word.classes } else { LEXICON.classes("walk") });
                after_to = false;
            } else if self.is_inside(&verb, word) {
                verb.all.add(word.classes);
                if !word.is(Not) {
                    self.chunks.push(Chunk::Mark(word.classes));
                }
            } else {
                break;
            }
            self.at += 1;
        }
        verb.is_past = first.text.ends_with("ed") && !first.is(Copula) && verb.chain.len() == 1;
        self.chunks.push(Chunk::Verb(verb));
    }

    /// Returns true for an adverb or a negation within a chain.
    fn is_inside(&self, verb: &Verb, word: &Word) -> bool {
        let is_lexical = !verb.main().has_any(&[Aux, Copula, Unreal]);
        if word.is(Not) {
            let is_loose = matches!(word.text.as_str(), "no" | "none" | "without");
            return !is_loose && (!is_lexical || self.is_next(self.at, |next| next.hue.is_some()));
        }
        let is_thing = word.is(Thing) && self.is_next(self.at, |next| !next.is(Not));
        let is_word = is_adverb(word) && word.hue.is_none() && !word.classes.has_any(&[As, Preposition]);
        is_word && !is_thing && !self.is_expletive(self.at)
    }
}
