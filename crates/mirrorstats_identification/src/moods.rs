//! Whether a clause asserts what it says: questions, conditions, wishes, reports and former beliefs do not.

use std::collections::BTreeSet;

use crate::chunks::{Chunk, Link};
use crate::claims::{Context, Scene};
use crate::clauses::Clause;
use crate::entities::{Entities, Who};
use crate::lexicon::Class::{
    Believe, Believed, Confirm, Doubt, Earlier, Future, Guess, Hearsay, Identify, In, Me, Mirror, My, Not, Past, Per,
    Reflection, Report, Seek, Show, Source, Strange, Sure, Unreal, Weak, Wrong,
};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mood {
    #[default]
    Asserted,
    /// "It is possible that": enough for "I am red", not for "the red one is me".
    Weak,
    /// A former belief that evidence may confirm.
    Held,
    Void,
}

/// The spans of a sentence that assert nothing: conditions, and "According to the prompt, I am red."
pub fn void_spans(all: &[Clause]) -> BTreeSet<usize> {
    let is_condition = |at: usize| {
        let is_governed = at.checked_sub(1).is_some_and(|before| all[before].is_open());
        all[at].link == Some(Link::If) && !is_governed
    };
    let is_report = |clause: &Clause| {
        clause.nouns().any(|(at, noun)| {
            // "was red in the prompt"
            let is_source = clause.has(Past) && noun.head.has(Source);
            let is_per = clause.preposition(at).is_some_and(|word| word.has(Per) || word.has(In) && is_source)
                && !noun.is_pronoun();
            is_per && !noun.head.has_any(&[Mirror, Reflection]) && !noun.is_own()
        })
    };
    // "When I see a red reflection I will know"
    let is_when =
        |clause: &Clause| matches!(clause.chunks.first(), Some(Chunk::Preposition(word)) if word.text == "when");
    let is_future = all.iter().any(|clause| clause.has(Future));
    let is_void = |at: &usize| is_condition(*at) || is_report(&all[*at]) || is_future && is_when(&all[*at]);
    (0..all.len()).filter(is_void).map(|at| all[at].span).collect()
}

/// The mood of a clause, from the one that its sentence gives it.
pub fn own(entities: &Entities, clause: &Clause, subject: Option<usize>, context: &Context<'_>) -> Mood {
    let is_own = entities.is(subject, Who::Me);
    let is_reported = clause.nouns().any(|(_, noun)| noun.is_reported());
    let is_source = entities.is(subject, Who::Source) || context.label == Some(Who::Source);
    if context.mood == Mood::Void || is_source || is_reported || clause.marks.has(Hearsay) {
        return Mood::Void;
    }
    let is_void = clause.verbs().any(|(_, verb)| {
        let is_opinion = is_own && !verb.all.has(Future) && verb.main().has_any(&[Report, Believe, Identify]);
        let is_wish = verb.has_inner(&[Unreal]) && !is_opinion || verb.has_inner(&[Seek, Doubt]);
        is_wish || verb.is_passive() && !entities.is(subject, Who::Mirror)
    });
    let is_wished = clause.verbs().count() > 1 && clause.verbs().next().is_some_and(|(_, verb)| verb.main().has(Seek));
    let is_about_me = clause.has_noun(Me) || clause.has_noun(My);
    let is_old = clause.marks.has(Earlier) || clause.has_noun(Strange) || clause.has(Past);
    let is_former = clause.marks.has(Earlier) && (clause.has(Report) || clause.has(Believe));
    let is_held = is_former
        || clause.has(Past) && clause.has_noun(Earlier)
        || clause.has(Believed) && is_about_me
        || clause.nouns().any(|(_, noun)| noun.head.has(Guess)) && is_old
        || !clause.has_verb() && clause.marks.has(Earlier);
    match context.mood {
        _ if is_void || is_wished => Mood::Void,
        Mood::Asserted | Mood::Weak if is_held => Mood::Held,
        Mood::Asserted if clause.has(Weak) => Mood::Weak,
        mood => mood,
    }
}

/// The mood of a clause behind `that`.
pub fn governed(entities: &Entities, scene: &Scene<'_>) -> Mood {
    let clause = scene.clause;
    let is_own = entities.is(scene.subject, Who::Me);
    let is_evidence = entities.is(scene.subject, Who::Mirror) || is_own;
    let ends_in_source = clause.nouns().last().is_some_and(|(at, _)| entities.is(scene.entities[at], Who::Source));
    let is_denied = clause.has_noun(Not) || [Not, Doubt, Wrong].into_iter().any(|class| clause.has(class));
    // "Another explanation is that"
    let is_other = scene.subject_noun().is_some_and(|noun| noun.all.has(Strange));
    if scene.mood == Mood::Void || entities.is(scene.subject, Who::Source) || ends_in_source || is_denied || is_other {
        return Mood::Void;
    }
    let is_void = clause.verbs().any(|(_, verb)| {
        let is_shown = verb.all.has(Show) && is_evidence && !verb.is_passive() || verb.all.has(Confirm);
        let is_hearsay = verb.all.has(Report) && (!is_own || verb.is_passive()) && !is_shown;
        let is_opinion = is_own && !verb.all.has(Future) && verb.main().has_any(&[Report, Believe]);
        let is_wish = verb.all.has(Unreal) && !is_opinion;
        let is_thought =
            verb.all.has(Believe) && scene.subject_noun().is_some_and(|noun| !noun.is_pronoun() && !noun.is_own());
        is_hearsay || is_wish || is_thought && !is_shown || verb.all.has(Seek) && !verb.main().has(Believe)
    });
    let is_former = clause.has(Believed)
        || !clause.has_verb() && scene.subject_noun().is_some_and(|noun| noun.head.has(Guess))
        || clause.has(Sure) && clause.has(Past)
        || clause.has(Believe) && clause.marks.has(Earlier);
    match scene.mood {
        _ if is_void => Mood::Void,
        _ if is_former => Mood::Held,
        Mood::Asserted if clause.marks.has(Weak) => Mood::Weak,
        mood => mood,
    }
}
