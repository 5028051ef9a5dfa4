//! The pictures of a contact sheet: experiments from above and from the agent's view, with captions.
//!
//! Rule: a row is a function of the configuration, the experiments and the seed, so that a changed world changes the
//! picture.

use std::fmt::Write as _;

use crate::body::{Figure, Pose};
use crate::camera::{Camera, CameraError};
use crate::config::WorldConfig;
use crate::model::ModelError;
use crate::placement::Crowded;
use crate::scene::Scene;
use crate::world::World;
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::frame::Frame;

#[derive(Debug, thiserror::Error)]
pub enum DrawingError {
    #[error(transparent)]
    Crowded(#[from] Crowded),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(transparent)]
    Camera(#[from] CameraError),
}

pub struct SheetPicture {
    pub frame: Frame,
    pub caption: String,
}

/// An experiment from above; at the start; before the mirror, nearby and from the side, with every mark. The pictures use the
/// experiment's settings.
pub fn row(config: &WorldConfig, experiment: &Experiment, seed: i32) -> Result<Vec<SheetPicture>, DrawingError> {
    let eye = &mut Camera::new(&config.for_experiment(experiment))?;
    let scene = Scene::draw(config, experiment.clone(), seed, 1)?;
    let mut world = World::new(config, scene)?;
    let name = experiment.name();
    let color = world.scene().body_color.name();
    let above =
        SheetPicture { frame: eye.top_view(&world)?, caption: format!("{name} from above; the own body is {color}") };
    let start = picture(eye, &world, "at the start")?;
    let [near, aside] = [(1.6, 0.0), (2.6, 0.9)].map(|(away, aside)| before_mirror(&world, away, aside));
    let panes = world.scene().panes.iter().filter_map(|pane| pane.from_t);
    let marked = world.scene().marks.iter().map(|mark| mark.from_t).chain(panes).max().unwrap_or(1);
    world.place_at(Figure::standing(near), marked);
    let near = picture(eye, &world, "before the mirror")?;
    world.place_at(Figure::standing(aside), marked);
    let aside = picture(eye, &world, "further from it")?;
    Ok(vec![above, start, near, aside])
}

fn picture(eye: &mut Camera, world: &World, place: &str) -> Result<SheetPicture, DrawingError> {
    let visibility = world.visibility();
    let mut caption = format!("{place}: own body {} px", visibility.self_px);
    if !visibility.marks.is_empty() {
        let _ = write!(caption, ", mark {}", visibility.mark_px);
    }
    if !visibility.others.is_empty() {
        let _ = write!(caption, ", others {}", visibility.other_px);
    }
    Ok(SheetPicture { frame: eye.frame(world)?, caption })
}

fn before_mirror(world: &World, away: f64, aside: f64) -> Pose {
    let mirror = world.scene().mirror;
    let [x, y] = mirror.center(world.config());
    let heading = mirror.heading();
    let [out_x, out_y] = heading.direction();
    let wanted = Pose { x: x - aside * out_y, y: y + aside * out_x, heading }.ahead(-away);
    let places = (0..40).map(|at| wanted.ahead(-0.1 * f64::from(at)));
    let (plan, figures) = (world.floor_plan(), world.figures());
    let touches = |spot: [f64; 2], other: &Figure| plan.is_blocked_by(spot, spot, other.pose.spot());
    let is_free =
        |pose: &Pose| plan.admits(pose.spot(), 0.0) && !figures[1..].iter().any(|other| touches(pose.spot(), other));
    places.into_iter().find(is_free).unwrap_or(wanted)
}
