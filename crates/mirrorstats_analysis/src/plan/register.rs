//! A plan registered before the first episode: inputs, results, and hashes of the definitions, experiments and prompts.
//!
//! Rule: the same plan and the same definitions give the same bytes. `sha256` is the hash of the document itself, as
//! compact JSON in field order with an empty `sha256`, so later changes are visible without the file's history.
//! `experiments` and `prompts` are empty until a recorder fills them in; the hash includes them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Plan;
use mirrorstats_exact::hash;

/// A registered plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RegisteredPlan {
    /// `mirrorstats-plan`.
    pub format: String,
    /// 1.
    pub version: u32,
    /// The plan.
    pub plan: Plan,
    /// The definitions that the study will be scored under.
    pub definitions: NamedHash,
    /// The experiments as they will be recorded, each with the hash of its configuration.
    pub experiments: Vec<NamedHash>,
    /// The prompts, each with the hash of its text.
    pub prompts: Vec<NamedHash>,
    /// The metric of the primary question; absent where none is declared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub primary: Option<String>,
    /// The names of the experiments that are analysed; empty where none are declared.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub experiment_names: Vec<String>,
    /// The names of the models; empty where none are declared.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub model_names: Vec<String>,
    /// The filter of the analysis; absent where all episodes are analysed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filter: Option<String>,
    /// SHA-256 over all of the above, 64 hexadecimal digits.
    pub sha256: String,
}

/// A thing and the hash of its content.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NamedHash {
    /// Its name; never a path.
    pub name: String,
    /// SHA-256, 64 hexadecimal digits.
    pub sha256: String,
}

impl RegisteredPlan {
    pub fn new(plan: Plan, definitions: NamedHash, experiments: Vec<NamedHash>, prompts: Vec<NamedHash>) -> Self {
        Self {
            format: "mirrorstats-plan".to_owned(),
            version: 1,
            plan,
            definitions,
            experiments,
            prompts,
            primary: None,
            experiment_names: Vec::new(),
            model_names: Vec::new(),
            filter: None,
            sha256: String::new(),
        }
        .sealed()
    }

    #[must_use]
    pub fn sealed(self) -> Self {
        Self { sha256: self.content_hash(), ..self }
    }

    pub fn parse(text: &str) -> Result<Self, String> {
        let plan: Self = serde_json::from_str(text).map_err(|error| {
            format!("expected a registered plan: {error}\n  help: `mirrorstats plan ... --register FILE` writes one")
        })?;
        if plan.is_unchanged() {
            return Ok(plan);
        }
        let words = "the plan was changed after it was registered: its hash is not that of its content";
        Err(format!("{words}\n  help: use the file as it was registered, or register a new plan"))
    }

    pub fn is_unchanged(&self) -> bool {
        self.sha256 == self.content_hash()
    }

    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("texts and finite numbers") + "\n"
    }

    fn content_hash(&self) -> String {
        let open = Self { sha256: String::new(), ..self.clone() };
        hash::of_bytes(serde_json::to_string(&open).expect("texts and finite numbers").as_bytes())
    }
}
