//! From chunks to clauses.

use crate::chunks::{Chunk, Link, Noun, Verb};
use crate::lexicon::Class::{self, As, Believe, Copula, Doubt, I, Like, Me, Move, Not, Seek, Show, Sure, Wrong};
use crate::lexicon::Classes;

#[derive(Clone, Debug, Default)]
pub struct Clause {
    pub link: Option<Link>,
    pub chunks: Vec<Chunk>,
    /// The classes of its adverbs and of its link.
    pub marks: Classes,
    /// Clauses between two words such as `but` have one number.
    pub span: usize,
}

impl Clause {
    pub fn noun(&self, at: usize) -> Option<&Noun> {
        match self.chunks.get(at) {
            Some(Chunk::Noun(noun)) => Some(noun),
            _ => None,
        }
    }

    pub fn nouns(&self) -> impl Iterator<Item = (usize, &Noun)> {
        (0..self.chunks.len()).filter_map(|at| Some((at, self.noun(at)?)))
    }

    pub fn verbs(&self) -> impl Iterator<Item = (usize, &Verb)> {
        self.chunks.iter().enumerate().filter_map(|(at, chunk)| match chunk {
            Chunk::Verb(verb) => Some((at, verb)),
            _ => None,
        })
    }

    pub fn has_verb(&self) -> bool {
        self.verbs().next().is_some()
    }

    /// Returns true if a verb or an adverb is of the class.
    pub fn has(&self, class: Class) -> bool {
        self.marks.has(class) || self.verbs().any(|(_, verb)| verb.all.has(class))
    }

    pub fn has_noun(&self, class: Class) -> bool {
        self.nouns().any(|(_, noun)| noun.all.has(class))
    }

    /// Returns true if a clause about what may be so can follow: "I do not know whether".
    pub fn is_open(&self) -> bool {
        [Not, Doubt, Seek, Sure].into_iter().any(|class| self.has(class))
    }

    /// "I think"
    pub fn is_opinion(&self) -> bool {
        self.chunks.len() == 2 && self.has(Believe)
    }

    fn is_finite(&self) -> bool {
        self.verbs().any(|(_, verb)| verb.is_finite)
    }

    pub fn preposition(&self, at: usize) -> Option<Classes> {
        match self.chunks.get(at.checked_sub(1)?) {
            Some(Chunk::Preposition(word)) => Some(word.classes),
            _ => None,
        }
    }
}

pub fn clauses(chunks: &[Chunk]) -> Vec<Clause> {
    let mut builder = Builder { done: Vec::new(), open: Clause { link: Some(Link::Start), ..Clause::default() } };
    for (at, chunk) in chunks.iter().enumerate() {
        builder.add(chunk, &chunks[at + 1..]);
    }
    builder.close(Link::Start);
    builder.done
}

struct Builder {
    done: Vec<Clause>,
    open: Clause,
}

impl Builder {
    fn add(&mut self, chunk: &Chunk, next: &[Chunk]) {
        match chunk {
            Chunk::Link(Link::Colon) if self.takes_colon() => return,
            Chunk::Link(link) => return self.close(*link),
            Chunk::Mark(classes) => return self.open.marks.add(*classes),
            Chunk::Noun(noun) if self.begins_clause(noun, next) => {
                let is_apart = matches!(self.open.link, Some(Link::If | Link::Whether))
                    && matches!(self.open.chunks.last(), Some(Chunk::Noun(_)));
                self.close(match self.open.is_finite() {
                    true if is_apart => Link::So,
                    true => Link::Implicit,
                    false => Link::Relative,
                });
            }
            Chunk::Verb(verb) if verb.is_finite && !verb.is_past && self.open.is_finite() && !self.is_comparison() => {
                self.close(Link::Resumed);
            }
            _ => {}
        }
        self.open.chunks.push(chunk.clone());
    }

    fn close(&mut self, link: Link) {
        let span = self.open.span + usize::from(link == Link::But);
        let fresh = Clause { link: Some(link), span, ..Clause::default() };
        if !self.open.chunks.is_empty() || link == Link::Start {
            self.done.push(std::mem::replace(&mut self.open, fresh));
        } else if link != Link::Comma {
            // "and that", ", but": the later word says more than a comma.
            (self.open.link, self.open.span) = (Some(link), span);
        }
    }

    /// "I am: red", "I see myself: red" go on.
    fn takes_colon(&self) -> bool {
        match self.open.chunks.last() {
            Some(Chunk::Verb(verb)) => {
                verb.all.has(Copula) && !self.open.has(Wrong) || verb.all.has(Show) && self.open.chunks.len() > 1
            }
            Some(Chunk::Noun(noun)) => {
                noun.is_pronoun() && self.open.is_finite() && !self.open.has(Copula) && !self.open.has(Seek)
            }
            _ => false,
        }
    }

    /// "moves as I"
    fn is_comparison(&self) -> bool {
        let at = self.open.chunks.len().saturating_sub(1);
        self.open.noun(at).is_some_and(|noun| noun.all.has(I))
            && self.open.preposition(at).is_some_and(|word| word.has(As))
    }

    fn begins_clause(&self, noun: &Noun, next: &[Chunk]) -> bool {
        let before = match self.open.chunks.last() {
            Some(Chunk::Preposition(word)) => Some(word.classes),
            Some(_) => None,
            None => return false,
        };
        if noun.all.has(I) {
            let is_step = before.is_some_and(|word| word.has(As)) && self.open.has(Move);
            let has_noun = self.open.nouns().any(|(at, _)| self.open.preposition(at).is_none());
            return !is_step && (has_noun && before.is_none() || self.open.is_finite());
        }
        // "it looks like the robot is red"
        let seems = self.open.chunks.len() == 3 && self.open.has(Copula) && before.is_some_and(|word| word.has(Like));
        if seems && is_subject(next) {
            return true;
        }
        let is_object = self.open.link == Some(Link::Relative) || noun.is_pronoun() && noun.all.has(Me);
        self.open.is_finite() && !is_object && before.is_none() && is_subject(next)
    }
}

/// Returns true if a finite verb follows, perhaps behind places and participles: "facing me in the mirror is".
fn is_subject(mut next: &[Chunk]) -> bool {
    let mut is_inner = false;
    loop {
        match next {
            [Chunk::Verb(verb), ..] if verb.is_finite && !verb.is_past && !is_inner => return true,
            [Chunk::Verb(_), Chunk::Noun(noun), rest @ ..] if noun.is_pronoun() => next = rest,
            [Chunk::Verb(_) | Chunk::Mark(_), rest @ ..] | [Chunk::Preposition(_), Chunk::Noun(_), rest @ ..] => {
                next = rest;
            }
            [Chunk::Noun(noun), rest @ ..] if noun.all.has(I) => {
                (next, is_inner) = (rest, true);
                continue;
            }
            _ => return false,
        }
        is_inner = false;
    }
}
