//! Seeded draws that are the same on every machine and with every library version.

/// A stream of draws (`SplitMix64`, Steele, Lea and Flood 2014).
pub struct Draw(u64);

impl Draw {
    /// The stream of an episode.
    pub fn of(seed: u64, episode: u64) -> Self {
        let mut mixed = Self(seed);
        Self(mixed.next() ^ episode.wrapping_mul(0x9E37_79B9_7F4A_7C15))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A whole number from 0 to `below - 1`.
    pub fn below(&mut self, below: u64) -> u64 {
        self.next() % below
    }

    /// A whole number below `below`, as the 32 bits of a column.
    pub fn small(&mut self, below: u32) -> i32 {
        i32::try_from(self.below(u64::from(below))).unwrap_or_default()
    }

    /// A whole number below `below`, as a float that holds it exactly.
    pub fn short(&mut self, below: u16) -> u16 {
        u16::try_from(self.below(u64::from(below))).unwrap_or_default()
    }

    /// True with a probability of `chance` in a hundred.
    pub fn percent(&mut self, chance: u64) -> bool {
        self.below(100) < chance
    }

    /// One of these.
    pub fn one<T: Copy>(&mut self, of: &[T]) -> T {
        of[usize::try_from(self.below(of.len() as u64)).unwrap_or_default()]
    }
}
