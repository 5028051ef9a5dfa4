//! `lost.jsonl` beside the traces: the episodes that failures prevented, one JSON object per line.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ListError, numbered_lines};
use crate::inputs::Input;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::escape::visible;

/// A line names an episode and its failure; both are short.
pub const LONGEST_LINE: Limit = Limit::new("bytes in a line of a list of lost episodes", 1 << 20);

/// An episode that was lost without an answer.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct LostEpisode {
    /// Its id.
    pub episode_id: String,
    /// The model's name as shown in tables.
    pub model: String,
    /// The condition; absent for the default one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    /// The experiment, E1 to E5.
    pub experiment: String,
    /// The block of runs.
    pub seed: i32,
    /// The run within it.
    pub run: i32,
    /// The step that got no reply; null if the episode did not come to its first.
    pub step: Option<i32>,
    /// The failure's value in the trace's column `reply_status`; null if none of them fits.
    pub status: Option<String>,
    /// The failure, without any key.
    pub reason: String,
}

pub fn list_of(folder: &Path) -> PathBuf {
    folder.join("lost.jsonl")
}

/// The contents of a list; empty if the file does not exist.
pub fn read(path: &Path) -> Result<Vec<LostEpisode>, ListError> {
    let mut found = Vec::new();
    for line in numbered_lines(path, LONGEST_LINE)? {
        let (line, text) = line?;
        found.push(serde_json::from_slice(&text).map_err(|error| {
            let found = visible(&error.to_string());
            let problem = format!("expected a lost episode as `mirrorstats record` lists it, found {found}");
            let help =
                "`mirrorstats record` writes the list anew; remove the line, or the file if no episode is missing";
            ListError::Line { path: path.to_owned(), line, problem, help }
        })?);
    }
    Ok(found)
}

pub fn beside(traces: &[Input]) -> Result<Vec<LostEpisode>, ListError> {
    let folders: BTreeSet<&Path> = traces.iter().filter_map(|input| input.path.parent()).collect();
    let mut all = BTreeSet::new();
    for folder in folders {
        all.extend(read(&list_of(folder))?);
    }
    Ok(all.into_iter().collect())
}

#[cfg(test)]
mod tests {
    use super::{beside, list_of, read};
    use crate::inputs::Input;

    const LINE: &str = r#"{"episode_id":"E1/m/s1/r1","model":"m","experiment":"E1","seed":1,"run":1,"step":4,"status":"timeout","reason":"x"}"#;

    #[test]
    fn each_list_beside_the_traces_is_read_once() {
        let folder = tempfile::tempdir().unwrap();
        let inputs = ["a.parquet", "b.parquet"].map(|name| Input::new(folder.path().join(name)));
        assert!(beside(&inputs).unwrap().is_empty());
        std::fs::write(list_of(folder.path()), format!("{LINE}\n")).unwrap();
        let found = beside(&inputs).unwrap();
        assert_eq!((found.len(), found[0].episode_id.as_str(), found[0].condition.as_deref()), (1, "E1/m/s1/r1", None));
    }

    #[test]
    fn an_invalid_line_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let list = list_of(folder.path());
        std::fs::write(&list, format!("{LINE}\n\n{{\"model\":7}}\n")).unwrap();
        let error = read(&list).unwrap_err().to_string();
        assert!(error.contains("line 3: expected a lost episode"), "{error}");
    }
}
