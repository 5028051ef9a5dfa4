use super::millimetres;
use crate::schema::MirrorTable;
use crate::spec::{BodyShown, Paint, Pane, PaneKind, Wall};
use mirrorstats_toml_spec::{At, Fault};

pub(super) fn panes(tables: &[MirrorTable], list: &At<'_>, faults: &mut Vec<Fault>) -> Vec<Pane> {
    let mut panes: Vec<Pane> = Vec::new();
    for (n, table) in tables.iter().enumerate() {
        let at = list.item(n);
        let Some(pane) = pane(table, &at, faults) else { continue };
        let is_across_from_none = pane.wall == Wall::Opposite && panes.is_empty();
        let across = is_across_from_none.then_some("the first mirror is across from no other");
        for message in across.into_iter().chain(quarrel(&panes, pane.wall)) {
            faults.push(at.fault(message).help("use `wall = \"random\"`"));
        }
        panes.push(pane);
    }
    panes
}

/// The reason why a mirror cannot be on a wall together with the earlier ones.
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

fn pane(table: &MirrorTable, at: &At<'_>, faults: &mut Vec<Fault>) -> Option<Pane> {
    let before = faults.len();
    let kind = table.kind.unwrap_or(PaneKind::Mirror);
    let body = table.body.unwrap_or_default();
    let delay = table.delay.unwrap_or_default();
    if kind == PaneKind::Delayed && delay == 0 {
        faults.push(at.key("delay").fault("a mirror of the kind `delayed` needs a `delay` of 1 or more"));
    }
    let shows_a_body = matches!(kind, PaneKind::Decoy | PaneKind::Window);
    for (key, is_misplaced) in
        [("delay", kind == PaneKind::Window), ("color", !shows_a_body), ("body", kind != PaneKind::Decoy)]
    {
        if let Some(at) = at.get(key).filter(|_| is_misplaced) {
            faults.push(at.fault(format!("a mirror of the kind `{}` has no `{key}`", kind.name())));
        }
    }
    let of_another = if shows_a_body && body == BodyShown::Own { Paint::Other } else { Paint::Own };
    let color = table.color.unwrap_or(of_another);
    if kind == PaneKind::Decoy && body == BodyShown::Own && color == Paint::Own {
        let fault = at.fault("a decoy of the own body in its own colour is a mirror");
        faults.push(fault.help("use `color = \"other\"` or `body = \"independent\"`"));
    }
    // A mirror with a delay is a delayed mirror, whichever key says so.
    let kind = if kind == PaneKind::Mirror && delay > 0 { PaneKind::Delayed } else { kind };
    let [width_mm, height_mm, bottom_mm] =
        [table.width, table.height, table.bottom].map(|length| length.map(millimetres));
    let pane = Pane { kind, delay, color, body, wall: table.wall.unwrap_or_default(), width_mm, height_mm, bottom_mm };
    (faults.len() == before).then_some(pane)
}
