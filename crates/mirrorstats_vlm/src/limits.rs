//! The limits of a whole run, over all its episodes and starts.
//!
//! Rule: a request's maximum cost is reserved before it is sent, so a run never exceeds its cost limit. An unanswered
//! request that may have been billed keeps its reservation. The token limit is checked before every request; those in
//! flight may still end.

use std::sync::{Arc, Mutex};

use schemars::JsonSchema;
use serde::Serialize;
use tokio::sync::Notify;

use mirrorstats_agents::locked;

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
    pub(crate) fn add_unanswered(&mut self, at_most_usd: f64) {
        self.unanswered += 1;
        self.uncosted_usd_at_most += at_most_usd;
    }

    pub(crate) fn add_answer(&mut self, tokens: u64, cost_usd: Option<f64>, at_most_usd: f64) {
        self.tokens = self.tokens.saturating_add(tokens);
        if let Some(cost) = cost_usd {
            self.cost_usd += cost;
        } else {
            self.uncosted += 1;
            self.uncosted_usd_at_most += at_most_usd;
        }
    }

    fn cost_at_most(&self) -> f64 {
        self.cost_usd + self.uncosted_usd_at_most
    }
}

/// The limits of a run; `None` for no limit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    pub cost_usd: Option<f64>,
    /// Tokens of requests and replies together.
    pub tokens: Option<u64>,
    /// Requests, including retries.
    pub requests: Option<u64>,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the limit of {0}\n  help: the same command with a higher limit continues")]
pub struct Reached(String);

/// The account of a run, shared by all of its episodes.
#[derive(Debug, Default)]
pub struct Account {
    limits: Limits,
    state: Mutex<SpendState>,
    changed: Notify,
}

#[derive(Debug, Default)]
struct SpendState {
    spend: Spend,
    in_flight: u64,
    reserved_usd: f64,
    /// Replies of known cost, their total cost, and the highest cost of one.
    costed: u64,
    costed_usd: f64,
    dearest_usd: f64,
    begun: u64,
    steps_left: u64,
}

/// A request in flight. If dropped without an outcome, it may have been billed.
#[derive(Debug)]
pub struct Reserved {
    account: Arc<Account>,
    at_most_usd: f64,
    is_open: bool,
}

/// An episode under way; it ends when this is dropped.
#[derive(Debug)]
pub struct Begun {
    account: Arc<Account>,
    left: u64,
}

impl Account {
    pub fn new(limits: Limits) -> Self {
        Self { limits, ..Self::default() }
    }

    pub(crate) fn limits_cost(&self) -> bool {
        self.limits.cost_usd.is_some()
    }

    pub(crate) fn begin_with(&self, spent: Spend) {
        locked(&self.state).spend = spent;
    }

    pub fn spend(&self) -> Spend {
        locked(&self.state).spend
    }

    /// Reserves this maximum cost for a request about to be sent. Waits for requests in flight if their final cost
    /// decides.
    pub async fn reserve(self: &Arc<Self>, at_most_usd: Option<f64>) -> Result<Reserved, Reached> {
        let at_most_usd = self.wait_for(|state| self.reserve_now(state, at_most_usd).transpose()).await?;
        Ok(Reserved { account: Arc::clone(self), at_most_usd, is_open: true })
    }

    /// Begins an episode of this many steps, with this maximum cost of the next one. Waits while episodes under way may
    /// need the rest of the limit.
    pub async fn begin(self: &Arc<Self>, steps: u64, at_most_usd: Option<f64>) -> Begun {
        self.wait_for(|state| self.begin_now(state, steps, at_most_usd).then_some(())).await;
        Begun { account: Arc::clone(self), left: steps }
    }

    /// Continues an episode that an earlier start began; it does not wait for others.
    pub(crate) fn go_on(self: &Arc<Self>, steps: u64) -> Begun {
        locked(&self.state).add_episode(steps);
        Begun { account: Arc::clone(self), left: steps }
    }

    async fn wait_for<T>(&self, attempt: impl Fn(&mut SpendState) -> Option<T>) -> T {
        loop {
            // A change between the attempt and the wait is noticed.
            let changed = self.changed.notified();
            if let Some(done) = attempt(&mut locked(&self.state)) {
                return done;
            }
            changed.await;
        }
    }

    fn change(&self, change: impl FnOnce(&mut SpendState)) {
        change(&mut locked(&self.state));
        self.changed.notify_waiters();
    }

    fn reserve_now(&self, state: &mut SpendState, at_most_usd: Option<f64>) -> Result<Option<f64>, Reached> {
        let spend = state.spend;
        if let Some(limit) = self.limits.requests.filter(|limit| spend.requests >= *limit) {
            return Err(Reached(format!("requests is reached: {} of {limit}", spend.requests)));
        }
        if let Some(limit) = self.limits.tokens.filter(|limit| spend.tokens >= *limit) {
            return Err(Reached(format!("tokens is reached: {} of {limit}", spend.tokens)));
        }
        // An answer may cost more than its stated maximum; the higher cost counts.
        let next = at_most_usd.map_or(0.0, |usd| usd.max(state.dearest_usd));
        let all = spend.cost_at_most() + state.reserved_usd + next;
        if let Some(limit) = self.limits.cost_usd.filter(|limit| all > *limit) {
            if state.in_flight > 0 {
                return Ok(None);
            }
            let [sum, limit, next] = [spend.cost_at_most(), limit, next].map(dollars);
            return Err(Reached(format!("cost is reached: {sum} of {limit}; the next request may cost {next}")));
        }
        state.spend.requests += 1;
        state.in_flight += 1;
        state.reserved_usd += next;
        Ok(Some(next))
    }

    #[expect(clippy::cast_precision_loss, reason = "nobody counts 2^53 steps")]
    fn begin_now(&self, state: &mut SpendState, steps: u64, at_most_usd: Option<f64>) -> bool {
        let a_step = if state.costed == 0 { at_most_usd } else { Some(state.costed_usd / state.costed as f64) };
        let (spend, steps_of_all) = (state.spend, state.steps_left + steps);
        let cost = a_step.map(|a_step| spend.cost_at_most() + a_step * steps_of_all as f64);
        // Until the cost is known, only one episode is under way.
        let fits = self.limits.cost_usd.is_none_or(|limit| cost.is_some_and(|cost| cost <= limit))
            && self.limits.requests.is_none_or(|limit| spend.requests + steps_of_all <= limit);
        if state.begun == 0 || fits {
            state.add_episode(steps);
            return true;
        }
        false
    }
}

impl SpendState {
    fn add_episode(&mut self, steps: u64) {
        self.begun += 1;
        self.steps_left += steps;
    }
}

impl Reserved {
    pub fn answered(mut self, tokens: u64, cost_usd: Option<f64>) {
        let at_most_usd = self.at_most_usd;
        self.close(|state| {
            state.spend.add_answer(tokens, cost_usd, at_most_usd);
            state.costed += u64::from(cost_usd.is_some());
            state.costed_usd += cost_usd.unwrap_or(0.0);
            state.dearest_usd = state.dearest_usd.max(cost_usd.unwrap_or(0.0));
        });
    }

    /// Closes a request that the provider rejected or never received: it costs nothing.
    pub fn refused(mut self) {
        self.close(|_| ());
    }

    fn close(&mut self, outcome: impl FnOnce(&mut SpendState)) {
        self.is_open = false;
        self.account.change(|state| {
            state.in_flight -= 1;
            state.reserved_usd = if state.in_flight == 0 { 0.0 } else { state.reserved_usd - self.at_most_usd };
            outcome(state);
        });
    }
}

impl Drop for Reserved {
    fn drop(&mut self) {
        if self.is_open {
            let at_most_usd = self.at_most_usd;
            self.close(|state| state.spend.add_unanswered(at_most_usd));
        }
    }
}

impl Begun {
    pub(crate) fn note_left(&mut self, steps: u64) {
        self.account.change(|state| state.steps_left = state.steps_left + steps - self.left);
        self.left = steps;
    }
}

impl Drop for Begun {
    fn drop(&mut self) {
        self.account.change(|state| {
            state.begun -= 1;
            state.steps_left -= self.left;
        });
    }
}

fn dollars(value: f64) -> String {
    let text = mirrorstats_exact::number::Decimal::of_float(value, 4);
    text.map_or_else(|| "an unknown number of".to_owned(), |number| format!("{number} US dollars"))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::time::Duration;

    use tokio::time::timeout;

    use super::{Account, Limits, Spend};

    fn account(limits: Limits, spent: Spend) -> Arc<Account> {
        let account = Account::new(limits);
        account.begin_with(spent);
        Arc::new(account)
    }

    /// Returns true if `work` is still waiting after a while.
    async fn waits<T>(work: impl Future<Output = T>) -> bool {
        timeout(Duration::from_millis(20), work).await.is_err()
    }

    #[tokio::test]
    async fn a_limit_stops_before_the_request_over_it() {
        let account = account(Limits { requests: Some(2), ..Limits::default() }, Spend::default());
        for _ in 0..2 {
            account.reserve(None).await.unwrap().refused();
        }
        assert!(account.reserve(None).await.unwrap_err().to_string().contains("requests is reached: 2 of 2"));
        assert_eq!(account.spend().requests, 2);
    }

    #[tokio::test]
    async fn money_and_tokens_count_from_earlier_starts() {
        let spent = Spend { cost_usd: 0.7, uncosted_usd_at_most: 0.1, tokens: 90, ..Spend::default() };
        let account = account(Limits { cost_usd: Some(1.0), tokens: Some(100), ..Limits::default() }, spent);
        let stopped = account.reserve(Some(0.21)).await.unwrap_err().to_string();
        assert!(stopped.contains("0.8000 US dollars of 1.0000"), "{stopped}");
        assert!(stopped.contains("the next request may cost 0.2100 US dollars"), "{stopped}");
        account.reserve(Some(0.1)).await.unwrap().answered(5, Some(0.05));
        account.reserve(Some(0.1)).await.unwrap().answered(5, None);
        assert!(account.reserve(None).await.unwrap_err().to_string().contains("tokens is reached: 100 of 100"));
        assert_eq!((account.spend().uncosted, account.spend().unanswered), (1, 0));
    }

    #[tokio::test]
    async fn requests_in_flight_reserve_their_largest_cost() {
        let account = account(Limits { cost_usd: Some(0.2), ..Limits::default() }, Spend::default());
        let first = account.reserve(Some(0.15)).await.unwrap();
        assert!(waits(account.reserve(Some(0.15))).await, "both together may cost 0.30");
        let (second, ()) = tokio::join!(account.reserve(Some(0.15)), async { first.answered(10, Some(0.01)) });
        // Whether it was billed is unknown.
        drop(second.unwrap());
        let spend = account.spend();
        assert_eq!((spend.unanswered, spend.uncosted_usd_at_most, spend.requests), (1, 0.15, 2));
        assert!(account.reserve(Some(0.15)).await.is_err());
        account.reserve(Some(0.03)).await.unwrap().refused();
    }

    #[tokio::test]
    async fn begun_episodes_come_before_new_ones() {
        let account = account(Limits { cost_usd: Some(1.0), ..Limits::default() }, Spend::default());
        let mut first = account.begin(100, Some(0.1)).await;
        assert!(waits(account.begin(100, Some(0.1))).await, "the first may need all of it");
        account.reserve(Some(0.1)).await.unwrap().answered(1, Some(0.004));
        assert!(!waits(account.begin(100, Some(0.1))).await, "200 steps of 0.004");
        let second = account.begin(100, Some(0.1)).await;
        assert!(waits(account.begin(100, Some(0.1))).await);
        first.note_left(10);
        assert!(!waits(account.begin(100, Some(0.1))).await);
        drop((first, second));
        // An episode of an earlier start has already begun, and one is always under way.
        let (_old, spent) = (account.go_on(1_000), account.spend());
        assert!(waits(account.begin(1, Some(0.1))).await);
        let poor = Arc::new(Account::new(Limits { cost_usd: Some(0.0), ..Limits::default() }));
        poor.begin_with(spent);
        assert!(!waits(poor.begin(100, Some(0.1))).await);
    }
}
