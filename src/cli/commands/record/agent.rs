//! The player of a recording: what only models or only people need, programs as agents, and Ctrl-C.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use super::HUMAN;
use crate::cli::Failure;
use crate::cli::args::one_of;
use mirrorstats_agents::exec::{Exec, ExecSettings, Images};
#[cfg(feature = "view")]
use mirrorstats_agents::human::{Human, design::Planned};
use mirrorstats_agents::scripted::Scripted;
use mirrorstats_agents::{Player, Turn};
use mirrorstats_exact::suggest::hint;
use mirrorstats_experiment::Experiment;
use mirrorstats_record::lock::parts_of;
#[cfg(feature = "view")]
use mirrorstats_record::plan::Key;
use mirrorstats_record::plan::{Episodes, Subject};
use mirrorstats_vlm::limits::Spend;
use mirrorstats_vlm::{Vlm, VlmPlayer};

/// The folder inside a recording's folder for the standard error of programs.
const STANDARD_ERROR: &str = "stderr";

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

    pub(super) fn vlm(&self) -> Option<&Vlm> {
        if let Self::Model(model) = self { Some(&model.vlm) } else { None }
    }

    /// Connects to a model's provider, or deals the episodes to people.
    #[cfg_attr(not(feature = "view"), expect(unused_variables, reason = "people play with the feature alone"))]
    pub(super) fn begin(&self, episodes: &Episodes, subject: &Subject) -> Result<(), Failure> {
        match self {
            Self::Model(VlmPlayer { vlm, .. }) => {
                if episodes.todo.len() < episodes.planned.len() {
                    vlm.note_answered();
                }
                if !episodes.todo.is_empty() {
                    vlm.connect().map_err(Failure::input)?;
                }
            }
            #[cfg(feature = "view")]
            Self::People(people) => people.hub().deal(&to_play(episodes, subject)),
            Self::Other(_) => {}
        }
        Ok(())
    }

    /// The default number of episodes under way, and the most.
    pub(super) fn in_flight(&self) -> (usize, usize) {
        match self {
            Self::Model(model) => (model.in_flight, usize::MAX),
            #[cfg(feature = "view")]
            Self::People(people) => (people.hub().seats(), people.hub().seats()),
            Self::Other(_) => (1, usize::MAX),
        }
    }

    /// Returns true if the steps of an unfinished episode stay in a journal, from which the next start continues.
    pub(super) const fn keeps_steps(&self) -> bool {
        !matches!(self, Self::Other(_))
    }

    pub(super) fn spend(&self) -> Option<Spend> {
        if let Self::Model(model) = self { model.spend() } else { None }
    }

    pub(super) fn turn(&self, episode_id: &str) -> Turn {
        #[cfg(feature = "view")]
        if let Self::People(people) = self {
            return people.hub().turn(episode_id);
        }
        let _ = episode_id;
        Turn::Now
    }

    /// The ids of episodes that were deleted at their participants' request.
    pub(super) fn deleted(&self) -> Result<BTreeSet<String>, String> {
        #[cfg(feature = "view")]
        if let Self::People(people) = self {
            return people.hub().delete_due();
        }
        Ok(BTreeSet::new())
    }

    pub(super) fn end(&self, is_complete: bool) {
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

/// All planned episodes, in the form for people.
#[cfg(feature = "view")]
fn to_play(episodes: &Episodes, subject: &Subject) -> Vec<Planned> {
    let todo: BTreeSet<&Key> = episodes.todo.iter().collect();
    let one = |key: &Key| Planned {
        episode_id: key.episode_id(subject),
        experiment: key.experiment.name().to_owned(),
        seed: key.seed,
        repetition: key.repetition,
        is_recorded: !todo.contains(key),
    };
    episodes.planned.iter().map(one).collect()
}

pub fn scripted(name: &str) -> Result<Scripted, Failure> {
    if let Some(scripted) = Scripted::named(name) {
        return Ok(scripted);
    }
    let known: Vec<&str> = Scripted::ALL.iter().map(|agent| agent.name()).chain(["vlm", HUMAN, "exec:'CMD'"]).collect();
    let near = hint(name, known.iter().copied());
    Err(Failure::input(format!("no agent is called `{name}`{near}; expected one of {}", known.join(", "))))
}

/// Refuses experiments that ask for a hand if the scripted agent has none.
pub fn check_hands(agent: &str, experiments: &[Experiment]) -> Result<(), Failure> {
    let has_hand = Scripted::named(agent).is_none_or(Scripted::has_hand);
    let Some(reaching) = experiments.iter().find(|experiment| experiment.hand.is_some() && !has_hand) else {
        return Ok(());
    };
    let handed = Scripted::ALL.into_iter().filter(|script| script.has_hand()).map(Scripted::name);
    Err(Failure::input(format!(
        "`{agent}` has no hand, which `{}` asks for; scripted agents that have one: {}",
        reaching.name(),
        handed.collect::<Vec<_>>().join(", ")
    )))
}

/// The arguments for a program of one's own.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "With --agent exec:'CMD'")]
pub struct ExecArgs {
    /// How the program gets frames: path, a PNG file, kept until the episode ends; base64, PNG in the line
    #[arg(long, default_value = "path", hide_possible_values = true, value_parser = one_of(&Images::ALL, Images::name))]
    exec_images: Images,
    /// Seconds for one reply; the first includes the program's start
    #[arg(long, value_name = "SECONDS", default_value_t = 180, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    exec_timeout: u64,
}

impl ExecArgs {
    /// The player that runs a command; its name in tables is `model`. Recordings go into `out`.
    pub fn player(&self, command: &str, model: Option<&str>, out: &Path) -> Result<Exec, Failure> {
        if command.trim().is_empty() {
            return Err(Failure::input("--agent exec: needs a command, such as --agent exec:'python3 agent.py'"));
        }
        Exec::new(ExecSettings {
            model: model.unwrap_or("exec").to_owned(),
            command: command.to_owned(),
            images: self.exec_images,
            timeout: Duration::from_secs(self.exec_timeout),
            scratch: parts_of(out),
            standard_error: out.join(STANDARD_ERROR),
        })
        .map_err(Failure::input)
    }
}

pub type Playing = Arc<Mutex<Option<Arc<AnyPlayer>>>>;

/// The first Ctrl-C ends a recording after the current steps, or at once for people; a second one ends everything at
/// once.
pub fn stop_at_interrupt(stop: &'static AtomicBool, playing: Playing) -> Result<(), Failure> {
    ctrlc::set_handler(move || {
        let is_second = stop.swap(true, Ordering::Relaxed);
        let playing = playing.lock().unwrap_or_else(PoisonError::into_inner);
        match playing.as_ref() {
            Some(player) if is_second => player.player().abandon(),
            Some(player) => player.interrupt(),
            None => {}
        }
        if is_second {
            leave(130);
        }
    })
    .map_err(|error| Failure::input(format!("cannot listen for Ctrl-C: {error}")))
}

/// Ends the process at once, without the exit handlers of libraries: those of the renderer would destroy objects that
/// other threads are drawing with. Only temporary data is lost; the next recording sweeps it.
#[cfg(unix)]
fn leave(code: i32) -> ! {
    signal_hook::low_level::exit(code)
}

#[cfg(not(unix))]
fn leave(code: i32) -> ! {
    std::process::exit(code)
}
