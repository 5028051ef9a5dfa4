//! The view through a pane: the apparent position of the eye, from which the direct view is what the pane shows.
//!
//! All reflected rays of a plane start from one point, the eye's mirror image. A window opens into a second room that
//! is the first one moved along the wall's normal; an eye moved back equally sees the first room. So the view through
//! any pane is a view into the same room, through the place of a removed wall. Its rays start before the pane: the
//! empty space behind the wall contains nothing.

use crate::body::Pose;
use crate::config::WorldConfig;
use crate::scene::HungPane;
use mirrorstats_experiment::angle::Heading;
use mirrorstats_experiment::spec::PaneKind;

/// The pose of the eye for the view through a pane, for a body at a pose. A mirror's picture is drawn from there and
/// then flipped, since a camera cannot be mirrored.
pub fn eye(config: &WorldConfig, pane: &HungPane, body: Pose) -> Pose {
    let eye = body.ahead(config.eye.forward);
    let out = pane.place.heading();
    let [out_x, out_y] = out.direction();
    if pane.kind == PaneKind::Window {
        let length = shift(config);
        return Pose { x: eye.x - length * out_x, y: eye.y - length * out_y, heading: eye.heading };
    }
    let away = 2.0 * pane.place.distance(eye.spot(), config);
    // The middle of the two directions is at a right angle to the normal.
    let thirties = 2 * i16::from(out.thirties()) + 6 - i16::from(eye.heading.thirties());
    let heading = Heading::new(u8::try_from(thirties.rem_euclid(12)).unwrap_or(0));
    Pose { x: eye.x + away * out_x, y: eye.y + away * out_y, heading }
}

/// The distance of the second room from the first, m: from a pane's face to the face of one on the wall across.
pub fn shift(config: &WorldConfig) -> f64 {
    config.room.size - 2.0 * config.mirror.gap
}
