//! The number of episodes behind each row of a published table.
//!
//! Written as `21`, or `E1=21,E2=20`, or both: a number alone applies to all other rows. A key is an experiment, or an
//! experiment and a model as `E1/GPT 5.1`, which takes precedence.

use std::collections::BTreeMap;
use std::str::FromStr;

/// The most episodes per row in an audit: printed digits carry no information about more.
pub const MOST_EPISODES: u64 = 2_000;

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Episodes {
    others: Option<u64>,
    named: BTreeMap<String, u64>,
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EpisodesError {
    #[error("expected a number of episodes from 1 to {MOST_EPISODES}, found `{found}`")]
    NotANumber { found: String },
    #[error("expected one number per row, found two for {row}")]
    Twice { row: String },
}

impl Episodes {
    /// The episodes of a row; `None` if they are not given.
    pub fn of(&self, experiment: &str, model: &str) -> Option<u64> {
        let of_row = self.named.get(&format!("{experiment}/{model}"));
        of_row.or_else(|| self.named.get(experiment)).copied().or(self.others)
    }

    pub fn stranger(&self, rows: &[(&str, &str)]) -> Option<&str> {
        let names = |key: &str| rows.iter().any(|&(e, m)| key == e || key.split_once('/') == Some((e, m)));
        self.named.keys().map(String::as_str).find(|key| !names(key))
    }
}

impl FromStr for Episodes {
    type Err = EpisodesError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut found = Self::default();
        for part in text.split(',') {
            let (key, number) = match part.rsplit_once('=') {
                Some((key, number)) => (Some(key.trim().to_owned()), number.trim()),
                None => (None, part.trim()),
            };
            let fault = || EpisodesError::NotANumber { found: number.to_owned() };
            let n: u64 = number.parse().map_err(|_| fault())?;
            if !(1..=MOST_EPISODES).contains(&n) {
                return Err(fault());
            }
            let earlier = match &key {
                Some(key) => found.named.insert(key.clone(), n),
                None => found.others.replace(n),
            };
            if earlier.is_some() {
                return Err(EpisodesError::Twice {
                    row: key.map_or("all other rows".to_owned(), |key| format!("`{key}`")),
                });
            }
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::Episodes;

    #[test]
    fn rows_may_differ() {
        let episodes: Episodes = "21, E2=20,E3/GPT 5.1=19".parse().unwrap();
        let of = |experiment, model| episodes.of(experiment, model);
        assert_eq!([of("E1", "a"), of("E2", "a"), of("E3", "a"), of("E3", "GPT 5.1")], [21, 20, 21, 19].map(Some));
        assert_eq!("E2=20".parse::<Episodes>().unwrap().of("E1", "a"), None);
        assert_eq!(episodes.stranger(&[("E2", "a"), ("E3", "GPT 5.1")]), None);
        assert_eq!(episodes.stranger(&[("E3", "GPT 5.1")]), Some("E2"));
    }

    #[test]
    fn invalid_numbers_of_episodes_are_refused() {
        let message = |text: &str| text.parse::<Episodes>().unwrap_err().to_string();
        for text in ["", "0", "-1", "2001", "2.5", "E1=", "21,"] {
            assert!(message(text).starts_with("expected a number of episodes from 1 to 2000, found `"), "{text}");
        }
        assert_eq!(message("21,20"), "expected one number per row, found two for all other rows");
        assert_eq!(message("E1=21,E1=20"), "expected one number per row, found two for `E1`");
    }
}
