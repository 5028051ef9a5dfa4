//! A model's journals in a folder: answers, costs, and averages of finished episodes.

use super::journal::{Journal, JournalError};
use super::model::{Vlm, tokens};
use crate::limits::Spend;
use mirrorstats_experiment::built_in_names;

/// The average answer of finished episodes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Typical {
    pub episodes: u64,
    pub steps: f64,
    /// US dollars per answer; `None` if no answer has a cost or a price.
    pub cost_usd: Option<f64>,
    /// Tokens per reply; `None` if not counted.
    pub completion_tokens: Option<f64>,
    /// Seconds per answer.
    pub seconds: f64,
}

impl Vlm {
    pub fn answered(&self, episode: &str) -> Result<u64, JournalError> {
        match Journal::cassette(&self.path(episode)) {
            Ok(journal) => Ok(journal.answers().count() as u64),
            Err(JournalError::Missing { .. }) => Ok(0),
            Err(error) => Err(error),
        }
    }

    /// Adds the spending of earlier starts on the model, from its journals. `slug` is the model's name in episode names.
    pub fn count_spent(&self, slug: &str) -> Result<(), JournalError> {
        if self.online.is_some() {
            self.account.begin_with(spent(self, slug)?);
        }
        Ok(())
    }

    /// Reads the journals of these finished episodes; `None` if no journal exists.
    pub fn typical<'a>(&self, episodes: impl Iterator<Item = &'a str>) -> Result<Option<Typical>, JournalError> {
        let (mut steps, mut seconds, mut costs, mut tokens) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for episode in episodes {
            let journal = match Journal::cassette(&self.path(episode)) {
                Err(JournalError::Missing { .. }) => continue,
                journal => journal?,
            };
            steps.push(f64::from(u32::try_from(journal.answers().count()).unwrap_or(u32::MAX)));
            for recorded in journal.answers() {
                seconds.push(f64::from(recorded.latency_ms) / 1e3);
                let Some(answer) = self.read(&recorded.body) else { continue };
                costs.extend(self.choice.cost_usd(&answer));
                tokens.extend(answer.completion_tokens.map(f64::from));
            }
        }
        let episodes = steps.len() as u64;
        let (cost_usd, completion_tokens) = (mean(&costs), mean(&tokens));
        let of_steps = mean(&steps).zip(mean(&seconds));
        Ok(of_steps.map(|(steps, seconds)| Typical { episodes, steps, cost_usd, completion_tokens, seconds }))
    }
}

/// The spending on this model according to its journals, for the account of a restarted run. `slug` is its name in
/// episode names; other models' journals in the folder have other prices and limits.
fn spent(vlm: &Vlm, slug: &str) -> Result<Spend, JournalError> {
    let mut spend = Spend::default();
    let failed = |source| JournalError::Io { path: vlm.folder.clone(), source };
    let entries = match std::fs::read_dir(&vlm.folder) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(spend),
        entries => entries.map_err(failed)?,
    };
    for entry in entries {
        let path = entry.map_err(failed)?.path();
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        if path.extension().is_none_or(|ending| ending != "jsonl") || !is_of_model(stem, slug) {
            continue;
        }
        add_journal(vlm, &Journal::cassette(&path)?, &mut spend);
    }
    Ok(spend)
}

#[expect(clippy::cast_precision_loss, reason = "there are fewer than 2^53 answers")]
fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn add_journal(vlm: &Vlm, journal: &Journal, spend: &mut Spend) {
    let usd = |at_most| vlm.cost_of(at_most).unwrap_or(0.0);
    let requests = journal.requests();
    spend.requests += requests.sent;
    requests.unanswered.into_iter().for_each(|at_most| spend.add_unanswered(usd(at_most)));
    for recorded in journal.answers() {
        let answer = vlm.read(&recorded.body);
        if let Some(answer) = &answer {
            vlm.learn_from(answer);
        }
        let cost = answer.as_ref().and_then(|answer| vlm.choice.cost_usd(answer));
        spend.add_answer(answer.as_ref().map_or(0, tokens), cost, recorded.at_most.map_or(0.0, usd));
    }
}

/// Returns true if an episode's journal is of this model: `E1-slug-s1-r3`, and `two-mirrors-slug@near-s1-r3-x2`.
///
/// Names of experiments and of models may have a `-`: `E1-mini-slug` is of the model `mini-slug`, since `E1` is built in.
fn is_of_model(stem: &str, slug: &str) -> bool {
    let without_last = |name, mark: char| {
        let (rest, last): (&str, &str) = str::rsplit_once(name, '-')?;
        let number = last.strip_prefix(mark)?;
        (!number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())).then_some(rest)
    };
    let first = without_last(stem, 'x').unwrap_or(stem);
    let Some(subject) = without_last(first, 'r').and_then(|rest| without_last(rest, 's')) else { return false };
    let subject = subject.split_once('@').map_or(subject, |(model, _)| model);
    let experiment = subject.strip_suffix(slug).and_then(|rest| rest.strip_suffix('-')).filter(|rest| !rest.is_empty());
    let has_model =
        |experiment: &str, name: &str| experiment.strip_prefix(name).is_some_and(|rest| rest.starts_with('-'));
    experiment.is_some_and(|experiment| {
        let names = built_in_names();
        names.contains(&experiment) || !names.iter().any(|name| has_model(experiment, name))
    })
}

#[cfg(test)]
mod tests {
    use super::is_of_model;

    #[test]
    fn a_journal_names_its_model() {
        for (stem, model) in [
            ("E1-gpt-5-1-s1-r3", "gpt-5-1"),
            ("E1-gpt-5-s1-r3-x2", "gpt-5"),
            ("E5-a@near-s1-s2-r10", "a"),
            ("E1-a-s1-r1-s2-r3", "a-s1-r1"),
            ("two-mirrors-gpt-5-s1-r1", "gpt-5"),
            ("contingency-late-gpt-5@near-s1-r1", "gpt-5"),
            ("my-own-room-gpt-5-s1-r1", "gpt-5"),
        ] {
            assert!(is_of_model(stem, model), "{stem}");
        }
        for (stem, model) in [
            ("E1-mini-gpt-5-s1-r1", "gpt-5"),
            ("two-mirrors-mini-gpt-5-s1-r1", "gpt-5"),
            ("E1-gpt-5-1-s1-r3", "gpt-5"),
            ("E1-s2-r3", "E1"),
            ("E1-a-s2", "a"),
            ("gpt-5-s1-r1", "gpt-5"),
            ("notes", "notes"),
            ("", ""),
        ] {
            assert!(!is_of_model(stem, model), "{stem}");
        }
    }
}
