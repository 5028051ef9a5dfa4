//! A camera for labels, with which tests compare the visibility that rays find.

use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::label_image::LabelImage;
use mirrorstats_sim::model::{EYE_CAMERA, Item, PaintMode, Stage, labelled};
use mirrorstats_sim::scene::Scene;
use mirrorstats_sim::visibility::Shown;
use mirrorstats_sim::world::World;
use mirrorstats_trace::frame::Frame;

/// A camera for labels: every pixel has the colour of its label, in the mirror too.
pub struct LabelCamera {
    eye: Camera,
    painted: Option<(Scene, (Stage, Vec<Stage>))>,
}

impl LabelCamera {
    pub fn new(config: &WorldConfig, width: usize, height: usize) -> Self {
        Self { eye: Camera::painted(config, PaintMode::Labels, width, height).unwrap(), painted: None }
    }

    /// The label of every pixel, as drawn; a colour without a label counts as the room.
    pub fn labels(&mut self, world: &World) -> LabelImage {
        let mut stages = match self.painted.take() {
            Some((scene, stages)) if scene == *world.scene() => stages,
            _ => Stage::all(world.config(), PaintMode::Labels, world.scene()).unwrap(),
        };
        world.show_on(&mut stages);
        let (stage, beyond) = &stages;
        let direct = self.eye.draw(stage, EYE_CAMERA, None).unwrap();
        let named = |frame: &Frame, at: usize| labelled([frame.rgb[3 * at], frame.rgb[3 * at + 1]]);
        let mut codes: Vec<u8> = (0..direct.width * direct.height)
            .map(|at| match named(&direct, at) {
                Some(Item::Pane(pane)) => Shown::Through(pane, Item::Room),
                item => Shown::Direct(item.unwrap_or(Item::Room)),
            })
            .map(Shown::code)
            .collect();
        for (pane, stage) in beyond.iter().enumerate() {
            let blank = Shown::Through(pane, Item::Room).code();
            if !codes.contains(&blank) {
                continue;
            }
            let seen = self.eye.through(stage, &world.scene().panes[pane], None).unwrap();
            for (at, code) in codes.iter_mut().enumerate().filter(|(_, code)| **code == blank) {
                if let Some(item) = named(&seen, at).filter(|item| !matches!(item, Item::Pane(_))) {
                    *code = Shown::Through(pane, item).code();
                }
            }
        }
        self.painted = Some((world.scene().clone(), stages));
        LabelImage { width: direct.width, height: direct.height, codes }
    }
}
