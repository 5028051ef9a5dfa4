//! Pictures: the agent's view, the same view in label colours, and the room from above.
//!
//! MuJoCo draws at most one mirror, in its current state. So the first picture has blank panes. The view through each
//! pane is a separate picture from beyond it, and its pixels are copied where rays show the pane.
//!
//! Rule: a camera draws any worlds of its configuration in turn, and keeps no state between them. It belongs to the
//! thread that made it.

use std::sync::Arc;

use mujoco_rs::prelude::{MjData, MjModel, MjtObjBase, MjvCamera, RendererError};
use mujoco_rs::renderer::MjRenderer;

use crate::config::WorldConfig;
use crate::label_image::{LabelImage, Rectangle};
use crate::model::{
    BEYOND_CAMERA, EYE_CAMERA, Item, ModelError, PaintMode, Stage, TOP_CAMERA, compile, group, labelled,
};
use crate::scene::{HungPane, Scene};
use crate::visibility::{self, Shown};
use crate::world::World;
use mirrorstats_experiment::spec::{Look, PaneKind};
use mirrorstats_trace::episodes::frame::Frame;
use mirrorstats_trace::footers::renderer::Renderer;

#[derive(Debug, thiserror::Error)]
pub enum CameraError {
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(
        "cannot draw the world without a display: {reason}; software rendering needs EGL and Mesa, which on Debian \
         and Ubuntu are the packages libegl1 and libgl1-mesa-dri"
    )]
    NoDisplay { reason: String },
    #[error("drawing the world failed: {reason}")]
    Failed { reason: String },
}

/// The ceiling's index in a picture's groups.
const CEILING: usize = group::CEILING as usize;

pub struct Camera {
    width: usize,
    height: usize,
    data: MjData<Arc<MjModel>>,
    renderer: MjRenderer,
    draws_all: bool,
    drawn_by: Renderer,
}

impl Camera {
    pub fn new(config: &WorldConfig) -> Result<Self, CameraError> {
        Self::sized(config, config.eye.width as usize, config.eye.height_px as usize)
    }

    pub fn sized(config: &WorldConfig, width: usize, height: usize) -> Result<Self, CameraError> {
        Self::painted(config, PaintMode::Lit, width, height)
    }

    fn painted(config: &WorldConfig, paint: PaintMode, width: usize, height: usize) -> Result<Self, CameraError> {
        let model = Arc::new(compile(config, paint, [width, height])?);
        let renderer = MjRenderer::new(&model, width, height, 0)
            .map_err(|error| CameraError::NoDisplay { reason: reason(&error) })?;
        let drawn_by = current_renderer();
        Ok(Self { width, height, data: MjData::new(model), renderer, draws_all: false, drawn_by })
    }

    pub const fn drawn_by(&self) -> &Renderer {
        &self.drawn_by
    }

    /// Draws things out of view too, including panes, as MuJoCo's own mirror does. It changes no picture; a test and a
    /// benchmark compare with it.
    pub const fn draw_all(&mut self, all: bool) {
        self.draws_all = all;
    }

    pub fn frame(&mut self, world: &World) -> Result<Frame, CameraError> {
        let size = [self.width, self.height];
        let whole = Rectangle { left: 0, right: self.width, top: 0, bottom: self.height };
        let in_view = visibility::in_view(world, world.stage(), size, whole);
        let mut frame = self.draw(world.stage(), EYE_CAMERA, Some(&in_view))?;
        if world.beyond().is_empty() {
            return Ok(frame);
        }
        let eye = &world.config().eye;
        let own;
        let labels = if size == [eye.width as usize, eye.height_px as usize] {
            world.labels()
        } else {
            own = visibility::labels(world, self.width, self.height);
            &own
        };
        for (pane, stage) in world.beyond().iter().enumerate() {
            let is_seen = |code: &u8| Shown::of_code(*code).pane() == Some(pane);
            let Some(within) = labels.around(is_seen).or(self.draws_all.then_some(whole)) else { continue };
            let in_view = visibility::in_view(world, stage, size, within);
            let seen = self.through(stage, &world.scene().panes[pane], Some(&in_view))?;
            overlay(&mut frame, &seen, |at| is_seen(&labels.codes[at]));
            if world.config().look == Look::Textured && world.scene().panes[pane].kind != PaneKind::Window {
                tint(&mut frame, |at| is_seen(&labels.codes[at]));
            }
        }
        Ok(frame)
    }

    fn through(&mut self, stage: &Stage, pane: &HungPane, in_view: Option<&[bool]>) -> Result<Frame, CameraError> {
        let frame = self.draw(stage, BEYOND_CAMERA, in_view)?;
        Ok(if pane.kind == PaneKind::Window { frame } else { flipped(&frame) })
    }

    /// The room from above, without its ceiling.
    pub(crate) fn top_view(&mut self, world: &World) -> Result<Frame, CameraError> {
        self.draw(world.stage(), TOP_CAMERA, None)
    }

    /// Draws a stage, or only the geoms that may be in view: MuJoCo also draws things behind the eye, which takes most
    /// of its time.
    fn draw(&mut self, stage: &Stage, camera: &str, in_view: Option<&[bool]>) -> Result<Frame, CameraError> {
        let model = match in_view.filter(|_| !self.draws_all) {
            None => Arc::clone(stage.shared_model()),
            Some(in_view) => {
                let mut model = MjModel::clone(stage.shared_model());
                let groups = model.geom_group_mut().iter_mut().zip(in_view);
                groups.filter(|(_, is_in_view)| !**is_in_view).for_each(|(own, _)| *own = group::HIDDEN);
                Arc::new(model)
            }
        };
        self.data.swap_model(model);
        self.data.mocap_pos_mut().copy_from_slice(stage.data.mocap_pos());
        self.data.mocap_quat_mut().copy_from_slice(stage.data.mocap_quat());
        self.data.forward();
        let id = stage.model().name_to_id(MjtObjBase::mjOBJ_CAMERA, camera).expect("every model has this camera");
        *self.renderer.camera_mut() = MjvCamera::new_fixed(id);
        self.renderer.opts_mut().geomgroup[CEILING] = u8::from(camera != TOP_CAMERA);
        let failed = |error: RendererError| CameraError::Failed { reason: reason(&error) };
        self.renderer.sync_data(&mut self.data).map_err(failed)?;
        self.renderer.render().map_err(failed)?;
        let rgb = self.renderer.rgb_flat().unwrap_or_default().to_vec();
        Ok(Frame::new(self.width, self.height, rgb))
    }
}

/// Copies the selected pixels of `over` to a frame of the same size.
fn overlay(frame: &mut Frame, over: &Frame, is_asked: impl Fn(usize) -> bool) {
    let pixels = frame.rgb.chunks_exact_mut(3).zip(over.rgb.chunks_exact(3)).enumerate();
    for (_, (pixel, seen)) in pixels.filter(|(at, _)| is_asked(*at)) {
        pixel.copy_from_slice(seen);
    }
}

/// The shares of red, green and blue that glass reflects, of 256.
const GLASS: [u16; 3] = [242, 250, 246];

fn tint(frame: &mut Frame, is_asked: impl Fn(usize) -> bool) {
    for (_, pixel) in frame.rgb.chunks_exact_mut(3).enumerate().filter(|(at, _)| is_asked(*at)) {
        for (level, share) in pixel.iter_mut().zip(GLASS) {
            *level = u8::try_from(u16::from(*level) * share / 256).unwrap_or(u8::MAX);
        }
    }
}

fn flipped(frame: &Frame) -> Frame {
    let rows = frame.rgb.chunks_exact(3 * frame.width.max(1));
    let rgb = rows.flat_map(|row| row.chunks_exact(3).rev().flatten().copied()).collect();
    Frame::new(frame.width, frame.height, rgb)
}

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

fn reason(error: &RendererError) -> String {
    let mut words = error.to_string();
    let mut cause = std::error::Error::source(error);
    while let Some(inner) = cause {
        words = format!("{words}: {inner}");
        cause = inner.source();
    }
    words
}

const SOFTWARE: [&str; 4] = ["llvmpipe", "softpipe", "swrast", "SwiftShader"];

/// The environment variable that limits the processor extensions used by Mesa.
const LIMIT: &str = "GALLIUM_OVERRIDE_CPU_CAPS";

/// The renderer of the context that is current on this thread.
fn current_renderer() -> Renderer {
    let Some(mirrorstats_gl::Names { vendor, renderer, version }) = mirrorstats_gl::names() else {
        return Renderer { name: "unknown".to_owned(), version: None, vendor: None, processor: Some(processor()) };
    };
    let is_software = SOFTWARE.iter().any(|name| renderer.contains(name));
    let processor = is_software.then(processor);
    Renderer { name: renderer, version: Some(version), vendor: Some(vendor), processor }
}

/// The extensions of the processor, or the limit from the environment.
fn processor() -> String {
    let limit = std::env::var(LIMIT).ok().filter(|limit| !limit.is_empty());
    let extensions = limit.map_or_else(extensions, |limit| format!("limited to {limit}"));
    format!("{} {extensions}", std::env::consts::ARCH)
}

#[cfg(target_arch = "x86_64")]
fn extensions() -> String {
    let found = [
        ("sse4.2", is_x86_feature_detected!("sse4.2")),
        ("avx", is_x86_feature_detected!("avx")),
        ("f16c", is_x86_feature_detected!("f16c")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    found.into_iter().filter(|(_, is_there)| *is_there).map(|(name, _)| name).collect::<Vec<_>>().join(" ")
}

#[cfg(not(target_arch = "x86_64"))]
fn extensions() -> String {
    "all".to_owned()
}
