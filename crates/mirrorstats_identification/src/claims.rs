//! From clauses to claims about oneself.

use crate::chunks::{Chunk, Link, Noun, Owner, chunks};
use crate::clauses::{Clause, clauses};
use crate::entities::{Claim, Entities, Statement, Who};
use crate::lexicon::Class::{
    Agent, Answer, Are, As, Away, Copula, Definite, Except, Feature, I, In, Mirror, Move, Not, Part, Plain, Reflection,
    Thing, This, Turn, Worn, Wrong,
};
use crate::lexicon::Hue;
use crate::moods::{Mood, governed, own, void_spans};
use crate::tokens::Sentence;

#[derive(Default)]
pub struct Reader {
    pub(super) entities: Entities,
    /// The number of corrections so far.
    pub(super) turn: u32,
    /// The subject of the clause before.
    pub(super) topic: Option<usize>,
    /// The phrase before a relative clause, which goes on behind it.
    pub(super) antecedent: Option<usize>,
    /// The colours of a former belief or of a report, which evidence may confirm.
    pub(super) held: Option<Vec<Hue>>,
    pub(super) was_question: bool,
    /// The labels are those of another: "type: cube; color: red".
    pub(super) is_of_other: bool,
    pub(super) sentences: usize,
}

/// The state of one sentence.
#[derive(Default)]
pub(super) struct Context<'a> {
    pub mood: Mood,
    /// The mood of a clause that the clause before governs.
    pub governed: Mood,
    pub label: Option<Who>,
    pub next: Option<&'a Clause>,
    pub after: Option<&'a Clause>,
    /// The last noun phrase of the clause before.
    pub neighbor: Option<usize>,
    /// No clause before names anything: "unknown, maybe red".
    pub is_plain: bool,
    /// The clause before denies.
    pub was_denied: bool,
}

/// A clause with its entities.
pub(super) struct Scene<'a> {
    pub clause: &'a Clause,
    pub entities: Vec<Option<usize>>,
    pub subject: Option<usize>,
    pub mood: Mood,
}

impl<'a> Scene<'a> {
    pub fn noun(&self, at: usize) -> Option<(&'a Noun, usize)> {
        Some((self.clause.noun(at)?, self.entities[at]?))
    }

    pub fn subject_noun(&self) -> Option<&'a Noun> {
        let is_subject = |at: &usize| self.subject.is_some() && self.entities[*at] == self.subject;
        self.clause.nouns().find(|(at, _)| is_subject(at)).map(|(_, noun)| noun)
    }
}

impl Context<'_> {
    pub fn next_is(&self, links: &[Link]) -> bool {
        self.next.and_then(|next| next.link).is_some_and(|link| links.contains(&link))
    }

    /// "the red robot and I are", "the red robot and the cube are"
    pub fn is_conjoined(&self) -> bool {
        let is_subject = |next: &Clause| {
            let verb = next.verbs().next().filter(|(_, verb)| verb.is_finite);
            let is_i = next.noun(0).is_some_and(|noun| noun.all.has(I));
            let is_am = verb.is_some_and(|(_, verb)| verb.all.has(Copula) && !verb.all.has(Are));
            next.noun(0).is_some() && if is_i { !is_am } else { verb.is_some() }
        };
        self.next_is(&[Link::And]) && self.next.is_some_and(is_subject)
    }

    /// "green (me), red (other)": returns true if the tag behind this clause is one's own.
    pub fn tag(&self) -> Option<bool> {
        let next = self.next.filter(|next| next.link == Some(Link::Comma) && next.chunks.len() == 1)?;
        let tag = next.noun(0).filter(|tag| tag.hues.is_empty() && !tag.all.has(Away))?;
        let is_label = self.after.is_some_and(|after| after.link == Some(Link::Colon));
        let is_tag = tag.is_pronoun() || tag.is_strange() || tag.is_own();
        (is_tag && !is_label).then(|| !tag.is_strange())
    }

    fn has_alternative(&self) -> bool {
        self.next_is(&[Link::Or]) && self.next.is_some_and(|next| !next.has_verb() || next.marks.has(Not))
    }
}

impl Reader {
    pub fn add(&mut self, sentence: &Sentence) {
        let all = clauses(&chunks(&sentence.words));
        let mut context = Context { is_plain: true, ..Context::default() };
        let void = void_spans(&all);
        self.topic = None;
        for (at, clause) in all.iter().enumerate() {
            (context.next, context.after) = (all.get(at + 1), all.get(at + 2));
            let is_void = sentence.is_question || void.contains(&clause.span);
            context.mood = match clause.link {
                _ if is_void => Mood::Void,
                Some(Link::That | Link::Implicit) => context.governed,
                Some(Link::If | Link::Whether) => Mood::Void,
                Some(Link::Or) => context.mood,
                Some(Link::And | Link::Comma) if !clause.has_verb() && context.mood != Mood::Held => context.mood,
                _ => Mood::Asserted,
            };
            self.clause(clause, &mut context);
            context.is_plain &= !clause.has_verb() && clause.nouns().all(|(_, noun)| noun.head.is_empty());
        }
        // "My reflection is not visible. It is a red robot that passes."
        let is_missing = |clause: &Clause| clause.has(Not) && clause.nouns().all(|(_, noun)| noun.hues.is_empty());
        let is_vague = sentence.is_question || all.iter().any(is_missing);
        let last = self.entities.last;
        self.entities.last = last.filter(|last| !(is_vague && self.is_me(Some(*last))));
        self.was_question = sentence.is_question;
        self.sentences += 1;
    }

    pub fn claim(&self) -> Claim {
        self.entities.claim()
    }

    fn clause(&mut self, clause: &Clause, context: &mut Context<'_>) {
        self.turn += u32::from(clause.marks.has(Turn) || clause.has_noun(Turn) || clause.link == Some(Link::But));
        let mut scene = self.scene(clause, context);
        if matches!(scene.mood, Mood::Asserted | Mood::Weak) && context.has_alternative() {
            let has_hue = context
                .next
                .is_some_and(|next| next.marks.has(Not) || next.nouns().any(|(_, noun)| !noun.hues.is_empty()));
            scene.mood = if has_hue { Mood::Void } else { Mood::Weak };
        }
        let is_source = self.entities.is(scene.subject, Who::Source);
        if (clause.has(Wrong) || clause.has_noun(Wrong)) && !is_source {
            self.entities.retract();
            // "I was wrong about being red"
            if !clause.marks.has(Wrong) || clause.verbs().any(|(_, verb)| verb.all.has(Wrong)) {
                scene.mood = Mood::Void;
            }
        }
        self.attributes(&scene);
        // The whole text is "red robot facing the mirror".
        let is_whole =
            context.is_plain && self.sentences == 0 && clause.link == Some(Link::Start) && context.next.is_none();
        let is_posed = clause.noun(0).is_some_and(|noun| !noun.hues.is_empty())
            && clause.verbs().all(|(_, verb)| !verb.is_finite)
            && clause.nouns().count() == 2
            && clause.nouns().skip(1).all(|(_, noun)| noun.head.has(Mirror));
        if let Some(subject) = scene.subject.filter(|_| is_whole && is_posed && clause.has_verb()) {
            self.entities[subject].is_answer |= self.entities.is(Some(subject), Who::Maybe);
        }
        self.is_of_other &= !clause.has_verb();
        for (at, verb) in clause.verbs() {
            self.predicate(&scene, at, verb);
        }
        if clause.has_verb() {
            context.label = context.label.filter(|_| scene.subject.is_none());
            self.label(&scene, context);
        } else {
            self.fragment(&scene, context);
        }
        context.governed = governed(&self.entities, &scene);
        // ", I think,"
        let is_aside = clause.link == Some(Link::Comma) && clause.is_opinion();
        // "stops when I stop"
        let is_step = clause.link == Some(Link::Implicit) && clause.has(Move) && self.is_me(scene.subject);
        if is_aside {
            self.topic = context.neighbor.or(self.topic);
        } else if (clause.has_verb() || clause.link != Some(Link::Comma)) && !is_step {
            self.topic = scene.subject.or(self.topic);
        }
        context.mood = scene.mood;
        context.was_denied = clause.has(Not) || clause.has_noun(Not);
        context.neighbor = self.neighbor(&scene);
    }

    /// Finds the entities and the subject of a clause.
    fn scene<'a>(&mut self, clause: &'a Clause, context: &Context<'_>) -> Scene<'a> {
        let before = context.neighbor.or(self.entities.last);
        self.entities.is_fresh = false;
        let mut entities = vec![None; clause.chunks.len()];
        for (at, noun) in clause.nouns() {
            let is_own = |place: &Noun| {
                place.head.has_any(&[Mirror, Reflection]) || place.owner == Owner::Me && place.head.has(Feature)
            };
            let is_described = match clause.chunks.get(at + 1) {
                // "the robot on the left"
                Some(Chunk::Preposition(_)) => !clause.noun(at + 2).is_some_and(is_own),
                // "I am the robot looking at the red one", "the color given in the prompt is red"
                Some(Chunk::Verb(_)) => at > 0 || context.next_is(&[Link::Resumed]) && !clause.has_noun(Mirror),
                // "the color that I look for"
                Some(_) => false,
                None => {
                    let is_behind =
                        context.next_is(&[Link::Relative]) || noun.head.has(Answer) && context.next_is(&[Link::That]);
                    is_behind && !context.next.is_some_and(|next| next.nouns().any(|(_, noun)| is_own(noun)))
                }
            };
            entities[at] = Some(self.entities.resolve(noun, clause.preposition(at).is_some(), is_described));
        }
        let verb_at = clause.verbs().next().map_or(clause.chunks.len(), |(at, _)| at);
        let first = clause.nouns().find(|(at, _)| clause.preposition(*at).is_none() && *at < verb_at);
        let first = first.and_then(|(at, _)| entities[at]);
        let listed = [Link::Comma, Link::And, Link::But, Link::Or, Link::So].map(Some);
        let subject = match clause.link {
            Some(Link::Relative) => first.or(before),
            Some(Link::Resumed) => self.antecedent,
            link if first.is_none() && verb_at == 0 && listed.contains(&link) => self.topic,
            _ => first,
        };
        self.antecedent = match clause.link {
            // "I think that the robot reflected behind me | is red"
            Some(Link::Implicit | Link::That) if subject.is_some() && !clause.has_noun(I) => subject,
            Some(Link::Relative | Link::Implicit | Link::That) => before,
            Some(Link::Resumed) => self.antecedent,
            _ => subject,
        };
        self.places(clause, &entities);
        let mood = own(&self.entities, clause, subject, context);
        Scene { clause, entities, subject, mood }
    }

    /// "the robot in front of me", "the figure near the wall", "the color on the cube" are others.
    fn places(&mut self, clause: &Clause, entities: &[Option<usize>]) {
        for (at, noun) in clause.nouns() {
            let Some(word) = clause.preposition(at) else { continue };
            let Some((head, entity)) = at.checked_sub(2).and_then(|at| Some((clause.noun(at)?, entities[at]?))) else {
                continue;
            };
            let is_color = head.head.has_any(&[Answer, Reflection]) && head.owner == Owner::Nobody;
            let is_on_other = is_color && !word.has(In) && crate::entities::who(noun) == Who::Other;
            let is_agent = head.head.has(Agent) && head.owner == Owner::Nobody && !head.all.has(This);
            let is_away = noun.all.has(Away) || noun.owner == Owner::Me && !noun.is_own();
            let is_beside_me = noun.is_pronoun() && noun.owner == Owner::Me || !word.has(Plain);
            let is_placed = !word.has(As) && is_beside_me || is_away;
            if is_on_other || is_placed && (is_agent || self.entities.is(Some(entity), Who::Maybe)) {
                self.entities.disown(entity);
            }
        }
    }

    /// The last noun phrase, without its places.
    fn neighbor(&self, scene: &Scene<'_>) -> Option<usize> {
        let (at, noun) = scene.clause.nouns().last()?;
        let is_plain = !noun.all.has(Not) && (noun.is_named() || noun.is_pronoun());
        let head = at.checked_sub(2).and_then(|at| scene.entities[at]);
        let is_head = |head: &usize| !self.entities.is(Some(*head), Who::Me) || noun.head.has(Mirror);
        // "the robot looks at me, a red robot"
        let is_subject = noun.is_pronoun()
            && noun.owner == Owner::Me
            && scene.clause.has_verb()
            && !scene.clause.has(Copula)
            && scene.subject.is_some_and(|subject| matches!(self.entities[subject].who, Who::Maybe | Who::Other));
        let found = match () {
            () if is_subject => scene.subject,
            // "the robot I see, which is red"
            () if noun.all.has(I) && scene.clause.link == Some(Link::Relative) => self.antecedent,
            () if scene.clause.preposition(at).is_some() => head.filter(is_head),
            () => scene.entities[at],
        };
        found.filter(|_| is_plain)
    }

    /// Colours before their noun: "my red body", "a red robot", "a robot with a red body".
    fn attributes(&mut self, scene: &Scene<'_>) {
        for (at, noun) in scene.clause.nouns().filter(|(_, noun)| !noun.hues.is_empty()) {
            let word = scene.clause.preposition(at).unwrap_or_default();
            let Some(entity) = scene.entities[at].filter(|_| !word.has(Except)) else { continue };
            self.state(scene, entity, noun, noun.all.has(Not));
            let is_worn = noun.is_bare() || noun.head.has_any(&[Feature, Answer]) && noun.owner == Owner::Nobody;
            let Some((wearer, entity)) = at.checked_sub(2).and_then(|at| scene.noun(at)) else { continue };
            if is_worn && word.has(Worn) && wearer.hues.is_empty() && wearer.head.has_any(&[Agent, Reflection]) {
                self.state(scene, entity, noun, noun.all.has(Not));
            }
        }
    }

    /// Records that an entity has the colours of a noun phrase.
    pub(super) fn state(&mut self, scene: &Scene<'_>, entity: usize, noun: &Noun, is_denied: bool) {
        // Wishes and conditions do not change the color of "the red cube".
        let is_known = noun.head.has(Thing) && noun.all.has(Definite);
        match scene.mood {
            _ if noun.hues.is_empty() => {}
            mood if is_known || matches!(mood, Mood::Asserted | Mood::Weak) => {
                let is_part = noun.head.has(Part) || scene.subject_noun().is_some_and(|subject| subject.head.has(Part));
                let (hues, turn) = (noun.hues.clone(), self.turn);
                self.entities.statements.push(Statement { entity, hues, is_denied, is_part, turn });
            }
            _ if !self.entities.is_mine(entity) => {}
            Mood::Held => self.held = Some(noun.hues.clone()),
            _ => self.held = self.held.take().or_else(|| Some(noun.hues.clone())),
        }
    }

    /// Records that an entity is the author, or is not.
    pub(super) fn identify(&mut self, scene: &Scene<'_>, entity: usize, is_denied: bool) {
        match scene.mood {
            Mood::Asserted | Mood::Weak if is_denied => self.entities.disown(entity),
            Mood::Asserted => self.entities[entity].who = Who::Me,
            _ => {}
        }
    }
}
