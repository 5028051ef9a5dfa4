//! Randomness from the task's seed alone.
//!
//! Rule: only whole numbers are drawn, so the draws are the same on every machine.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

#[derive(Clone, Debug)]
pub struct Chance(Pcg64Mcg);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }

    /// One of `items` with equal probability; `None` if there are none.
    pub fn pick<T: Copy>(&mut self, items: &[T]) -> Option<T> {
        let draw = u64::from(self.0.next_u32());
        let at = (draw * items.len() as u64) >> 32;
        usize::try_from(at).ok().and_then(|at| items.get(at)).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_drawn_about_equally_often() {
        let mut chance = Chance::new(7);
        let mut counts = [0; 3];
        for _ in 0..3_000 {
            counts[chance.pick(&[0, 1, 2]).unwrap()] += 1;
        }
        assert!(counts.iter().all(|count| (900..1_100).contains(count)), "{counts:?}");
    }

    #[test]
    fn equal_seeds_give_equal_draws() {
        let draws = |seed| {
            let mut chance = Chance::new(seed);
            (0..20).map(|_| chance.pick(&[1, 2, 3, 4, 5]).unwrap()).collect::<Vec<i32>>()
        };
        assert_eq!(draws(1), draws(1));
        assert_ne!(draws(1), draws(2));
        assert_eq!(Chance::new(1).pick::<i32>(&[]), None);
    }
}
