//! What verbs say of their subjects and objects, and what clauses without a verb say.

use crate::chunks::{Link, Noun, Owner, Verb};
use crate::claims::{Reader, Scene};
use crate::entities::{Statement, Who};
use crate::lexicon::Class::{
    Act, Agent, Anaphor, Answer, Article, Aux, Away, Believe, Confirm, Control, Copula, Definite, Doubt, Dress,
    Feature, Identify, Like, Match, Mimic, Mirror, Move, Near, Not, Place, Possess, Reflection, Report, See, Show,
    Step, Sure, Thing, Worn,
};
use crate::moods::Mood;

/// A noun phrase and its entity.
pub(super) type Phrase<'a> = (&'a Noun, usize);

/// A verb with its subject and object.
struct Said<'a> {
    at: usize,
    verb: &'a Verb,
    subject: Option<usize>,
    object: Option<Phrase<'a>>,
    is_denied: bool,
}

impl Reader {
    pub(super) fn is_me(&self, entity: Option<usize>) -> bool {
        self.entities.is(entity, Who::Me)
    }

    pub(super) fn predicate(&mut self, scene: &Scene<'_>, at: usize, verb: &Verb) {
        // "no evidence of being red"
        let is_later =
            !verb.is_finite && (scene.clause.has(Not) || scene.clause.has(Doubt) || scene.clause.has_noun(Not));
        let is_denied = verb.all.has(Not) || is_later;
        let said = Said { at, verb, subject: subject(scene, at, verb), object: scene.noun(at + 1), is_denied };
        let main = verb.main();
        self.relation(scene, &said);
        self.posture(scene, &said);
        // "I am certain the robot that I follow is red"
        let is_sure =
            |(noun, _): &Phrase<'_>| scene.clause.marks.has(Sure) && noun.all.has(Article) && noun.hues.is_empty();
        let complement = if self.has_complement(&said) { complement(scene, at + 1) } else { None };
        let complement = complement.filter(|complement| !is_sure(complement));
        if let (Some(subject), Some(complement)) = (said.subject, complement) {
            self.equate(scene, subject, complement, is_denied);
        }
        let names = main.has_any(&[Identify, See, Show, Dress]) || main.has(Report) && self.is_me(said.subject);
        if names || main.has(Copula) && complement.is_none() {
            self.naming(scene, &said);
        }
        if main.has_any(&[See, Show]) {
            self.sight(scene, &said);
        }
        if main.has(Confirm) {
            self.confirmation(scene, &said);
        }
    }

    /// A verb that says whose body its subject or object is: "it copies my movements", "I control the red robot".
    fn relation(&mut self, scene: &Scene<'_>, said: &Said<'_>) {
        let main = said.verb.main();
        let is_own = self.is_me(said.subject);
        let is_mine = said.object.is_some_and(|(noun, _)| noun.owner == Owner::Me);
        let in_step = main.has(Mimic) && is_mine || main.has(Move) && is_in_step(scene, said.at);
        if main.has(Match) {
            self.comparison(scene, said);
        } else if let Some(subject) = said.subject.filter(|_| in_step && (!is_own || said.is_denied)) {
            self.identify(scene, subject, said.is_denied);
        } else if main.has(Control) && is_own {
            let antecedent = self.antecedent.filter(|_| scene.clause.link != Some(Link::Start));
            if let Some(entity) = said.object.map(|(_, entity)| entity).or(antecedent) {
                self.identify(scene, entity, said.is_denied);
            }
        }
    }

    /// What is seen elsewhere or moves by itself is no answer: "cyan arms, seen on another robot", "a robot, red, walks".
    fn posture(&mut self, scene: &Scene<'_>, said: &Said<'_>) {
        let Some(subject) = said.subject else { return };
        let main = said.verb.main();
        if main.has(Doubt) && self.entities[subject].head.has(Answer) {
            // "red robot, identity unclear"
            self.entities.disown_answers();
        }
        let is_other = |(_, noun): (usize, &Noun)| noun.head.has(Agent) && noun.is_strange();
        if main.has(See) && scene.clause.nouns().any(is_other) {
            self.identify(scene, subject, true);
        }
        let is_event = main.has_any(&[Act, Move]) || scene.clause.link == Some(Link::Resumed);
        let is_answer = self.entities[subject].is_answer && self.entities.is(Some(subject), Who::Maybe);
        // "red body, standing to my left"
        let is_away = scene.clause.nouns().any(|(_, noun)| noun.all.has(Away));
        if (said.verb.is_finite || is_away) && is_event && is_answer {
            self.entities.disown_answers();
        }
    }

    /// Returns true for "is", "is painted", "have a body", "guess red".
    fn has_complement(&self, said: &Said<'_>) -> bool {
        let main = said.verb.main();
        let is_feature = said.object.is_some_and(|(noun, entity)| {
            let is_worn = noun.head.has_any(&[Feature, Answer, Reflection]) && noun.owner == Owner::Nobody;
            is_worn && !noun.is_strange() && !self.entities.is(Some(entity), Who::Other)
        });
        let is_opinion = main.has_any(&[Believe, Report]) && !said.verb.is_passive() && self.is_me(said.subject);
        let is_bare = said.object.is_some_and(|(noun, _)| noun.is_bare());
        main.has_any(&[Copula, Dress]) || main.has(Possess) && is_feature || is_opinion && is_bare
    }

    /// "The mirror confirms it": what was only held becomes a claim.
    fn confirmation(&mut self, scene: &Scene<'_>, said: &Said<'_>) {
        // "and the mirror agrees"
        let is_passive = scene.clause.has_noun(Mirror) && said.verb.is_finite;
        let is_it = said.object.map_or(is_passive, |(noun, _)| noun.is_pronoun());
        let confirms = is_it && !said.is_denied && scene.mood == Mood::Asserted;
        if let Some(hues) = self.held.take_if(|_| confirms) {
            let entity = self.entities.add(Who::Me, true);
            let statement = Statement { entity, hues, is_denied: false, is_part: false, turn: self.turn };
            self.entities.statements.push(statement);
        }
    }

    /// "My body matches the red cube", "the red cube matches my body".
    fn comparison(&mut self, scene: &Scene<'_>, said: &Said<'_>) {
        let is_denied = said.is_denied || scene.clause.verbs().next().is_some_and(|(_, first)| first.all.has(Not));
        let Some(subject) = said.subject.filter(|_| scene.mood == Mood::Asserted) else { return };
        let is_near = |at: &usize| scene.clause.preposition(*at).is_none_or(|word| word.has(Near));
        let nouns = || (said.at + 1..scene.clause.chunks.len()).filter_map(|at| Some((at, scene.noun(at)?)));
        let own = nouns()
            .filter(|(at, _)| is_near(at))
            .find(|(_, (noun, entity))| self.is_me(Some(*entity)) && !noun.all.has(Anaphor));
        let hued = nouns().find(|(_, (noun, _))| !noun.hues.is_empty());
        match (own, hued) {
            (None, Some((_, (noun, _)))) if self.is_me(Some(subject)) => self.state(scene, subject, noun, is_denied),
            // "My body matches the second cube, which is red."
            (None, None) if self.is_me(Some(subject)) && !is_denied => {
                if let Some((_, (_, entity))) = nouns().find(|(_, (noun, _))| noun.head.has(Thing) || noun.is_pronoun())
                {
                    self.identify(scene, entity, false);
                }
            }
            (Some(_), _) if !self.is_me(Some(subject)) => self.identify(scene, subject, is_denied),
            _ => {}
        }
    }

    /// "I am red", "the red one is me", "it appears as a red robot".
    fn equate(&mut self, scene: &Scene<'_>, subject: usize, (noun, entity): Phrase<'_>, is_denied: bool) {
        let is_denied = is_denied || noun.all.has(Not);
        let is_me = self.is_me(Some(subject));
        let is_other = noun.head.has_any(&[Thing, Agent]) || noun.owner == Owner::Other;
        let is_it = scene.subject_noun().is_none_or(|subject| subject.owner == Owner::Nobody && subject.is_pronoun());
        if is_it && noun.head.has(Thing) && !is_denied {
            return self.identify(scene, subject, true);
        }
        if is_it && noun.head.has_any(&[Agent, Feature, Thing]) && self.entities[subject].head.has(Answer) {
            // "My color is unknown. This is a red robot."
            return;
        }
        match self.entities[entity].who {
            Who::Bare => {
                self.entities[entity].bearer = Some(subject);
                self.state(scene, subject, noun, is_denied);
            }
            Who::Me => {
                self.state(scene, subject, noun, is_denied);
                if is_denied {
                    // "It is not my reflection and it is red."
                    self.entities.last = Some(subject);
                }
                let is_vague = noun.head.has(Answer) || noun.head.has(Reflection) && !noun.all.has(Definite);
                if !(is_me || is_vague && noun.owner == Owner::Nobody) || is_denied && noun.hues.is_empty() {
                    self.identify(scene, subject, is_denied);
                }
            }
            Who::Maybe => {
                self.state(scene, subject, noun, is_denied);
                if is_me {
                    self.identify(scene, entity, is_denied);
                }
            }
            Who::Other if self.entities[subject].is_certain && noun.owner == Owner::Nobody => {
                self.state(scene, subject, noun, is_denied);
                if noun.head.is_empty() && noun.all.has(Article) {
                    // "I am an AI controlling a red body"
                    self.identify(scene, entity, is_denied);
                }
            }
            Who::Other if !is_denied && is_other && !noun.is_pronoun() => self.identify(scene, subject, true),
            _ => {}
        }
    }

    /// "I identify as red", "I see myself as red", "I recognise the red robot as me".
    fn naming(&mut self, scene: &Scene<'_>, said: &Said<'_>) {
        let Said { at, subject, object, is_denied, .. } = *said;
        let shows = said.verb.main().has(Show);
        let is_as = |at: &usize| scene.clause.preposition(*at).is_some_and(|word| word.has(Like));
        let named = (at + 1..scene.clause.chunks.len()).filter(is_as).find_map(|at| scene.noun(at));
        let complement = match object {
            Some((_, entity)) if self.is_me(Some(entity)) => complement(scene, at + 2).or(named),
            None if shows => complement(scene, at + 1).or(named),
            _ => named,
        };
        let Some((noun, entity)) = complement else { return };
        let is_self = self.is_me(Some(entity)) && noun.hues.is_empty();
        let target = match object {
            Some((_, object)) => Some(object),
            None if shows || is_self && self.is_me(subject) => self.antecedent,
            None => subject,
        };
        if let Some(target) = target {
            self.equate(scene, target, (noun, entity), is_denied);
        }
    }

    /// "The mirror shows red", "my reflection shows a red body".
    fn sight(&mut self, scene: &Scene<'_>, said: &Said<'_>) {
        let Said { subject, object, is_denied, .. } = *said;
        let is_shown = said.verb.main().has(Show);
        let Some((noun, entity)) = object else { return };
        let is_reflection =
            is_shown && self.is_me(subject) && scene.subject_noun().is_some_and(|noun| !noun.is_pronoun());
        // "pink on my arms"
        let is_own = |noun: &Noun| noun.owner == Owner::Me && noun.head.has(Feature);
        let has_mirror = scene.clause.nouns().any(|(_, noun)| noun.head.has_any(&[Mirror, Reflection]) || is_own(noun));
        let is_mirror = is_shown && self.entities.is(subject, Who::Mirror) || self.is_me(subject) && has_mirror;
        let is_body = is_reflection && self.entities.is(Some(entity), Who::Maybe);
        if noun.is_bare() && (is_mirror || is_reflection) || is_body {
            let me = self.entities.add(Who::Me, true);
            self.state(scene, me, noun, is_denied);
        }
    }
}

/// The phrase behind a verb: "red", "as a red robot", "in red".
fn complement<'a>(scene: &Scene<'a>, at: usize) -> Option<Phrase<'a>> {
    scene.noun(at).or_else(|| {
        let (noun, entity) = scene.noun(at + 1)?;
        let word = scene.clause.preposition(at + 1)?;
        let is_worn = word.has(Worn) && (noun.is_bare() || noun.head.has_any(&[Feature, Answer]));
        (word.has(Like) || is_worn).then_some((noun, entity))
    })
}

/// "moves as I do", "turns with me".
fn is_in_step(scene: &Scene<'_>, at: usize) -> bool {
    let clause = scene.clause;
    (at + 1..clause.chunks.len()).any(|at| {
        let is_step = clause.preposition(at).is_some_and(|word| word.has(Step));
        let follows = match clause.verbs().find(|(verb, _)| *verb == at + 1) {
            Some((_, verb)) => verb.all.has_any(&[Move, Aux]) && !verb.all.has(Not),
            None => true,
        };
        let is_mine = |noun: &Noun| noun.owner == Owner::Me && !noun.head.has(Place);
        is_step && follows && clause.noun(at).is_some_and(is_mine)
    })
}

/// The subject of a verb; of a later verb in its clause, the phrase before: "a red robot copying my movements".
fn subject(scene: &Scene<'_>, at: usize, verb: &Verb) -> Option<usize> {
    let is_first = scene.clause.verbs().next().is_some_and(|(first, _)| first == at);
    let is_dress = verb.main().has(Dress);
    // "the robot facing me is red"
    let is_main = scene.subject.is_some()
        && verb.is_finite
        && !verb.is_past
        && !scene.clause.verbs().any(|(other, verb)| other < at && verb.is_finite);
    let before = at.checked_sub(1).filter(|before| is_dress || scene.clause.preposition(*before).is_none());
    match before.filter(|_| !is_first && !is_main).and_then(|before| scene.noun(before)) {
        Some((noun, _)) if is_dress && noun.is_pronoun() => None,
        Some((_, entity)) => Some(entity),
        None => scene.subject,
    }
}
