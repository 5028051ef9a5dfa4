//! The view through mirrors and windows, as part of the agent's picture.
//!
//! MuJoCo draws at most one mirror, in its current state. So the first picture has blank panes. The view through each
//! pane is a separate picture from beyond it, and its pixels are copied where rays show the pane.

use crate::camera::{Camera, CameraError};
use crate::label_image::Rectangle;
use crate::model::{BEYOND_CAMERA, Stage};
use crate::scene::HungPane;
use crate::visibility::{self, Shown};
use crate::world::World;
use mirrorstats_experiment::spec::{Look, PaneKind};
use mirrorstats_trace::frame::Frame;

impl Camera {
    /// Draws the view through every visible pane into a frame; `whole` is all of the frame.
    pub(super) fn draw_mirrors(
        &mut self,
        world: &World,
        frame: &mut Frame,
        whole: Rectangle,
    ) -> Result<(), CameraError> {
        let eye = &world.config().eye;
        let own;
        let labels = if [self.width, self.height] == [eye.width as usize, eye.height_px as usize] {
            world.labels()
        } else {
            own = visibility::labels(world, self.width, self.height);
            &own
        };
        for (pane, stage) in world.beyond().iter().enumerate() {
            let is_seen = |code: &u8| Shown::of_code(*code).pane() == Some(pane);
            let Some(within) = labels.around(is_seen).or(self.draws_all.then_some(whole)) else { continue };
            let in_view = visibility::in_view(world, stage, [self.width, self.height], within);
            let seen = self.through(stage, &world.scene().panes[pane], Some(&in_view))?;
            overlay(frame, &seen, |at| is_seen(&labels.codes[at]));
            if world.config().look == Look::Textured && world.scene().panes[pane].kind != PaneKind::Window {
                tint(frame, |at| is_seen(&labels.codes[at]));
            }
        }
        Ok(())
    }

    pub fn through(&mut self, stage: &Stage, pane: &HungPane, in_view: Option<&[bool]>) -> Result<Frame, CameraError> {
        let frame = self.draw(stage, BEYOND_CAMERA, in_view)?;
        Ok(if pane.kind == PaneKind::Window { frame } else { flipped(&frame) })
    }
}

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
