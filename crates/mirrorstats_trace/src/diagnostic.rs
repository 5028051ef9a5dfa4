//! Diagnostics of traces: rule, location, expected, found, remedy.
//!
//! The codes are stable: programs may depend on them. A message always says enough to find the row.

use std::collections::HashMap;
use std::fmt;
use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mirrorstats_exact::budget::Exceeded;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::names;

pub const MORE_FILES: &str = "raise the limit of open files, as in `ulimit -n 1024`, and run the command again";

pub fn is_short_of_files(words: &str) -> bool {
    // EMFILE and ENFILE.
    words.contains("(os error 24)") || words.contains("(os error 23)")
}

/// One thing that is wrong with a trace.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Finding {
    /// The broken rule.
    pub code: Code,
    /// The severity: unusable or only unusual.
    pub severity: Severity,
    /// The file, as it was named.
    pub file: String,
    /// The row group of the file, 0-based.
    pub row_group: Option<usize>,
    /// The episode's id.
    pub episode: Option<String>,
    /// The timestep as the file has it.
    pub t: Option<i64>,
    /// The column.
    pub column: Option<String>,
    /// The expected value.
    pub expected: String,
    /// The value found.
    pub found: String,
    /// The remedy.
    pub help: String,
}

/// The severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The trace cannot be scored as it is.
    Error,
    /// The trace is read as it is; its writer could do better.
    Note,
}

names! {
    /// A rule of the schema; the name in kebab case is stable.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "kebab-case")]
    pub enum Code {
        /// The file cannot be opened or read.
        Unreadable = "unreadable",
        /// The file has no bytes.
        EmptyFile = "empty-file",
        /// The file is not Parquet.
        NotParquet = "not-parquet",
        /// The file starts as Parquet and ends before its footer.
        Truncated = "truncated",
        /// The footer is there and makes no sense.
        CorruptFooter = "corrupt-footer",
        /// The footer is good and the data behind it is not.
        CorruptData = "corrupt-data",
        /// Reading the file would take more work than files of its size do.
        OverBudget = "over-budget",
        /// The footer's metadata of mirrorstats cannot be read.
        InvalidMetadata = "invalid-metadata",
        /// The file was written under a newer schema.
        NewerSchema = "newer-schema",
        /// A required column is not there.
        MissingColumn = "missing-column",
        /// Two columns have the same name.
        RepeatedColumn = "repeated-column",
        /// A column of the schema has another type.
        WrongType = "wrong-type",
        /// The file has no row.
        NoEpisodes = "no-episodes",
        /// A column that is never null has a null.
        NullInRequired = "null-in-required",
        /// A name is the empty string.
        EmptyString = "empty-string",
        /// An integer does not fit the column's type.
        OutOfRange = "out-of-range",
        /// A number of pixels, tokens, ... is below zero.
        NegativeCount = "negative-count",
        /// An episode's first t is not 1.
        TStart = "t-start",
        /// An episode's t leaves numbers out.
        TGap = "t-gap",
        /// An episode has the same t twice in a row.
        TDuplicate = "t-duplicate",
        /// An episode's t goes backward.
        TOrder = "t-order",
        /// A value that names the episode or its setting changes within it.
        InconsistentConstant = "inconsistent-constant",
        /// The rows of an episode are not together, or two episodes of a file share an id.
        EpisodeTwice = "episode-twice",
        /// Two files have an episode of the same id.
        EpisodeInTwoFiles = "episode-in-two-files",
        /// The experiment is none that the definitions know.
        UnknownExperiment = "unknown-experiment",
        /// The action is none of the five.
        UnknownAction = "unknown-action",
        /// The reply status is none of the schema's.
        UnknownReplyStatus = "unknown-reply-status",
        /// A text is none of those that the definitions declare.
        UnknownValue = "unknown-value",
        /// A colour is not spelled as colours are, or none of the palette.
        InvalidColor = "invalid-color",
        /// A claimed colour is no body's and no cube's in all inputs.
        UnseenColor = "unseen-color",
        /// The checksums in the footer are those of the file that this one was made from.
        StaleChecksums = "stale-checksums",
        /// A title, an order or a level of an experiment is another in the definitions than in the footer.
        ExperimentOverridden = "experiment-overridden",
        /// A level of an experiment in the footer is one of no metric of the definitions.
        UnknownLevel = "unknown-level",
        /// An episode's rows are in more than one row group.
        SplitEpisode = "split-episode",
        /// Replies of the file gave no decision.
        UnreadableReplies = "unreadable-replies",
        /// All rows of an episode are those of another one, the id aside.
        CopiedEpisode = "copied-episode",
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CodeText {
    #[serde(default)]
    note: bool,
    rule: String,
    help: String,
}

static CODES: LazyLock<HashMap<Code, CodeText>> = LazyLock::new(|| {
    let text = include_str!("../../../assets/trace/rules.toml");
    toml::from_str(text).expect("the built-in rules are well-formed: a test reads them")
});

impl Code {
    fn text(self) -> &'static CodeText {
        CODES.get(&self).expect("the built-in rules have every code: a test reads them")
    }

    pub fn severity(self) -> Severity {
        if self.text().note { Severity::Note } else { Severity::Error }
    }

    /// The rule in one line, as `mirrorstats trace schema` prints it.
    pub fn explain(self) -> &'static str {
        &self.text().rule
    }

    /// The remedy, unless the location of the finding has better advice.
    pub fn help(self) -> &'static str {
        &self.text().help
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Finding {
    pub fn new(code: Code, file: impl Into<String>, expected: impl Into<String>, found: impl Into<String>) -> Self {
        let mut found = found.into();
        // Decoders pass on system messages as text; these do not mean that the file is damaged.
        let decoded = matches!(code, Code::CorruptFooter | Code::CorruptData | Code::NotParquet | Code::Truncated);
        let code = if decoded && found.contains(" (os error ") { Code::Unreadable } else { code };
        if let Some(said) = found.strip_prefix("External: ").filter(|_| code == Code::Unreadable) {
            found = said.to_owned();
        }
        Self {
            code,
            severity: code.severity(),
            file: file.into(),
            row_group: None,
            episode: None,
            t: None,
            column: None,
            expected: expected.into(),
            help: if is_short_of_files(&found) { MORE_FILES } else { code.help() }.into(),
            found,
        }
    }

    pub(crate) fn unreadable(file: &str, found: &impl ToString) -> Box<Self> {
        Box::new(Self::new(Code::Unreadable, file, "a file that can be read", found.to_string()))
    }

    pub fn over_budget(file: &str, exceeded: &Exceeded) -> Self {
        Self::new(Code::OverBudget, file, exceeded.expected(), "more")
    }

    pub(crate) fn in_row_group(mut self, row_group: usize) -> Self {
        self.row_group = Some(row_group);
        self
    }

    #[must_use]
    pub fn in_episode(mut self, episode: impl Into<String>) -> Self {
        self.episode = Some(episode.into());
        self
    }

    #[must_use]
    pub fn at(mut self, t: impl Into<Option<i64>>) -> Self {
        self.t = t.into();
        self
    }

    #[must_use]
    pub fn in_column(mut self, column: impl Into<String>) -> Self {
        self.column = Some(column.into());
        self
    }

    #[must_use]
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = help.into();
        self
    }
}

/// For checks that end with their first finding, among others that report all.
impl From<Box<Finding>> for Vec<Finding> {
    fn from(finding: Box<Finding>) -> Self {
        vec![*finding]
    }
}

/// `code: file, row group 0, episode x, t = 3, column c: expected .., found ..; help`, on three lines.
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.code, visible(&self.file))?;
        if let Some(row_group) = self.row_group {
            write!(f, ", row group {row_group}")?;
        }
        if let Some(episode) = &self.episode {
            write!(f, ", episode `{}`", visible(episode))?;
        }
        if let Some(t) = self.t {
            write!(f, ", t = {t}")?;
        }
        if let Some(column) = &self.column {
            write!(f, ", column `{}`", visible(column))?;
        }
        write!(f, "\n  expected {}\n  found {}\n  help: {}", visible(&self.expected), visible(&self.found), self.help)
    }
}

#[cfg(test)]
mod tests {
    use super::{Code, Finding};

    #[test]
    fn names_are_unique_and_what_serde_writes() {
        for (i, code) in Code::ALL.iter().enumerate() {
            assert_eq!(serde_json::to_string(code).unwrap(), format!("\"{}\"", code.name()));
            assert!(!code.explain().is_empty() && !code.help().is_empty(), "{code}");
            assert!(Code::ALL[..i].iter().all(|before| before.name() != code.name()), "{code} twice");
        }
    }

    #[test]
    fn a_message_has_problem_location_expected_found_and_remedy() {
        let finding = Finding::new(Code::TGap, "a.parquet", "t = 3", "t = 4")
            .in_row_group(0)
            .in_episode("e1")
            .at(4)
            .in_column("t");
        let expected = "t-gap: a.parquet, row group 0, episode `e1`, t = 4, column `t`\n  expected t = 3\n  found t = 4\
                        \n  help: add the missing steps, or record it again";
        assert_eq!(finding.to_string(), expected);
    }
}
