//! The words of noun phrases.

use crate::chunks::{Chunker, LINKS, Noun, Owner, is_adverb, is_noun, is_verb};
use crate::lexicon::Class::{
    Adverb, Agent, Anaphor, And, Answer, Article, As, Aux, Away, Basic, Believe, Copula, Dress, Earlier, Feature,
    Hearsay, Its, Match, Me, My, Not, Or, Owned, Preposition, Report, Strange, Stranger, Turn,
};
use crate::lexicon::{Classes, LEXICON};
use crate::tokens::Word;

impl Chunker<'_> {
    /// The phrase at a position, with what belongs to it: "the color of my body", "the robot ahead".
    pub fn noun(&self, start: usize) -> Option<(Noun, usize)> {
        let (mut noun, at) = self.phrase(start)?;
        let end = if noun.is_pronoun() { at } else { self.attached(at, &mut noun) };
        Some((noun, end))
    }

    fn phrase(&self, start: usize) -> Option<(Noun, usize)> {
        let first = self.words.get(start)?;
        let mut noun = Noun::default();
        if first.is(Me) && first.text != "self" {
            (noun.owner, noun.all) = (Owner::Me, first.classes);
            return Some((noun, start + 1));
        }
        if first.classes.has_any(&[Anaphor, Stranger]) && !self.is_determiner(start) {
            noun.all = first.classes;
            return Some((noun, start + 1));
        }
        let mut at = start;
        while let Some(next) = self.extended(at, start, &mut noun) {
            at = next;
        }
        let is_empty = self.words[start..at].iter().all(|word| word.is(Article) && !word.is(Strange));
        (!is_empty).then_some((noun, at))
    }

    /// "this robot", "its body".
    fn is_determiner(&self, at: usize) -> bool {
        let word = &self.words[at];
        let is_phrase = |next: &Word| {
            let is_material = is_noun(next) || next.hue.is_some() || next.is(Strange) || next.is_unknown();
            is_material && (!is_verb(next) || next.is(Agent))
        };
        word.is(Its) || word.is(Article) && self.is_next(at, is_phrase)
    }

    /// Adds the word at a position to a phrase; returns the next position, or `None` at the end of the phrase.
    fn extended(&self, at: usize, start: usize, noun: &mut Noun) -> Option<usize> {
        let word = self.words.get(at)?;
        let is_first = at == start;
        let is_open = !noun.has_head && !noun.has_unknown && noun.hues.is_empty();
        if word.is(Me) && word.text != "self" {
            return None;
        }
        if word.hue.is_some() {
            // "the color red"
            let is_named = noun.head.has(Answer) && noun.hues.is_empty() && !self.precedes_noun(at);
            return (!noun.has_head || is_named).then(|| self.hues(at, noun));
        }
        if word.text == "'s" && !is_first {
            noun.owner = if noun.is_own() { Owner::Me } else { Owner::Other };
            (noun.head, noun.all, noun.has_head) = (Classes::default(), Classes::default(), false);
            return Some(at + 1);
        }
        if word.is(Adverb) && !noun.has_head && self.is_next(at, |next| next.hue.is_some()) {
            return Some(at + 1);
        }
        let is_adjective = |next: &Word| next.is_unknown() && !next.is_participle() || next.is(Strange);
        if word.text == "one" && is_open && (self.precedes_noun(at) || self.is_next(at, is_adjective)) {
            noun.all.add(LEXICON.classes("a"));
            return Some(at + 1);
        }
        let is_determiner = word.is(Its) || word.is(My) || word.text == "self";
        if is_adverb(word) && !noun.has_head && !is_noun(word)
            || word.is(Dress) && !noun.has_head && !noun.hues.is_empty()
        {
            let is_inner = word.is(Dress) || self.is_next(at, Word::is_unknown) || self.precedes_noun(at);
            noun.all.add(word.classes);
            return (!is_first && is_inner).then_some(at + 1);
        }
        let belongs = match noun.has_head {
            _ if is_determiner => self.possessor(at, noun),
            _ if word.is(Article) && !noun.has_head => is_open && (is_first || word.text != "that"),
            _ if self.is_head(at, noun) => {
                (noun.head, noun.has_head) = (word.classes, true);
                true
            }
            // "robot 2", "agent b"
            true => {
                let is_material = |next: &Word| next.hue.is_some() || is_noun(next) || next.is_unknown();
                let is_letter = word.text == "a" && noun.head.has(Agent) && !self.is_next(at, is_material);
                let is_label = is_letter
                    || word.is_unknown() && (word.text.len() == 1 || word.text.chars().all(|c| c.is_ascii_digit()));
                if is_label {
                    noun.all.put(Strange);
                }
                is_label
            }
            false => word.is(Strange) && !word.is(Preposition) || word.is(Owned) || self.modifier(at, noun),
        };
        noun.all.add(if belongs { word.classes } else { Classes::default() });
        belongs.then_some(at + 1)
    }

    /// "my", "its", "self" before a head.
    fn possessor(&self, at: usize, noun: &mut Noun) -> bool {
        let word = &self.words[at];
        if noun.has_head {
            return false;
        }
        noun.owner = match word {
            // "its own reflection"
            _ if word.text == "own" && noun.owner != Owner::Nobody => noun.owner,
            _ if !word.is(Its) => Owner::Me,
            _ if word.text == "its" => Owner::It,
            _ => Owner::Other,
        };
        noun.has_head = word.text == "self" && !self.precedes_noun(at);
        true
    }

    /// Takes an adjective or an unknown noun.
    fn modifier(&self, at: usize, noun: &mut Noun) -> bool {
        let word = &self.words[at];
        if !self.is_modifier(at, noun) {
            return false;
        }
        noun.has_head |= !noun.hues.is_empty();
        noun.has_unknown |= word.is_unknown();
        if word.is(Report) && !word.is(Believe) {
            noun.all.put(Hearsay);
        }
        if noun.all.has(Article) && word.is(Report) {
            // "the claim"
            (noun.head, noun.has_head) = (LEXICON.classes("statement"), true);
        }
        true
    }

    /// Returns true for a noun; not for a verb behind a complete phrase, nor for an adjective: "the distractor robot".
    fn is_head(&self, at: usize, noun: &Noun) -> bool {
        let word = &self.words[at];
        let is_open = !noun.has_head && !noun.has_unknown && noun.hues.is_empty();
        let is_place = word.is(Preposition) && is_open && !noun.all.has(Article);
        let is_behind = noun.has_head && (word.text == "one" || is_verb(word) || word.is(Adverb));
        let is_adjective = word.is(Strange) && !noun.has_head && self.precedes_noun(at);
        is_noun(word) && !is_place && !is_behind && !is_adjective
    }

    /// An adjective or an unknown noun.
    fn is_modifier(&self, at: usize, noun: &Noun) -> bool {
        let word = &self.words[at];
        let is_function = word.classes.has_any(&[Me, My, Anaphor, Stranger, Article, Match, Preposition, As, Not]);
        if is_function || word.classes.has_any(&LINKS) || matches!(word.text.as_str(), "," | ":" | "'s") {
            return false;
        }
        let has_determiner = noun.all.has(Article) || noun.owner != Owner::Nobody;
        if is_verb(word) {
            let is_plain = !noun.has_unknown || word.is_participle() && self.precedes_noun(at);
            return has_determiner && noun.hues.is_empty() && !word.classes.has_any(&[Copula, Aux]) && is_plain;
        }
        !word.is_participle() || has_determiner || !noun.hues.is_empty() || self.precedes_noun(at)
    }

    /// Colours in a row or in a list: "dark red", "blue-green", "red, green and blue".
    fn hues(&self, start: usize, noun: &mut Noun) -> usize {
        let mut at = start;
        loop {
            let hue = self.words[at].hue.expect("the caller found a colour");
            let is_row = self.is_next(at, |next| next.hue.is_some());
            // A shade before the name of a colour: "golden brown".
            let is_shade = is_row && !self.words[at].is(Basic);
            if !is_shade && !noun.hues.contains(&hue) {
                noun.hues.push(hue);
            }
            let is_between = |word: &&Word| {
                word.text == ","
                    || word.classes.has_any(&[And, Or])
                    || is_adverb(word) && !word.classes.has_any(&[Turn, Earlier])
            };
            let next = at + 1 + self.words[at + 1..].iter().take_while(is_between).count();
            let is_listed =
                next > at + 1 && self.is_next(next - 1, |next| next.hue.is_some()) && self.is_joined(at + 1);
            if !is_row && !is_listed {
                return at + 1;
            }
            at = next;
        }
    }

    /// Returns true if `and` or `or` is in the list of colours from here.
    fn is_joined(&self, start: usize) -> bool {
        let is_list = |word: &&Word| {
            word.hue.is_some() || word.text == "," || word.classes.has_any(&[And, Or]) || is_adverb(word)
        };
        // A limit, so that a long list does not take quadratic time.
        let list: Vec<_> = self.words[start..].iter().take_while(is_list).take(64).collect();
        list.windows(2).any(|pair| pair[0].classes.has_any(&[And, Or]) && (pair[1].hue.is_some() || is_adverb(pair[1])))
    }

    fn attached(&self, mut at: usize, noun: &mut Noun) -> usize {
        let Some(word) = self.words.get(at) else { return at };
        if word.is(And) && noun.head.has(Feature) && self.is_next(at, |next| next.is(Feature)) {
            return at + 2;
        }
        let is_ahead = noun.has_head && word.is(Strange) && word.is(Away);
        if is_ahead && !self.is_next(at, |next| next.classes.has_any(&[Article, My, Me])) {
            noun.all.put(Strange);
            return at + 1;
        }
        while self.words.get(at).is_some_and(|word| word.text == "of") {
            let Some((inner, next)) = self.phrase(at + 1) else { break };
            if noun.hues.is_empty() && inner.head.has(Answer) && inner.owner == Owner::Nobody && !inner.hues.is_empty()
            {
                // "a robot of red color"
                noun.hues = inner.hues;
                at = next;
                continue;
            }
            noun.owner = if inner.is_own() { Owner::Me } else { Owner::Other };
            if inner.is_own() && noun.hues.is_empty() {
                noun.hues = inner.hues;
            }
            at = next;
        }
        at
    }
}
