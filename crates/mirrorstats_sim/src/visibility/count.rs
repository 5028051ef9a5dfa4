//! The pixel counts of a step, as stored in logs and in the columns of traces.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::model::Item;
use super::super::scene::{HungPane, Scene};
use super::view::Shown;
use crate::world::World;
use mirrorstats_experiment::spec::{PaneKind, is_default};
use mirrorstats_trace::episodes::episode::Extra;
use mirrorstats_trace::schema::colors::Color;

/// The visible pixels of one step, out of `view_px`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Census")]
pub struct Visibility {
    /// Pixels of the view.
    pub view_px: u32,
    /// Of all panes, whatever is seen in them.
    pub mirror_px: u32,
    /// Of the own body by way of a mirror, in whatever colour it shows it; marks on it are part of it.
    pub self_px: u32,
    /// Of the own body directly; the eye is placed so that this is always 0.
    pub self_direct_px: u32,
    /// Of all other agents by way of the mirror.
    pub other_px: u32,
    /// Of all other agents directly.
    pub direct_other_px: u32,
    /// Each other agent, in the order of the scene.
    pub others: Vec<Sighting>,
    /// Each cube, in the order of the scene.
    pub cubes: Vec<Sighting>,
    /// Of marks on the own body by way of a mirror.
    #[serde(default, skip_serializing_if = "is_default")]
    pub mark_px: u32,
    /// Of bodies that a pane alone shows: in place of the own one, or behind a window.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(crate) double_px: u32,
    /// The hand of a reaching task.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hand: Option<Sighting>,
    /// Each mark, in the order of the scene.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub marks: Vec<Sighting>,
    /// Each pane, in the order of the scene, where there are several or one that is no plain mirror.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub panes: Vec<PaneSighting>,
}

/// The visible pixels of a pane, and of its contents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PaneSighting {
    /// Of its surface, whatever is seen in it.
    pub px: u32,
    /// Of the own body in it, marks on it included.
    pub self_px: u32,
    /// Of other agents of the room in it.
    pub other_px: u32,
    /// Of the body that it alone shows.
    pub(crate) double_px: u32,
    /// Of marks on the own body in it.
    pub mark_px: u32,
}

/// The visible pixels of another agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sighting {
    /// Of its body.
    pub color: Color,
    /// Pixels that show it directly.
    pub direct_px: u32,
    /// Pixels that show it by way of the mirror.
    pub mirror_px: u32,
}

pub(super) fn of_tally(tally: &[u32; 256], scene: &Scene) -> Visibility {
    let counts = Counts { tally, scene };
    let others: Vec<Sighting> =
        scene.others.iter().enumerate().map(|(at, other)| counts.body(at + 1, other.color)).collect();
    let cubes: Vec<Sighting> =
        scene.cubes.iter().enumerate().map(|(at, cube)| counts.sighting(Item::Cube(at), cube.color)).collect();
    let marks: Vec<Sighting> =
        scene.marks.iter().enumerate().map(|(at, mark)| counts.sighting(Item::Mark(at), mark.color)).collect();
    let panes: Vec<PaneSighting> = (0..scene.panes.len()).map(|pane| counts.pane(pane)).collect();
    let own = counts.body(0, scene.body_color);
    let sum = |part: fn(&PaneSighting) -> u32| panes.iter().map(part).sum::<u32>();
    let is_plain = matches!(scene.panes.as_slice(), [] | [HungPane { kind: PaneKind::Mirror, .. }]);
    Visibility {
        view_px: tally.iter().sum(),
        mirror_px: sum(|pane| pane.px),
        self_px: own.mirror_px,
        self_direct_px: own.direct_px,
        other_px: sum(|pane| pane.other_px),
        direct_other_px: others.iter().map(|other| other.direct_px).sum(),
        others,
        cubes,
        mark_px: sum(|pane| pane.mark_px),
        double_px: sum(|pane| pane.double_px),
        hand: scene.hand.map(|hand| counts.sighting(Item::Hand, hand.color)),
        marks,
        panes: if is_plain { Vec::new() } else { panes },
    }
}

struct Counts<'a> {
    tally: &'a [u32; 256],
    scene: &'a Scene,
}

impl Counts<'_> {
    fn pixels(&self, shown: Shown) -> u32 {
        self.tally[usize::from(shown.code())]
    }

    fn sighting(&self, item: Item, color: Color) -> Sighting {
        let through = (0..self.scene.panes.len()).map(|pane| self.pixels(Shown::Through(pane, item)));
        Sighting { color, direct_px: self.pixels(Shown::Direct(item)), mirror_px: through.sum() }
    }

    fn marks(&self, wearer: usize) -> impl Iterator<Item = Item> {
        let marks = self.scene.marks.iter().enumerate().filter(move |(_, mark)| mark.wearer == wearer);
        marks.map(|(at, _)| Item::Mark(at))
    }

    fn body(&self, agent: usize, color: Color) -> Sighting {
        let parts = self.marks(agent).chain([Item::Agent(agent)]).map(|item| self.sighting(item, color));
        parts.fold(Sighting { color, direct_px: 0, mirror_px: 0 }, |sum, part| Sighting {
            color,
            direct_px: sum.direct_px + part.direct_px,
            mirror_px: sum.mirror_px + part.mirror_px,
        })
    }

    fn pane(&self, pane: usize) -> PaneSighting {
        let through = |item: Item| self.pixels(Shown::Through(pane, item));
        let body = |agent: usize| through(Item::Agent(agent)) + self.marks(agent).map(through).sum::<u32>();
        let (self_px, double_px) = (body(0), through(Item::Double));
        let other_px = (1..=self.scene.others.len()).map(body).sum::<u32>();
        let cubes = (0..self.scene.cubes.len()).map(|at| through(Item::Cube(at))).sum::<u32>();
        PaneSighting {
            px: through(Item::Room) + self_px + other_px + double_px + cubes + through(Item::Hand),
            self_px,
            other_px,
            double_px,
            mark_px: self.marks(0).map(through).sum(),
        }
    }
}

/// Adds the columns of a step: those of panes if there are several, those of marks if the own body wears several.
pub fn columns(world: &World, seen: &Visibility, others: Extra) -> Extra {
    let scene = world.scene();
    // A pane shows the own body or another one, never both.
    let bodies: Vec<u32> = seen.panes.iter().map(|pane| pane.self_px + pane.double_px).collect();
    let shown = scene.shown_color().map(|shown| {
        let colors = scene.panes.iter().map(HungPane::shown_color);
        colors.zip(&bodies).filter(|(color, _)| *color == Some(shown)).map(|(_, px)| px).sum()
    });
    let has_double = scene.panes.iter().any(|pane| pane.double.is_some());
    let own = scene.marks.iter().zip(&seen.marks).filter(|(mark, _)| mark.wearer == 0);
    let marks: Vec<u32> = own.map(|(_, sighting)| sighting.mirror_px).collect();
    let [pane1_body_px, pane2_body_px, pane3_body_px, pane4_body_px] = several(&bodies);
    let [mark1_px, mark2_px, mark3_px, mark4_px] = several(&marks);
    Extra {
        mirror_self_px: Some(narrow(seen.self_px)),
        mirror_other_px: Some(narrow(seen.other_px)),
        mirror_px: Some(narrow(seen.mirror_px)),
        direct_other_px: Some(narrow(seen.direct_other_px)),
        mirror_mark_px: world.has_own_mark().then(|| narrow(seen.mark_px)),
        mirror_double_px: has_double.then(|| narrow(seen.double_px)),
        shown_px: shown.map(narrow),
        pane1_body_px,
        pane2_body_px,
        pane3_body_px,
        pane4_body_px,
        mark1_px,
        mark2_px,
        mark3_px,
        mark4_px,
        ..others
    }
}

fn several(counts: &[u32]) -> [Option<i32>; 4] {
    [0, 1, 2, 3].map(|at| counts.get(at).filter(|_| counts.len() > 1).copied().map(narrow))
}

fn narrow(px: u32) -> i32 {
    i32::try_from(px).unwrap_or(i32::MAX)
}
