//! The contact sheet: experiments from above and from the agent's view, with a caption under each picture.
//!
//! Rule: a sheet is a function of the configuration, the experiments and the seed, so that a changed world changes the
//! picture.

use std::fmt::Write as _;

use resvg::tiny_skia::{Pixmap, PremultipliedColorU8, Transform};

use super::super::Experiment;
use super::super::body::{Figure, Pose};
use super::super::camera::{Camera, CameraError};
use super::super::config::WorldConfig;
use super::super::model::ModelError;
use super::super::placement::Crowded;
use super::super::scene::Scene;
use super::super::world::World;
use mirrorstats_figures::kit::convert::{self, ConvertError};
use mirrorstats_trace::episodes::frame::Frame;

/// The scale of pictures on the sheet: pixels per pixel of the sheet, along each side.
const SHRINK: usize = 2;

/// The height of a caption, px.
const CAPTION: usize = 22;

const GAP: usize = 6;

#[derive(Debug, thiserror::Error)]
pub enum ContactSheetError {
    #[error(transparent)]
    Crowded(#[from] Crowded),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(transparent)]
    Camera(#[from] CameraError),
    #[error(transparent)]
    Convert(#[from] ConvertError),
    #[error("the contact sheet cannot be encoded as PNG: {0}")]
    Png(String),
}

struct SheetPicture {
    frame: Frame,
    caption: String,
}

/// The sheet as PNG bytes: a row for each experiment.
pub fn png(config: &WorldConfig, experiments: &[Experiment], seed: i32) -> Result<Vec<u8>, ContactSheetError> {
    let rows = experiments.iter().map(|experiment| row(config, experiment, seed));
    compose(&rows.collect::<Result<Vec<_>, _>>()?)
}

/// From above; at the start; before the mirror, nearby and from the side, with every mark. The pictures use the
/// experiment's settings.
fn row(config: &WorldConfig, experiment: &Experiment, seed: i32) -> Result<Vec<SheetPicture>, ContactSheetError> {
    let eye = &mut Camera::new(&config.of(experiment))?;
    let scene = Scene::draw(config, experiment.clone(), seed, 1)?;
    let mut world = World::new(config, scene)?;
    let name = experiment.name();
    let color = world.scene().body_color.name();
    let above =
        SheetPicture { frame: eye.top_view(&world)?, caption: format!("{name} from above; the own body is {color}") };
    let start = picture(eye, &world, "at the start")?;
    let [near, aside] = [(1.6, 0.0), (2.6, 0.9)].map(|(away, aside)| before_mirror(&world, away, aside));
    let marked = world.scene().marks.iter().map(|mark| mark.from_t).max().unwrap_or(1);
    world.place_at(Figure::standing(near), marked);
    let near = picture(eye, &world, "before the mirror")?;
    world.place_at(Figure::standing(aside), marked);
    let aside = picture(eye, &world, "further from it")?;
    Ok(vec![above, start, near, aside])
}

fn picture(eye: &mut Camera, world: &World, place: &str) -> Result<SheetPicture, ContactSheetError> {
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

fn compose(rows: &[Vec<SheetPicture>]) -> Result<Vec<u8>, ContactSheetError> {
    let frames = || rows.iter().flatten().map(|picture| &picture.frame);
    let widest = frames().map(|frame| frame.width).max().unwrap_or_default();
    let highest = frames().map(|frame| frame.height).max().unwrap_or_default();
    if widest == 0 {
        return Err(ContactSheetError::Png("it has no pictures".to_owned()));
    }
    let cell = [widest / SHRINK + GAP, highest / SHRINK + CAPTION];
    let columns = rows.iter().map(Vec::len).max().unwrap_or_default();
    let size = [columns * cell[0] + GAP, rows.len() * cell[1] + GAP];
    let [width, height] = size.map(|px| u32::try_from(px).unwrap_or(u32::MAX));
    let mut sheet = Pixmap::new(width, height).ok_or_else(|| ContactSheetError::Png("it has no pixels".to_owned()))?;
    sheet.fill(resvg::tiny_skia::Color::WHITE);
    let mut words = String::new();
    for (down, row) in rows.iter().enumerate() {
        for (right, picture) in row.iter().enumerate() {
            let corner = [GAP + right * cell[0], GAP + down * cell[1]];
            paste(&mut sheet, &picture.frame, corner);
            let (x, y) = (corner[0] + 2, corner[1] + cell[1] - CAPTION + 15);
            let _ = write!(words, r#"<text x="{x}" y="{y}" font-size="12" fill="black">{}</text>"#, picture.caption);
        }
    }
    let svg = format!(r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}">{words}</svg>"#);
    resvg::render(&convert::tree(&svg)?, Transform::identity(), &mut sheet.as_mut());
    sheet.encode_png().map_err(|error| ContactSheetError::Png(error.to_string()))
}

fn paste(sheet: &mut Pixmap, frame: &Frame, corner: [usize; 2]) {
    let stride = sheet.width() as usize;
    for y in 0..frame.height / SHRINK {
        for x in 0..frame.width / SHRINK {
            let [red, green, blue] = mean(frame, x * SHRINK, y * SHRINK);
            let color =
                PremultipliedColorU8::from_rgba(red, green, blue, 255).expect("an opaque colour is premultiplied");
            sheet.pixels_mut()[(corner[1] + y) * stride + corner[0] + x] = color;
        }
    }
}

fn mean(frame: &Frame, x: usize, y: usize) -> [u8; 3] {
    [0, 1, 2].map(|part| {
        let block = (0..SHRINK * SHRINK).map(|at| (x + at % SHRINK, y + at / SHRINK));
        let sum: usize = block.map(|(x, y)| usize::from(frame.rgb[3 * (y * frame.width + x) + part])).sum();
        u8::try_from(sum / (SHRINK * SHRINK)).expect("a mean of bytes is a byte")
    })
}
