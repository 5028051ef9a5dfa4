//! The proof of pairs: episodes of one scene are pairs if they began with the same observation.
//!
//! A scene is a name that a recorder wrote. Equal seeds do not make equal starts, so a name alone is a claim. The digest
//! of the first frame proves it.

use std::collections::BTreeMap;
use std::fmt;

use arrow::array::{Array as _, AsArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Int64Type};

use crate::inputs::Source;
use crate::{Study, StudyError};
use mirrorstats_exact::format::counted;
use mirrorstats_trace::frame::{Likeness, likeness};
use mirrorstats_trace::read::steps::Steps;

const SCENE: &str = "scene";
const DIGEST: &str = "frame_digest";

/// Scenes with several episodes, by the proof that these are pairs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pairs {
    /// All first frames are alike.
    pub proven: usize,
    /// An episode has no digest of its first frame.
    pub claimed: usize,
    /// First frames differ: experiment and scene.
    pub contradicted: Vec<String>,
}

/// Says that pairs are claimed, from the footers alone; `None` without scenes, or if every file has digests.
pub fn claimed(study: &Study) -> Option<String> {
    let Source::Traces(traces) = &study.source else { return None };
    let files: Vec<_> = traces.files().iter().filter(|file| file.declares(SCENE)).collect();
    let without = files.iter().filter(|file| !file.declares(DIGEST)).count();
    (without > 0).then(|| {
        let all = counted(files.len() as u64, "file");
        format!("pairs claimed, not proven: {without} of {all} with scenes have no digest of the first observation")
    })
}

/// Compares the first frames of each scene, in one pass over the steps. `None` without scenes.
pub fn pairs(study: &Study) -> Result<Option<Pairs>, StudyError> {
    let traces = study.traces()?;
    if !traces.declares(SCENE) {
        return Ok(None);
    }
    let columns = ["experiment", SCENE, "t", DIGEST].map(str::to_owned);
    let has_digests = traces.column(DIGEST).is_some();
    let columns = &columns[..if has_digests { 4 } else { 3 }];
    let mut scenes: BTreeMap<(String, String), Vec<Option<String>>> = BTreeMap::new();
    for batch in Steps::new(traces, Some(columns), None, study.threads)? {
        let batch = batch?;
        let text = |at: usize| cast(batch.column(at), &DataType::Utf8).ok();
        let (Some(experiments), Some(names)) = (text(0), text(1)) else { continue };
        let Ok(steps) = cast(batch.column(2), &DataType::Int64) else { continue };
        let digests = if has_digests { text(3) } else { None };
        for row in (0..batch.num_rows()).filter(|row| steps.as_primitive::<Int64Type>().value(*row) == 1) {
            let of = |values: &arrow::array::ArrayRef| {
                values.is_valid(row).then(|| values.as_string::<i32>().value(row).to_owned())
            };
            if let (Some(experiment), Some(scene)) = (of(&experiments), of(&names)) {
                scenes.entry((experiment, scene)).or_default().push(digests.as_ref().and_then(of));
            }
        }
    }
    let mut found = Pairs::default();
    for ((experiment, scene), digests) in scenes.into_iter().filter(|(_, digests)| digests.len() > 1) {
        let known: Option<Vec<String>> = digests.into_iter().collect();
        match known {
            None => found.claimed += 1,
            Some(all) if all.iter().all(|one| is_alike(&all[0], one)) => found.proven += 1,
            Some(_) => found.contradicted.push(format!("{experiment}, {scene}")),
        }
    }
    Ok(Some(found))
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
            write!(f, "pairs contradicted: in {count} of {all} the first frames differ, such as {first}; ")?;
        }
        match self.claimed {
            0 => write!(f, "pairs proven in {} of {all}: their first frames are alike", self.proven),
            count => write!(f, "pairs claimed, not proven, in {count} of {all}: no digest of the first observation"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Pairs, claimed, pairs};
    use crate::Study;

    #[test]
    fn first_frames_prove_pairs() {
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
        assert_eq!(text(2, 0, &[]), "pairs proven in 2 of 2 scenes: their first frames are alike");
        assert!(text(1, 1, &[]).starts_with("pairs claimed, not proven, in 1 of 2 scenes"));
        assert!(
            text(1, 0, &["E1, a"])
                .starts_with("pairs contradicted: in 1 of 2 scenes the first frames differ, such as E1, a")
        );
        assert_eq!(text(0, 0, &[]), "no pairs: each scene has one episode");
    }
}
