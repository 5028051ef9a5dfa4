use super::Experiment;
use super::file;
use mirrorstats_toml_spec::Source;

macro_rules! files {
    ($($name:literal)+) => {
        /// The experiments by name, the paper's five first; a later one may use the scenes of an earlier one.
        const FILES: [(&str, &str); [$($name),+].len()] =
            [$(($name, include_str!(concat!("../../../assets/experiments/", $name, ".toml")))),+];
    };
}

files! {
    "E1" "E2" "E3" "E4" "E5"
    "two-mirrors" "delayed" "decoy" "window" "mark"
    "reach-scheme" "reach-mirror" "reach-hand" "reach-bare" "reach-no-mirror" "reach-decoy" "reach-late"
    "delay-01" "delay-02" "delay-04" "delay-08" "delay-16" "delay-32"
    "memory-0" "memory-8" "memory-no-summary" "memory-no-position"
    "can-know" "cannot-know" "random-clutter"
    "contingency" "contingency-late" "contingency-swap"
}

pub fn built_in_names() -> Vec<&'static str> {
    FILES.iter().map(|(name, _)| *name).collect()
}

pub fn built_in(name: &str) -> Option<&'static str> {
    FILES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Every built-in experiment, parsed as one text, so that one may use the scenes of another.
pub(super) fn all() -> Vec<Experiment> {
    let text: String = FILES.iter().map(|(_, text)| *text).collect::<Vec<_>>().join("\n");
    let source = Source { name: "built-in experiments".to_owned(), text };
    let entries =
        file::read(source, None, &[]).unwrap_or_else(|faults| panic!("the built-in experiments are tested:\n{faults}"));
    entries.into_iter().map(|entry| entry.experiment).collect()
}
