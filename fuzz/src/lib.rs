//! Fuzz targets: functions of bytes that panic when a property does not hold.
//!
//! One function serves three callers: libFuzzer (`make fuzz`), the replay of the committed corpora (`tests/corpus.rs`,
//! which CI runs), and the seeded campaign of page mutants (`mirrorstats-fuzz pages`). `benches/FUZZ.md` has commands
//! and counts.

mod definitions;
pub mod depth;
mod episodes;
mod logs;
pub mod pages;
pub mod pairs;
mod quiet;
mod replies;
mod scratch;
pub mod seeds;
mod texts;
mod traces;

/// A target: its name, which is that of its corpus, and its function.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 23] = [
    ("pages", pages::target),
    ("footer", traces::footer),
    ("trace", traces::trace),
    ("import", traces::import_lines),
    ("recover", logs::recover),
    ("assemble", logs::assembled),
    ("definitions", definitions::target),
    ("manifest", texts::manifest),
    ("style", texts::style),
    ("world", texts::world),
    ("experiments", texts::experiments),
    ("plan", texts::plan),
    ("lost", texts::lost_episodes),
    ("scores", texts::scores),
    ("journal", replies::journal),
    ("cassette", replies::cassette),
    ("replies", replies::target),
    ("defined", pairs::defined),
    ("grouped", pairs::grouped),
    ("filtered", pairs::filtered),
    ("asked", pairs::asked),
    ("logged", pairs::logged),
    ("styled", pairs::styled),
];

/// The target of this name.
///
/// # Panics
/// For a name that is invalid.
pub fn target(name: &str) -> fn(&[u8]) {
    let names = || TARGETS.map(|(name, _)| name).join(", ");
    TARGETS.iter().find(|(known, _)| *known == name).unwrap_or_else(|| panic!("no target `{name}`: {}", names())).1
}
