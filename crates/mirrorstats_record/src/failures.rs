//! `lost.jsonl` beside the traces: the episodes lost to failures, one JSON object per line.
//!
//! Rule: an episode is listed until a trace has it. Each recording removes the episodes recorded by now and adds those
//! it lost, and keeps other models' and shards' lines; an empty list has no file.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use super::error::StoreError;
use super::plan::{Key, Subject};
use mirrorstats_agents::Lost;
use mirrorstats_agents::json_lines;
use mirrorstats_trace::beside::lost::LONGEST_LINE;
pub use mirrorstats_trace::beside::lost::{LostEpisode, list_of};

pub(crate) fn lost_episode(key: &Key, subject: &Subject, step: Option<i32>, lost: Lost) -> LostEpisode {
    LostEpisode {
        episode_id: key.episode_id(subject),
        model: subject.model.clone(),
        condition: subject.condition.clone(),
        experiment: key.experiment.name().to_owned(),
        seed: key.seed,
        run: key.run,
        step,
        status: lost.status.map(|status| status.name().to_owned()),
        reason: lost.cause,
    }
}

/// Rewrites the list: removes the episodes with these ids, and adds those lost now.
pub fn update(path: &Path, recorded: &BTreeSet<String>, lost: &[LostEpisode]) -> Result<(), StoreError> {
    let before = read(path)?;
    let again: BTreeSet<&str> = lost.iter().map(|episode| episode.episode_id.as_str()).collect();
    let stays = |id: &str| !recorded.contains(id) && !again.contains(id);
    let mut listed: Vec<&LostEpisode> =
        before.iter().filter(|episode| stays(&episode.episode_id)).chain(lost).collect();
    listed.sort_by_key(|episode| (&episode.model, &episode.condition, &episode.experiment, episode.seed, episode.run));
    match listed.as_slice() {
        [] if before.is_empty() => Ok(()),
        [] => fs::remove_file(path).map_err(StoreError::io("remove", path)),
        listed => json_lines::replace(path, listed).map_err(StoreError::io("write", path)),
    }
}

fn read(path: &Path) -> Result<Vec<LostEpisode>, StoreError> {
    json_lines::read(path, LONGEST_LINE).map_err(StoreError::io("read", path))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::{LostEpisode, lost_episode, read, update};
    use crate::plan::{Key, Subject};
    use mirrorstats_agents::{Lost, Status};
    use mirrorstats_experiment::Experiment;
    use mirrorstats_trace::beside::lost::list_of;

    fn lost(model: &str, run: i32, cause: &str) -> LostEpisode {
        let key = Key::first(Experiment::E1, 1, run);
        lost_episode(&key, &Subject::for_model(model), Some(4), Lost::counted_as(Status::Timeout, cause))
    }

    #[test]
    fn the_list_of_losses_has_only_episodes_without_rows() {
        let folder = tempfile::tempdir().unwrap();
        let list = list_of(folder.path());
        let ids =
            |runs: &[i32]| -> BTreeSet<String> { runs.iter().map(|run| lost("b", *run, "").episode_id).collect() };
        update(&list, &ids(&[]), &[]).unwrap();
        assert!(!list.exists());
        update(&list, &ids(&[]), &[lost("b", 10, "x"), lost("b", 2, "x")]).unwrap();
        update(&list, &ids(&[]), &[lost("a", 3, "x")]).unwrap();
        assert_eq!(read(&list).unwrap(), [lost("a", 3, "x"), lost("b", 2, "x"), lost("b", 10, "x")]);
        // One is recorded, one is lost again, and another model's stays.
        update(&list, &ids(&[1, 2]), &[lost("b", 10, "y")]).unwrap();
        assert_eq!(read(&list).unwrap(), [lost("a", 3, "x"), lost("b", 10, "y")]);
        update(&list, &ids(&[10]), &[]).unwrap();
        update(&list, &BTreeSet::from([lost("a", 3, "").episode_id]), &[]).unwrap();
        assert!(!list.exists());
    }
}
