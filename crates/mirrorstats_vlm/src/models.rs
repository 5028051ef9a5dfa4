//! The models, their providers, and their prices.
//!
//! The paper's eight are built in (`assets/models.toml`); a user's file adds to them. A model is chosen by its name in
//! tables or by the provider's id; an unknown id needs `--base-url` or `--backend`.

use std::collections::BTreeMap;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

use regex::{Captures, Regex};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

use super::wire_format::{Effort, ModelAnswer, WireFormat};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;
use mirrorstats_exact::names;
use mirrorstats_exact::suggest::hint;
use mirrorstats_toml_spec::{Faults, Source};
use mirrorstats_trace::footers::model_id::{OWN_SERVER, answers_for};

const BUILT_IN: &str = include_str!("../../../assets/models.toml");

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

/// A provider of models.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Backend {
    /// The shape of its requests and answers.
    pub wire_format: WireFormat,
    /// The base of its paths; `--base-url` replaces it.
    pub base_url: Option<String>,
    /// The environment variable with the key.
    pub key: String,
    /// True if the key may go to another machine over `http://`, where everyone on the way reads it.
    #[serde(default)]
    pub plain_http: bool,
    /// What every request of its models has besides.
    #[serde(default)]
    pub extra_body: Map<String, Value>,
}

/// A model of a backend.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// The vendor.
    pub vendor: Option<String>,
    /// The backend's name.
    pub backend: String,
    /// The backend's id of the model.
    pub id: String,
    /// The prices; unless both are known, the cost is unknown.
    #[serde(default)]
    pub prices: Prices,
    /// The enforcement of the reply's schema: by the provider, or by the prompt alone.
    #[serde(default)]
    pub contract: Contract,
    /// The most tokens of a reply, those of hidden reasoning included; absent for the usual number.
    pub max_output_tokens: Option<NonZeroU32>,
    /// The requested reasoning effort; absent to leave it to the provider.
    pub reasoning_effort: Option<Effort>,
    /// The sampling temperature; `default` sends none. The paper's, 0.2, if absent.
    #[serde(default = "paper_temperature", deserialize_with = "temperature")]
    #[schemars(with = "Temperature")]
    pub temperature: Option<f64>,
    /// Additional keys of every request, over those of its provider: tables are merged, other values replaced.
    #[serde(default)]
    pub extra_body: Map<String, Value>,
    /// Ids by which the model answers, besides its own and those of its dated snapshots; `*` is any text.
    #[serde(default)]
    pub answers_as: Vec<String>,
    /// Ids of other models that the user accepts in its place.
    #[serde(skip)]
    pub accepted: Vec<String>,
}

/// The temperature of the paper (Panel A).
#[expect(clippy::unnecessary_wraps, reason = "the default of a field that may say `default`")]
fn paper_temperature() -> Option<f64> {
    Some(0.2)
}

/// A temperature as written.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged)]
enum Temperature {
    /// Sent with each request.
    Of(#[schemars(range(min = 0.0))] f64),
    /// None is sent.
    Default(DefaultTemperature),
}

/// The provider's temperature.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum DefaultTemperature {
    /// `default`.
    Default,
}

fn temperature<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    Temperature::deserialize(from).map(|temperature| match temperature {
        Temperature::Of(number) => Some(number),
        Temperature::Default(_) => None,
    })
}

/// Merges a value into another one: tables recursively, other values by replacement.
pub(super) fn merge(into: &mut Value, from: &Value) {
    match (into, from) {
        (Value::Object(into), Value::Object(from)) => {
            for (key, value) in from {
                merge(into.entry(key.as_str()).or_insert(Value::Null), value);
            }
        }
        (into, from) => *into = from.clone(),
    }
}

impl Model {
    /// Returns true if an answer with this model id comes from this model or an accepted one.
    pub(crate) fn takes_answer_of(&self, returned: &str) -> bool {
        self.accepted.iter().any(|accepted| accepted == returned) || answers_for(&self.id, returned, &self.answers_as)
    }

    /// The default maximum tokens of a reply. A model with a reasoning effort gets more, or its reply would be cut off.
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
    #[schemars(range(min = 0.0))]
    pub input: Option<f64>,
    /// Of the part of the request that the provider has in its cache; as `input` if absent.
    #[schemars(range(min = 0.0))]
    pub cached_input: Option<f64>,
    /// Of the reply.
    #[schemars(range(min = 0.0))]
    pub output: Option<f64>,
}

impl Prices {
    /// The cost of an answer, US dollars; `None` unless its tokens and both prices are known.
    pub fn cost_usd(self, answer: &ModelAnswer) -> Option<f64> {
        let (prompt, completion) = (answer.prompt_tokens?, answer.completion_tokens?);
        let cached = answer.cached_tokens.unwrap_or(0).min(prompt);
        let of_cached = Self { input: self.cached_input.or(self.input), ..self }.cost_of_requests(cached.into())?;
        Some(of_cached + self.cost_of((prompt - cached).into(), completion.into())?)
    }

    /// The cost of a whole run's tokens, US dollars; `None` unless both prices are known.
    #[expect(clippy::cast_precision_loss, reason = "nobody pays for 2^53 tokens")]
    pub fn cost_of(self, prompt_tokens: u64, completion_tokens: u64) -> Option<f64> {
        Some((prompt_tokens as f64 * self.input? + completion_tokens as f64 * self.output?) / 1e6)
    }

    /// The cost of a whole run's requests, US dollars; `None` unless their price is known.
    pub fn cost_of_requests(self, prompt_tokens: u64) -> Option<f64> {
        Self { output: Some(0.0), ..self }.cost_of(prompt_tokens, 0)
    }

    pub fn unknown(self) -> Vec<&'static str> {
        let prices = [("input", self.input), ("output", self.output)];
        prices.into_iter().filter(|(_, price)| price.is_none()).map(|(name, _)| name).collect()
    }
}

/// The enforcement of a reply's shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Contract {
    /// The provider enforces the schema.
    #[default]
    Schema,
    /// The prompt asks for it.
    Prompt,
}

names!(Contract { Schema: "schema", Prompt: "prompt" });

#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    pub name: String,
    pub model: Model,
    pub backend: Backend,
    /// True if a file of models lists it, and knows its prices and parameters.
    pub is_known: bool,
}

#[derive(Debug, thiserror::Error)]
pub enum ModelsError {
    #[error("cannot read the models in `{}`: {source}", path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error("{0}")]
    Faults(#[from] Faults),
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
    pub fn extra_body(&self) -> Map<String, Value> {
        let mut all = Value::Object(self.backend.extra_body.clone());
        merge(&mut all, &Value::Object(self.model.extra_body.clone()));
        match all {
            Value::Object(all) => all,
            _ => Map::new(),
        }
    }

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

/// The keys that the prompt and the chosen model determine.
const PROTOCOL: [&str; 7] = ["model", "messages", "system", "contents", "systemInstruction", "stream", "n"];

/// A list of models is written by hand.
const LARGEST: Limit = Limit::new("bytes of a list of models", 1 << 20);

impl Models {
    pub fn load(file: Option<&Path>) -> Result<Self, ModelsError> {
        let mut models = Self::default();
        models.add("assets/models.toml", BUILT_IN)?;
        if let Some(path) = file {
            let text = input::text(path, LARGEST)
                .map_err(|source| ModelsError::Unreadable { path: path.to_owned(), source })?;
            models.add(&path.display().to_string(), &text)?;
        }
        Ok(models)
    }

    fn add(&mut self, file: &str, text: &str) -> Result<(), ModelsError> {
        let source = Source { name: file.to_owned(), text: text.to_owned() };
        let known = &self.backend;
        let read = mirrorstats_toml_spec::read_source(source, "a file of models", |own: &Self, at, faults| {
            for (_, backend) in at.within("backend") {
                if let Some(key) = backend.get("key").filter(|key| !is_variable(key.written())) {
                    let fault = key.fault("`key` is not the name of an environment variable");
                    faults.push(fault.help("write the name of the variable with the key, such as OPENAI_API_KEY"));
                }
            }
            for (_, at) in at.within("backend").chain(at.within("model")) {
                for (key, value) in at.within("extra_body").filter(|(key, _)| PROTOCOL.contains(key)) {
                    faults.push(value.fault(format!("`extra_body` has `{key}`, which is part of the protocol")));
                }
            }
            let names = || known.keys().chain(own.backend.keys()).map(String::as_str);
            for (name, at) in at.within("model") {
                let Some(model) = own.model.get(name) else { continue };
                if !names().any(|name| name == model.backend) {
                    let known = names().collect::<Vec<_>>().join(", ");
                    let fault = at.key("backend").fault(format!("no backend is called `{}`", model.backend));
                    faults.push(fault.help(format!("expected one of: {known}")));
                }
            }
        });
        let own = read.map_err(|mut faults| {
            let shown = Arc::new(Source { name: file.to_owned(), text: without_keys(text) });
            faults.0.iter_mut().for_each(|fault| fault.place.source = shown.clone());
            faults
        })?;
        self.backend.extend(own.backend);
        self.model.extend(own.model);
        Ok(())
    }

    /// The model of this name or id; with a backend, or if it looks like a provider's id, any id is accepted.
    pub fn choose(&self, name: &str, backend: Option<&str>) -> Result<Choice, ModelsError> {
        let known = self.model.iter().find(|(own, model)| *own == name || model.id == name);
        let is_known = known.is_some();
        let backend = backend.or_else(|| if is_known { None } else { backend_of(name) });
        let (title, mut model) = match (known, backend) {
            (Some((title, model)), _) => (title.clone(), model.clone()),
            (None, Some(backend)) => {
                let own = serde_json::json!({ "backend": backend, "id": name });
                let mut model: Model = serde_json::from_value(own).expect("all other keys of a model have defaults");
                if backend == OWN_SERVER {
                    // A local server may call its only model by any name.
                    model.answers_as = vec!["*".to_owned()];
                }
                (name.to_owned(), model)
            }
            (None, None) => return Err(self.unknown(name)),
        };
        if let Some(backend) = backend {
            backend.clone_into(&mut model.backend);
        }
        let backend = self.backend.get(&model.backend).cloned().ok_or_else(|| ModelsError::UnknownBackend {
            name: model.backend.clone(),
            known: self.backend.keys().cloned().collect::<Vec<_>>().join(", "),
        })?;
        Ok(Choice { name: title, model, backend, is_known })
    }

    fn unknown(&self, name: &str) -> ModelsError {
        let names = self.model.iter().flat_map(|(title, model)| [title.as_str(), model.id.as_str()]);
        let near = hint(name, names);
        let known = self.model.keys().map(|title| format!("`{title}`")).collect::<Vec<_>>().join(", ");
        ModelsError::Unknown { name: name.to_owned(), near, known }
    }
}

/// A text of the same length without possible secrets, such as a key in place of its variable's name: diagnostics show
/// lines.
fn without_keys(text: &str) -> String {
    static VALUES: LazyLock<Regex> = LazyLock::new(|| {
        let pattern = r#"(key["' \t]*=[ \t]*)("[^"\r\n]*"?|'[^'\r\n]*'?|[^,}#\r\n]*)"#;
        Regex::new(pattern).expect("a pattern of two groups")
    });
    let hidden = |found: &Captures<'_>| match &found[2] {
        value if is_variable(value.trim_end().trim_matches(['"', '\''])) => found[0].to_owned(),
        value => format!("{}{}", &found[1], "*".repeat(value.len())),
    };
    VALUES.replace_all(text, hidden).into_owned()
}

fn backend_of(id: &str) -> Option<&'static str> {
    let is_id = id.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || b"-./:_@".contains(&byte));
    match id {
        _ if !is_id => None,
        _ if id.contains('/') => Some("openrouter"),
        _ if id.starts_with("gpt-") => Some("openai"),
        _ if id.starts_with("claude-") => Some("anthropic"),
        _ if id.starts_with("gemini-") => Some("google"),
        _ => None,
    }
}

/// Returns true if this may name an environment variable: letters, digits and `_`, not starting with a digit.
fn is_variable(name: &str) -> bool {
    let is_word = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    is_word && !name.is_empty() && !name.starts_with(|first: char| first.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::{Models, Prices, WireFormat};

    #[test]
    fn a_cost_needs_both_prices() {
        let [none, input, output] = [(None, None), (Some(2.0), None), (None, Some(3.0))]
            .map(|(input, output)| Prices { input, output, ..Prices::default() });
        assert_eq!([none, input, output].map(|prices| prices.cost_of(1, 1)), [None; 3]);
        assert_eq!(
            [none, input, output].map(Prices::unknown),
            [vec!["input", "output"], vec!["output"], vec!["input"]]
        );
        assert_eq!([none, input].map(|prices| prices.cost_of_requests(500_000)), [None, Some(1.0)]);
        let both = Prices { input: Some(2.0), output: Some(3.0), ..Prices::default() };
        assert_eq!((both.cost_of(500_000, 1_000_000), both.unknown()), (Some(4.0), vec![]));
    }

    #[test]
    fn cached_tokens_have_a_price_of_their_own() {
        let body = serde_json::json!({ "choices": [], "usage": {
            "prompt_tokens": 500_000, "completion_tokens": 1_000_000, "prompt_tokens_details": { "cached_tokens": 400_000 },
        } });
        let answer = WireFormat::OpenaiChat.answer(&body).unwrap();
        let prices = Prices { input: Some(2.0), cached_input: Some(0.5), output: Some(3.0) };
        assert!((prices.cost_usd(&answer).unwrap() - 3.4).abs() < 1e-9);
        assert_eq!(Prices { cached_input: None, ..prices }.cost_usd(&answer), Some(4.0));
        assert_eq!(Prices { input: None, ..prices }.cost_usd(&answer), None);
    }

    #[test]
    fn temperature_and_extra_body_are_per_model() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("own.toml");
        let own = |keys: &str| {
            std::fs::write(&file, format!("[model.own]\nbackend = \"openrouter\"\nid = \"x\"\n{keys}\n")).unwrap();
            Models::load(Some(&file))
                .map(|models| models.choose("own", None).unwrap())
                .map_err(|fault| fault.to_string())
        };
        let temperature = |keys: &str| own(keys).map(|choice| choice.model.temperature);
        assert_eq!([temperature(""), temperature("temperature = 1")], [Ok(Some(0.2)), Ok(Some(1.0))]);
        assert_eq!(temperature("temperature = \"default\""), Ok(None));
        for wrong in ["-0.1", "\"low\"", "nan", "true"] {
            let fault = temperature(&format!("temperature = {wrong}")).unwrap_err();
            assert!(
                fault.contains(["`temperature` may be 0 or more", "a number"][usize::from(wrong.contains(['l', 'u']))]),
                "{fault}"
            );
        }
        let extra = |keys: &str| own(keys).map(|choice| serde_json::Value::from(choice.extra_body()));
        let merged = serde_json::json!({ "top_k": 1, "provider": { "only": ["a"], "require_parameters": true } });
        assert_eq!(extra("extra_body = { top_k = 1, provider = { only = [\"a\"] } }"), Ok(merged));
        let without = serde_json::json!({ "provider": { "require_parameters": false } });
        assert_eq!(extra("extra_body = { provider = { require_parameters = false } }"), Ok(without));
        let fault = extra("extra_body = { messages = [] }").unwrap_err();
        assert!(fault.contains("`extra_body` has `messages`, which is part of the protocol"), "{fault}");
    }

    #[test]
    fn an_unknown_id_goes_to_the_provider_of_its_form() {
        let models = Models::load(None).unwrap();
        for (id, backend) in
            [("gpt-9-x", "openai"), ("claude-x-1", "anthropic"), ("gemini-9", "google"), ("a/b:free", "openrouter")]
        {
            let choice = models.choose(id, None).unwrap();
            assert_eq!((choice.model.backend.as_str(), choice.is_known), (backend, false), "{id}");
        }
        assert!(models.choose("gpt-5.1", None).unwrap().is_known);
        for name in ["GPT 9", "gpt", "own-1", "Claude Sonnet"] {
            assert!(models.choose(name, None).is_err(), "{name}");
        }
    }

    #[test]
    fn an_invalid_price_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("own.toml");
        for price in ["-1.0", "nan", "inf"] {
            let model = format!("[model.own]\nbackend = \"google\"\nid = \"x\"\nprices = {{ input = {price} }}\n");
            std::fs::write(&file, model).unwrap();
            let fault = Models::load(Some(&file)).unwrap_err().to_string();
            assert!(fault.contains("`input` may be 0 or more"), "{fault}");
        }
    }

    #[test]
    fn reasoning_raises_the_default_token_limit_of_a_model() {
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
        assert!(fault.contains("`hard`") && fault.contains("minimal"), "{fault}");
        let models = Models::load(None).unwrap().model;
        let [reasons, replies] = ["Gemini 2.5 Pro", "Ministral 3 14B"].map(|name| models[name].max_output_tokens());
        assert!(reasons > 2_048 && replies == 2_048);
    }

    #[test]
    fn a_key_in_place_of_its_variable_is_refused_and_not_repeated() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("own.toml");
        for text in [
            "[backend.own]\nwire_format = \"gemini\"\nkey = \"sk-secret-1\"\n",
            "backend.own = { key = 'sk-secret,1', dialct = \"gemini\" }\n",
            "[backend.own]\nwire_format = \"gemini\"\n\"key\" = sk-secret-1\n",
        ] {
            std::fs::write(&file, text).unwrap();
            let fault = Models::load(Some(&file)).unwrap_err().to_string();
            assert!(fault.contains("own.toml:") && !fault.contains("secret"), "{fault}");
            assert!(fault.contains("environment variable") || text.contains("= sk"), "{fault}");
        }
    }
}
