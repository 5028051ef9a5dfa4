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

/// A target: its function, and its name, which is also the name of its corpus.
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

/// The target with this name.
///
/// # Panics
/// If there is no target with this name.
pub fn target(name: &str) -> fn(&[u8]) {
    let names = || TARGETS.map(|(name, _)| name).join(", ");
    TARGETS.iter().find(|(known, _)| *known == name).unwrap_or_else(|| panic!("no target `{name}`: {}", names())).1
}
