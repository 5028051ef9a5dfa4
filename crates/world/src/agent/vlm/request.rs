//! One request of a model: its body, and what an answer to it cost.

use serde_json::Value;

use super::models::{Choice, Contract, Prices, merge};
use super::wire_format::{Answer, Question};
use crate::agent::prompt;

/// A provider without a flex tier.
#[derive(Debug, thiserror::Error)]
#[error(
    "the backend `{backend}` has no flex tier\n  help: OpenAI (openai-chat) and Google (gemini) have one; leave --tier out"
)]
pub struct NoFlexTier {
    backend: String,
}

impl Choice {
    /// Asks for the flex tier: half the price, and answers that take minutes.
    pub fn use_flex_tier(&mut self) -> Result<(), NoFlexTier> {
        let Some(key) = self.backend.dialect.tier_key() else {
            return Err(NoFlexTier { backend: self.model.backend.clone() });
        };
        self.model.extra_body.insert(key.to_owned(), "flex".into());
        let Prices { input, cached_input, output } = self.model.prices;
        let [input, cached_input, output] = [input, cached_input, output].map(|price| price.map(|price| price / 2.0));
        self.model.prices = Prices { input, cached_input, output };
        Ok(())
    }

    /// The body of a request with this frame, as PNG in base64.
    pub(super) fn body(&self, words: &prompt::Rendered, schema: &Value, png: &str) -> Value {
        let mut body = self.backend.dialect.body(&Question {
            model: &self.model.id,
            system: &words.system,
            user: &words.user,
            png_base64: png,
            schema: (self.model.contract == Contract::Schema).then_some(schema),
            temperature: self.model.temperature,
            max_output_tokens: self.model.max_output_tokens(),
            reasoning_effort: self.model.reasoning_effort,
        });
        merge(&mut body, &self.extra_body().into());
        body
    }

    /// What an answer cost, US dollars: as the provider says, else by its tokens.
    pub(super) fn cost_usd(&self, answer: &Answer) -> Option<f64> {
        answer.cost_usd.or_else(|| self.model.prices.cost_usd(answer))
    }
}
