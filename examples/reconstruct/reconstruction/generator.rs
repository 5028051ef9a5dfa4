//! A small seeded generator for everything that the published tables leave open.
//!
//! `SplitMix64` (Steele, Lea and Flood, 2014), written out so that no library release can change the fixture. Not for
//! statistics: bounds are applied by multiplication, which is slightly uneven.

use mirrorstats_exact::hash;

/// The generator's state.
pub struct Generator(u64);

impl Generator {
    /// The generator for a name, such as `E1/GPT 5.1`.
    pub fn of(name: &str) -> Self {
        let digits = &hash::of_bytes(name.as_bytes())[..16];
        Self(u64::from_str_radix(digits, 16).expect("a hash starts with sixteen hexadecimal digits"))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number in `0..count`; 0 if there is no choice.
    pub fn below(&mut self, count: usize) -> usize {
        let scaled = (u128::from(self.next()) * count as u128) >> 64;
        usize::try_from(scaled).expect("a scaled draw is below a usize")
    }

    /// True with a chance of `times` in `of`.
    pub fn chance(&mut self, times: usize, of: usize) -> bool {
        self.below(of) < times
    }

    /// One of the items, which must not be empty.
    pub fn pick<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.below(items.len())]
    }

    /// Puts the items into a random order (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }

    /// `total` as a sum of `pieces` numbers of at least 1; needs `total >= pieces >= 1`.
    pub fn compose(&mut self, total: usize, pieces: usize) -> Vec<usize> {
        let mut parts = vec![1; pieces];
        for _ in pieces..total {
            parts[self.below(pieces)] += 1;
        }
        parts
    }
}
