//! A reaching task: the hand, and the constraints between keys.

use super::{in_order, millimetres};
use crate::schema::HandTable;
use crate::spec::{Actions, Decision, Hand, Part, Spec, Start, Truth, Wearer};
use mirrorstats_toml_spec::{At, Fault};

/// `hand = { step = 0.1, least = 6, most = 12, within = 1, extra_steps = 10 }`
pub(super) fn hand(table: HandTable, at: &At<'_>, faults: &mut Vec<Fault>) -> Hand {
    in_order(at, table.least, table.most, faults);
    let within = table.within.unwrap_or(1);
    if let Some(least) = table.least.filter(|least| table.within.is_some_and(|within| within >= *least)) {
        let message = format!("`within` is {within}, and the hand may start {least} steps from the mark");
        let fault = at.key("within").fault(message);
        faults.push(fault.help("the mark is already reached at the start: use a larger `least`"));
    }
    let least = table.least.unwrap_or(6).min(table.most.unwrap_or(u32::MAX));
    let most = table.most.unwrap_or_else(|| least.max(12));
    let step_mm = table.step.map_or(100, millimetres);
    Hand { step_mm, least, most, within, extra_steps: table.extra_steps.unwrap_or(10) }
}

pub(super) fn relations(spec: &Spec, at: &At<'_>, faults: &mut Vec<Fault>) {
    let hand = at.key("hand");
    let mut refuse = |message: &str, help: &str| faults.push(hand.fault(message).help(help));
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
            "the decision of a hand is its distance to the mark, and only a hand has this decision",
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
