//! Tied sets: members of a family that no test separates, in place of ranks.
//!
//! Rule: a set is tied if no two of its members are separated. All maximal tied sets are returned, as in a compact
//! letter display (Piepho 2004). Sets overlap if separation is not transitive, which is usual at n = 21.

/// All maximal tied sets of `count` members; `separated` is called with the smaller index first. Members ascend within
/// a set, sets ascend by their members, and each member is in at least one set. The search is the Bron-Kerbosch
/// algorithm with a pivot (1973), exponential only for contrived ties.
pub fn tied_sets(count: usize, separated: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let row = |a: usize| (0..count).map(|b| a != b && !separated(a.min(b), a.max(b))).collect();
    let tied = Ties((0..count).map(row).collect());
    let mut found = Vec::new();
    if count > 0 {
        tied.grow(&mut Vec::new(), (0..count).collect(), Vec::new(), &mut found);
    }
    found.sort();
    found
}

struct Ties(Vec<Vec<bool>>);

impl Ties {
    /// Extends `set` by each candidate in turn. A set without candidates and excluded members is maximal.
    fn grow(
        &self,
        set: &mut Vec<usize>,
        mut candidates: Vec<usize>,
        mut excluded: Vec<usize>,
        found: &mut Vec<Vec<usize>>,
    ) {
        if candidates.is_empty() && excluded.is_empty() {
            let mut whole = set.clone();
            whole.sort_unstable();
            found.push(whole);
            return;
        }
        for member in self.away_from_pivot(&candidates, &excluded) {
            set.push(member);
            self.grow(set, self.tied_to(member, &candidates), self.tied_to(member, &excluded), found);
            set.pop();
            candidates.retain(|&other| other != member);
            excluded.push(member);
        }
    }

    fn tied_to(&self, member: usize, others: &[usize]) -> Vec<usize> {
        others.iter().copied().filter(|&other| self.0[member][other]).collect()
    }

    fn away_from_pivot(&self, candidates: &[usize], excluded: &[usize]) -> Vec<usize> {
        let pivot =
            candidates.iter().chain(excluded).copied().max_by_key(|&pivot| self.tied_to(pivot, candidates).len());
        candidates.iter().copied().filter(|&member| pivot.is_none_or(|pivot| !self.0[pivot][member])).collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::tied_sets;

    #[test]
    fn sets_are_maximal_and_may_overlap() {
        assert_eq!(tied_sets(3, |_, _| false), [[0, 1, 2]]);
        assert_eq!(tied_sets(3, |_, _| true), [[0], [1], [2]]);
        assert_eq!(tied_sets(3, |a, b| (a, b) == (0, 2)), [[0, 1], [1, 2]]);
        assert_eq!(tied_sets(0, |_, _| true), Vec::<Vec<usize>>::new());
    }

    proptest! {
        #[test]
        fn the_sets_match_a_brute_force_search(bits in prop::collection::vec(any::<bool>(), 64)) {
            const COUNT: usize = 8;
            let separated = |a: usize, b: usize| bits[a * COUNT + b];
            let is_tied = |mask: usize| (0..COUNT).all(|b| (0..b).all(|a| mask >> a & mask >> b & 1 == 0 || !separated(a, b)));
            let whole = |mask: usize| is_tied(mask) && (0..COUNT).all(|m| mask >> m & 1 == 1 || !is_tied(mask | 1 << m));
            let mut expected: Vec<Vec<usize>> =
                (1usize..1 << COUNT).filter(|&m| whole(m)).map(|m| (0..COUNT).filter(|i| m >> i & 1 == 1).collect()).collect();
            expected.sort();
            prop_assert_eq!(tied_sets(COUNT, separated), expected);
        }
    }
}
