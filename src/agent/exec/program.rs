//! A program that runs for one episode: lines in, lines out, and what can go wrong between.
//!
//! Rule: nothing of a program outlives its [`Program`]: it has a process group of its own, which is killed when the
//! value is dropped, whatever the program has started meanwhile. What it says on standard error is read all the time,
//! and its end is kept for messages.

use std::collections::VecDeque;
use std::io;
use std::process::{ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use futures_util::FutureExt as _;
use tokio::io::{AsyncBufReadExt as _, AsyncReadExt as _, AsyncWriteExt as _, BufReader};
use tokio::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command};
use tokio::time::timeout;

use super::group::{Group, Groups};

/// Bytes of one reply.
pub const LONGEST_REPLY: u64 = 1 << 20;
/// How long a program may take to leave after its standard input was closed.
const FAREWELL: Duration = Duration::from_secs(5);
/// How long the end of a process may come after the end of its output.
const CLOSING: Duration = Duration::from_secs(1);
/// Bytes of standard error that are kept.
const KEPT: usize = 2_000;

/// Why there is no reply.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum Failure {
    #[error("the program cannot be started: {0}")]
    Start(io::Error),
    #[error(
        "the program wrote a line that nobody had asked for: `{0}` (one line on standard output for each observation; \
         everything else belongs on standard error)"
    )]
    OutOfTurn(String),
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

/// A running program.
#[derive(Debug)]
pub struct Program {
    child: Child,
    group: Group,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    said: Arc<Mutex<Tail>>,
}

impl Program {
    /// Starts a command of the shell.
    ///
    /// # Errors
    /// When there is no shell, or no process can be had.
    pub fn start(command: &str, groups: &Arc<Groups>) -> Result<Self, Failure> {
        let mut shell = shell(command);
        shell.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).kill_on_drop(true);
        let mut child = shell.spawn().map_err(Failure::Start)?;
        let group = Group::of(child.id(), groups);
        let gone = || Failure::Start(io::Error::other("it has no standard streams"));
        let (input, output) = (child.stdin.take().ok_or_else(gone)?, child.stdout.take().ok_or_else(gone)?);
        let said = Arc::default();
        tokio::spawn(listen(child.stderr.take().ok_or_else(gone)?, Arc::clone(&said)));
        Ok(Self { child, group, input, output: BufReader::new(output), said })
    }

    /// Sends lines and waits for one, which is given without its end.
    ///
    /// # Errors
    /// Whatever kept a whole line from coming in time. The program is of no use then.
    pub async fn ask(&mut self, lines: &[u8], patience: Duration) -> Result<Vec<u8>, Failure> {
        self.is_silent().await?;
        timeout(patience, self.exchange(lines)).await.unwrap_or(Err(Failure::Slow(patience)))
    }

    async fn exchange(&mut self, lines: &[u8]) -> Result<Vec<u8>, Failure> {
        // A program that no longer listens has ended or is about to, which reading finds.
        let _ = self.input.write_all(lines).await;
        let mut line = Vec::new();
        let read = (&mut self.output).take(LONGEST_REPLY + 1).read_until(b'\n', &mut line).await;
        read.map_err(Failure::Unreadable)?;
        if line.pop_if(|last| *last == b'\n').is_some() {
            line.pop_if(|last| *last == b'\r');
            return Ok(line);
        }
        if line.len() as u64 > LONGEST_REPLY {
            return Err(Failure::TooLong);
        }
        match timeout(CLOSING, self.child.wait()).await {
            Ok(Ok(status)) => Err(Failure::Ended(status)),
            Ok(Err(_)) | Err(_) => Err(Failure::Closed),
        }
    }

    /// Nothing waits to be read: a line from before the question would be taken for the answer.
    async fn is_silent(&mut self) -> Result<(), Failure> {
        // Lets what has arrived be noticed.
        tokio::task::yield_now().await;
        match self.output.fill_buf().now_or_never() {
            Some(Ok(early)) if !early.is_empty() => {
                let line = early.split(|byte| *byte == b'\n').next().unwrap_or_default();
                let start = &line[..line.len().min(100)];
                Err(Failure::OutOfTurn(String::from_utf8_lossy(start).into_owned()))
            }
            _ => Ok(()),
        }
    }

    /// The end of what it said on standard error, on one line; `None` if it said nothing.
    pub async fn last_words(&self) -> Option<String> {
        // What was said just before the end may be on its way.
        tokio::time::sleep(Duration::from_millis(20)).await;
        self.said.lock().unwrap_or_else(PoisonError::into_inner).text()
    }

    /// Says a last line, closes standard input, and waits for the program to leave; one that stays is killed.
    pub async fn end(self, line: &[u8]) {
        let Self { mut child, group, mut input, output, said: _ } = self;
        let leaving = async {
            let _ = input.write_all(line).await;
            drop(input);
            child.wait().await
        };
        // It leaves, or it is killed with its group right here.
        let _ = timeout(FAREWELL, leaving).await;
        drop((group, output));
    }
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

/// The end of a text, by bytes.
#[derive(Debug, Default)]
struct Tail(VecDeque<u8>);

impl Tail {
    fn add(&mut self, bytes: &[u8]) {
        self.0.extend(bytes);
        let surplus = self.0.len().saturating_sub(KEPT);
        self.0.drain(..surplus);
    }

    fn text(&self) -> Option<String> {
        let bytes: Vec<u8> = self.0.iter().copied().collect();
        let text = String::from_utf8_lossy(&bytes).split_whitespace().collect::<Vec<_>>().join(" ");
        (!text.is_empty()).then_some(text)
    }
}

async fn listen(mut stream: ChildStderr, said: Arc<Mutex<Tail>>) {
    let mut bytes = [0; 4096];
    while let Ok(count @ 1..) = stream.read(&mut bytes).await {
        said.lock().unwrap_or_else(PoisonError::into_inner).add(&bytes[..count]);
    }
}

#[cfg(test)]
mod tests {
    use super::{KEPT, Tail};

    #[test]
    fn the_end_of_what_was_said_is_kept() {
        let mut tail = Tail::default();
        assert_eq!(tail.text(), None);
        tail.add(" \n".as_bytes());
        assert_eq!(tail.text(), None);
        tail.add(&vec![b'x'; KEPT]);
        tail.add(b"\nthe\tend\n");
        let text = tail.text().unwrap();
        assert!(text.starts_with("xxx") && text.ends_with("xx the end"), "{text}");
        assert_eq!(text.len(), KEPT - 1);
    }
}
