//! Two blocks by pairs of episodes with the same scene, and by unit of analysis: a scene, a declared cluster or a
//! participant counts once.
//!
//! Rule: a pair is one episode of each side with one scene, if each side has exactly one with it. Only the scenes
//! decide whether two blocks are compared by pairs, before any outcome is read.

use std::collections::BTreeMap;
use std::mem::discriminant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::study::{Block, Study, Unit};
use mirrorstats_exact::format::counted;
use mirrorstats_exact::moments::Moments;
use mirrorstats_score::tables::table::MetricColumn;
use mirrorstats_statistics::comparisons::holm::level;
use mirrorstats_statistics::comparisons::paired::Pairs;
use mirrorstats_statistics::comparisons::units::{self, UnitTest, difference_test};
use mirrorstats_statistics::intervals::clustered::fewest_clusters;

/// The matching of the episodes of two blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Matching {
    /// The pairs: scenes that each side has exactly once.
    pub pairs: u64,
    /// Episodes of either side whose scene the other side does not have.
    pub alone: u64,
    /// Episodes of either side whose scene both have, and one of them more than once.
    pub repeated: u64,
    /// Episodes of either side without a declared scene.
    pub undeclared: u64,
    /// True if the two are compared by their pairs: at least half of the episodes of each side are in one.
    pub paired: bool,
}

pub(crate) struct Scenes {
    /// The rows of each scene, by its number in the table.
    pub rows: BTreeMap<usize, Vec<usize>>,
    undeclared: u64,
}

/// Two blocks' pairs, as rows of the table, in the order of the scenes.
pub(crate) struct Matched {
    pub matching: Matching,
    /// The pairs if they are compared; otherwise `None`.
    pub pairs: Option<Vec<(usize, usize)>>,
}

/// The 2x2 table of a rate over pairs of rows; pairs with an undefined value do not count.
pub(crate) fn outcomes(column: &MetricColumn, pairs: &[(usize, usize)]) -> Pairs {
    Pairs::of(pairs.iter().filter_map(|&(a, b)| Some((column.get(a)?, column.get(b)?))))
}

impl Scenes {
    pub fn of(study: &Study, block: &Block) -> Self {
        let mut found = Self { rows: BTreeMap::new(), undeclared: 0 };
        for row in block.rows() {
            match study.scenes().and_then(|scenes| scenes.code(row)) {
                Some(scene) => found.rows.entry(scene).or_default().push(row),
                None => found.undeclared += 1,
            }
        }
        found
    }

    fn episodes(&self) -> u64 {
        self.undeclared + self.rows.values().map(|rows| rows.len() as u64).sum::<u64>()
    }
}

impl Matched {
    pub fn of(first: &Scenes, second: &Scenes) -> Self {
        let mut matching = Matching { undeclared: first.undeclared + second.undeclared, ..Matching::default() };
        let mut pairs = Vec::new();
        for (scene, here) in &first.rows {
            match (here.as_slice(), second.rows.get(scene).map(Vec::as_slice)) {
                (here, None) => matching.alone += here.len() as u64,
                (&[a], Some(&[b])) => pairs.push((a, b)),
                (here, Some(there)) => matching.repeated += (here.len() + there.len()) as u64,
            }
        }
        let only_second = second.rows.iter().filter(|(scene, _)| !first.rows.contains_key(scene));
        matching.alone += only_second.map(|(_, rows)| rows.len() as u64).sum::<u64>();
        matching.pairs = pairs.len() as u64;
        let most = first.episodes().max(second.episodes());
        // A test of fewer pairs would leave out most of the episodes.
        matching.paired = !pairs.is_empty() && 2 * matching.pairs >= most;
        Self { matching, pairs: matching.paired.then_some(pairs) }
    }
}

/// The selection of two sides by the condition of a metric, such as success; `None` if the metric is defined in all their
/// episodes or in none of a side. What selects episodes may be what the sides differ in. A difference among the selected
/// ones is then no difference of the sides (Frangakis and Rubin 2002, principal stratification).
pub(crate) fn selection(study: &Study, column: &MetricColumn, sides: [&Block; 2]) -> Option<String> {
    let counts = sides.map(|block| (block.moments(column).n, block.rows().count() as u64));
    // A side without any value is not compared at all.
    let is_part = counts.iter().any(|(defined, all)| defined < all) && counts.iter().all(|(defined, _)| *defined > 0);
    let is_conditional = study.metric(&column.name).when.is_some();
    let [(a, m), (b, n)] = counts;
    (is_conditional && is_part).then(|| format!("defined in {a} of {m} against {b} of {n} episodes"))
}

/// Scenes, seeds or participants with several episodes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Units {
    /// The number of units.
    pub n: u64,
    /// Their name, in the plural.
    pub name: String,
    /// True if the units are too few for a verdict: no symmetric test can reach the level of significance.
    pub too_few: bool,
}

impl Units {
    pub(crate) fn new(study: &Study, block: &Block, n: usize, least: f64) -> Self {
        Self { n: n as u64, name: study.unit_name(block).to_owned(), too_few: too_few(n, least, study.confidence) }
    }

    /// The units of two sides. Units of different kinds, such as participants and scenes, cannot be tested.
    pub(super) fn between(study: &Study, blocks: [&Block; 2], sides: &Sides, least: f64) -> Self {
        let ([first, second], names) = (sides.counts(), blocks.map(|block| study.unit_name(block)));
        if names[0] == names[1] {
            return Self::new(study, blocks[0], first.min(second), least);
        }
        let second = counted(second as u64, singular(names[1]));
        Self { n: first as u64, name: format!("{} against {second}", names[0]), too_few: true }
    }

    /// `1 scene`, `2 scenes`, `1 participant against 2 scenes`.
    pub(crate) fn counted(&self) -> String {
        let (noun, second) = self.name.split_at(self.name.find(" against ").unwrap_or(self.name.len()));
        counted(self.n, singular(noun)) + second
    }
}

pub(crate) fn singular(plural: &str) -> &str {
    plural.strip_suffix('s').unwrap_or(plural)
}

/// True if no symmetric test with this number of units or episodes, or with this least p value, can reach the level.
pub(crate) fn too_few(n: usize, least: f64, confidence: f64) -> bool {
    level(confidence).is_none_or(|level| least > level || n < fewest_clusters(level))
}

pub(crate) struct Sides {
    units: BTreeMap<Unit, [Moments; 2]>,
}

impl Sides {
    /// The sides of all strata together: a unit of several strata counts once. `None` if each episode is its own unit,
    /// or all units are pairs of one episode each.
    pub fn of(study: &Study, column: &MetricColumn, strata: &[(&Block, &Block)]) -> Option<Self> {
        if !study.has_units() {
            return None;
        }
        let sides = Self::by(study, strata, |row| column.get(row));
        let repeats = sides.units.values().flatten().any(|side| side.n > 1);
        let shared = sides.units.values().filter(|[a, b]| a.n > 0 && b.n > 0).count();
        let is_partly_shared = shared > 0 && shared < sides.units.len();
        (repeats || is_partly_shared).then_some(sides)
    }

    pub fn by(study: &Study, strata: &[(&Block, &Block)], value: impl Fn(usize) -> Option<i64>) -> Self {
        let mut units: BTreeMap<Unit, [Moments; 2]> = BTreeMap::new();
        for (side, block) in strata.iter().flat_map(|(first, second)| [(0, first), (1, second)]) {
            for (row, value) in block.rows().filter_map(|row| Some((row, value(row)?))) {
                let sum = &mut units.entry(study.unit(row)).or_default()[side];
                *sum = sum.with(value).expect("a part of blocks that were summed whole");
            }
        }
        Self { units }
    }

    /// The means of both sides, with each unit counted once.
    pub fn means(&self) -> [Option<f64>; 2] {
        [0, 1].map(|side| units::mean(&self.of_side(side).collect::<Vec<_>>()))
    }

    fn of_side(&self, side: usize) -> impl Iterator<Item = Moments> {
        self.units.values().map(move |unit| unit[side]).filter(|moments| moments.n > 0)
    }

    /// The units on the smaller side.
    pub fn len(&self) -> usize {
        self.counts().into_iter().min().unwrap_or_default()
    }

    fn counts(&self) -> [usize; 2] {
        [0, 1].map(|side| self.of_side(side).count())
    }

    /// The shared units, and those of one side; `None` if the units of the two sides are of different kinds.
    pub(crate) fn divided(&self) -> Option<units::Sides> {
        let mut sides = units::Sides::default();
        let mut kinds = [None; 2];
        for (unit, &[a, b]) in &self.units {
            match (a.n, b.n) {
                (0, _) => sides.second.push(b),
                (_, 0) => sides.first.push(a),
                _ => sides.shared.push((a, b)),
            }
            for (kind, side) in kinds.iter_mut().zip([a, b]) {
                if side.n > 0 {
                    kind.get_or_insert(discriminant(unit));
                }
            }
        }
        (kinds[0] == kinds[1]).then_some(sides)
    }

    /// The exact test of a rate; `lost` are additional shared units.
    pub fn test(&self, lost: &[(Moments, Moments)]) -> Option<UnitTest> {
        let mut sides = self.divided()?;
        sides.shared.splice(..0, lost.iter().copied());
        difference_test(&sides)
    }
}
