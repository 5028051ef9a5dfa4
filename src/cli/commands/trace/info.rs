//! `mirrorstats trace info`: the contents of traces.

use serde_json::json;

use crate::cli::args::TraceArgs;
use crate::cli::{Failure, Outcome, output, terminal};
use mirrorstats_study::contents::{Contents, episode_list};
use mirrorstats_trace::footers::answered::by_others;
use mirrorstats_trace::info::{Listing, info};

/// Summarise traces: episodes, steps, models, experiments, coverage, files
#[derive(Clone, Debug, clap::Args)]
pub struct InfoCommand {
    #[command(flatten)]
    input: TraceArgs,
    /// List the episodes: their ids, steps and files
    #[arg(long)]
    episodes: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl InfoCommand {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let study = self.input.open(None)?;
        let listing = if self.episodes { Listing::Episodes } else { Listing::Nothing };
        output::notes(&by_others(study.traces()?.files()));
        let info = info(study.traces()?, listing, self.input.threads.count())?;
        if let Some(episodes) = info.episode_list.as_ref().filter(|_| !self.json) {
            return output::plain(episode_list(episodes).within(terminal::width()));
        }
        let contents = Contents::of(&study, info)?;
        if self.json {
            return output::plain(format!("{:#}\n", json!(contents.answer())));
        }
        output::plain(contents.render(terminal::width()))
    }
}
