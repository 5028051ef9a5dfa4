//! The world of an experiment, and the world that its scenes are drawn in.

use super::{WorldConfig, metres};
use mirrorstats_experiment::Spec;
use mirrorstats_experiment::spec::{CameraKind, Cubes, Layout, Occluders, Others};

/// The camera behind the body: ahead of its axis and above the floor, m, and below the horizon, degrees. The slope
/// leads to a point 1.7 m above the body's spot, 0.3 m down on 1.1 m ahead, with no more digits than recordings keep.
const BEHIND: (f64, f64, f64) = (-1.1, 2.0, 15.255_118_7);

fn put(place: &mut u32, value: Option<u32>) {
    *place = value.unwrap_or(*place);
}

impl WorldConfig {
    /// The world for an experiment, whose lengths and counts override this configuration.
    #[must_use]
    pub fn for_experiment(&self, experiment: &Spec) -> Self {
        let mut world = self.with_counts(&experiment.layout);
        put(&mut world.episode.steps, experiment.steps);
        if let Some(millimetres) = experiment.step_length_mm {
            world.body.step_length = metres(millimetres);
        }
        if let Some(picture) = experiment.view {
            (world.eye.width, world.eye.height_px) = (picture.width, picture.height);
            world.eye.fovy = f64::from(picture.fovy);
            world.eye.height = picture.eye_height_mm.map_or(world.eye.height, metres);
        }
        world.look = experiment.look;
        world.body.shape = experiment.body.unwrap_or(world.body.shape);
        if experiment.camera == CameraKind::Behind {
            (world.eye.forward, world.eye.height, world.eye.pitch) = BEHIND;
        }
        world
    }

    /// The world that the scenes of a layout are drawn in. It ignores an experiment's own steps and view, so that
    /// experiments with a common layout have common scenes. A narrower view than the default one is ignored too: the mirror
    /// that it must not show at the start is then out of its view as well.
    pub(crate) fn for_layout(&self, layout: &Layout) -> Self {
        let mut world = self.with_counts(layout);
        let default = Self::default().eye;
        if world.eye.half_extent()[0] <= default.half_extent()[0] {
            (world.eye.fovy, world.eye.width, world.eye.height_px) = (default.fovy, default.width, default.height_px);
        }
        world
    }

    fn with_counts(&self, layout: &Layout) -> Self {
        let mut world = self.clone();
        let Others { least, most, twin_percent, .. } = layout.others;
        put(&mut world.others.least, least);
        put(&mut world.others.most, most);
        put(&mut world.others.twin_percent, twin_percent);
        world.others.least = world.others.least.min(world.others.most);
        if let Cubes::Clutter { least, most, hides, occluders } = layout.cubes {
            if occluders == Occluders::Random {
                (world.clutter.hides_percent, world.clutter.stack_percent) = (0, 0);
            }
            put(&mut world.clutter.hides_percent, hides);
            put(&mut world.clutter.least, least);
            put(&mut world.clutter.most, most);
            world.clutter.least = world.clutter.least.min(world.clutter.most);
        }
        world
    }
}
