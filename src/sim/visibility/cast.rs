//! The two passes over the view, a row at a time, each part within its own rectangle of pixels.

use super::super::model::{Item, Stage};
use super::super::world::World;
use super::shape::{Part, Rectangle, Solid, solid};
use super::view::{Shown, View, dot, minus};

/// A part and where it can be seen.
struct Candidate {
    part: Part,
    rectangle: Rectangle,
}

/// One of the two views, and what can be in it.
struct Pass {
    view: View,
    candidates: Vec<Candidate>,
    depths: Vec<f64>,
}

/// Calls `each` with the codes of every row, from the top.
pub(super) fn rows(world: &World, width: usize, height: usize, mut each: impl FnMut(&[u8])) {
    let view = View::of_eye(world, width, height);
    let stage = world.stage();
    let mut direct = Pass::new(view, parts(stage));
    let mut reflected = mirrored(&view, stage).map(|view| {
        let parts = parts(stage).into_iter().filter(|part| part.item != Item::Mirror).collect();
        Pass::new(view, parts)
    });
    let mirror = Shown::Mirror.code();
    let mut row = vec![0; width];
    for y in 0..height {
        row.fill(Shown::Room.code());
        direct.paint(y, &mut row, |part| part.code_direct, |_| true);
        if let Some(pass) = &mut reflected
            && row.contains(&mirror)
        {
            pass.paint(y, &mut row, |part| part.code_reflected, is_of_mirror);
        }
        each(&row);
    }
}

/// Whether a pixel is of the mirror, with whatever has been found in it.
fn is_of_mirror(code: u8) -> bool {
    matches!(Shown::of_code(code), Shown::Mirror | Shown::Reflected(_))
}

/// The view by way of the mirror, where there is a mirror and the eye is before it.
fn mirrored(view: &View, stage: &Stage) -> Option<View> {
    let mirror = stage.items().iter().position(|item| *item == Item::Mirror).filter(|geom| stage.is_shown(*geom))?;
    let Solid::Box { center, axes, .. } = solid(stage, mirror) else { return None };
    (dot(minus(view.origin, center), axes[2]) > 0.0).then(|| view.reflected(center, axes[2]))
}

fn parts(stage: &Stage) -> Vec<Part> {
    let shown = stage.items().iter().enumerate().filter(|(geom, item)| **item != Item::Room && stage.is_shown(*geom));
    shown
        .map(|(geom, item)| Part {
            item: *item,
            code_direct: Shown::Direct(*item).code(),
            code_reflected: Shown::Reflected(*item).code(),
            solid: solid(stage, geom),
        })
        .collect()
}

impl Pass {
    fn new(view: View, parts: Vec<Part>) -> Self {
        let candidates = parts
            .into_iter()
            .filter_map(|part| Some(Candidate { part, rectangle: part.solid.rectangle(&view)? }))
            .collect();
        Self { view, candidates, depths: vec![f64::INFINITY; view.width] }
    }

    /// Puts the code of the nearest part over each pixel of a row that is open to it.
    fn paint(&mut self, y: usize, row: &mut [u8], code: impl Fn(&Part) -> u8, is_open: impl Fn(u8) -> bool) {
        self.depths.fill(f64::INFINITY);
        let view = self.view;
        let in_row = |candidate: &&Candidate| (candidate.rectangle.top..candidate.rectangle.bottom).contains(&y);
        for Candidate { part, rectangle } in self.candidates.iter().filter(in_row) {
            let columns = rectangle.left..rectangle.right;
            let pixels = row[columns.clone()].iter_mut().zip(&mut self.depths[columns.clone()]);
            for (x, (pixel, depth)) in columns.zip(pixels).filter(|(_, (pixel, _))| is_open(**pixel)) {
                if let Some(met) = part.solid.meets(view.origin, view.ray(x, y))
                    && met < *depth
                {
                    *depth = met;
                    *pixel = code(part);
                }
            }
        }
    }
}
