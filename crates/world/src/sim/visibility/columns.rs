//! The pixel counts of a step by trace column, for recordings, replays and recounts.

use crate::experiment::spec::{MOST_MARKS, MOST_PANES};
use crate::sim::visibility::Visibility;
use crate::sim::world::World;

const PANES: [&str; MOST_PANES] = ["pane1_body_px", "pane2_body_px", "pane3_body_px", "pane4_body_px"];
const MARKS: [&str; MOST_MARKS] = ["mark1_px", "mark2_px", "mark3_px", "mark4_px"];

/// The counts of a scene: those of panes if there are several, those of marks if the own body wears several.
pub fn by_column(world: &World, seen: &Visibility) -> Vec<(&'static str, i32)> {
    let scene = world.scene();
    let mut counts = vec![
        ("mirror_self_px", seen.self_px),
        ("mirror_other_px", seen.other_px),
        ("mirror_px", seen.mirror_px),
        ("direct_other_px", seen.direct_other_px),
    ];
    if world.has_own_mark() {
        counts.push(("mirror_mark_px", seen.mark_px));
    }
    if world.has_double() {
        counts.push(("mirror_double_px", seen.double_px));
    }
    // A pane shows the own body or another one, never both.
    let bodies: Vec<u32> = seen.panes.iter().map(|pane| pane.self_px + pane.double_px).collect();
    if let Some(shown) = scene.shown_color() {
        let colors = scene.panes.iter().map(|pane| pane.paint.or_else(|| pane.double.map(|double| double.color)));
        let of_shown = colors.zip(&bodies).filter(|(color, _)| *color == Some(shown));
        counts.push(("shown_px", of_shown.map(|(_, px)| px).sum()));
    }
    if scene.panes.len() > 1 {
        counts.extend(PANES.into_iter().zip(bodies));
    }
    let own = scene.marks.iter().zip(&seen.marks).filter(|(mark, _)| mark.wearer == 0);
    let marks: Vec<u32> = own.map(|(_, sighting)| sighting.mirror_px).collect();
    if marks.len() > 1 {
        counts.extend(MARKS.into_iter().zip(marks));
    }
    counts.into_iter().map(|(column, px)| (column, i32::try_from(px).unwrap_or(i32::MAX))).collect()
}
