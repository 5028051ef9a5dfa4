//! The colour of the body: each equally often, for any number of seeds and runs of a study, and never visible in the
//! scene.
//!
//! Rule: a scene is drawn without the body's colour. Then a candidate is drawn to be the agent's, and the colour of that
//! candidate changes places with the body's in the whole scene. All colours are drawn alike, so the scene says nothing
//! about which candidate it is.
//!
//! A square of `n` by `n` numbers: each row and each column has each number once. Every rectangle at its first corner
//! has each number equally often, or once more. Seeds are its rows and runs its columns, periodically, so colours are
//! balanced for any size of study and stay unchanged when it grows. Each period has an order of colours of its own, which
//! does not change the counts. A backtracking search, row after row, found the squares.

use super::super::rng::Rng;
use super::super::scene::Scene;
use super::shuffle;
use mirrorstats_experiment::Spec;
use mirrorstats_experiment::spec::{Colors, Cubes, Paint};
use mirrorstats_trace::schema::colors::Color;

/// The squares of 2 to 10 colours, row after row, one digit per cell.
const SQUARES: [&str; 9] = [
    "1001",
    "102210021",
    "3201012323101032",
    "2014331402042311302442310",
    "204513153042431205025431342150510324",
    "3165420425016306132455024631634150214320562506314",
    "3214657050672413475031621632075474215036650312472146730503754621",
    "528140637460738125371625804082457361715306248634281750807562413253814076146073582",
    "6872530941104396275892518743063706418529458902167321376590848964705132031528649756983472107420193865",
];

/// The minimum number of colours that can be balanced.
const LEAST: usize = 2;

/// Separates these streams from the layout's.
const PURPOSE: u64 = 0x726f_6c65_0000;

/// What the scene does not show: the agent's colour, and the candidate that is to have it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Role {
    pub color: Color,
    /// The index of the cube; 0 without candidates.
    pub candidate: usize,
}

impl Role {
    pub(super) fn draw(experiment: &Spec, purpose: u64, seed: i32, run: i32) -> Self {
        let mut chance = Rng::for_run(purpose ^ PURPOSE, seed, run);
        let candidate = match experiment.layout.cubes {
            Cubes::Candidates { count } => chance.below(count) as usize,
            Cubes::None | Cubes::Clutter { .. } => 0,
        };
        let palette = &experiment.layout.palette;
        let color = match experiment.layout.colors {
            Colors::Random => Rng::for_run(!purpose, seed, run).one_of(palette),
            Colors::Balanced => balanced(palette, purpose, seed, run),
        };
        Self { color, candidate }
    }
}

/// The colour of an episode by its seed and run.
fn balanced(palette: &[Color], purpose: u64, seed: i32, run: i32) -> Color {
    if palette.len() < LEAST {
        return palette[0];
    }
    let square = SQUARES[palette.len() - LEAST].as_bytes();
    let side = i32::try_from(palette.len()).expect("a palette has at most ten colours");
    // Seeds and runs start at 1.
    let [seed, run] = [seed, run].map(|from_one| from_one.wrapping_sub(1));
    let at = usize::try_from(seed.rem_euclid(side) * side + run.rem_euclid(side)).expect("both are at least 0");
    let mut order = palette.to_vec();
    shuffle(&mut order, &mut Rng::for_run(purpose ^ (PURPOSE + 1), seed.div_euclid(side), run.div_euclid(side)));
    order[usize::from(square[at] - b'0')]
}

/// The same scene with another colour of the body, which changes places with the present one. Colours that the
/// experiment names stay.
pub(super) fn recolored(mut scene: Scene, body: Color) -> Scene {
    let present = scene.body_color;
    let swap = |color: &mut Color| match *color {
        before if before == present => *color = body,
        before if before == body => *color = present,
        _ => {}
    };
    scene.cubes.iter_mut().for_each(|cube| swap(&mut cube.color));
    if !matches!(scene.experiment.layout.others.color, Some(Paint::Named(_))) {
        scene.others.iter_mut().for_each(|other| swap(&mut other.color));
    }
    Scene { body_color: body, ..scene }
}

/// The colours of the palette that no candidate has. If there are none, all but the body's.
pub(super) fn strange_colors(scene: &Scene) -> Vec<Color> {
    let without = |is_taken: &dyn Fn(Color) -> bool| {
        let palette = scene.experiment.layout.palette.iter().copied();
        palette.filter(|color| *color != scene.body_color && !is_taken(*color)).collect::<Vec<_>>()
    };
    let free = without(&|color| scene.candidates().iter().any(|cube| cube.color == color));
    if free.is_empty() { without(&|_| false) } else { free }
}

#[cfg(test)]
mod tests {
    use super::{LEAST, SQUARES, balanced};
    use mirrorstats_trace::schema::colors::Color;

    #[test]
    fn every_study_from_the_first_seed_and_run_is_balanced() {
        for count in 1..=SQUARES.len() + 1 {
            let (side, palette) = (i32::try_from(count).unwrap(), &Color::ALL[..count]);
            for (seeds, runs) in (1..=2 * side + 1).flat_map(|seeds| (1..=2 * side + 1).map(move |runs| (seeds, runs)))
            {
                let mut counts = vec![0_usize; count];
                for (seed, run) in (1..=seeds).flat_map(|seed| (1..=runs).map(move |run| (seed, run))) {
                    let color = balanced(palette, 7, seed, run);
                    counts[palette.iter().position(|known| *known == color).unwrap()] += 1;
                }
                let (least, most) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
                assert!(most - least <= 1, "{count} colours, {seeds} seeds of {runs} runs: {counts:?}");
            }
        }
    }

    #[test]
    fn any_seed_and_run_has_a_colour() {
        for number in [i32::MIN, -1, 0, 1, i32::MAX] {
            assert!(Color::ALL[..LEAST].contains(&balanced(&Color::ALL[..LEAST], 7, number, number)));
        }
    }

    /// A formula of seed and run that finds the colours of the first period would find those of the others.
    #[test]
    fn colours_are_not_a_function_of_seed_and_run_modulo_the_period() {
        let color = |seed, run| balanced(&Color::ALL, 7, seed, run);
        let equal = (1..=10).flat_map(|seed| (1..=10).map(move |run| (seed, run)));
        let equal = equal.filter(|&(seed, run)| color(seed, run) == color(seed + 10, run + 20)).count();
        assert!(equal <= 40, "{equal} of 100 colours of one period come again in another one");
    }
}
