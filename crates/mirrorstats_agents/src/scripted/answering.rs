//! Answers that an experiment declares: from what an agent has seen, or by chance.
//!
//! Rule: agents get no ground truth. An agent that looks answers what it believes it has seen. All other answers are
//! `unknown` if that is allowed, and absent otherwise.

use crate::Answers;
use mirrorstats_experiment::Spec;
use mirrorstats_experiment::spec::{Answer, AnswerType, Fact, UNKNOWN};
use mirrorstats_trace::episodes::answers::Answered;
use mirrorstats_trace::schema::colors::Color;

use super::chance::Chance;
use super::knowledge::Knowledge;
use super::policy::{Belief, Policy};

/// The bound of randomly drawn whole numbers.
const NUMBERS: u32 = 10;

pub fn by_evidence(
    experiment: &Spec,
    known: &Knowledge,
    policy: &mut impl Policy,
    (belief, mark): (Belief, Option<Color>),
) -> Answers {
    let text = |text: &str| Some(Answered::Text(text.to_owned()));
    let mut answered = |answer: &Answer| match answer.truth? {
        Fact::BodyColor => text(belief.claim?.name()),
        Fact::MarkColor => text(mark?.name()),
        Fact::MirrorPlace => {
            let at = policy.place(known, belief, answer.options.len())?;
            text(answer.options.get(at)?)
        }
        Fact::PoseX => Some(Answered::Number(known.pose.place.x)),
        Fact::PoseY => Some(Answered::Number(known.pose.place.y)),
        Fact::PoseYaw => Some(Answered::Number(known.pose.heading.degrees())),
        Fact::MirrorVisible | Fact::Others => None,
    };
    let mut or_unknown =
        |answer: &Answer| answered(answer).or_else(|| answer.unknown.then(|| Answered::Text(UNKNOWN.to_owned())));
    let all = experiment.answers.iter();
    all.filter_map(|answer| Some((answer.key.clone(), or_unknown(answer)?))).collect()
}

pub fn may_come(experiment: &Spec, answers: &Answers) -> bool {
    let is_text = |answer: &Answer, words: &[String]| matches!(answers.get(&answer.key), Some(Answered::Text(text)) if words.contains(text));
    let is_open = |answer: &Answer| answer.truth == Some(Fact::MirrorPlace) && !is_text(answer, &answer.options);
    experiment.answers.iter().any(is_open)
}

pub fn by_chance(experiment: &Spec, chance: &mut Chance) -> Answers {
    let mut draw = |answer: &Answer| {
        let words: Vec<&str> = answer.words().into_iter().filter(|word| *word != UNKNOWN).collect();
        match answer.kind {
            AnswerType::Color => {
                chance.pick(&experiment.layout.palette).map(|color| color.name().to_owned()).map(Answered::Text)
            }
            AnswerType::OneOf | AnswerType::YesNo => chance.pick(&words).map(|word| Answered::Text(word.to_owned())),
            AnswerType::Number => chance.pick(&(0..NUMBERS).collect::<Vec<_>>()).map(f64::from).map(Answered::Number),
        }
    };
    experiment.answers.iter().filter_map(|answer| Some((answer.key.clone(), draw(answer)?))).collect()
}
