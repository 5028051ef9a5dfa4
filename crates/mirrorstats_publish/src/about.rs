//! What the author says about a data set: a TOML file, and defaults that hold for every recording.

use std::path::Path;

use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::PublishError;

const LARGEST: Limit = Limit::new("bytes of a description of a data set", 1 << 20);

/// The description of a data set. Every key is optional.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct About {
    /// The title.
    pub title: Option<String>,
    /// The authors, each as `Family, Given` or as the name of a group.
    pub authors: Vec<String>,
    /// The licence as an SPDX identifier, such as `CC-BY-4.0`.
    pub license: Option<String>,
    /// The address of the data set.
    pub url: Option<String>,
    /// The DOI of the data set, such as `10.5281/zenodo.123`.
    pub doi: Option<String>,
    /// A short description.
    pub description: Option<String>,
    /// More tags.
    pub tags: Vec<String>,
    /// What the data cannot show.
    pub limitations: Option<String>,
    /// Known biases.
    pub biases: Option<String>,
    /// Personal and sensitive information.
    pub personal: Option<String>,
    /// Intended uses, and uses to avoid.
    pub uses: Option<String>,
    /// Social impact.
    pub impact: Option<String>,
    /// True if the data is synthetic, such as pictures of a simulator.
    pub synthetic: Option<bool>,
    /// What the data was derived from, as addresses.
    pub derived_from: Vec<String>,
    /// The time of the evaluation, seconds since 1970; Every Eval Ever asks for it.
    pub time: Option<u64>,
    /// How the data was made.
    pub generated_by: Option<String>,
}

impl About {
    /// Reads the file of `--about`.
    pub fn read(path: &Path) -> Result<Self, PublishError> {
        let text = input::text(path, LARGEST).map_err(PublishError::file(path))?;
        let invalid = |words: String| {
            PublishError::Refused(format!(
                "{}: expected a description of a data set, found {words}\n  help: `mirrorstats publish --help` lists its keys",
                path.display()
            ))
        };
        let about: Self = toml::from_str(&text).map_err(|error| invalid(error.to_string().trim().to_owned()))?;
        let is_identifier = |text: &str| {
            !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b".+-".contains(&byte))
        };
        match about.license.as_deref().filter(|license| !is_identifier(license)) {
            Some(license) => Err(invalid(format!("the licence `{license}`, which is no SPDX identifier"))),
            None => Ok(about),
        }
    }

    pub(crate) fn title(&self) -> &str {
        self.title.as_deref().unwrap_or("Recordings of embodied agents")
    }

    pub(crate) fn description(&self) -> &str {
        self.description.as_deref().unwrap_or(
            "Step traces of evaluation episodes, with the definitions that score them, the scores, and a report that \
             `mirrorstats verify` computes again.",
        )
    }
}
