//! The spans of a sample's events that belong to scorers: what a grader does is not a step of the agent.

use std::collections::HashMap;

use serde_json::Value;

const SCORERS: [&str; 2] = ["scorers", "scorer"];
/// The role of the models that judge, also outside of scorers.
const GRADER: &str = "grader";

/// The spans begun so far. Events name their span, as those of concurrent spans mix. Older logs have steps instead,
/// which begin and end in turn.
#[derive(Debug, Default)]
pub(super) struct Spans {
    /// True for a span of a scorer, or inside one.
    of_scorers: HashMap<String, bool>,
    open_scorers: u64,
}

impl Spans {
    /// Takes the next event; true if it belongs to a scorer.
    pub(super) fn is_of_scorer(&mut self, event: &Value) -> bool {
        let is_scorer = || [&event["type"], &event["name"]].into_iter().find_map(Value::as_str).is_some_and(is_scorer);
        match event["event"].as_str() {
            Some("span_begin") => {
                let is_inside = is_scorer() || self.has(&event["parent_id"]);
                self.open_scorers += u64::from(is_inside);
                self.of_scorers.insert(event["id"].as_str().unwrap_or_default().to_owned(), is_inside);
                is_inside
            }
            Some("span_end") => {
                let is_inside = self.has(&event["id"]);
                self.open_scorers = self.open_scorers.saturating_sub(u64::from(is_inside));
                is_inside
            }
            Some("step") if is_scorer() && event["action"] == "begin" => {
                self.open_scorers += 1;
                true
            }
            Some("step") if is_scorer() => {
                self.open_scorers = self.open_scorers.saturating_sub(1);
                true
            }
            Some("model") if event["role"] == GRADER => true,
            _ => self.has(&event["span_id"]),
        }
    }

    /// True if the span with this id is of a scorer; without a known id, true while one is open.
    fn has(&self, id: &Value) -> bool {
        let known = id.as_str().and_then(|id| self.of_scorers.get(id));
        known.copied().unwrap_or(self.open_scorers > 0)
    }
}

fn is_scorer(word: &str) -> bool {
    SCORERS.contains(&word)
}
