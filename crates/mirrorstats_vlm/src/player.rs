//! A model as a player: its episodes share the network thread.

use std::sync::Arc;

use serde_json::Value;
use tokio::runtime::Runtime;

use super::limits::Spend;
use super::model::Vlm;
use mirrorstats_agents::{Agent, Lost, Player, Task};

pub struct VlmPlayer {
    pub vlm: Arc<Vlm>,
    /// The default number of episodes under way.
    pub in_flight: usize,
    /// `None` if all answers come from journals.
    pub network: Option<Runtime>,
}

impl VlmPlayer {
    pub fn spend(&self) -> Option<Spend> {
        self.network.as_ref().map(|_| self.vlm.spend())
    }
}

impl Player for VlmPlayer {
    fn model(&self) -> &str {
        &self.vlm.choice().name
    }

    fn description(&self) -> Value {
        self.vlm.description()
    }

    fn agent(&self, task: Task, episode_id: &str) -> Result<Box<dyn Agent>, Lost> {
        let agent = self.vlm.agent(task, &episode_id.replace('/', "-"));
        Ok(Box::new(agent.map_err(|error| Lost::because(error.to_string()))?))
    }

    fn waits(&self) -> bool {
        self.network.is_some()
    }

    fn stopped(&self) -> Option<String> {
        self.vlm.stopped().map(str::to_owned)
    }
}
