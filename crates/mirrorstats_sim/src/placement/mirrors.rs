//! Mirrors and windows with their places and contents, and the marks on bodies.
//!
//! Rule: all of this is drawn from a separate stream after the layout, so experiments that differ only here have the
//! same layout. The stream depends on the name of their scenes, so shared features are drawn alike.

use super::super::body::Pose;
use super::super::config::{WorldConfig, metres};
use super::super::hand::HandRules;
use super::super::model::HALF_BAR;
use super::super::rng::Rng;
use super::super::scene::{
    HandShape, HandStart, HungPane, MirrorPlace, Other, Patch, Scene, WornMark, floor_plan, manhattan,
};
use super::balance::strange_colors;
use super::{DoesNotFit, Drawing, is_in_view, purpose};
use mirrorstats_experiment::angle::{HEADINGS, Heading};
use mirrorstats_experiment::spec::{
    BodyShown, Hand, Look, Mark, MarkColor, Paint, Pane, PaneKind, Part, Stated, Wall, Wearer,
};
use mirrorstats_trace::schema::colors::Color;

/// The maximum number of draws for a pane to be out of view at the start.
const PLACES: u32 = 40;

/// The maximum number of draws for a hand to be free and at the required distance.
const STARTS: u32 = 2000;

/// Between two panes on one wall, for the bars of their frames, m.
const BETWEEN: f64 = 4.0 * HALF_BAR;

/// Separates this stream from the layout's.
const PURPOSE: u64 = 0x7061_6e65_7300;

/// A scene without panes and marks, to which they are added.
pub(super) struct PaneLayout<'a> {
    pub config: &'a WorldConfig,
    pub scene: &'a Scene,
}

impl PaneLayout<'_> {
    /// The scene of a seed and run, with its panes and marks.
    pub(super) fn hung(&self, seed: i32, run: i32) -> Result<Scene, DoesNotFit> {
        let purpose = purpose(&self.scene.experiment);
        let stream = |at: u64| Rng::for_run(purpose ^ (PURPOSE + at), seed, run);
        // Separate streams, so that an unused one does not affect the others.
        let marks = self.marks(stream);
        let hand = self.scene.experiment.hand.and_then(|hand| self.hand(hand, &marks, &mut stream(32)));
        let mut others = stream(0);
        let another = match hand {
            Some(hand) => self.color_beside(hand, &marks, &mut others),
            None => self.another_color(&mut others),
        };
        // A window is no mirror, and a prompt is read at once: neither may point at a candidate.
        let strange = others.one_of(&strange_colors(self.scene));
        let stated_color = match self.scene.experiment.stated_color {
            Stated::None => None,
            Stated::Candidate => Some(another),
            Stated::Random => Some(strange),
        };
        let mut panes = Vec::new();
        for (at, pane) in (1_u64..).zip(&self.scene.experiment.panes) {
            let mut chance = stream(at);
            let place = if panes.is_empty() { self.scene.mirror } else { self.place(pane, &panes, &mut chance)? };
            let other = if pane.kind == PaneKind::Window { strange } else { another };
            panes.push(self.pane(pane, place, other, &mut chance));
        }
        match self.scene.experiment.hand {
            Some(task) if hand.is_none() => Err(DoesNotFit::hand(task)),
            _ => Ok(Scene { seed, run, stated_color, panes, marks, hand, ..self.scene.clone() }),
        }
    }

    /// The marks in the order of the experiment. Those on others are drawn first: they are visible without a mirror, so
    /// they must not depend on the own one.
    fn marks(&self, stream: impl Fn(u64) -> Rng) -> Vec<WornMark> {
        let mut marks: Vec<(u64, Mark)> = (16_u64..).zip(self.scene.experiment.marks.iter().copied()).collect();
        marks.sort_by_key(|(_, mark)| mark.on == Wearer::Own);
        let mut worn: Vec<(u64, WornMark)> = Vec::new();
        for (at, mark) in marks {
            let before: Vec<Color> = worn.iter().map(|(_, mark)| mark.color).collect();
            worn.extend(self.worn(mark, &before, &mut stream(at)).map(|mark| (at, mark)));
        }
        worn.sort_by_key(|(at, _)| *at);
        worn.into_iter().map(|(_, mark)| mark).collect()
    }

    /// A hand in neither the body's nor its mark's colour, which starts on the near side of the mirror, outside the
    /// body; `None` if no such place has the required distance.
    fn hand(&self, task: Hand, marks: &[WornMark], chance: &mut Rng) -> Option<HandStart> {
        let free = self.other_colors(|color| marks.iter().all(|mark| mark.color != color));
        let palette = &self.scene.experiment.layout.palette;
        let color = chance.one_of(if free.is_empty() { palette } else { &free });
        let shape = chance.one_of(&HandShape::ALL);
        let half_mm = 10 * chance.between(4, 5);
        let patch = marks.iter().find_map(|mark| mark.patch)?;
        let draw = |chance: &mut Rng| HandStart {
            color,
            shape,
            half_mm,
            from_mark: [chance.between(2, 6), chance.between(-5, 5), chance.between(-4, 5)],
        };
        let fits = |hand: &HandStart| {
            let is_there = HandRules { task, patch, hand: *hand, config: self.config, body: self.scene.start };
            (task.least..=task.most).contains(&manhattan(hand.from_mark)) && is_there.is_free(hand.from_mark)
        };
        (0..STARTS).map(|_| draw(chance)).find(fits)
    }

    /// A colour other than those of the body, its mark and the hand, which would be invisible on a body of that colour.
    fn color_beside(&self, hand: HandStart, marks: &[WornMark], chance: &mut Rng) -> Color {
        let free = self.other_colors(|color| color != hand.color && marks.iter().all(|mark| mark.color != color));
        if free.is_empty() { self.any_other_color(chance) } else { chance.one_of(&free) }
    }

    fn another_color(&self, chance: &mut Rng) -> Color {
        let colors: Vec<Color> =
            self.scene.candidates().iter().map(|cube| cube.color).filter(|c| *c != self.scene.body_color).collect();
        if colors.is_empty() { self.any_other_color(chance) } else { chance.one_of(&colors) }
    }

    fn any_other_color(&self, chance: &mut Rng) -> Color {
        chance.one_of(&self.other_colors(|_| true))
    }

    fn other_colors(&self, is_free: impl Fn(Color) -> bool) -> Vec<Color> {
        let palette = self.scene.experiment.layout.palette.iter().copied();
        palette.filter(|color| *color != self.scene.body_color && is_free(*color)).collect()
    }

    fn place(&self, pane: &Pane, before: &[HungPane], chance: &mut Rng) -> Result<MirrorPlace, DoesNotFit> {
        let first = before[0].place.wall;
        let fixed = match pane.wall {
            Wall::Opposite => Some((first + 2) % 4),
            Wall::Same => Some(first),
            wall => wall.quarter(),
        };
        let free: Vec<u8> = (0..4).filter(|wall| before.iter().all(|other| other.place.wall != *wall)).collect();
        let config = self.config;
        let width = pane.width_mm.map_or(config.mirror.width, metres);
        if let Some(wall) = fixed.filter(|wall| !free.contains(wall)) {
            let offsets = self.beside(wall, width, before);
            let offset = (!offsets.is_empty()).then(|| chance.one_of(&offsets));
            let offset = offset.ok_or_else(|| DoesNotFit::overlap(before.len()))?;
            return Ok(MirrorPlace { wall, offset });
        }
        let slack = (config.room.size / 2.0 - width / 2.0 - config.placement.wall_margin).max(0.0);
        let mut draw = || {
            let wall = fixed.unwrap_or_else(|| chance.one_of(&free));
            MirrorPlace { wall, offset: Drawing { config, chance }.length(-slack, slack) }
        };
        let last = draw();
        let unseen = |place: &MirrorPlace| !is_in_view(config, *place, self.scene.start);
        Ok(if unseen(&last) { last } else { (0..PLACES).map(|_| draw()).find(unseen).unwrap_or(last) })
    }

    /// The free places for a pane of this width on a wall, as offsets in whole centimetres.
    fn beside(&self, wall: u8, width: f64, before: &[HungPane]) -> Vec<f64> {
        let most = self.config.room.size / 2.0 - self.config.placement.wall_margin - width / 2.0;
        let is_apart = |offset: f64, other: &HungPane| {
            other.place.wall != wall
                || (offset - other.place.offset).abs() >= f64::midpoint(width, other.width) + BETWEEN
        };
        // Half of the largest room is 6 m.
        let offsets = (-600..=600).map(|offset| f64::from(offset) / 100.0);
        let is_free = |offset: &f64| offset.abs() <= most && before.iter().all(|other| is_apart(*offset, other));
        offsets.filter(is_free).collect()
    }

    fn pane(&self, pane: &Pane, place: MirrorPlace, other: Color, chance: &mut Rng) -> HungPane {
        let mirror = &self.config.mirror;
        let room = &self.config.room;
        let width = pane.width_mm.map_or(mirror.width, metres);
        let height = pane.height_mm.map_or(mirror.height, metres).min(room.height);
        // A wide pane moves towards the middle of its wall, a high one to a height where it fits.
        let slack = (room.size / 2.0 - width / 2.0).max(0.0);
        let place = MirrorPlace { offset: place.offset.clamp(-slack, slack), ..place };
        let center_height = pane.bottom_mm.map_or(mirror.center_height, |bottom| metres(bottom) + height / 2.0);
        let center_height = center_height.clamp(height / 2.0, room.height - height / 2.0);
        let color = match pane.color {
            Paint::Own => self.scene.body_color,
            Paint::Other => other,
            Paint::Named(color) => color,
        };
        let is_independent = pane.kind == PaneKind::Window || pane.body == BodyShown::Independent;
        HungPane {
            kind: pane.kind,
            place,
            width,
            height,
            center_height,
            delay: pane.delay,
            paint: (!is_independent && color != self.scene.body_color).then_some(color),
            from_t: pane.from_t,
            until_t: pane.until_t,
            frame: pane.frame || self.scene.experiment.look == Look::Textured,
            double: is_independent.then(|| self.double(pane, place, color, chance)),
        }
    }

    /// A walking body, initially in view of an observer before the pane.
    fn double(&self, pane: &Pane, place: MirrorPlace, color: Color, chance: &mut Rng) -> Other {
        let [out_x, out_y] = place.heading().direction();
        // The second room is the first one moved: its opening is in the wall across.
        let (side, cubes) = if pane.kind == PaneKind::Window { (-1.0, &[][..]) } else { (1.0, &self.scene.cubes[..]) };
        let plan = floor_plan(self.config, cubes);
        let half = self.config.room.size / 2.0;
        let mut draw = || {
            let away = Drawing { config: self.config, chance }.length(1.2, 2.6);
            let aside = Drawing { config: self.config, chance }.length(-0.8, 0.8) + place.offset;
            let depth = side * (half - away);
            [depth * out_x - aside * out_y, depth * out_y + aside * out_x]
        };
        let last = draw();
        let is_clear = |spot: &[f64; 2]| plan.admits(*spot, 0.05);
        let spot = if is_clear(&last) { last } else { (0..PLACES).map(|_| draw()).find(is_clear).unwrap_or(last) };
        let heading = Heading::new(u8::try_from(chance.below(u32::from(HEADINGS))).unwrap_or(0));
        let habit = u32::try_from(chance.number() >> 32).unwrap_or(0);
        Other { color, start: Pose { x: spot[0], y: spot[1], heading }, habit }
    }

    /// A mark on a body, in a colour other than its wearer's and the earlier marks'.
    fn worn(&self, mark: Mark, before: &[Color], chance: &mut Rng) -> Option<WornMark> {
        let (wearer, body) = match mark.on {
            Wearer::Own => (0, self.scene.body_color),
            Wearer::Other => (1, self.scene.others.first()?.color),
        };
        let palette = self.scene.experiment.layout.palette.iter().copied();
        let free: Vec<Color> = palette.filter(|color| *color != body).collect();
        let unused: Vec<Color> = free.iter().copied().filter(|color| !before.contains(color)).collect();
        let drawn = if unused.is_empty() { &free } else { &unused };
        let color = match mark.color {
            MarkColor::Named(color) if color != body => color,
            MarkColor::Named(_) | MarkColor::Random if drawn.is_empty() => return None,
            MarkColor::Named(_) | MarkColor::Random => chance.one_of(drawn),
        };
        let patch = (mark.part == Part::Front).then(|| Patch {
            aside_mm: 20 * chance.between(-2, 2),
            height_mm: 50 * chance.between(19, 23),
            edge_mm: 20 * chance.between(5, 8),
        });
        Some(WornMark { part: mark.part, color, from_t: mark.from_t, wearer, patch })
    }
}
