//! Mirrors and windows, key by key.

use super::{millimetres, missing, no_color, pairs};
use crate::experiment::limits::LATEST;
use crate::experiment::spec::{BodyShown, MOST_PANES, Paint, Pane, PaneKind, Wall};
use toml_spec::Keys;
use toml_spec::{Fault, Place};
use trace::palette::Color;

/// The `[[experiment.NAME.mirror]]` tables.
pub(super) fn panes(keys: &mut Keys<'_>, faults: &mut Vec<Fault>) -> Vec<Pane> {
    let mut panes: Vec<Pane> = Vec::new();
    for (place, keys) in keys.list("mirror", MOST_PANES, faults).unwrap_or_default() {
        let Some(pane) = pane(&place, keys, faults) else { continue };
        if pane.wall == Wall::Opposite && panes.is_empty() {
            let message = "the first mirror is across from no other";
            faults.push(Fault::new(place.clone(), message).help("use `wall = \"random\"`"));
        }
        if let Some(message) = quarrel(&panes, pane.wall) {
            faults.push(Fault::new(place.clone(), message).help("use `wall = \"random\"`"));
        }
        panes.push(pane);
    }
    panes
}

/// Why a mirror cannot be on a wall beside those before it.
fn quarrel(before: &[Pane], wall: Wall) -> Option<&'static str> {
    let first = before.first()?.wall.quarter();
    let across = first.map(|quarter| (quarter + 2) % 4);
    let quarter = |wall: Wall| if wall == Wall::Opposite { across } else { wall.quarter() };
    match wall {
        Wall::Random => None,
        Wall::Opposite if before.iter().any(|pane| pane.wall == Wall::Opposite) => Some("two mirrors on one wall"),
        Wall::Opposite | Wall::East | Wall::North | Wall::West | Wall::South => {
            let own = quarter(wall);
            if own.is_some() && before.iter().any(|pane| quarter(pane.wall) == own) {
                Some("two mirrors on one wall")
            } else if first.is_none() && wall != Wall::Opposite {
                Some("the wall of the first mirror is drawn, and could be this one")
            } else {
                None
            }
        }
    }
}

fn pane(place: &Place, mut keys: Keys<'_>, faults: &mut Vec<Fault>) -> Option<Pane> {
    let before = faults.len();
    let kind = keys.choice("kind", &pairs(PaneKind::ALL, PaneKind::name), faults).unwrap_or(PaneKind::Mirror);
    let least = u32::from(kind == PaneKind::Delayed);
    let delay = keys.count("delay", [least, LATEST], faults);
    let color = keys.text("color", faults);
    let body_place = keys.value_place("body");
    let body = keys.choice("body", &pairs(BodyShown::ALL, BodyShown::name), faults).unwrap_or_default();
    let wall = keys.choice("wall", &pairs(Wall::ALL, Wall::name), faults).unwrap_or_default();
    let width_mm = keys.length("width", [0.5, 10.0], faults).map(|(width, _)| millimetres(width));
    let height_mm = keys.length("height", [0.5, 5.0], faults).map(|(height, _)| millimetres(height));
    let bottom_mm = keys.length("bottom", [0.0, 3.0], faults).map(|(bottom, _)| millimetres(bottom));
    keys.refuse_the_rest(faults);
    let misplaced =
        |key: &str, place: Place| Fault::new(place, format!("a mirror of the kind `{}` has no `{key}`", kind.name()));
    match (&delay, kind) {
        (None, PaneKind::Delayed) => faults.push(missing(place, "delay", "5")),
        (Some((_, at)), PaneKind::Window) => faults.push(misplaced("delay", at.clone())),
        _ => {}
    }
    let shows_a_body = matches!(kind, PaneKind::Decoy | PaneKind::Window);
    let color = match color {
        None if shows_a_body && body == BodyShown::Own => Paint::Other,
        None => Paint::Own,
        Some((_, at)) if !shows_a_body => {
            faults.push(misplaced("color", at));
            Paint::Own
        }
        Some((name, at)) => paint(&name, at, faults),
    };
    if let Some(at) = body_place.filter(|_| kind != PaneKind::Decoy) {
        faults.push(misplaced("body", at));
    }
    if kind == PaneKind::Decoy && body == BodyShown::Own && color == Paint::Own {
        let fault = Fault::new(place.clone(), "a decoy of the own body in its own colour is a mirror");
        faults.push(fault.help("use `color = \"other\"` or `body = \"independent\"`"));
    }
    let delay = delay.map(|(delay, _)| delay).unwrap_or_default();
    // A mirror that is late is a late mirror, by whichever key it says so.
    let kind = if kind == PaneKind::Mirror && delay > 0 { PaneKind::Delayed } else { kind };
    (faults.len() == before).then_some(Pane { kind, delay, color, body, wall, width_mm, height_mm, bottom_mm })
}

fn paint(name: &str, place: Place, faults: &mut Vec<Fault>) -> Paint {
    match (name, Color::named(name)) {
        ("own", _) => Paint::Own,
        ("other", _) => Paint::Other,
        (_, Some(color)) => Paint::Named(color),
        (_, None) => {
            faults.push(no_color(name, place).help("or `own`, or `other`"));
            Paint::Own
        }
    }
}
