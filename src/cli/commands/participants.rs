//! `mirrorstats participants`: the people of a recording.

use std::fmt::{self, Write as _};
use std::path::PathBuf;

use crate::cli::{Failure, Outcome, output};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::counted;
use mirrorstats_record::participants::{self, Removed};

/// Remove people from a recording
#[derive(Clone, Debug, clap::Subcommand)]
pub enum ParticipantsCommand {
    /// Remove a person: out of the traces, the logs and the journal of a folder
    ///
    /// Reports that were made before keep their numbers: make them again.
    Remove {
        /// The code of the person
        #[arg(value_name = "CODE")]
        code: String,
        /// The folder of the recording
        #[arg(value_name = "FOLDER")]
        folder: PathBuf,
        /// Print what was removed as JSON
        #[arg(long)]
        json: bool,
    },
}

impl ParticipantsCommand {
    pub fn run(self) -> Result<Outcome, Failure> {
        let Self::Remove { code, folder, json } = self;
        let removed = participants::remove(&folder, &code).map_err(Failure::Input)?;
        if removed == Removed::default() {
            let (code, folder) = (visible(&code), folder.display());
            return Err(Failure::input(format!("{folder} has nothing of the participant `{code}`")));
        }
        output::print_with(&removed, json, write_answer)
    }
}

fn write_answer(text: &mut String, removed: &Removed) -> fmt::Result {
    let Removed { episodes, files, journal_lines, label_lines } = removed;
    let (count, lines) = (counted(episodes.len() as u64, "episode"), counted(*journal_lines as u64, "line"));
    let labels = counted(*label_lines as u64, "line");
    write!(text, "removed {count} from {}, ", counted(files.len() as u64, "file"))?;
    write!(text, "{lines} of the journal and {labels} of labels")?;
    episodes.iter().try_for_each(|id| write!(text, "\n  {}", visible(id)))
}
