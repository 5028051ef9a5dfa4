//! The proof of pairs: episodes of one scene are pairs if they began with the same observation.
//!
//! A scene is a name that a recorder wrote. Equal seeds do not make equal starts, so a name alone is a claim. It is proven
//! by the digests of the first frames, or, for agents that see no frames, by the first states.

use std::collections::BTreeMap;
use std::fmt;

use arrow::array::{Array as _, ArrayRef, AsArray};
use arrow::compute::cast;
use arrow::datatypes::DataType;

use crate::inputs::Source;
use crate::{Study, StudyError};
use mirrorstats_exact::format::counted;
use mirrorstats_trace::frame::{Likeness, likeness};
use mirrorstats_trace::read::steps::Steps;

const SCENE: &str = "scene";
const DIGEST: &str = "frame_digest";
/// The state before the first action, which a recorder takes from the world.
const STATE: [&str; 7] =
    ["pose_x", "pose_y", "pose_yaw", "mirror_px", "mirror_self_px", "mirror_other_px", "direct_other_px"];

/// Scenes with several episodes, by the proof that these are pairs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pairs {
    /// All first frames are alike, or all first states are equal.
    pub proven: usize,
    /// An episode has neither a digest of its first frame nor a first state.
    pub claimed: usize,
    /// First frames or states differ: experiment and scene.
    pub contradicted: Vec<String>,
}

/// The beginning of an episode.
#[derive(Debug)]
struct FirstStep {
    digest: Option<String>,
    state: Option<String>,
}

/// Says that pairs are claimed, from the footers alone; `None` without scenes, or if every file has a proof.
pub fn claimed(study: &Study) -> Option<String> {
    let Source::Traces(traces) = &study.source else { return None };
    let files: Vec<_> = traces.files().iter().filter(|file| file.declares(SCENE)).collect();
    let without = files.iter().filter(|file| !file.declares(DIGEST) && !file.declares(STATE[0])).count();
    (without > 0).then(|| {
        let all = counted(files.len() as u64, "file");
        format!(
            "pairs claimed, not proven: {without} of {all} with scenes have no digest of the first observation or state"
        )
    })
}

/// Compares the beginnings of the episodes of each scene, in one pass over the steps. `None` without scenes.
pub fn pairs(study: &Study) -> Result<Option<Pairs>, StudyError> {
    let traces = study.traces()?;
    if !traces.declares(SCENE) {
        return Ok(None);
    }
    let optional = STATE.into_iter().chain([DIGEST]).filter(|name| traces.column(name).is_some());
    let columns: Vec<String> = ["experiment", SCENE, "t"].into_iter().chain(optional).map(str::to_owned).collect();
    let mut scenes: BTreeMap<(String, String), Vec<FirstStep>> = BTreeMap::new();
    for batch in Steps::new(traces, Some(&columns), None, study.threads)? {
        let batch = batch?;
        let texts: Vec<ArrayRef> = batch.columns().iter().filter_map(|one| cast(one, &DataType::Utf8).ok()).collect();
        let of = |name: &str, row: usize| {
            let column = texts.get(columns.iter().position(|column| column == name)?)?;
            column.is_valid(row).then(|| column.as_string::<i32>().value(row).to_owned())
        };
        for row in (0..batch.num_rows()).filter(|row| of("t", *row).as_deref() == Some("1")) {
            if let (Some(experiment), Some(scene)) = (of("experiment", row), of(SCENE, row)) {
                let state = of(STATE[0], row).map(|_| {
                    let values = STATE.iter().map(|name| of(name, row).unwrap_or_default());
                    values.collect::<Vec<_>>().join(" ")
                });
                scenes.entry((experiment, scene)).or_default().push(FirstStep { digest: of(DIGEST, row), state });
            }
        }
    }
    let mut found = Pairs::default();
    for ((experiment, scene), steps) in scenes.into_iter().filter(|(_, steps)| steps.len() > 1) {
        match is_pair(&steps) {
            None => found.claimed += 1,
            Some(true) => found.proven += 1,
            Some(false) => found.contradicted.push(format!("{experiment}, {scene}")),
        }
    }
    Ok(Some(found))
}

/// Compares frames where all episodes have them, else states. `None` without either.
fn is_pair(steps: &[FirstStep]) -> Option<bool> {
    let digests: Option<Vec<&String>> = steps.iter().map(|step| step.digest.as_ref()).collect();
    if let Some(all) = digests {
        return Some(all.iter().all(|one| is_alike(all[0], one)));
    }
    let states: Option<Vec<&String>> = steps.iter().map(|step| step.state.as_ref()).collect();
    states.map(|all| all.iter().all(|one| one == &all[0]))
}

fn is_alike(one: &str, other: &str) -> bool {
    matches!(likeness(one, other), Some(Likeness::Equal | Likeness::Alike))
}

impl fmt::Display for Pairs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = self.proven + self.claimed + self.contradicted.len();
        if all == 0 {
            return f.write_str("no pairs: each scene has one episode");
        }
        let all = counted(all as u64, "scene");
        if let Some(first) = self.contradicted.first() {
            let count = self.contradicted.len();
            write!(f, "pairs contradicted: in {count} of {all} the first observations differ, such as {first}; ")?;
        }
        match self.claimed {
            0 => write!(f, "pairs proven in {} of {all}: their first observations are alike", self.proven),
            count => {
                write!(f, "pairs claimed, not proven, in {count} of {all}: no digest of the first observation or state")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Pairs, claimed, pairs};
    use crate::Study;

    #[test]
    fn first_observations_prove_pairs() {
        let recorded = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/recorded");
        let study = Study::open([recorded]).unwrap();
        let found = pairs(&study).unwrap().unwrap();
        assert!(found.proven > 0 && found.claimed == 0 && found.contradicted.is_empty(), "{found:?}");
        assert_eq!(claimed(&study), None);
        let paper = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper");
        assert_eq!(pairs(&Study::open([paper]).unwrap()).unwrap(), None);
    }

    #[test]
    fn the_sentence_names_the_worst_case_first() {
        let text = |proven, claimed, contradicted: &[&str]| {
            let contradicted = contradicted.iter().map(|name| (*name).to_owned()).collect();
            Pairs { proven, claimed, contradicted }.to_string()
        };
        assert_eq!(text(2, 0, &[]), "pairs proven in 2 of 2 scenes: their first observations are alike");
        assert!(text(1, 1, &[]).starts_with("pairs claimed, not proven, in 1 of 2 scenes"));
        assert!(
            text(1, 0, &["E1, a"])
                .starts_with("pairs contradicted: in 1 of 2 scenes the first observations differ, such as E1, a")
        );
        assert_eq!(text(0, 0, &[]), "no pairs: each scene has one episode");
    }
}
