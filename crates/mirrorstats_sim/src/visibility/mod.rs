//! Ground truth: the content of each pixel of the eye's view, by ray casting.
//!
//! A ray goes from the eye through the middle of a pixel to the nearest surface. At a pane it continues: all rays
//! through a pane start from one point ([`super::mirror_eye`]), so each pane is another view over the same pixels. Its
//! stage has the bodies that the pane shows, with its delay. A window is a view into the same room from further back,
//! so there too, rays that hit nothing else hit walls.
//!
//! Rule: visibility is pure geometry, in closed forms, at the full size of the view. It needs no picture and misses
//! nothing visible in one. The own body is not excluded from the direct view: a test shows that it never appears there.

mod cast;
mod count;
mod places;
mod shape;
mod truths;
mod view;

pub use count::{PaneSighting, Sighting, Visibility, columns};
pub use places::SelfVisibility;
pub use view::{RayView, Shown};

use super::label_image::{LabelImage, Rectangle};
use super::model::{Item, Stage};
use super::world::World;

impl World {
    pub fn labels(&self) -> &LabelImage {
        let eye = &self.config().eye;
        self.labels.get_or_init(|| labels(self, eye.width as usize, eye.height_px as usize))
    }

    pub fn visibility(&self) -> Visibility {
        let mut tally = [0_u32; 256];
        for code in &self.labels().codes {
            tally[usize::from(*code)] += 1;
        }
        count::of_tally(&tally, self.scene())
    }

    /// Returns true if mirror evidence is in view, by the configured threshold.
    pub const fn is_mirror_visible(&self, visibility: &Visibility) -> bool {
        visibility.self_px >= self.config().evidence.mirror_self_px
    }
}

/// Returns, per geom, true if it may appear within these pixels of a view of this size; others do not change the
/// picture. The room always may.
pub(crate) fn in_view(world: &World, stage: &Stage, size: [usize; 2], within: Rectangle) -> Vec<bool> {
    let view = RayView::of_eye(world, size[0], size[1]);
    let view = stage.pane.map_or(view, |pane| view.through(world, &world.scene().panes[pane]));
    let is_in_view = |(geom, item): (usize, &Item)| {
        *item == Item::Room
            || (stage.is_shown(geom)
                && shape::solid(stage, geom).rectangle(&view).is_some_and(|rectangle| rectangle.meets(within)))
    };
    stage.items.iter().enumerate().map(is_in_view).collect()
}

pub fn labels(world: &World, width: usize, height: usize) -> LabelImage {
    let mut codes = Vec::with_capacity(width * height);
    cast::rows(world, width, height, |row| codes.extend_from_slice(row));
    LabelImage { width, height, codes }
}
