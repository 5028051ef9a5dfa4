use serde_json::Value;

use super::models::{Choice, Contract, Prices, merge};
use super::wire_format::{Effort, ModelAnswer, Question, WireFormat};
use mirrorstats_agents::prompt::Rendered;

#[derive(Debug, thiserror::Error)]
#[error("the backend `{backend}` has no such tier\n  help: OpenAI (openai-chat) and Google (gemini) have --tier flex")]
pub struct NoTier {
    backend: String,
}

/// Returns true for Gemini 3.5 Flash-Lite and Gemini from 3.6 on, which accept a temperature and ignore it:
/// <https://ai.google.dev/gemini-api/docs/whats-new-gemini-3.6>.
fn ignores_temperature(id: &str) -> bool {
    let version = id.rsplit_once("gemini-").map_or("", |(_, version)| version);
    let mut numbers = version.split(['-', '.', ':']).map(|number| number.parse().unwrap_or(0));
    (numbers.next(), numbers.next()) >= (Some(3), Some(6)) || version.starts_with("3.5-flash-lite")
}

impl Choice {
    /// Asks for the flex tier: half the price, and answers that take minutes.
    pub fn use_flex_tier(&mut self) -> Result<(), NoTier> {
        let Some(key) = self.backend.wire_format.tier_key() else {
            return Err(NoTier { backend: self.model.backend.clone() });
        };
        self.model.extra_body.insert(key.to_owned(), "flex".into());
        let Prices { input, cached_input, output } = self.model.prices;
        let [input, cached_input, output] = [input, cached_input, output].map(|price| price.map(|price| price / 2.0));
        self.model.prices = Prices { input, cached_input, output };
        Ok(())
    }

    /// The temperature that is sent: none to a model that would ignore or reject it.
    pub(super) fn temperature(&self) -> Option<f64> {
        let thinks = !matches!(self.model.reasoning_effort, None | Some(Effort::None));
        let is_claude = self.backend.wire_format == WireFormat::AnthropicMessages;
        self.model.temperature.filter(|_| !(is_claude && thinks || ignores_temperature(&self.model.id)))
    }

    pub(super) fn body(&self, words: &Rendered, schema: &Value, png: &str) -> Value {
        let schema = (self.model.contract == Contract::Schema).then_some(schema);
        let question = Question { model: &self.model, temperature: self.temperature(), words, png, schema };
        let mut body = self.backend.wire_format.body(&question);
        merge(&mut body, &self.extra_body().into());
        body
    }

    pub(super) fn cost_usd(&self, answer: &ModelAnswer) -> Option<f64> {
        answer.cost_usd.or_else(|| self.model.prices.cost_usd(answer))
    }
}

#[cfg(test)]
mod tests {
    use super::ignores_temperature;

    #[test]
    fn gemini_ignores_a_temperature_from_3_6_on() {
        for id in [
            "gemini-3.6-flash",
            "google/gemini-3.8-flash:nitro",
            "gemini-3.10-pro",
            "gemini-4-pro",
            "gemini-3.5-flash-lite",
        ] {
            assert!(ignores_temperature(id), "{id}");
        }
        for id in [
            "gemini-2.5-pro",
            "gemini-3-flash-preview",
            "gemini-3.1-pro-preview",
            "gemini-3.5-flash",
            "gemini-flash-latest",
            "gpt-6",
            "",
        ] {
            assert!(!ignores_temperature(id), "{id}");
        }
    }
}
