//! Ground truth: what each pixel of the eye's view shows, by casting its ray.
//!
//! A ray goes from the eye through the middle of a pixel to the nearest surface. Where that is a pane, it goes on from
//! there: all rays through a pane start from one point ([`super::passage`]), so that each pane is another view over the
//! same pixels, of a stage with the bodies that it shows, as late as it shows them. A window is a view into the same
//! room from further back, so that there too the walls are what is seen where nothing else is.
//!
//! Rule: visibility is geometry alone, in closed forms, at the full size of the view. It needs no picture and misses
//! nothing that a picture shows. The own body is not left out of the direct view: that it never shows there is what a
//! test finds, not an assumption.

mod cast;
pub(crate) mod columns;
mod count;
mod shape;
mod truths;
mod view;

pub use count::{CubeSighting, PaneSighting, Sighting, Visibility};
pub use view::Shown;

use view::View;

use super::label_image::{LabelImage, Rectangle};
use super::model::{Item, Look, ModelError, Paint, Stage};
use super::world::World;

impl World {
    /// The label of every pixel of the eye's view.
    pub fn labels(&self) -> &LabelImage {
        let eye = &self.config().eye;
        self.labels_or(|| labels(self, eye.width as usize, eye.height_px as usize))
    }

    /// The visible pixels of everything, directly and by way of the mirror.
    pub fn visibility(&self) -> Visibility {
        take(self)
    }

    /// Returns true if there is mirror evidence in view, by the configured threshold.
    pub const fn is_mirror_visible(&self, visibility: &Visibility) -> bool {
        visibility.self_px >= self.config().evidence.mirror_self_px
    }
}

fn take(world: &World) -> Visibility {
    let mut tally = [0_u32; 256];
    for code in &world.labels().codes {
        tally[usize::from(*code)] += 1;
    }
    count::of_tally(&tally, world.scene())
}

/// Which geoms of a stage may be in a view of some size, within some pixels: the others change no picture. The room always
/// may.
pub(in crate::sim) fn in_view(world: &World, stage: &Stage, size: [usize; 2], within: Rectangle) -> Vec<bool> {
    let view = View::of_eye(world, size[0], size[1]);
    let view = match stage.look() {
        Look::Direct => view,
        Look::Through(pane) => view.through(world, &world.scene().panes[pane]),
    };
    let is_in_view = |(geom, item): (usize, &Item)| {
        *item == Item::Room
            || (stage.is_shown(geom)
                && shape::solid(stage, geom).rectangle(&view).is_some_and(|rectangle| rectangle.meets(within)))
    };
    stage.items().iter().enumerate().map(is_in_view).collect()
}

/// The label of every pixel of a view of some size.
pub fn labels(world: &World, width: usize, height: usize) -> LabelImage {
    let mut codes = Vec::with_capacity(width * height);
    cast::rows(world, width, height, |row| codes.extend_from_slice(row));
    LabelImage { width, height, codes }
}

/// The same with a loop over MuJoCo's own rays, which takes fifty times as long: what the counts are tested against.
pub fn labels_by_mujoco(world: &World, width: usize, height: usize) -> Result<LabelImage, ModelError> {
    let mut stages = world.stages(Paint::Lit)?;
    Ok(view::by_mujoco(world, &mut stages, width, height))
}
