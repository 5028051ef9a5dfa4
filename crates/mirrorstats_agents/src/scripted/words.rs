//! The words of a scripted reply: short and true of what the agent saw and believes, for readers of the log.

use crate::Words;
use crate::perception::things::Thing;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::schema::colors::Color;

use super::knowledge::Knowledge;
use super::policy::Belief;

pub fn describe(known: &Knowledge, belief: Belief, action: Action, selected: Option<Color>) -> Words {
    let cubes = named(&known.cubes_in_view, "cube", "cubes");
    let bodies = named(&known.bodies, "body", "bodies");
    Words {
        view_description: Some(format!("In view: {cubes}; {bodies}.")),
        reasoning: Some(reasoning(known, belief, selected)),
        summary: Some(format!("At ({:.1}, {:.1}); next: {}.", known.pose.place.x, known.pose.place.y, action.name())),
        identification: Some(identification(belief.claim)),
    }
}

/// The words of an agent that does not look into the mirror.
pub fn plain(view: &str, reasoning: &str, summary: &str, claim: Option<Color>) -> Words {
    Words {
        view_description: Some(view.to_owned()),
        reasoning: Some(reasoning.to_owned()),
        summary: Some(summary.to_owned()),
        identification: Some(identification(claim)),
    }
}

fn identification(claim: Option<Color>) -> String {
    claim.map_or_else(|| "unknown".to_owned(), |color| format!("My body is {}.", color.name()))
}

fn reasoning(known: &Knowledge, belief: Belief, selected: Option<Color>) -> String {
    let mirror = if known.room.has_mirror() { "One of the walls is a mirror" } else { "I have seen no mirror" };
    let tests = known.reflection.matches();
    let body = match (belief.claim, tests) {
        (None, 0) => "I have not seen my own body".to_owned(),
        (None, _) => format!("a body stands where mine would be reflected ({tests} looks so far)"),
        (Some(color), _) => format!("I hold my body to be {}", color.name()),
    };
    match selected {
        Some(color) => format!("{mirror}; {body}; I choose the {} cube.", color.name()),
        None => format!("{mirror}; {body}."),
    }
}

fn named(things: &[Thing], one: &str, many: &str) -> String {
    let mut colors: Vec<&str> = things.iter().map(|thing| thing.color.name()).collect();
    colors.sort_unstable();
    match colors.len() {
        0 => format!("no {one}"),
        1 => format!("1 {one} ({})", colors[0]),
        count => format!("{count} {many} ({})", colors.join(", ")),
    }
}
