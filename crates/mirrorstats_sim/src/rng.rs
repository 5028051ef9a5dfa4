//! Draws: whole numbers from a permuted congruential generator, the same on every machine.
//!
//! Rule: floats are never drawn, and every range is drawn without bias, by rejection.

use rand::Rng as _;
use rand_pcg::Pcg64;

#[derive(Clone, Debug)]
pub struct Rng(Pcg64);

impl Rng {
    /// The stream of these whole numbers; different numbers give different streams.
    pub fn for_run(purpose: u64, seed: i32, run: i32) -> Self {
        let episode = (u64::from(seed.cast_unsigned()) << 32) | u64::from(run.cast_unsigned());
        Self::from_number(mixed(episode) ^ purpose)
    }

    pub(crate) fn from_number(number: u64) -> Self {
        // Neighbouring numbers must not give neighbouring states, which would be noticeable at first.
        let [low, high] = [mixed(number), mixed(mixed(number))];
        Self(Pcg64::new((u128::from(high) << 64) | u128::from(low), 0))
    }

    pub fn number(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// One of 0, 1, .. `below` - 1; 0 if `below` is 0.
    pub fn below(&mut self, below: u32) -> u32 {
        if below == 0 {
            return 0;
        }
        let unbiased = u32::MAX - u32::MAX % below;
        loop {
            let drawn = u32::try_from(self.0.next_u64() >> 32).expect("32 bits are left");
            if drawn < unbiased {
                return drawn % below;
            }
        }
    }

    /// One of `least`, .. `most`.
    pub fn between(&mut self, least: i32, most: i32) -> i32 {
        let span = most.abs_diff(least).saturating_add(1);
        least.saturating_add_unsigned(self.below(span))
    }

    pub fn happens(&mut self, percent: u32) -> bool {
        self.below(100) < percent
    }

    pub fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(u32::try_from(choices.len()).unwrap_or(u32::MAX)) as usize]
    }
}

/// A mixed number in which every bit depends on every input bit (the finalizer of `SplitMix64`).
const fn mixed(number: u64) -> u64 {
    let number = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let number = (number ^ (number >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let number = (number ^ (number >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    number ^ (number >> 31)
}

#[cfg(test)]
mod tests {
    use super::Rng;

    #[test]
    fn draws_are_roughly_uniform() {
        let mut chance = Rng::for_run(1, 2, 3);
        let mut counts = [0_u32; 7];
        for _ in 0..70_000 {
            counts[usize::try_from(chance.between(-3, 3) + 3).unwrap()] += 1;
        }
        assert!(counts.iter().all(|count| (9_600..10_400).contains(count)), "{counts:?}");
    }

    #[test]
    fn streams_are_these_on_every_machine() {
        let drawn = |seed, run| {
            let mut chance = Rng::for_run(1, seed, run);
            [chance.below(1000), chance.below(1000), chance.below(1000)]
        };
        assert_eq!(drawn(0, 0), drawn(0, 0));
        assert_ne!(drawn(0, 0), drawn(0, 1));
        assert_ne!(drawn(0, 1), drawn(1, 0));
    }
}
