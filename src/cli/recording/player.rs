//! The player of a recording, and what only models or only people need.

use std::collections::BTreeSet;

use super::vlm::VlmPlayer;
#[cfg(feature = "view")]
use mirrorstats_agents::human::Human;
use mirrorstats_agents::{Player, Turn};
use mirrorstats_vlm::limits::Spend;

pub enum AnyPlayer {
    Model(VlmPlayer),
    #[cfg(feature = "view")]
    People(Human),
    Other(Box<dyn Player>),
}

impl AnyPlayer {
    pub fn player(&self) -> &dyn Player {
        match self {
            Self::Model(model) => model,
            #[cfg(feature = "view")]
            Self::People(people) => people,
            Self::Other(player) => player.as_ref(),
        }
    }

    /// The default number of episodes under way, and the most.
    pub(crate) fn in_flight(&self) -> (usize, usize) {
        match self {
            Self::Model(model) => (model.in_flight, usize::MAX),
            #[cfg(feature = "view")]
            Self::People(people) => (people.hub().seats(), people.hub().seats()),
            Self::Other(_) => (1, usize::MAX),
        }
    }

    /// Returns true if the steps of an unfinished episode stay in a journal, from which the next start continues.
    pub(crate) const fn keeps_steps(&self) -> bool {
        !matches!(self, Self::Other(_))
    }

    pub(crate) fn spend(&self) -> Option<Spend> {
        if let Self::Model(model) = self { model.spend() } else { None }
    }

    pub(crate) fn turn(&self, episode_id: &str) -> Turn {
        #[cfg(feature = "view")]
        if let Self::People(people) = self {
            return people.hub().turn(episode_id);
        }
        let _ = episode_id;
        Turn::Now
    }

    /// The ids of episodes that were deleted at their participants' request.
    pub(crate) fn deleted(&self) -> Result<BTreeSet<String>, String> {
        #[cfg(feature = "view")]
        if let Self::People(people) = self {
            return people.hub().delete_due();
        }
        Ok(BTreeSet::new())
    }

    pub(crate) fn end(&self, is_complete: bool) {
        #[cfg(feature = "view")]
        if let Self::People(people) = self {
            people.end(is_complete);
        }
        let _ = is_complete;
    }

    /// Stops all waiting for people; others complete their current steps.
    pub fn interrupt(&self) {
        #[cfg(feature = "view")]
        if let Self::People(people) = self {
            people.hub().interrupt();
        }
    }
}
