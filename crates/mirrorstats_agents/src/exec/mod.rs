//! Agents that are external programs: any command that reads and writes JSON lines.
//!
//! One process plays one episode. Its replies are read like a model's: any other text than the requested object is no
//! decision. A program that ends, hangs or speaks out of turn loses its episode, like a broken network.
//!
//! Rule: a program gets the words and the frame that a model gets. It inherits the environment, including keys, but the
//! values of variables that hold keys are removed from all recorded output.

pub(super) mod conversation;
pub mod files;
pub mod group;
pub mod message;
pub mod program;
pub mod said;

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use self::conversation::Conversation;
use self::files::Unreadable;
use self::group::Groups;
use self::message::PROTOCOL;
use self::program::{Program, ProgramFailure};
use self::said::Kept;
use super::reply::Ending;
use super::secrets::{Secret, from_every_key_variable};
use super::{Agent, Decision, Ended, Farewell, Lost, Observation, Player, Reply, Status, Task, Usage};
use mirrorstats_exact::{hash, names};

/// The shell's exit codes for a missing command, and for one that cannot be run.
const NO_COMMAND: [i32; 2] = [126, 127];

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Images {
    /// As files, which are there until the episode ends.
    #[default]
    Path,
    Base64,
}

names!(Images { Path: "path", Base64: "base64" });

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExecSettings {
    pub model: String,
    pub command: String,
    pub images: Images,
    /// The time limit of a reply; for the first reply it includes the program's start.
    pub timeout: Duration,
    /// The parent folder of the episodes' temporary frame folders.
    pub scratch: PathBuf,
    /// The folder with one file per episode for the program's standard error.
    pub standard_error: PathBuf,
}

#[derive(Debug)]
pub struct Exec {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    settings: ExecSettings,
    files: Option<String>,
    groups: Arc<Groups>,
    secrets: Arc<[Secret]>,
    stop: OnceLock<String>,
}

impl Exec {
    pub fn new(settings: ExecSettings) -> Result<Self, Unreadable> {
        let files = files::fingerprint(&settings.command)?;
        let (groups, secrets, stop) = (Arc::default(), from_every_key_variable().into(), OnceLock::new());
        Ok(Self { shared: Arc::new(Shared { settings, files, groups, secrets, stop }) })
    }
}

impl Player for Exec {
    fn model(&self) -> &str {
        &self.shared.settings.model
    }

    /// The command by its hash, since its text may hold local paths or keys; the files that it names by theirs, null if
    /// it names none.
    fn description(&self) -> serde_json::Value {
        let ExecSettings { model, command, images, .. } = &self.shared.settings;
        serde_json::json!({
            "exec": model,
            "command": hash::of_bytes(command.as_bytes()),
            "files": self.shared.files,
            "protocol": PROTOCOL,
            "images": images.name(),
            "identification_version": mirrorstats_identification::VERSION,
        })
    }

    fn agent(&self, task: Task, episode_id: &str) -> Result<Box<dyn Agent>, Lost> {
        let shared = Arc::clone(&self.shared);
        let ExecSettings { images, scratch, .. } = &shared.settings;
        let conversation = Conversation::new(task, episode_id, *images, scratch, &shared.secrets)?;
        let kept = Kept::new(&shared.settings.standard_error, episode_id, Arc::clone(&shared.secrets));
        let program = Program::start(&shared.settings.command, &shared.groups, &kept.said);
        let program = program.map_err(|failure| lost(&failure))?;
        Ok(Box::new(ExecAgent { shared, conversation, program: Some(program), kept }))
    }

    fn waits(&self) -> bool {
        true
    }

    fn stopped(&self) -> Option<String> {
        self.shared.stop.get().cloned()
    }

    fn abandon(&self) {
        self.shared.groups.kill_all();
    }
}

#[derive(Debug)]
struct ExecAgent {
    shared: Arc<Shared>,
    conversation: Conversation,
    /// `None` once it is unusable.
    program: Option<Program>,
    kept: Kept,
}

impl Agent for ExecAgent {
    fn decide<'a>(&'a mut self, observation: &'a Observation) -> Decision<'a> {
        Box::pin(self.step(observation))
    }

    fn end(&mut self, reason: Ended) -> Farewell<'_> {
        Box::pin(async move {
            let Some(program) = self.program.take() else { return };
            if let Ok(line) = self.conversation.end(reason).line() {
                program.end(Some(&line)).await;
            }
        })
    }
}

impl ExecAgent {
    async fn step(&mut self, observation: &Observation) -> Result<Reply, Lost> {
        let (task, question) = self.conversation.messages(observation)?;
        let task = task.map(|task| task.line()).transpose().map_err(Lost::unobservable)?;
        let question = question.line().map_err(Lost::unobservable)?;
        let Some(program) = &mut self.program else { return Err(Lost::because("the program has ended")) };
        let start = Instant::now();
        match program.ask(task.as_deref(), &question, self.shared.settings.timeout).await {
            Ok(line) => Ok(self.read(&line, Usage::of_time(start.elapsed()))),
            Err(failure) => Err(self.give_up(&failure).await),
        }
    }

    fn read(&self, line: &[u8], usage: Usage) -> Reply {
        match str::from_utf8(line) {
            Ok(text) => self.conversation.read(text, Ending::Whole, usage),
            // With its bytes replaced, the line might pass for something else.
            Err(fault) => Reply::without_decision(Status::ParseFailed, Some(fault.to_string()))
                .with_text(self.conversation.without_secrets(&String::from_utf8_lossy(line)), usage),
        }
    }

    /// The program is unusable from now on; if the command cannot be run at all, so are all others.
    async fn give_up(&mut self, failure: &ProgramFailure) -> Lost {
        let Some(program) = self.program.take() else { return lost(failure) };
        let lost = lost(failure);
        program.end(None).await;
        let words = self.kept.said.last_words(&self.shared.secrets);
        let words = words.map_or_else(String::new, |words| format!("; its last words:\n{words}"));
        // Output before the reply belongs to the previous step, though it is noticed now.
        let asked = self.conversation.steps;
        let earlier = matches!(failure, ProgramFailure::Chatter { .. }).then_some(asked - 1);
        let step = earlier.unwrap_or(asked);
        let cause = self.conversation.without_secrets(&format!("step {step}: {}{words}", lost.cause));
        if let ProgramFailure::Ended(status) = failure
            && asked == 1
            && status.code().is_some_and(|code| NO_COMMAND.contains(&code))
        {
            self.shared.stop.get_or_init(|| format!("the command of --agent exec: cannot be run: {cause}"));
        }
        Lost { cause, step: earlier, ..lost }
    }
}

fn lost(failure: &ProgramFailure) -> Lost {
    let status = match failure {
        ProgramFailure::Slow(_) => Status::Timeout,
        _ => Status::ServerError,
    };
    Lost::counted_as(status, failure.to_string())
}
