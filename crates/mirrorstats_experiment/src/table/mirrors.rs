use super::millimetres;
use crate::schema::MirrorTable;
use crate::spec::{BodyShown, Paint, Pane, PaneKind, Wall};
use mirrorstats_toml_spec::{At, Fault};

pub(super) fn panes(tables: &[MirrorTable], list: &At<'_>, faults: &mut Vec<Fault>) -> Vec<Pane> {
    let mut panes: Vec<Pane> = Vec::new();
    for (table, at) in tables.iter().zip(list.items()) {
        let Some(pane) = pane(table, &at, faults) else { continue };
        let message = match (panes.first(), pane.wall) {
            (None, Wall::Opposite) => Some("the first mirror is across from no other"),
            (None, Wall::Same) => Some("the first mirror is beside no other"),
            (Some(first), wall) if first.wall == Wall::Random && wall.quarter().is_some() => {
                Some("the wall of the first mirror is drawn, and could be this one")
            }
            _ => None,
        };
        faults.extend(message.map(|message| at.fault(message).help("use `wall = \"random\"`")));
        panes.push(pane);
    }
    panes
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
    let MirrorTable { from_t, until_t, .. } = *table;
    if let (Some(from_t), Some(until_t)) = (from_t, until_t)
        && from_t > until_t
    {
        let fault = at.key("until_t").fault(format!("`until_t` is {until_t}, before `from_t`, which is {from_t}"));
        faults.push(fault.help(format!("use `until_t = {from_t}` or more")));
    }
    let (wall, frame) = (table.wall.unwrap_or_default(), table.frame.unwrap_or_default());
    let pane = Pane { kind, delay, color, body, wall, width_mm, height_mm, bottom_mm, from_t, until_t, frame };
    (faults.len() == before).then_some(pane)
}
