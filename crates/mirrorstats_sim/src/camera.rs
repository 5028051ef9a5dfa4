//! Pictures: the agent's view, and the room from above.
//!
//! Rule: a camera draws any worlds of its configuration in turn, and keeps no state between them. It belongs to the
//! thread that made it.

use std::sync::Arc;

use mujoco_rs::prelude::{MjData, MjModel, MjtObjBase, MjvCamera, RendererError};
use mujoco_rs::renderer::MjRenderer;

use crate::config::WorldConfig;
use crate::label_image::Rectangle;
use crate::model::{EYE_CAMERA, ModelError, Stage, TOP_CAMERA, compile, group};
use crate::visibility;
use crate::world::World;
use mirrorstats_trace::footers::renderer::Renderer;
use mirrorstats_trace::frame::Frame;

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
    pub(super) width: usize,
    pub(super) height: usize,
    data: MjData<Arc<MjModel>>,
    renderer: MjRenderer,
    pub(super) draws_all: bool,
    drawn_by: Renderer,
}

impl Camera {
    pub fn new(config: &WorldConfig) -> Result<Self, CameraError> {
        let (width, height) = (config.eye.width as usize, config.eye.height_px as usize);
        let model = Arc::new(compile(config)?);
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
        if !world.beyond().is_empty() {
            self.draw_mirrors(world, &mut frame, whole)?;
        }
        Ok(frame)
    }

    /// The room from above, without its ceiling.
    pub(crate) fn top_view(&mut self, world: &World) -> Result<Frame, CameraError> {
        self.draw(world.stage(), TOP_CAMERA, None)
    }

    /// Draws a stage, or only the geoms that may be in view: MuJoCo also draws things behind the eye, which takes most
    /// of its time.
    pub fn draw(&mut self, stage: &Stage, camera: &str, in_view: Option<&[bool]>) -> Result<Frame, CameraError> {
        let model = match in_view.filter(|_| !self.draws_all) {
            None => Arc::clone(&stage.model),
            Some(in_view) => {
                let mut model = MjModel::clone(&stage.model);
                let groups = model.geom_group_mut().iter_mut().zip(in_view);
                groups.filter(|(_, is_in_view)| !**is_in_view).for_each(|(own, _)| *own = group::HIDDEN);
                Arc::new(model)
            }
        };
        self.data.swap_model(model);
        self.data.mocap_pos_mut().copy_from_slice(stage.data.mocap_pos());
        self.data.mocap_quat_mut().copy_from_slice(stage.data.mocap_quat());
        self.data.forward();
        let id = stage.model.name_to_id(MjtObjBase::mjOBJ_CAMERA, camera).expect("every model has this camera");
        *self.renderer.camera_mut() = MjvCamera::new_fixed(id);
        self.renderer.opts_mut().geomgroup[CEILING] = u8::from(camera != TOP_CAMERA);
        let failed = |error: RendererError| CameraError::Failed { reason: reason(&error) };
        self.renderer.sync_data(&mut self.data).map_err(failed)?;
        self.renderer.render().map_err(failed)?;
        let rgb = self.renderer.rgb_flat().unwrap_or_default().to_vec();
        Ok(Frame::new(self.width, self.height, rgb))
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

fn current_renderer() -> Renderer {
    let Some(mirrorstats_gl::Names { vendor, renderer, version }) = mirrorstats_gl::names() else {
        return Renderer { name: "unknown".to_owned(), version: None, vendor: None, processor: Some(processor()) };
    };
    let is_software = SOFTWARE.iter().any(|name| renderer.contains(name));
    let processor = is_software.then(processor);
    Renderer { name: renderer, version: Some(version), vendor: Some(vendor), processor }
}

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
