//! The keys of a reaching task: the hand, the picture, and what fits only together.

use super::{in_order, millimetres};
use crate::experiment::spec::{Actions, Decision, Hand, Part, Picture, Spec, Start, Truth, Wearer};
use toml_spec::Keys;
use toml_spec::{Fault, Place};

/// The furthest that a hand starts from the mark, steps.
const FURTHEST: u32 = 40;

/// `hand = { step = 0.1, least = 6, most = 12, within = 1, extra_steps = 10 }`
pub(super) fn hand(keys: &mut Keys<'_>, faults: &mut Vec<Fault>) -> Option<Hand> {
    let mut keys = keys.table("hand", faults)?;
    let step = keys.length("step", [0.02, 0.5], faults).map_or(100, |(step, _)| millimetres(step));
    let least = keys.count("least", [2, FURTHEST], faults);
    let most = keys.count("most", [2, FURTHEST], faults);
    let bounds = [&least, &most].map(|count| count.as_ref().map(|(count, _)| *count));
    in_order(least.as_ref(), most.as_ref(), faults);
    let within = keys.count("within", [1, FURTHEST], faults);
    if let (Some((within, place)), [Some(least), _]) = (&within, bounds)
        && *within >= least
    {
        let message = format!("`within` is {within}, and the hand may start {least} steps from the mark");
        faults.push(Fault::new(place.clone(), message).help("reached at the start is no task: use a larger `least`"));
    }
    let extra_steps = keys.count("extra_steps", [0, 1000], faults).map_or(10, |(steps, _)| steps);
    keys.refuse_the_rest(faults);
    let least = bounds[0].unwrap_or(6).min(bounds[1].unwrap_or(FURTHEST));
    let most = bounds[1].unwrap_or_else(|| least.max(12));
    Some(Hand { step_mm: step, least, most, within: within.map_or(1, |(within, _)| within), extra_steps })
}

/// `view = { width = 1024, height = 1024, fovy = 60 }`
pub(super) fn view(keys: &mut Keys<'_>, faults: &mut Vec<Fault>) -> Option<Picture> {
    let mut keys = keys.table("view", faults)?;
    let width = keys.count("width", [16, 1920], faults).map_or(640, |(width, _)| width);
    let height = keys.count("height", [12, 1440], faults).map_or(480, |(height, _)| height);
    let fovy = keys.count("fovy", [30, 115], faults).map_or(60, |(fovy, _)| fovy);
    keys.refuse_the_rest(faults);
    Some(Picture { width, height, fovy })
}

/// What a hand needs, and what needs a hand.
pub(super) fn relations(spec: &Spec, hand: &Place, faults: &mut Vec<Fault>) {
    let mut refuse = |message: &str, help: &str| faults.push(Fault::new(hand.clone(), message).help(help));
    let fronts = spec.marks.iter().filter(|mark| mark.part == Part::Front);
    let has_hand = spec.hand.is_some();
    if (spec.actions == Actions::Hand) != has_hand {
        refuse(
            "the actions are those of a hand where there is one, and else no others",
            "leave `actions` out, or add `hand = {}`",
        );
    }
    if (spec.decision == Decision::TargetDistance) != has_hand || (spec.truth == Truth::StartDistance) != has_hand {
        refuse(
            "a hand is held against its distance to the mark, and nothing else is",
            "leave `decision` and `truth` out",
        );
    }
    let is_target = |(on, from_t): (Wearer, u32)| on == Wearer::Own && from_t == 1;
    match (has_hand, fronts.map(|mark| (mark.on, mark.from_t)).collect::<Vec<_>>().as_slice()) {
        (true, [mark]) if is_target(*mark) => {}
        (true, _) => refuse(
            "the hand needs one mark to reach",
            "add one with `part = \"front\"`, on the own body from the start",
        ),
        (false, []) => {}
        (false, _) => refuse("a mark on the front is there to be reached", "add `hand = {}`, or choose another `part`"),
    }
    if has_hand && spec.layout.start != Start::BeforeMirror {
        refuse("who reaches stands still before the mirror", "add `start = \"before_mirror\"`");
    }
}
