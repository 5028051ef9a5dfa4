//! Which models there are, who serves them, and what they cost.
//!
//! The paper's eight are built in (`assets/models.toml`); a user's file adds to them. A model is named by its name in
//! tables or by the provider's id; an id that no file knows needs `--base-url` or `--backend`.

use std::collections::BTreeMap;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Deserialize;

use super::wire_format::{Dialect, Effort};
use exact::budget::Limit;
use exact::input;
use exact::suggest::hint;
use trace::model_id::{OWN_SERVER, answers_for};

const BUILT_IN: &str = include_str!("../../../../../assets/models.toml");

/// A file of models.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Models {
    /// Backends by name.
    #[serde(default)]
    pub backend: BTreeMap<String, Backend>,
    /// Models by their name in tables.
    #[serde(default)]
    pub model: BTreeMap<String, Model>,
}

/// Who serves models.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Backend {
    /// The language it speaks.
    #[schemars(with = "String")]
    pub dialect: Dialect,
    /// Where its paths begin; `--base-url` replaces it.
    pub base_url: Option<String>,
    /// The environment variable with the key.
    pub key: String,
}

/// A model of a backend.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Who made it.
    pub vendor: Option<String>,
    /// The backend's name.
    pub backend: String,
    /// The backend's id of the model.
    pub id: String,
    /// What it costs; unless both prices are known, nothing is known of the cost.
    #[serde(default)]
    pub prices: Prices,
    /// Whether the backend is asked to enforce the reply's schema, or the prompt alone has to do.
    #[serde(default)]
    pub contract: Contract,
    /// The most tokens of a reply, those of hidden reasoning included; absent for the usual number.
    pub max_output_tokens: Option<NonZeroU32>,
    /// How much the model is asked to reason before it replies; absent to leave it to the provider.
    pub reasoning_effort: Option<Effort>,
    /// Ids by which the model answers, besides its own and those of its dated snapshots; `*` is any text.
    #[serde(default)]
    pub answers_as: Vec<String>,
    /// Ids of other models that the user accepts in its place.
    #[serde(skip)]
    pub accepted: Vec<String>,
}

impl Model {
    /// Whether an answer by the model of this id is one of this model, or accepted as one.
    pub fn takes_answer_of(&self, returned: &str) -> bool {
        self.accepted.iter().any(|accepted| accepted == returned) || answers_for(&self.id, returned, &self.answers_as)
    }

    /// The most tokens of a reply where nobody asks for another number. A model that is asked to reason gets more, or it
    /// would be cut off before its reply.
    pub fn max_output_tokens(&self) -> u32 {
        const OF_A_REPLY: u32 = 2_048;
        const WITH_REASONING: u32 = 16_384;
        match (self.max_output_tokens, self.reasoning_effort) {
            (Some(most), _) => most.get(),
            (None, None | Some(Effort::None)) => OF_A_REPLY,
            (None, Some(_)) => WITH_REASONING,
        }
    }
}

/// US dollars per million tokens; `None` where a price is not known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Prices {
    /// Of the request.
    pub input: Option<f64>,
    /// Of the reply.
    pub output: Option<f64>,
}

impl Prices {
    /// What so many tokens cost, US dollars; `None` unless both prices are known.
    pub fn cost_usd(self, prompt_tokens: u32, completion_tokens: u32) -> Option<f64> {
        self.cost_of(prompt_tokens.into(), completion_tokens.into())
    }

    /// What the tokens of a whole run cost, US dollars; `None` unless both prices are known.
    #[expect(clippy::cast_precision_loss, reason = "nobody pays for 2^53 tokens")]
    pub fn cost_of(self, prompt_tokens: u64, completion_tokens: u64) -> Option<f64> {
        Some((prompt_tokens as f64 * self.input? + completion_tokens as f64 * self.output?) / 1e6)
    }

    /// What the requests of a whole run cost, US dollars; `None` unless their price is known.
    pub fn cost_of_requests(self, prompt_tokens: u64) -> Option<f64> {
        Self { output: Some(0.0), ..self }.cost_of(prompt_tokens, 0)
    }

    /// The names of the prices that are not known.
    pub fn unknown(self) -> Vec<&'static str> {
        let prices = [("input", self.input), ("output", self.output)];
        prices.into_iter().filter(|(_, price)| price.is_none()).map(|(name, _)| name).collect()
    }

    fn are_amounts(self) -> bool {
        [self.input, self.output].into_iter().flatten().all(|price| price.is_finite() && price >= 0.0)
    }
}

/// How a reply is held to its shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Contract {
    /// The provider enforces the schema.
    #[default]
    Schema,
    /// The prompt asks for it.
    Prompt,
}

impl Contract {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Schema => "schema",
            Self::Prompt => "prompt",
        }
    }
}

/// A model that was chosen, with its backend.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    pub name: String,
    pub model: Model,
    pub backend: Backend,
}

/// What is wrong with a file of models, or with a choice from it.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum ModelsError {
    #[error("cannot read the models in `{}`: {source}", path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error("the models in `{file}` cannot be used: {fault}")]
    Invalid { file: String, fault: String },
    #[error(
        "no model is called `{name}`{near}; expected the name or the id of one of: {known}\n  help: `--models FILE` adds models, `--backend NAME` or `--base-url URL` takes any id"
    )]
    Unknown { name: String, near: String, known: String },
    #[error(
        "--max-cost needs the prices of the model, and `{name}` has no {missing} price: its cost would never be known and \
         the limit never reached\n  help: give both prices, US dollars per million tokens, in a file for --models:\n    \
         [model.\"{name}\"]\n    backend = \"{backend}\"\n    id = \"{id}\"\n    \
         prices = {{ input = ..., output = ... }}\n  or limit --max-tokens or --max-requests instead"
    )]
    NoPrices { name: String, missing: String, backend: String, id: String },
    #[error("no backend is called `{name}`; expected one of: {known}")]
    UnknownBackend { name: String, known: String },
}

impl Choice {
    /// Both prices are known, so that a limit of cost can be held.
    pub fn check_prices(&self) -> Result<(), ModelsError> {
        let missing = self.model.prices.unknown();
        if missing.is_empty() {
            return Ok(());
        }
        let (name, missing) = (self.name.clone(), missing.join(" and no "));
        let (backend, id) = (self.model.backend.clone(), self.model.id.clone());
        Err(ModelsError::NoPrices { name, missing, backend, id })
    }
}

/// A list of models is written by hand.
const LARGEST: Limit = Limit::new("bytes of a list of models", 1 << 20);

impl Models {
    /// The built-in models, and those of a user's file over them.
    pub fn load(file: Option<&Path>) -> Result<Self, ModelsError> {
        let mut models = parse("assets/models.toml", BUILT_IN)?;
        if let Some(path) = file {
            let text = input::text(path, LARGEST)
                .map_err(|source| ModelsError::Unreadable { path: path.to_owned(), source })?;
            let own = parse(&path.display().to_string(), &text)?;
            models.backend.extend(own.backend);
            models.model.extend(own.model);
        }
        let origin = || file.map_or("assets/models.toml".to_owned(), |path| path.display().to_string());
        if let Some((name, _)) = models.backend.iter().find(|(_, backend)| !is_variable(&backend.key)) {
            // What stands there may be the key itself, and is not repeated.
            let fault = format!(
                "the `key` of the backend `{name}` is not the name of an environment variable, such as OPENAI_API_KEY"
            );
            return Err(ModelsError::Invalid { file: origin(), fault });
        }
        for (name, model) in &models.model {
            if !model.prices.are_amounts() {
                let fault = format!("a price of the model `{name}` is not an amount: expected a finite number from 0");
                return Err(ModelsError::Invalid { file: origin(), fault });
            }
            if !models.backend.contains_key(&model.backend) {
                let fault = format!("the backend `{}` of the model `{name}` is not there", model.backend);
                return Err(ModelsError::Invalid { file: origin(), fault });
            }
        }
        Ok(models)
    }

    /// The model of this name or id; with a backend, any id is one.
    pub fn choose(&self, name: &str, backend: Option<&str>) -> Result<Choice, ModelsError> {
        let known = self.model.iter().find(|(own, model)| *own == name || model.id == name);
        let (title, mut model) = match (known, backend) {
            (Some((title, model)), _) => (title.clone(), model.clone()),
            (None, Some(backend)) => (
                name.to_owned(),
                Model {
                    vendor: None,
                    backend: backend.to_owned(),
                    id: name.to_owned(),
                    prices: Prices::default(),
                    contract: Contract::default(),
                    max_output_tokens: None,
                    reasoning_effort: None,
                    // A server of one's own may call the only model that it has by any name.
                    answers_as: if backend == OWN_SERVER { vec!["*".to_owned()] } else { Vec::new() },
                    accepted: Vec::new(),
                },
            ),
            (None, None) => return Err(self.unknown(name)),
        };
        if let Some(backend) = backend {
            backend.clone_into(&mut model.backend);
        }
        let backend = self.backend.get(&model.backend).cloned().ok_or_else(|| ModelsError::UnknownBackend {
            name: model.backend.clone(),
            known: self.backend.keys().cloned().collect::<Vec<_>>().join(", "),
        })?;
        Ok(Choice { name: title, model, backend })
    }

    fn unknown(&self, name: &str) -> ModelsError {
        let names = self.model.iter().flat_map(|(title, model)| [title.as_str(), model.id.as_str()]);
        let near = hint(name, names);
        let known = self.model.keys().map(|title| format!("`{title}`")).collect::<Vec<_>>().join(", ");
        ModelsError::Unknown { name: name.to_owned(), near, known }
    }
}

fn parse(file: &str, text: &str) -> Result<Models, ModelsError> {
    toml::from_str(text).map_err(|fault| ModelsError::Invalid { file: file.to_owned(), fault: fault.to_string() })
}

/// Whether this may name an environment variable: letters, digits and `_`, not a digit first.
fn is_variable(name: &str) -> bool {
    let is_word = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    is_word && !name.is_empty() && !name.starts_with(|first: char| first.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::{Models, Prices};

    #[test]
    fn a_cost_needs_both_prices() {
        let [none, input, output] =
            [(None, None), (Some(2.0), None), (None, Some(3.0))].map(|(input, output)| Prices { input, output });
        assert_eq!([none, input, output].map(|prices| prices.cost_of(1, 1)), [None; 3]);
        assert_eq!(
            [none, input, output].map(Prices::unknown),
            [vec!["input", "output"], vec!["output"], vec!["input"]]
        );
        assert_eq!([none, input].map(|prices| prices.cost_of_requests(500_000)), [None, Some(1.0)]);
        let both = Prices { input: Some(2.0), output: Some(3.0) };
        assert_eq!((both.cost_usd(500_000, 1_000_000), both.unknown()), (Some(4.0), vec![]));
    }

    #[test]
    fn a_price_that_is_no_amount_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("own.toml");
        for price in ["-1.0", "nan", "inf"] {
            let model = format!("[model.own]\nbackend = \"google\"\nid = \"x\"\nprices = {{ input = {price} }}\n");
            std::fs::write(&file, model).unwrap();
            let fault = Models::load(Some(&file)).unwrap_err().to_string();
            assert!(fault.contains("a price of the model `own` is not an amount"), "{fault}");
        }
    }

    #[test]
    fn a_model_has_its_own_most_tokens_and_more_if_it_reasons() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("own.toml");
        let most = |keys: &str| {
            std::fs::write(&file, format!("[model.own]\nbackend = \"google\"\nid = \"x\"\n{keys}\n")).unwrap();
            Ok(Models::load(Some(&file)).map_err(|fault| fault.to_string())?.model["own"].max_output_tokens())
        };
        assert_eq!(most(""), Ok(2_048));
        assert_eq!(most("reasoning_effort = \"none\""), Ok(2_048));
        assert_eq!(most("max_output_tokens = 300\nreasoning_effort = \"high\""), Ok(300));
        let with_reasoning: Result<u32, String> = most("reasoning_effort = \"low\"");
        assert!(with_reasoning.unwrap() > 2_048);
        assert!(most("max_output_tokens = 0").unwrap_err().contains("own.toml"));
        let fault = most("reasoning_effort = \"hard\"").unwrap_err();
        assert!(fault.contains("`hard`") && fault.contains("`minimal`"), "{fault}");
        // Of the paper's models, those that reason by themselves.
        let models = Models::load(None).unwrap().model;
        let [reasons, replies] = ["Gemini 2.5 Pro", "Ministral 3 14B"].map(|name| models[name].max_output_tokens());
        assert!(reasons > 2_048 && replies == 2_048);
    }

    #[test]
    fn a_key_in_place_of_its_variable_is_refused_and_not_repeated() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("own.toml");
        std::fs::write(&file, "[backend.own]\ndialect = \"gemini\"\nkey = \"sk-secret-1\"\n").unwrap();
        let fault = Models::load(Some(&file)).unwrap_err().to_string();
        assert!(fault.contains("backend `own`") && fault.contains("environment variable"), "{fault}");
        assert!(!fault.contains("sk-secret"), "{fault}");
    }
}
