//! Everything in a world as shapes with places and colours, for drawing by a log.

use mujoco_rs::prelude::{MjtGeomBase, MjtObjBase};

use super::body::Piece;
use super::model::{AGENTS, EYE_CAMERA, Item, Stage};
use super::world::World;
use mirrorstats_experiment::angle::Quaternion;
use mirrorstats_log::write::{Form, Placed, Solid};

#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// The moving bodies, each in the frame of the room and with a name of its own: `agent0_trunk`, .. and `eye`.
    pub frames: Vec<Placed>,
    /// Every visible shape, with a unique name such as `pane0`, `cube0` or `agent0_head`.
    pub solids: Vec<Solid>,
    /// What each of the shapes belongs to.
    pub items: Vec<Item>,
}

impl World {
    pub fn snapshot(&self) -> Snapshot {
        let (items, solids) = solids(self.stage()).unzip();
        Snapshot { frames: frames(self), solids, items }
    }
}

fn frames(world: &World) -> Vec<Placed> {
    let stage = world.stage();
    let agents = 1 + world.scene().others.len();
    let pieces = (0..agents.min(AGENTS)).flat_map(|agent| {
        Piece::ALL.into_iter().enumerate().map(move |(at, piece)| {
            let (position, rotation) = stage.piece_place(agent * Piece::ALL.len() + at);
            Placed { name: format!("agent{agent}_{}", piece.name()), position, rotation }
        })
    });
    let eye = &world.config().eye;
    let ahead = world.pose().ahead(eye.forward);
    let level = world.pose().heading.rotation();
    let rotation = if eye.pitch > 0.0 { level.after(Quaternion::about_y(eye.pitch)) } else { level };
    let eye = Placed { name: EYE_CAMERA.to_owned(), position: [ahead.x, ahead.y, eye.height], rotation: rotation.0 };
    // The positions of bodies that only a pane shows: behind a window, in the second room's own frame.
    let doubles = (0..world.scene().panes.len()).filter_map(|pane| {
        let pose = world.double(pane)?.pose;
        let rotation = pose.heading.rotation().0;
        Some(Placed { name: format!("double{pane}"), position: [pose.x, pose.y, 0.0], rotation })
    });
    pieces.chain([eye]).chain(doubles).collect()
}

fn solids(stage: &Stage) -> impl Iterator<Item = (Item, Solid)> {
    let model = &stage.model;
    // Only shadows are translucent.
    let shown = |geom: &usize| stage.is_shown(*geom) && model.geom_rgba()[*geom][3] >= 1.0;
    (0..stage.items.len()).filter(shown).map(move |geom| {
        let item = stage.items[geom];
        let solid = Solid {
            name: model.id_to_name(MjtObjBase::mjOBJ_GEOM, geom).unwrap_or_default().to_owned(),
            form: form(item, model.geom_type()[geom], model.geom_size()[geom]),
            position: stage.data.geom_xpos()[geom],
            rotation: quaternion(stage.data.geom_xmat()[geom]),
            rgba: model.geom_rgba()[geom],
        };
        (item, solid)
    })
}

fn form(item: Item, kind: MjtGeomBase, size: [f64; 3]) -> Form {
    match kind {
        // Only the face of a pane is shown.
        _ if matches!(item, Item::Pane(_)) => Form::Plane([2.0 * size[0], 2.0 * size[1]]),
        MjtGeomBase::mjGEOM_PLANE => Form::Plane([2.0 * size[0], 2.0 * size[1]]),
        MjtGeomBase::mjGEOM_SPHERE => Form::Sphere(size[0]),
        MjtGeomBase::mjGEOM_CAPSULE => Form::Capsule { radius: size[0], length: 2.0 * size[1] },
        _ => Form::Box(size.map(|half| 2.0 * half)),
    }
}

/// The unit quaternion of a rotation matrix, starting with its largest component to avoid small divisors.
fn quaternion(m: [f64; 9]) -> [f64; 4] {
    let squares =
        [1.0 + m[0] + m[4] + m[8], 1.0 + m[0] - m[4] - m[8], 1.0 - m[0] + m[4] - m[8], 1.0 - m[0] - m[4] + m[8]];
    let largest = (1..4).fold(0, |best, at| if squares[at] > squares[best] { at } else { best });
    let root = squares[largest].sqrt();
    let over = 0.5 / root;
    let products = match largest {
        0 => [0.0, m[7] - m[5], m[2] - m[6], m[3] - m[1]],
        1 => [m[7] - m[5], 0.0, m[1] + m[3], m[2] + m[6]],
        2 => [m[2] - m[6], m[1] + m[3], 0.0, m[5] + m[7]],
        _ => [m[3] - m[1], m[2] + m[6], m[5] + m[7], 0.0],
    };
    let mut quaternion = products.map(|product| product * over);
    quaternion[largest] = 0.5 * root;
    quaternion
}
