//! The look through a pane: where the eye seems to be, so that what it sees directly from there is what the pane shows.
//!
//! All reflected rays of a plane start from one point, the eye's mirror image. A window opens into a second room that is
//! the first one moved along the wall's normal; seen from an eye moved back by as much, it is the first room. So a look
//! through any pane is a look into the one room, through the place of a wall that is not there. Rays of that look begin
//! before the pane, where nothing stands: what is behind the wall is empty.

use super::super::angle::Heading;
use super::super::body::Pose;
use super::super::config::WorldConfig;
use super::super::scene::HungPane;
use crate::experiment::spec::PaneKind;

/// Where the eye of a look through a pane is and faces, for a body at a pose. A mirror's picture is drawn from there and then flipped, since a
/// camera cannot be mirrored.
pub fn eye(config: &WorldConfig, pane: &HungPane, body: Pose) -> Pose {
    let eye = body.ahead(config.eye.forward);
    match pane.kind {
        PaneKind::Window => moved(config, pane, eye),
        PaneKind::Mirror | PaneKind::Delayed | PaneKind::Decoy => mirrored(config, pane, eye),
    }
}

/// Returns true if pictures of a look through a pane are flipped.
pub const fn is_flipped(pane: &HungPane) -> bool {
    !matches!(pane.kind, PaneKind::Window)
}

fn mirrored(config: &WorldConfig, hung: &HungPane, eye: Pose) -> Pose {
    let out = hung.place.heading();
    let [out_x, out_y] = out.direction();
    let away = 2.0 * hung.place.distance(eye.spot(), config);
    // Of two directions whose middle is at a right angle to the normal.
    let thirties = 2 * i16::from(out.thirties()) + 6 - i16::from(eye.heading.thirties());
    let heading = Heading::new(u8::try_from(thirties.rem_euclid(12)).unwrap_or(0));
    Pose { x: eye.x + away * out_x, y: eye.y + away * out_y, heading }
}

fn moved(config: &WorldConfig, hung: &HungPane, eye: Pose) -> Pose {
    let [out_x, out_y] = hung.place.heading().direction();
    let length = shift(config);
    Pose { x: eye.x - length * out_x, y: eye.y - length * out_y, heading: eye.heading }
}

/// The distance of the second room from the first, m: from the face of a pane to that of one on the wall across.
pub fn shift(config: &WorldConfig) -> f64 {
    config.room.size - 2.0 * config.mirror.gap
}
