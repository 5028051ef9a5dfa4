use serde_json::Value;

use super::models::{Choice, Contract, Prices, merge};
use super::wire_format::{ModelAnswer, Question};
use mirrorstats_agents::prompt;

#[derive(Debug, thiserror::Error)]
#[error("the backend `{backend}` has no such tier\n  help: OpenAI (openai-chat) and Google (gemini) have --tier flex")]
pub struct NoTier {
    backend: String,
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

    /// The body of a request with this frame, as PNG in base64.
    pub(super) fn body(&self, words: &prompt::Rendered, schema: &Value, png: &str) -> Value {
        let mut body = self.backend.wire_format.body(&Question {
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

    pub(super) fn cost_usd(&self, answer: &ModelAnswer) -> Option<f64> {
        answer.cost_usd.or_else(|| self.model.prices.cost_usd(answer))
    }
}
