//! What the noun phrases of a text mean, and what the text says of them.

use crate::chunks::{Noun, Owner};
use crate::lexicon::Class::{
    Adverb, Agent, Anaphor, Answer, Article, Definite, Feature, Mirror, Not, Part, Place, Reflection, Source, Strange,
    Stranger, Thing,
};
use crate::lexicon::{Classes, Hue};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Who {
    Me,
    /// A body that may be one's own: "a red robot in the mirror".
    Maybe,
    Other,
    /// A colour alone: "red".
    Bare,
    Mirror,
    Source,
    Place,
}

#[derive(Clone, Debug)]
pub struct Entity {
    pub who: Who,
    /// An answer without a verb, such as "red robot": it is one's own unless another clause denies it.
    pub is_answer: bool,
    /// "I", "my body"; not "the reflection".
    pub is_certain: bool,
    /// The classes of its head.
    pub head: Classes,
    /// What a colour alone was said of.
    pub bearer: Option<usize>,
}

#[derive(Clone, Debug)]
pub struct Statement {
    pub entity: usize,
    pub hues: Vec<Hue>,
    pub is_denied: bool,
    /// Only a part of the body is meant.
    pub is_part: bool,
    /// The number of corrections before it.
    pub turn: u32,
}

/// What a text says about its author.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Claim {
    Nothing,
    One(Hue),
    Several,
}

#[derive(Default)]
pub struct Entities {
    all: Vec<Entity>,
    pub statements: Vec<Statement>,
    /// What `it` means.
    pub last: Option<usize>,
    /// The clause has named it.
    pub is_fresh: bool,
}

impl std::ops::Index<usize> for Entities {
    type Output = Entity;

    fn index(&self, at: usize) -> &Entity {
        &self.all[at]
    }
}

impl std::ops::IndexMut<usize> for Entities {
    fn index_mut(&mut self, at: usize) -> &mut Entity {
        &mut self.all[at]
    }
}

pub fn who(noun: &Noun) -> Who {
    match noun.head {
        _ if noun.is_bare() => Who::Bare,
        _ if noun.is_own() => Who::Me,
        head if head.has(Place) && noun.owner == Owner::Me => Who::Place,
        head if head.has(Mirror) => Who::Mirror,
        head if head.has(Source) => Who::Source,
        _ if noun.is_strange() || matches!(noun.owner, Owner::Other | Owner::It) => Who::Other,
        head if head.has(Feature) && noun.hues.is_empty() && !noun.all.has(Article) => Who::Me,
        head if head.has(Reflection) || head.has(Answer) && noun.hues.is_empty() => Who::Me,
        head if head.has_any(&[Agent, Feature, Answer]) => Who::Maybe,
        _ => Who::Other,
    }
}

impl Entities {
    pub fn add(&mut self, who: Who, is_certain: bool) -> usize {
        self.all.push(Entity { who, is_answer: false, is_certain, head: Classes::default(), bearer: None });
        self.all.len() - 1
    }

    /// The entity of a noun phrase, perhaps one of an earlier clause.
    pub fn resolve(&mut self, noun: &Noun, is_placed: bool, is_described: bool) -> usize {
        let last_head = self.last.map(|last| self.all[last].head).unwrap_or_default();
        let is_named = last_head.has(Agent) || last_head.has(Thing) && last_head.has(Strange);
        let may_be_other = |last: &usize| matches!(self.all[*last].who, Who::Maybe | Who::Other) && is_named;
        let is_vague = last_head.has(Answer);
        // "they" are no single body.
        let is_many = noun.all.has(Stranger) && !last_head.has(Part);
        let is_its = !is_vague && noun.owner == Owner::It && noun.head.has_any(&[Feature, Answer, Reflection]);
        let is_it = noun.is_pronoun() && noun.owner != Owner::Me && noun.all.has(Anaphor) && !is_many;
        let is_body = noun.hues.is_empty() && noun.head.has(Agent) && noun.owner == Owner::Nobody;
        let is_bare = !is_placed && !is_described && !noun.all.has(Adverb);
        let is_same = is_body && is_bare && noun.all.has(Definite) && !noun.is_strange();
        let meant = self.last.filter(|last| {
            let who = self.all[*last].who;
            // "Self: unknown. That is a red robot."
            let is_that = is_it && noun.all.has(Definite) && who == Who::Me;
            is_its || is_it && !is_that || is_same && may_be_other(last) && !(noun.is_own() && who == Who::Other)
        });
        if let Some(last) = meant {
            return last;
        }
        // "the color that I look for"
        let is_vague = is_described && noun.head.has_any(&[Answer, Reflection]) && noun.owner == Owner::Nobody;
        let who = if is_it || is_vague { Who::Other } else { who(noun) };
        let entity = self.add(who, noun.owner == Owner::Me);
        self.all[entity].head = noun.head;
        let is_place = noun.head.has(Place) && !noun.head.has(Thing);
        let is_aside = is_placed && (noun.head.is_empty() || noun.head.has_any(&[Thing, Place, Feature]));
        let is_other = matches!(who, Who::Maybe | Who::Other) && !is_place && noun.is_named();
        if (is_other || who == Who::Me) && !noun.is_pronoun() && !noun.all.has(Not) && !(is_aside && self.is_fresh) {
            (self.last, self.is_fresh) = (Some(entity), true);
        }
        entity
    }

    pub fn is(&self, entity: Option<usize>, who: Who) -> bool {
        entity.is_some_and(|entity| self.all[entity].who == who)
    }

    pub fn is_mine(&self, entity: usize) -> bool {
        self.all[entity].who == Who::Me || self.all[entity].is_answer
    }

    /// Forgets what was claimed.
    pub fn retract(&mut self) {
        let statements = std::mem::take(&mut self.statements);
        self.statements = statements.into_iter().filter(|statement| !self.is_mine(statement.entity)).collect();
    }

    /// Another's from here on, and in what was said before.
    pub fn disown(&mut self, entity: usize) {
        if self.all[entity].is_answer {
            // "white torso, white arms: the other robot"
            self.disown_answers();
        }
        if !self.all[entity].is_certain {
            self.all[entity].who = Who::Other;
        }
    }

    pub fn disown_answers(&mut self) {
        self.all.iter_mut().for_each(|entity| entity.is_answer = false);
    }

    /// The last claim counts; another one without a correction between them makes several.
    pub fn claim(&self) -> Claim {
        let mut claims: Vec<&Statement> = Vec::new();
        for statement in self.statements.iter().filter(|statement| self.is_mine(statement.entity)) {
            if statement.is_denied {
                claims.retain(|claim| claim.hues != statement.hues);
            } else {
                claims.push(statement);
            }
        }
        if claims.iter().any(|claim| !claim.is_part) {
            claims.retain(|claim| !claim.is_part);
        }
        let Some(last) = claims.last() else { return Claim::Nothing };
        match last.hues[..] {
            [hue] if claims.iter().all(|claim| claim.hues == last.hues || claim.turn < last.turn) => Claim::One(hue),
            _ => Claim::Several,
        }
    }
}
