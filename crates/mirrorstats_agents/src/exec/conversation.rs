//! The messages to a program or a function in one episode: the words and the frame that a model gets.

use std::path::Path;
use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::Images;
use super::message::{EndMessage, Image, Message, ObservationMessage, PROTOCOL, Position, TaskMessage};
use super::said::without;
use crate::prompt::{self, Prompt, Rendered};
use crate::reply::{self, Ending};
use crate::secrets::Secret;
use crate::{Ended, Lost, Observation, Reply, Task, Usage};
use mirrorstats_exact::hash;
use mirrorstats_exact::replace::TemporaryFolder;

#[derive(Debug)]
pub(crate) struct Conversation {
    task: Task,
    episode_id: String,
    prompt: Prompt,
    frames: Option<TemporaryFolder>,
    secrets: Arc<[Secret]>,
    /// The last step that was asked for.
    pub steps: i32,
}

impl Conversation {
    pub(crate) fn new(
        task: Task,
        episode_id: &str,
        images: Images,
        scratch: &Path,
        secrets: &Arc<[Secret]>,
    ) -> Result<Self, Lost> {
        let prompt = Prompt::for_experiment(&task.experiment).map_err(Lost::unobservable)?;
        let frames = match images {
            Images::Path => {
                let made = std::path::absolute(scratch).and_then(|folder| TemporaryFolder::create(&folder, "frames"));
                Some(made.map_err(Lost::unobservable)?)
            }
            Images::Base64 => None,
        };
        let (episode_id, secrets) = (episode_id.to_owned(), Arc::clone(secrets));
        Ok(Self { task, episode_id, prompt, frames, secrets, steps: 0 })
    }

    /// The task, only before the first observation, and the observation.
    pub(crate) fn messages(&mut self, observation: &Observation) -> Result<(Option<Message>, Message), Lost> {
        self.steps = observation.t;
        let Rendered { system, user } = self.prompt.render(&self.task, observation).map_err(Lost::unobservable)?;
        let task = (observation.t == 1).then(|| self.task_message(system));
        Ok((task, self.observation_message(observation, user)?))
    }

    fn task_message(&self, system_prompt: String) -> Message {
        Message::Task(TaskMessage {
            protocol: PROTOCOL,
            family: self.task.experiment.prompt.replace('-', "_"),
            stated_color: self.task.stated_color.clone(),
            max_steps: self.task.step_budget,
            seed: hashed(self.task.seed),
            system_prompt,
            reply_schema: reply::structure(&self.task.experiment),
        })
    }

    fn observation_message(&self, observation: &Observation, user_prompt: String) -> Result<Message, Lost> {
        let png = observation.frame.to_png().map_err(Lost::unobservable)?;
        let image = match &self.frames {
            Some(folder) => Image::Path(kept(folder.path(), observation.t, png)?),
            None => Image::Base64(STANDARD.encode(png)),
        };
        let (last_action, last_thought) = observation.history.clone().unwrap_or_default();
        Ok(Message::Observation(ObservationMessage {
            t: observation.t,
            remaining_steps: observation.remaining,
            position: Position { x: observation.x, y: observation.y },
            orientation: observation.yaw,
            wall_warning: observation.bumped,
            last_action: last_action.map(|action| prompt::letter(action).to_owned()),
            last_thought,
            user_prompt,
            image,
        }))
    }

    pub(crate) fn end(&self, reason: Ended) -> Message {
        Message::End(EndMessage { episode_id: self.episode_id.clone(), reason, steps: self.steps })
    }

    pub(crate) fn read(&self, text: &str, ending: Ending, usage: Usage) -> Reply {
        let text = self.without_secrets(text);
        reply::read(&text, &self.task.experiment, ending).with_text(text, usage)
    }

    pub(crate) fn without_secrets(&self, text: &str) -> String {
        without(&self.secrets, text)
    }
}

/// A seed that does not say which scene it belongs to.
fn hashed(seed: u64) -> u64 {
    let hash = hash::of_bytes(&[b"mirrorstats agent seed ", &seed.to_le_bytes()[..]].concat());
    u64::from_str_radix(&hash[..16], 16).expect("hexadecimal digits")
}

fn kept(folder: &Path, t: i32, png: &[u8]) -> Result<String, Lost> {
    let path = folder.join(format!("{t:03}.png"));
    std::fs::write(&path, png).map_err(Lost::unobservable)?;
    path.into_os_string().into_string().map_err(|_| {
        Lost::unobservable(
            "the folder's name is not UTF-8, which JSON cannot hold\n  help: --exec-images base64 needs no file",
        )
    })
}
