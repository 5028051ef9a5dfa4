//! The steps with the mirror in view.

use super::generator::Generator;
use super::outline::Outline;

/// The mean length of a look into the mirror, in steps.
const LOOK: usize = 6;

/// For each step, true if the mirror is in view: `gaze` steps in a few looks of several steps.
///
/// The first look begins early more often than late. It begins after the first step if a claim must precede it, and
/// before the last step exactly if the mirror was consulted.
pub fn visible(outline: &Outline, generator: &mut Generator) -> Vec<bool> {
    let Outline { belief, length, gaze, .. } = *outline;
    if gaze == 0 {
        return vec![false; length];
    }
    let sight = if belief.consulted() {
        let earliest = 1 + usize::from(belief.confabulated());
        let latest = (length - 1).min(length - gaze + 1);
        let late = generator.below(latest - earliest + 1);
        earliest + generator.below(late + 1)
    } else {
        length
    };
    let dark = length - sight + 1 - gaze;
    let looks = 1 + generator.below(gaze.min(dark + 1).min(2 * gaze / LOOK + 1));
    looks_from(sight, &generator.compose(gaze, looks), &gaps(dark, looks, generator), length)
}

/// The steps out of view after each look; only after the last one may there be 0.
fn gaps(dark: usize, looks: usize, generator: &mut Generator) -> Vec<usize> {
    let mut gaps = generator.compose(dark + 1, looks);
    gaps[looks - 1] -= 1;
    gaps
}

fn looks_from(sight: usize, looks: &[usize], gaps: &[usize], length: usize) -> Vec<bool> {
    let mut visible = vec![false; sight - 1];
    for (&look, &gap) in looks.iter().zip(gaps) {
        visible.resize(visible.len() + look, true);
        visible.resize(visible.len() + gap, false);
    }
    debug_assert_eq!(visible.len(), length, "looks and gaps fill the episode");
    visible
}

#[cfg(test)]
mod tests {
    use super::super::belief::Belief;
    use super::super::generator::Generator;
    use super::super::outline::{Outcome, Outline};
    use super::visible;

    /// Every possible belief, length and gaze gives exactly that gaze, in time and not too early.
    #[test]
    fn every_possible_gaze_is_generated() {
        let beliefs = [Belief::Unresolved, Belief::Corrected, Belief::Silent, Belief::BlindWrong];
        let mut generator = Generator::of("test");
        for belief in beliefs {
            for length in belief.shortest()..=12 {
                for gaze in belief.gaze(length) {
                    let outline = Outline { outcome: Outcome::Failure, belief, length, gaze };
                    let seen = visible(&outline, &mut generator);
                    assert_eq!(seen.len(), length, "{outline:?}");
                    assert_eq!(seen.iter().filter(|&&s| s).count(), gaze, "{outline:?}");
                    assert_eq!(seen[..length - 1].contains(&true), belief.consulted(), "{outline:?}");
                    assert!(!(belief.confabulated() && seen[0]), "{outline:?}");
                }
            }
        }
    }
}
