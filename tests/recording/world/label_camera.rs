//! A camera for labels, with which tests compare the visibility that rays find.

use std::sync::Arc;

use mirrorstats_experiment::spec::Look;
use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::label_image::LabelImage;
use mirrorstats_sim::model::{EYE_CAMERA, Item, Stage};
use mirrorstats_sim::scene::Scene;
use mirrorstats_sim::visibility::Shown;
use mirrorstats_sim::world::World;
use mirrorstats_trace::frame::Frame;

/// The distance of neighbouring labels, out of 255 levels.
const STEP: u8 = 8;

/// A camera for labels: every pixel has the colour of its label, in the mirror too.
pub struct LabelCamera {
    eye: Camera,
    painted: Option<(Scene, Vec<Stage>)>,
}

impl LabelCamera {
    pub fn new(config: &WorldConfig, width: u32, height: u32) -> Self {
        let mut config = config.clone();
        let eye = &mut config.eye;
        // No smoothing, and parts as round as possible, since rays meet round ones.
        (eye.width, eye.height_px, eye.samples) = (width, height, 0);
        (eye.slices, eye.stacks, eye.quads) = (40, 24, 2);
        Self { eye: Camera::new(&config).unwrap(), painted: None }
    }

    /// The label of every pixel, as drawn; a colour without a label counts as the room.
    pub fn labels(&mut self, world: &World) -> LabelImage {
        let mut stages = match self.painted.take() {
            Some((scene, stages)) if scene == *world.scene() => stages,
            _ => {
                // Textures and shadows have no labels.
                let config = WorldConfig { look: Look::default(), ..world.config().clone() };
                Stage::all(&config, world.scene()).unwrap()
            }
        };
        world.show_on(&mut stages);
        stages.iter_mut().for_each(paint);
        let direct = self.eye.draw(&stages[0], EYE_CAMERA, None).unwrap();
        let mut codes: Vec<u8> = (0..direct.width * direct.height)
            .map(|at| labelled(&direct, at).unwrap_or(Shown::Direct(Item::Room)).code())
            .collect();
        for (pane, stage) in stages[1..].iter().enumerate() {
            let blank = Shown::Through(pane, Item::Room).code();
            if !codes.contains(&blank) {
                continue;
            }
            let seen = self.eye.through(stage, &world.scene().panes[pane], None).unwrap();
            for (at, code) in codes.iter_mut().enumerate().filter(|(_, code)| **code == blank) {
                if let Some(Shown::Direct(item)) = labelled(&seen, at) {
                    *code = Shown::Through(pane, item).code();
                }
            }
        }
        self.painted = Some((world.scene().clone(), stages));
        LabelImage { width: direct.width, height: direct.height, codes }
    }
}

/// Gives everything exactly the colour of its label: no light, no shade.
fn paint(stage: &mut Stage) {
    let mut model = (*stage.model).clone();
    let head = &mut model.vis_mut().headlight;
    (head.ambient, head.diffuse, head.specular) = ([1.0; 3], [0.0; 3], [0.0; 3]);
    model.light_diffuse_mut().fill([0.0; 3]);
    for (geom, item) in stage.items.iter().enumerate() {
        let [red, green] = match *item {
            Item::Pane(pane) => [0, u8::try_from(pane + 1).unwrap()],
            item => [Shown::Direct(item).code(), 0],
        };
        let level = |label: u8| f32::from(label * STEP) / 255.0;
        model.geom_rgba_mut()[geom] = [level(red), level(green), 0.0, 1.0];
    }
    stage.model = Arc::new(model);
}

/// The meaning of a pixel's label, regardless of what a pane shows; `None` for no label.
fn labelled(frame: &Frame, at: usize) -> Option<Shown> {
    let number = |part: u8| part.is_multiple_of(STEP).then_some(part / STEP);
    let [red, green] = [number(frame.rgb[3 * at])?, number(frame.rgb[3 * at + 1])?];
    match green.checked_sub(1) {
        Some(pane) => (red == 0).then_some(Shown::Through(usize::from(pane), Item::Room)),
        None => Some(Shown::of_code(red)),
    }
}
