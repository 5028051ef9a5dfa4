//! The pixel counts, as traces and logs store them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::model::Item;
use super::super::scene::Scene;
use super::view::Shown;
use crate::base::palette::Color;

/// What the eye could see at one step: pixels of the view, out of `view_px`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Census")]
pub struct Visibility {
    /// Pixels of the view.
    pub view_px: u32,
    /// Of the mirror's surface, whatever is seen in it.
    pub mirror_px: u32,
    /// Of the own body by way of the mirror.
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
    pub cubes: Vec<CubeSighting>,
}

/// How much of another agent is in view.
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

/// How much of a cube is in view.
pub type CubeSighting = Sighting;

/// The counts of a tally of codes.
pub(super) fn of_tally(tally: &[u32; 256], scene: &Scene) -> Visibility {
    let count = |shown: Shown| tally[usize::from(shown.code())];
    let sighting = |item: Item, color: Color| Sighting {
        color,
        direct_px: count(Shown::Direct(item)),
        mirror_px: count(Shown::Reflected(item)),
    };
    let others: Vec<Sighting> =
        scene.others.iter().enumerate().map(|(at, other)| sighting(Item::Agent(at + 1), other.color)).collect();
    let cubes: Vec<CubeSighting> =
        scene.cubes.iter().enumerate().map(|(at, cube)| sighting(Item::Cube(at), cube.color)).collect();
    let own = sighting(Item::Agent(0), scene.body_color);
    let mirrored = |sightings: &[Sighting]| sightings.iter().map(|sighting| sighting.mirror_px).sum::<u32>();
    Visibility {
        view_px: tally.iter().sum(),
        mirror_px: count(Shown::Mirror) + own.mirror_px + mirrored(&others) + mirrored(&cubes),
        self_px: own.mirror_px,
        self_direct_px: own.direct_px,
        other_px: mirrored(&others),
        direct_other_px: others.iter().map(|other| other.direct_px).sum(),
        others,
        cubes,
    }
}
