//! A camera for labels, with which tests compare the visibility that rays find.

use crate::camera::{Camera, CameraError};
use crate::config::WorldConfig;
use crate::label_image::LabelImage;
use crate::model::{EYE_CAMERA, Item, PaintMode, Stage, labelled};
use crate::scene::Scene;
use crate::visibility::Shown;
use crate::world::World;
use mirrorstats_trace::episodes::frame::Frame;

/// A camera for labels: every pixel has the colour of its label, in the mirror too.
pub struct LabelCamera {
    eye: Camera,
    painted: Option<(Scene, (Stage, Vec<Stage>))>,
}

impl LabelCamera {
    pub fn new(config: &WorldConfig, width: usize, height: usize) -> Result<Self, CameraError> {
        Ok(Self { eye: Camera::painted(config, PaintMode::Labels, width, height)?, painted: None })
    }

    /// The label of every pixel, as drawn; a colour without a label counts as the room.
    pub fn labels(&mut self, world: &World) -> Result<LabelImage, CameraError> {
        let mut stages = match self.painted.take() {
            Some((scene, stages)) if scene == *world.scene() => stages,
            _ => Stage::all(world.config(), PaintMode::Labels, world.scene())?,
        };
        world.show_on(&mut stages);
        let (stage, beyond) = &stages;
        let direct = self.eye.draw(stage, EYE_CAMERA, None)?;
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
            let seen = self.eye.through(stage, &world.scene().panes[pane], None)?;
            for (at, code) in codes.iter_mut().enumerate().filter(|(_, code)| **code == blank) {
                if let Some(item) = named(&seen, at).filter(|item| !matches!(item, Item::Pane(_))) {
                    *code = Shown::Through(pane, item).code();
                }
            }
        }
        self.painted = Some((world.scene().clone(), stages));
        Ok(LabelImage { width: direct.width, height: direct.height, codes })
    }
}
