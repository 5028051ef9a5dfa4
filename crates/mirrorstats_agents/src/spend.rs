//! The spending on a model.

use schemars::JsonSchema;
use serde::Serialize;

/// The spending.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Spend {
    /// US dollars of the replies whose cost is known.
    pub cost_usd: f64,
    /// Replies whose cost is not known.
    pub uncosted: u64,
    /// Requests without an answer that may have been paid: timed out, broken off, or killed.
    pub unanswered: u64,
    /// US dollars at most of these requests, and of the replies whose cost is not known, as far as prices are known.
    pub uncosted_usd_at_most: f64,
    /// Tokens of requests and replies together.
    pub tokens: u64,
    /// Requests that went out.
    pub requests: u64,
}

impl Spend {
    pub fn add_unanswered(&mut self, at_most_usd: f64) {
        self.unanswered += 1;
        self.uncosted_usd_at_most += at_most_usd;
    }

    pub fn add_answer(&mut self, tokens: u64, cost_usd: Option<f64>, at_most_usd: f64) {
        self.tokens = self.tokens.saturating_add(tokens);
        if let Some(cost) = cost_usd {
            self.cost_usd += cost;
        } else {
            self.uncosted += 1;
            self.uncosted_usd_at_most += at_most_usd;
        }
    }

    pub fn cost_at_most(&self) -> f64 {
        self.cost_usd + self.uncosted_usd_at_most
    }
}
