//! A program running for one episode: lines in, lines out, and failures.
//!
//! Rule: no process outlives its `Program`: dropping the value kills its process group, including processes started
//! meanwhile. Standard error is read continuously.
//!
//! A line is a reply if the program had begun to read the question when it wrote the line. Where the system reports the
//! unread bytes of a pipe, earlier lines are detected; elsewhere only those from before the question was sent.

use std::io;
use std::process::{ExitStatus, Stdio};
use std::sync::Arc;
use std::time::Duration;

use futures_util::FutureExt as _;
use tokio::io::{AsyncBufReadExt as _, AsyncReadExt as _, AsyncWriteExt as _, BufReader};
use tokio::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command};
use tokio::task::JoinHandle;
use tokio::time::timeout;

use super::group::{Group, Groups};
use super::said::Said;

pub(crate) const LONGEST_REPLY: u64 = 1 << 20;
/// The time for a program to exit after its standard input was closed.
const FAREWELL: Duration = Duration::from_secs(5);
/// The time between the end of a process's output and its own end.
const CLOSING: Duration = Duration::from_secs(1);
/// The interval of checks that the program has read its task.
const GLANCE: Duration = Duration::from_millis(2);
const SHOWN: usize = 100;

#[derive(Debug, thiserror::Error)]
pub enum ProgramFailure {
    #[error("the program cannot be started: {0}")]
    Start(io::Error),
    #[error(
        "the program wrote an unrequested line: `{line}`; the previous line was taken for its reply: `{before}` \
         (one line on standard output for each observation; everything else belongs on standard error)"
    )]
    OutOfTurn { line: String, before: String },
    #[error(
        "the program wrote `{chatter}` where its reply was expected, and its reply would have come after it: `{line}` (one line \
         on standard output for each observation, the JSON object of the reply; everything else belongs on standard error)"
    )]
    Chatter { chatter: String, line: String },
    #[error(
        "the program wrote a line before it was asked for its first reply: `{0}` (one line on standard output for each \
         observation; everything else belongs on standard error)"
    )]
    Early(String),
    #[error("the program ended ({0}) before its reply")]
    Ended(ExitStatus),
    #[error("the program closed its standard output before its reply")]
    Closed,
    #[error("the program's output cannot be read: {0}")]
    Unreadable(io::Error),
    #[error("no reply within {} s (--exec-timeout allows more)", .0.as_secs())]
    Slow(Duration),
    #[error("the reply is longer than {LONGEST_REPLY} bytes")]
    TooLong,
}

#[derive(Debug)]
pub(crate) struct Program {
    child: Child,
    group: Group,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    listener: JoinHandle<()>,
    last: String,
}

impl Program {
    /// Starts a command of the shell; what it says on standard error is added to `said`.
    pub fn start(command: &str, groups: &Arc<Groups>, said: &Arc<Said>) -> Result<Self, ProgramFailure> {
        let mut shell = shell(command);
        shell.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).kill_on_drop(true);
        let (mut child, group) = Group::start(&mut shell, groups).map_err(ProgramFailure::Start)?;
        let gone = || ProgramFailure::Start(io::Error::other("it has no standard streams"));
        let (input, output) = (child.stdin.take().ok_or_else(gone)?, child.stdout.take().ok_or_else(gone)?);
        let listener = tokio::spawn(listen(child.stderr.take().ok_or_else(gone)?, Arc::clone(said)));
        Ok(Self { child, group, input, output: BufReader::new(output), listener, last: String::new() })
    }

    /// Sends a question and waits for a line, returned without its end. The first question follows the task, which
    /// requires no line.
    pub async fn ask(
        &mut self,
        task: Option<&[u8]>,
        question: &[u8],
        patience: Duration,
    ) -> Result<Vec<u8>, ProgramFailure> {
        let asked = async {
            match task {
                Some(task) => self.tell(task).await?,
                None => self.is_silent().await?,
            }
            let line = self.exchange(question).await?;
            if self.unread() >= question.len() as u64 {
                return Err(match task {
                    Some(_) => ProgramFailure::Early(beginning(&line)),
                    None => self.out_of_turn(&line),
                });
            }
            self.last = beginning(&line);
            Ok(line)
        };
        timeout(patience, asked).await.unwrap_or(Err(ProgramFailure::Slow(patience)))
    }

    /// Sends the task and waits until the program has read it; earlier output is not a reply.
    async fn tell(&mut self, task: &[u8]) -> Result<(), ProgramFailure> {
        // A program that no longer reads has ended or is about to; reading detects this.
        let _ = self.input.write_all(task).await;
        loop {
            // The order matters: output from before the task was read is visible afterwards.
            let is_read = self.unread() == 0;
            match timeout(GLANCE, self.output.fill_buf()).await {
                Ok(Ok(early)) if !early.is_empty() => return Err(ProgramFailure::Early(beginning(early))),
                // Its output has ended; the next read detects this.
                Ok(_) => return Ok(()),
                Err(_) if is_read => return Ok(()),
                Err(_) => {}
            }
        }
    }

    async fn exchange(&mut self, question: &[u8]) -> Result<Vec<u8>, ProgramFailure> {
        let _ = self.input.write_all(question).await;
        let mut line = Vec::new();
        let read = (&mut self.output).take(LONGEST_REPLY + 1).read_until(b'\n', &mut line).await;
        read.map_err(ProgramFailure::Unreadable)?;
        if line.pop_if(|last| *last == b'\n').is_some() {
            line.pop_if(|last| *last == b'\r');
            return Ok(line);
        }
        if line.len() as u64 > LONGEST_REPLY {
            return Err(ProgramFailure::TooLong);
        }
        match timeout(CLOSING, self.child.wait()).await {
            Ok(Ok(status)) => Err(ProgramFailure::Ended(status)),
            Ok(Err(_)) | Err(_) => Err(ProgramFailure::Closed),
        }
    }

    /// Checks that no output is waiting: a line from before the question would be taken for the answer.
    async fn is_silent(&mut self) -> Result<(), ProgramFailure> {
        // Lets the runtime notice output that has arrived.
        tokio::task::yield_now().await;
        let early = match self.output.fill_buf().now_or_never() {
            Some(Ok(early)) if !early.is_empty() => beginning(early),
            _ => return Ok(()),
        };
        Err(self.out_of_turn(early.as_bytes()))
    }

    fn out_of_turn(&self, line: &[u8]) -> ProgramFailure {
        let (line, before) = (beginning(line), self.last.clone());
        // Of two lines for one question, the one that is not an object was not meant as the reply.
        if before.trim_start().starts_with('{') {
            ProgramFailure::OutOfTurn { line, before }
        } else {
            ProgramFailure::Chatter { chatter: before, line }
        }
    }

    fn unread(&self) -> u64 {
        #[cfg(target_os = "linux")]
        return rustix::io::ioctl_fionread(&self.input).unwrap_or(0);
        #[cfg(not(target_os = "linux"))]
        return 0;
    }

    /// Ends it, and waits until all of its output is read. After a last line it may exit by itself for a while; without
    /// one it is killed at once.
    pub async fn end(self, line: Option<&[u8]>) {
        let Self { mut child, group, mut input, output, listener, last: _ } = self;
        let leaving = async {
            let Some(line) = line else { return };
            let _ = input.write_all(line).await;
            drop(input);
            let _ = child.wait().await;
        };
        // It has exited, or is killed here with its group.
        let _ = timeout(FAREWELL, leaving).await;
        drop((child, group, output));
        // A process that left the group may keep standard error open.
        let _ = timeout(CLOSING, listener).await;
    }
}

fn beginning(bytes: &[u8]) -> String {
    let line = bytes.split(|byte| *byte == b'\n').next().unwrap_or_default();
    String::from_utf8_lossy(&line[..line.len().min(SHOWN)]).into_owned()
}

#[cfg(unix)]
fn shell(command: &str) -> Command {
    let mut shell = Command::new("sh");
    shell.arg("-c").arg(command).process_group(0);
    shell
}

#[cfg(not(unix))]
fn shell(command: &str) -> Command {
    let mut shell = Command::new("cmd");
    shell.arg("/C").arg(command);
    shell
}

async fn listen(mut stream: ChildStderr, said: Arc<Said>) {
    let mut bytes = [0; 4096];
    while let Ok(count @ 1..) = stream.read(&mut bytes).await {
        said.add(&bytes[..count]);
    }
}
