//! What a whole run may spend, over all its episodes and all the times it was started.
//!
//! Rule: a limit is looked at before every request. Requests in flight may still end, so that a run can go over its
//! limit of tokens or money by what those take, and never by a request more.

use std::sync::Mutex;

use schemars::JsonSchema;
use serde::Serialize;

/// The limits of a run; `None` where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// US dollars.
    pub cost_usd: Option<f64>,
    /// Tokens of requests and replies together.
    pub tokens: Option<u64>,
    /// Requests, repeated ones included.
    pub requests: Option<u64>,
}

/// What was spent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Spend {
    /// US dollars of the replies whose cost is known.
    pub cost_usd: f64,
    /// Replies whose cost is not known.
    pub uncosted: u64,
    /// Tokens of requests and replies together.
    pub tokens: u64,
    /// Requests that went out.
    pub requests: u64,
}

/// A limit that is reached.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the limit of {what} is reached: {spent} of {limit}\n  help: the same command with a higher limit continues")]
pub struct Reached {
    what: &'static str,
    spent: String,
    limit: String,
}

/// The running account of a run; shared by all of its episodes.
#[derive(Debug, Default)]
pub struct Account {
    limits: Limits,
    spend: Mutex<Spend>,
}

impl Account {
    /// An account that begins with what earlier starts of the run have spent.
    pub fn new(limits: Limits, spent: Spend) -> Self {
        Self { limits, spend: Mutex::new(spent) }
    }

    /// What was spent so far.
    pub fn spend(&self) -> Spend {
        *self.spend.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Counts a request that is about to go out.
    pub fn request(&self) -> Result<(), Reached> {
        let mut spend = self.spend.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(limit) = self.limits.requests.filter(|limit| spend.requests >= *limit) {
            return Err(reached("requests", spend.requests.to_string(), limit.to_string()));
        }
        if let Some(limit) = self.limits.tokens.filter(|limit| spend.tokens >= *limit) {
            return Err(reached("tokens", spend.tokens.to_string(), limit.to_string()));
        }
        if let Some(limit) = self.limits.cost_usd.filter(|limit| spend.cost_usd >= *limit) {
            return Err(reached("cost", dollars(spend.cost_usd), dollars(limit)));
        }
        spend.requests += 1;
        Ok(())
    }

    /// Counts what an answer took.
    pub fn answer(&self, tokens: u64, cost_usd: Option<f64>) {
        let mut spend = self.spend.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        spend.tokens = spend.tokens.saturating_add(tokens);
        match cost_usd {
            Some(cost) => spend.cost_usd += cost,
            None => spend.uncosted += 1,
        }
    }
}

fn reached(what: &'static str, spent: String, limit: String) -> Reached {
    Reached { what, spent, limit }
}

fn dollars(value: f64) -> String {
    let text = exact::number::Decimal::of_float(value, 4);
    text.map_or_else(|| "an unknown number of".to_owned(), |number| format!("{number} US dollars"))
}

#[cfg(test)]
mod tests {
    use super::{Account, Limits, Spend};

    #[test]
    fn a_limit_stops_before_the_request_over_it() {
        let account = Account::new(Limits { requests: Some(2), ..Limits::default() }, Spend::default());
        assert!(account.request().is_ok() && account.request().is_ok());
        assert!(account.request().unwrap_err().to_string().contains("requests is reached: 2 of 2"));
        assert_eq!(account.spend().requests, 2);
    }

    #[test]
    fn money_and_tokens_count_from_earlier_starts() {
        let spent = Spend { cost_usd: 0.9, tokens: 90, ..Spend::default() };
        let account = Account::new(Limits { cost_usd: Some(1.0), tokens: Some(100), ..Limits::default() }, spent);
        assert!(account.request().is_ok());
        account.answer(5, Some(0.2));
        assert!(account.request().unwrap_err().to_string().contains("1.1000 US dollars of 1.0000"));
        account.answer(5, None);
        assert!(account.request().unwrap_err().to_string().contains("tokens is reached: 100 of 100"));
        assert_eq!(account.spend().uncosted, 1);
    }
}
