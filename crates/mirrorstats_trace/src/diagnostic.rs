//! Diagnostics of traces: rule, location, expected, found, remedy.
//!
//! The codes are stable: programs may depend on them. A message always says enough to find the row.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mirrorstats_exact::budget::Exceeded;
use mirrorstats_exact::escape::visible;

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

macro_rules! codes {
    ($(#[$doc:meta] $code:ident, $severity:ident, $name:literal: $rule:literal, $help:literal;)+) => {
        /// A rule of the schema; the name in kebab case is stable.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "kebab-case")]
        pub enum Code {
            $(#[$doc] $code,)+
        }

        impl Code {
            /// All codes, in the order of the documentation.
            pub const ALL: [Self; [$(Self::$code,)+].len()] = [$(Self::$code,)+];

            const fn entry(self) -> (Severity, &'static str, &'static str, &'static str) {
                match self {
                    $(Self::$code => (Severity::$severity, $name, $rule, $help),)+
                }
            }
        }
    };
}

codes! {
    /// The file cannot be opened or read.
    Unreadable, Error, "unreadable": "the file can be opened and read", "check the path and its permissions";
    /// The file has no bytes.
    EmptyFile, Error, "empty-file":
        "the file has bytes", "the recording was interrupted or the copy failed: copy it again, or leave the file out";
    /// The file is not Parquet.
    NotParquet, Error, "not-parquet": "the file is Parquet", "give the Parquet traces themselves";
    /// The file starts as Parquet and ends before its footer.
    Truncated, Error, "truncated":
        "the file ends with its footer", "the copy or the recording was cut short: copy it again";
    /// The footer is there and makes no sense.
    CorruptFooter, Error, "corrupt-footer":
        "the footer describes the file", "the file is damaged: restore it from its source";
    /// The footer is good and the data behind it is not.
    CorruptData, Error, "corrupt-data":
        "the data decodes to what the footer says, and `episode_hash` is that of the rows",
        "the file is damaged: restore it from its source";
    /// Reading the file would take more work than files of its size do.
    OverBudget, Error, "over-budget":
        "what comes out of the file is in proportion to its size, its names are short, and its episodes fit into memory",
        "if you trust the file, the environment variable MIRRORSTATS_BUDGET=10 allows ten times as much of everything";
    /// The footer's metadata of mirrorstats cannot be read.
    InvalidMetadata, Error, "invalid-metadata":
        "`mirrorstats.schema_version` is the version of this program's schema; `mirrorstats.checksums` has one of each column chunk; in `mirrorstats.recording` a `palette` lists colours, and an \
         `experiment` is spelled as in a definition file, in all files alike",
        "correct or remove that key in the footer; a file without a schema version is read as that of another writer";
    /// The file was written under a newer schema.
    NewerSchema, Error, "newer-schema":
        "the schema version is one that this program knows", "update mirrorstats to read this file";
    /// A required column is not there.
    MissingColumn, Error, "missing-column":
        "every required column is there",
        "`mirrorstats trace schema` lists the columns: add this one, or rename the one that holds it";
    /// Two columns have the same name.
    RepeatedColumn, Error, "repeated-column": "every column has its own name", "drop or rename all but one of them";
    /// A column of the schema has another type.
    WrongType, Error, "wrong-type":
        "a column of the schema has its logical type, in any width or encoding",
        "cast the column where the file is written";
    /// The file has no row.
    NoEpisodes, Error, "no-episodes": "the file has at least one episode", "leave the file out, or record it again";
    /// A column that is never null has a null.
    NullInRequired, Error, "null-in-required":
        "a column that is never null has a value in every row", "give the row its value; nothing is filled in";
    /// A name is the empty string.
    EmptyString, Error, "empty-string": "a required name is not empty", "give the name, or null where allowed";
    /// An integer does not fit the column's type.
    OutOfRange, Error, "out-of-range": "an integer fits the schema's type", "correct the number, or use smaller ones";
    /// A number of pixels, tokens, ... is below zero.
    NegativeCount, Error, "negative-count":
        "what is counted (px, mm, ms, tokens, USD, agents) is not below zero", "use null where the count is not known";
    /// An episode's first t is not 1.
    TStart, Error, "t-start": "an episode's first t is 1", "number the steps from 1; t = 0 is not a step";
    /// An episode's t leaves numbers out.
    TGap, Error, "t-gap": "t goes up by 1 from row to row", "add the missing steps, or record it again";
    /// An episode has the same t twice in a row.
    TDuplicate, Error, "t-duplicate": "every t of an episode has one row", "keep one row for each t";
    /// An episode's t goes backward.
    TOrder, Error, "t-order": "t never goes back in an episode", "sort the rows by episode_id and t";
    /// A value that names the episode or its setting changes within it.
    InconsistentConstant, Error, "inconsistent-constant":
        "a column that belongs to the episode is the same in all its rows",
        "correct the rows, or give the episodes ids of their own";
    /// The rows of an episode are not together, or two episodes of a file share an id.
    EpisodeTwice, Error, "episode-twice":
        "an episode is in a file once, its rows together",
        "remove the second one or give it another id; rows of one episode that lie apart belong together";
    /// Two files have an episode of the same id.
    EpisodeInTwoFiles, Error, "episode-in-two-files":
        "an episode is in one of the files only", "leave one of the files out, or give the second episode another id";
    /// The experiment is none that the definitions know.
    UnknownExperiment, Error, "unknown-experiment":
        "the definitions know the experiment, or a footer declares it",
        "add it to the definition file as `[experiment.NAME]`, say `open = true` there, or declare it in the footer";
    /// The action is none of the five.
    UnknownAction, Error, "unknown-action":
        "an action is one of the five, or null", "use one of the names; null where the reply gave none";
    /// The reply status is none of the schema's.
    UnknownReplyStatus, Error, "unknown-reply-status":
        "a reply status is one of the schema's", "use one of the names, or null";
    /// A text is none of those that the definitions declare.
    UnknownValue, Error, "unknown-value":
        "a text is one of the `values` that the definitions declare of its column",
        "use one of the values, or add it to `values` in the definition file";
    /// A colour is not spelled as colours are, or none of the palette.
    InvalidColor, Error, "invalid-color":
        "a colour is a lower-case name, of the palette in the footer where there is one, and has one spelling",
        "write the colour as the palette or the other rows do";
    /// A claimed colour is no body's and no cube's in all inputs.
    UnseenColor, Note, "unseen-color":
        "a claimed colour is that of a body or of a selected cube in the inputs",
        "nothing to do where the agent said so: the claim counts as a wrong one";
    /// The checksums in the footer are those of the file that this one was made from.
    StaleChecksums, Note, "stale-checksums":
        "checksums are those of the file",
        "nothing to do where another program wrote the file again: its bytes are not checked";
    /// A title, an order or a level of an experiment is another in the definitions than in the footer.
    ExperimentOverridden, Note, "experiment-overridden":
        "the footer and the definitions say the same of an experiment",
        "nothing to do where that is meant: the definitions count";
    /// A level of an experiment in the footer is one of no metric of the definitions.
    UnknownLevel, Note, "unknown-level":
        "a level of an experiment in the footer is one of a metric of the definitions",
        "nothing to do where other definitions have the metric: the level is passed over";
    /// An episode's rows are in more than one row group.
    SplitEpisode, Note, "split-episode":
        "an episode's rows are in one row group",
        "nothing to do: the episode is read whole; mirrorstats' own writer keeps it together";
    /// Replies of the file gave no decision.
    UnreadableReplies, Note, "unreadable-replies":
        "every reply could be read: its status is `ok` or `repaired`",
        "the column `reply` holds what was replied; to the metrics these are steps without a decision";
    /// All rows of an episode are those of another one, the id aside.
    CopiedEpisode, Note, "copied-episode":
        "no episode has all rows of another one under another id",
        "leave the copy out: statistics count it as an independent episode";
}

impl Code {
    pub const fn severity(self) -> Severity {
        self.entry().0
    }

    pub const fn name(self) -> &'static str {
        self.entry().1
    }

    /// The rule in one line, as `mirrorstats trace schema` prints it.
    pub const fn explain(self) -> &'static str {
        self.entry().2
    }

    /// The remedy, unless the location of the finding has better advice.
    pub const fn help(self) -> &'static str {
        self.entry().3
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Finding {
    /// A finding about a whole file; the methods below narrow its location.
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
