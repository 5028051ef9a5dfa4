//! Chance levels: what blind strategies reach.

use std::collections::BTreeMap;
use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::escape::visible;
use crate::ratio::Ratio;

/// A chance level.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Chance {
    /// No level.
    None(NoLevel),
    /// The level.
    Of(Ratio),
    /// The level of each blind strategy, by its name; the highest counts.
    ByStrategy(BTreeMap<String, Ratio>),
}

/// The word that says that there is no level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum NoLevel {
    /// `none`.
    #[serde(rename = "none")]
    None,
}

impl Chance {
    /// The levels from the lowest to the highest, with their strategies.
    pub fn levels(&self) -> Vec<(Option<String>, Ratio)> {
        let mut levels: Vec<_> = match self {
            Self::None(_) => Vec::new(),
            Self::Of(level) => vec![(None, *level)],
            Self::ByStrategy(levels) => levels.iter().map(|(name, level)| (Some(name.clone()), *level)).collect(),
        };
        levels.sort_by(|(_, one), (_, other)| one.value().total_cmp(&other.value()));
        levels
    }
}

impl fmt::Display for Chance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let levels = self.levels();
        let words = levels.iter().map(|(strategy, level)| with_strategy(*level, strategy.as_deref()));
        f.write_str(if levels.is_empty() { "none" } else { "" })?;
        f.write_str(&words.collect::<Vec<_>>().join(" or "))
    }
}

/// A level and its strategy, such as `1/2 by disbelieving`.
pub fn with_strategy(level: Ratio, strategy: Option<&str>) -> String {
    strategy.map_or_else(|| level.to_string(), |strategy| format!("{level} by {}", visible(strategy)))
}

#[cfg(test)]
mod tests {
    use super::Chance;

    #[test]
    fn levels_are_sorted_and_named_by_strategy() {
        let level = |text: &str| text.parse().unwrap();
        let strategies = [("guessing", "1/3"), ("disbelieving", "1/2"), ("hoping", "0")];
        let strategies = strategies.map(|(name, text)| (name.to_owned(), level(text)));
        assert_eq!(Chance::Of(level("2/6")).to_string(), "1/3");
        let chance = Chance::ByStrategy(strategies.into());
        assert_eq!(chance.to_string(), "0 by hoping or 1/3 by guessing or 1/2 by disbelieving");
    }
}
