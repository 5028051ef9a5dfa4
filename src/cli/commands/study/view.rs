//! `mirrorstats view`: recordings in the browser.

use std::ffi::OsString;
use std::io::{self, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;

use crate::cli::args::{GroupingArgs, ScoringArgs, ThreadArgs};
use crate::cli::{Failure, Outcome, output};
use mirrorstats_exact::escape::visible;
use mirrorstats_study::import::Logs;
use mirrorstats_study::question::Question;
use mirrorstats_trace::beside::label_line::check_coder;
use mirrorstats_trace::inputs;
use mirrorstats_view::{Options, View, export, routes};
use mirrorstats_web::{cannot_listen, check_token, listen, new_token};

/// Show recordings in the browser: the report, each episode step by step, two episodes side by side
///
/// Starts a server for this machine only and prints its address; Ctrl-C stops it. The page updates while a recording
/// runs. --export writes the page as files instead, for a web server or to open from disk.
#[derive(Clone, Debug, clap::Args)]
pub struct ViewArgs {
    /// Traces, logs, folders of them, quoted globs
    #[arg(value_name = "RUNS", default_value = "runs")]
    runs: Vec<OsString>,
    #[command(flatten)]
    scoring: ScoringArgs,
    #[command(flatten)]
    grouping: GroupingArgs,
    /// Open at this episode, such as E1/oracle/s1/r1
    #[arg(long, value_name = "EPISODE")]
    episode: Option<String>,
    /// Other definitions, to show what they change: a name or a TOML file
    #[arg(long, value_name = "NAME|FILE")]
    against: Option<PathBuf>,
    /// The style of tables: `default`, `paper`, or a TOML file
    #[arg(long, value_name = "STYLE", default_value = "default")]
    style: String,
    /// The port; 0 picks a free one
    #[arg(long, value_name = "PORT", default_value_t = 7431)]
    port: u16,
    /// Listen on this address or name, not only on this machine; the connection is not encrypted
    #[arg(long, value_name = "HOST", conflicts_with = "no_token")]
    host: Option<String>,
    /// The token of the link, at least 16 letters and digits [default: a new one at each start]
    #[arg(long, value_name = "TOKEN", value_parser = token)]
    token: Option<String>,
    /// Let every account of this machine open the page without a token
    #[arg(long, conflicts_with = "token")]
    no_token: bool,
    /// Label episodes and steps as this coder: lines are added to labels.jsonl beside the traces
    #[arg(long, value_name = "CODER", value_parser = coder)]
    label: Option<String>,
    /// Do not open a browser
    #[arg(long)]
    no_open: bool,
    /// Write the page and its data into this folder instead; with --episode write one file, such as episode.html
    #[arg(long, value_name = "DIR|FILE", conflicts_with_all = ["port", "host", "token", "no_token", "no_open", "label"])]
    export: Option<PathBuf>,
    #[command(flatten)]
    threads: ThreadArgs,
}

impl ViewArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let mut inputs = inputs::resolve(&self.runs, io::empty()).unwrap_or_default();
        // They exist until the server ends.
        let logs = Logs::of(&mut inputs, self.scoring.definitions.as_deref())?;
        output::notes(logs.as_ref().map_or(&[][..], |logs| &logs.notes));
        let of_logs = || inputs.iter().map(|input| input.path.clone().into()).collect();
        let options = Options {
            runs: if logs.is_some() { of_logs() } else { self.runs.clone() },
            question: Question { each: true, ..self.scoring.question(&self.grouping) },
            against: self.against.clone(),
            style: self.style.clone(),
            coder: self.label.clone(),
            threads: self.threads.count(),
        };
        output::note_stale_checksums(&inputs);
        if let (Some(folder), None) = (&self.export, &self.episode) {
            return Self::export_all(&options, folder);
        }
        let view = View::open(options)?;
        if let Some(id) = self.episode.as_ref().filter(|id| !view.has_episode(id)) {
            return Err(Failure::input(format!(
                "--episode: expected the id of an episode in these recordings, found `{}`\n  help: `mirrorstats trace info --episodes` lists them",
                visible(id)
            )));
        }
        match (&self.export, &self.episode) {
            (Some(path), Some(id)) => Self::export_episode(&view, id, path),
            _ => self.serve(view),
        }
    }

    fn export_episode(view: &View, id: &str, path: &Path) -> Result<Outcome, Failure> {
        if path.extension().is_some_and(|ending| ending == "png" || ending == "apng") {
            return Err(Failure::input(format!(
                "--export: an episode is written as a page, found the picture `{}`\n  help: name a file that ends in \
                 .html; `mirrorstats world filmstrip` draws frames",
                path.display()
            )));
        }
        output::write_file(path, export::episode_page(view, id)?.as_bytes())?;
        output::say(&format!("open {}", path.display()));
        Ok(Outcome::Done)
    }

    fn export_all(options: &Options, folder: &Path) -> Result<Outcome, Failure> {
        let is_shown = io::stderr().is_terminal();
        let progress = |done: usize, all: usize| {
            if is_shown {
                let end = if done == all { "\n" } else { "" };
                let _ = write!(io::stderr(), "\r{done} of {all} episodes{end}");
            }
        };
        let written = export::write(options, folder, &progress)?;
        output::say(&format!("{written} files; open {}", folder.join("index.html").display()));
        Ok(Outcome::Done)
    }

    fn serve(&self, view: View) -> Result<Outcome, Failure> {
        let (host, port) = (self.host.as_deref(), self.port);
        let taken = |error: io::Error| {
            let help = "is another `mirrorstats view` there? `--port 0` takes any port that is free";
            Failure::input(format!("{}\n  help: {help}", cannot_listen(host, port, &error)))
        };
        let drawn = (self.token.is_none() && !self.no_token).then(new_token).transpose();
        let drawn = drawn.map_err(|error| Failure::input(format!("cannot make a token: {error}")))?;
        let (listener, guard) = listen(host, port, self.token.as_deref().or(drawn.as_deref())).map_err(taken)?;
        let link = self
            .episode
            .as_deref()
            .map_or_else(|| guard.link(), |id| guard.link_with(&[("view", "episode"), ("id", id)]));
        writeln!(io::stdout(), "{link}")?;
        io::stdout().flush()?;
        output::say(&format!("{} episodes; Ctrl-C ends it", view.episodes()));
        if !guard.is_local() {
            output::say(
                "note: the connection is not encrypted; anyone on the network can read it. Use a tunnel: `ssh -L`",
            );
        }
        if !self.no_open {
            open(&link);
        }
        routes::serve(Arc::new(view), listener, guard).map_err(taken)?;
        Ok(Outcome::Done)
    }
}

fn coder(text: &str) -> Result<String, String> {
    check_coder(text).map(|()| text.to_owned()).map_err(|invalid| invalid.to_string())
}

fn token(text: &str) -> Result<String, String> {
    check_token(text).map(|()| text.to_owned())
}

fn open(link: &str) {
    let program = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(windows) {
        "explorer"
    } else {
        "xdg-open"
    };
    let quiet =
        Command::new(program).arg(link).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    if quiet.is_err() {
        output::say("no browser was opened: open the address above");
    }
}
