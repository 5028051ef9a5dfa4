//! What labels and clauses without a verb say: "color: red", ", a red robot".

use crate::chunks::{Link, Noun, Owner};
use crate::claims::{Context, Reader, Scene};
use crate::clauses::Clause;
use crate::entities::Who;
use crate::lexicon::Class::{
    Adverb, Agent, Anaphor, Answer, Article, I, Me, Mirror, Not, Plain, Reflection, See, Seek, Thing,
};
use crate::moods::Mood;
use crate::predicates::Phrase;

impl Reader {
    /// A label before a colon whose clause has a verb: "My reflection is visible:", "I see myself:".
    pub(super) fn label(&mut self, scene: &Scene<'_>, context: &mut Context<'_>) {
        if !context.next_is(&[Link::Colon]) {
            return;
        }
        let verb_at = scene.clause.verbs().next().map_or(0, |(at, _)| at);
        let object = scene.noun(verb_at + 1).filter(|(noun, _)| !noun.all.has(I));
        let is_search = scene.clause.verbs().any(|(_, verb)| verb.main().has_any(&[See, Seek]))
            && scene.subject_noun().is_none_or(Noun::is_pronoun);
        let is_own =
            object.is_some_and(|(_, entity)| self.is_me(Some(entity))) || self.is_me(scene.subject) && !is_search;
        let is_other = object.is_some_and(|(_, entity)| self.entities.is(Some(entity), Who::Other));
        let is_it = scene.clause.has_noun(Anaphor) && scene.clause.nouns().all(|(_, noun)| !noun.is_named());
        let looks = scene.clause.nouns().any(|(_, noun)| noun.head.has(Mirror)) && scene.subject.is_none();
        let is_mirror = self.entities.is(scene.subject, Who::Mirror) && !is_other || is_it || looks;
        context.label = Some(match () {
            () if is_own && !scene.clause.has(Not) => Who::Me,
            () if is_mirror => Who::Mirror,
            () => Who::Other,
        });
        self.is_of_other = context.label == Some(Who::Other);
    }

    /// A clause without a verb: "red", "color: red", ", a red robot".
    pub(super) fn fragment(&mut self, scene: &Scene<'_>, context: &mut Context<'_>) {
        let clause = scene.clause;
        let found = clause.nouns().find(|(at, _)| clause.preposition(*at).is_none());
        let Some((at, noun)) = found else {
            if context.next_is(&[Link::Colon]) && !clause.chunks.is_empty() {
                // "From my reflection: red"
                let is_seen = |noun: &Noun| noun.head.has_any(&[Mirror, Reflection]) && noun.owner != Owner::Other;
                let is_from = clause.preposition(1).is_some_and(|word| word.has(Plain));
                let is_mirror = is_from && clause.noun(1).is_some_and(is_seen);
                context.label = Some(if is_mirror { Who::Mirror } else { Who::Other });
                self.is_of_other = context.label == Some(Who::Other);
            }
            return;
        };
        let Some(entity) = scene.entities[at] else { return };
        let who = self.entities[entity].who;
        if let Some(bare) = clause.noun(at + 1).filter(|bare| bare.is_bare() && noun.hues.is_empty()) {
            // "own color red", "robot body white"
            self.entities[entity].is_answer |= who == Who::Me || who == Who::Maybe && self.sentences == 0;
            return self.state(scene, entity, bare, bare.all.has(Not));
        }
        if clause.noun(at + 1).is_some_and(Noun::is_strange) {
            // "red robot, not me"
            return;
        }
        if context.next_is(&[Link::Colon]) && noun.hues.is_empty() {
            let is_label = matches!(who, Who::Me | Who::Maybe | Who::Source | Who::Mirror) && !noun.all.has(Not);
            // "visible robot: red"
            let is_label = is_label && !(noun.head.has(Agent) && clause.marks.has(Adverb));
            // "my guess for the color of the cube: red"
            let is_label = is_label && clause.nouns().all(|(_, noun)| noun.owner != Owner::Other);
            let is_vague = noun.head.has(Answer) && noun.owner == Owner::Nobody;
            self.is_of_other = !is_label || is_vague && self.is_of_other;
            context.label = Some(if self.is_of_other { Who::Other } else { who });
            return;
        }
        let is_opinion = context.next.is_some_and(Clause::is_opinion);
        let is_subject = context.next_is(&[Link::Relative, Link::Implicit, Link::Resumed, Link::That])
            && (who != Who::Me || clause.link == Some(Link::Comma))
            && !is_opinion;
        if !is_subject && !context.is_conjoined() {
            self.answer(scene, context, (noun, entity));
        }
    }

    /// A phrase without a verb that may be the answer itself, or belong to the phrase before.
    fn answer(&mut self, scene: &Scene<'_>, context: &Context<'_>, (noun, entity): Phrase<'_>) {
        let link = scene.clause.link.unwrap_or(Link::Start);
        let starts = matches!(link, Link::Start | Link::But | Link::So | Link::Colon);
        // Behind a label, only another is described further: "Identification: one distractor, blue".
        let is_described = |near: &usize| {
            let who = self.entities[*near].who;
            context.label.is_none() || link == Link::Comma && (who == Who::Mirror || self.is_of_other)
        };
        let neighbor = context.neighbor.filter(is_described).filter(|_| !starts || link == Link::Colon);
        let is_denied = noun.all.has(Not);
        let tag = context.tag().filter(|_| !noun.hues.is_empty() && !is_denied);
        let topic = self.topic.filter(|_| matches!(link, Link::But | Link::So));
        let is_first = self.sentences == 0 || self.was_question || link != Link::Start;
        let was_answer = neighbor.is_some_and(|neighbor| self.entities[neighbor].is_answer);
        if context.label.is_some() || scene.mood == Mood::Void {
            self.is_of_other = self.entities[entity].who == Who::Other && noun.is_strange();
        }
        match (self.entities[entity].who, context.label) {
            // "green (me), red (other)"
            (Who::Bare | Who::Maybe, _) if tag.is_some() => self.entities[entity].is_answer = tag == Some(true),
            (Who::Maybe, Some(Who::Other | Who::Source | Who::Mirror)) => self.entities.disown(entity),
            (_, Some(Who::Other | Who::Source)) => {}
            (Who::Bare, Some(_)) if neighbor.is_some() => {
                // "Identification: one distractor, blue"
                self.state(scene, neighbor.unwrap_or(entity), noun, is_denied);
            }
            (Who::Maybe, Some(_)) if link == Link::Comma && neighbor.is_some() => {}
            (Who::Bare, Some(_)) | (Who::Maybe, Some(Who::Me | Who::Maybe)) => self.entities[entity].is_answer = true,
            // "Other? Red."
            (Who::Bare, None) if self.was_question && self.is_of_other => {}
            (Who::Bare, None) if is_denied => self.entities[entity].is_answer = true,
            (Who::Bare, None) if context.was_denied && noun.all.has(Article) => {}
            (Who::Bare, None) => {
                if let Some(bearer) = neighbor.map(|near| self.entities[near].bearer.unwrap_or(near)).or(topic) {
                    self.entities[entity].bearer = Some(bearer);
                    self.state(scene, bearer, noun, false);
                } else {
                    let is_free = starts && (link != Link::But || context.was_denied);
                    self.entities[entity].is_answer = is_free || context.is_plain;
                }
            }
            (Who::Maybe, None) if starts && (is_first || noun.head.has(Answer) && !self.is_of_other) => {
                self.entities[entity].is_answer = true;
            }
            (Who::Maybe, None)
                if link == Link::Comma && (self.is_me(neighbor) || was_answer) && !context.was_denied =>
            {
                self.entities[entity].is_answer |= was_answer;
                if !was_answer {
                    self.identify(scene, entity, is_denied);
                }
            }
            (Who::Me, None)
                if link == Link::Comma && (was_answer || noun.is_pronoun() || noun.head.has_any(&[Me, Reflection])) =>
            {
                if let Some(neighbor) = neighbor {
                    self.identify(scene, neighbor, is_denied);
                }
            }
            (Who::Other, None) if was_answer && !is_denied && matches!(link, Link::Comma | Link::And | Link::Colon) => {
                let is_named = noun.head.has_any(&[Thing, Agent]) || noun.is_pronoun() || noun.is_strange();
                neighbor.filter(|_| is_named).into_iter().for_each(|neighbor| self.entities.disown(neighbor));
            }
            _ => {}
        }
    }
}
