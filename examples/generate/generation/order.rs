//! The order of a study's episodes in its files.

use clap::ValueEnum;

use super::draw::Draw;

/// The order of episodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Order {
    /// As a study is recorded: model by model, then experiment, seed and run.
    Study,
    /// Models, experiments, seeds and runs at random, over all files.
    Shuffled,
}

impl Order {
    /// The numbers of the episodes, 0 to `episodes - 1`, in this order.
    pub fn numbers(self, seed: u64, episodes: u32) -> Vec<u32> {
        let mut numbers: Vec<u32> = (0..episodes).collect();
        if self == Self::Shuffled {
            // Fisher and Yates. No episode has the number u64::MAX, so its stream of draws is free.
            let mut draw = Draw::of(seed, u64::MAX);
            for last in (1..numbers.len()).rev() {
                let other = usize::try_from(draw.below(last as u64 + 1)).unwrap_or_default();
                numbers.swap(last, other);
            }
        }
        numbers
    }
}
