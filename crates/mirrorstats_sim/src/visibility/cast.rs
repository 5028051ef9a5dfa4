//! Views over the pixels, direct and through each pane, row by row, each part within its bounding rectangle.

use super::super::label_image::Rectangle;
use super::super::model::{Item, Stage};
use super::super::world::World;
use super::shape::{RaySolid, solid};
use super::view::{RayView, Shown};

struct Candidate {
    /// The label code of its thing in this view.
    code: u8,
    solid: RaySolid,
    rectangle: Rectangle,
}

struct Pass {
    view: RayView,
    candidates: Vec<Candidate>,
    depths: Vec<f64>,
}

pub(super) fn rows(world: &World, width: usize, height: usize, mut each: impl FnMut(&[u8])) {
    let view = RayView::of_eye(world, width, height);
    let mut direct = Pass::new(view, world.stage());
    let mut beyond: Vec<(usize, Pass)> = world
        .beyond()
        .iter()
        .enumerate()
        .filter(|(at, _)| direct.candidates.iter().any(|candidate| candidate.code == pane_code(*at)))
        .map(|(at, stage)| (at, Pass::new(view.through(world, &world.scene().panes[at]), stage)))
        .collect();
    let mut row = vec![0; width];
    for y in 0..height {
        row.fill(Shown::Direct(Item::Room).code());
        direct.paint(y, &mut row, |_| true);
        for (at, pass) in &mut beyond {
            if row.contains(&pane_code(*at)) {
                pass.paint(y, &mut row, |code| Shown::of_code(code).pane() == Some(*at));
            }
        }
        each(&row);
    }
}

fn pane_code(pane: usize) -> u8 {
    Shown::Through(pane, Item::Room).code()
}

impl Pass {
    fn new(view: RayView, stage: &Stage) -> Self {
        let code = |item: Item| match stage.pane {
            None => Shown::Direct(item).code(),
            Some(pane) => Shown::Through(pane, item).code(),
        };
        let shown = stage.items.iter().enumerate().filter(|(geom, item)| **item != Item::Room && stage.is_shown(*geom));
        let candidates = shown.filter_map(|(geom, item)| {
            let solid = solid(stage, geom);
            Some(Candidate { code: code(*item), solid, rectangle: solid.rectangle(&view)? })
        });
        Self { view, candidates: candidates.collect(), depths: vec![f64::INFINITY; view.width] }
    }

    /// Writes the code of the nearest part to each open pixel of a row.
    fn paint(&mut self, y: usize, row: &mut [u8], is_open: impl Fn(u8) -> bool) {
        self.depths.fill(f64::INFINITY);
        let view = self.view;
        let in_row = |candidate: &&Candidate| (candidate.rectangle.top..candidate.rectangle.bottom).contains(&y);
        for Candidate { code, solid, rectangle } in self.candidates.iter().filter(in_row) {
            let columns = rectangle.left..rectangle.right;
            let pixels = row[columns.clone()].iter_mut().zip(&mut self.depths[columns.clone()]);
            for (x, (pixel, depth)) in columns.zip(pixels).filter(|(_, (pixel, _))| is_open(**pixel)) {
                if let Some(met) = solid.meets(view.origin, view.ray(x, y))
                    && met < *depth
                {
                    *depth = met;
                    *pixel = *code;
                }
            }
        }
    }
}
