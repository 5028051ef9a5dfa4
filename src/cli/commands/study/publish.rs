//! `publish`: a study as one folder for other people and for registries.

use std::io::{self, IsTerminal as _, Write as _};
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::args::{Described, GroupingArgs, ScoringArgs, TraceArgs, described};
use crate::cli::{Failure, Outcome, output};
use mirrorstats_exact::format::counted;
use mirrorstats_publish::about::About;
use mirrorstats_publish::formats::{self, ExportFormat};
use mirrorstats_publish::{Frames, PublishRequest, Withheld, publish};
use mirrorstats_study::Study;

/// Publish a study: one folder that others open, check and cite
///
/// The folder is a data set of the Hugging Face Hub, a record of Zenodo and a web page: traces, frames, scores,
/// definitions, experiments, prompts, report, viewer, a data card, a citation, and a manifest with the hash of every
/// file. `mirrorstats verify` checks it. Episodes of people who declined or withdrew are left out.
///
/// --about names a TOML file. Its keys, all optional: `title`, `authors`, `license` (SPDX), `url`, `doi`,
/// `description`, `tags`, `limitations`, `biases`, `personal`, `uses`, `impact`, `synthetic`, `derived_from`,
/// `generated_by`, `time` (of the evaluation, seconds since 1970).
#[derive(Clone, Debug, clap::Args)]
pub struct PublishArgs {
    #[command(flatten)]
    pub traces: TraceArgs,
    /// The folder to write
    #[arg(short, long, value_name = "DIR")]
    pub out: PathBuf,
    /// The form of the folder
    #[arg(long, value_parser = described(&FORMATS), default_value = FORMATS[0].1)]
    pub format: FolderFormat,
    /// The frames of the logs beside the traces
    #[arg(long, value_parser = described(&FRAMES), default_value = FRAMES[2].1)]
    pub frames: Frames,
    /// A description of the data set: title, authors, licence, limitations
    #[arg(long, value_name = "FILE")]
    pub about: Option<PathBuf>,
    /// A folder of prompts that the traces name and that is not built in
    #[arg(long, value_name = "DIR")]
    pub prompts: Vec<PathBuf>,
    #[command(flatten)]
    pub scoring: ScoringArgs,
    #[command(flatten)]
    pub grouping: GroupingArgs,
    /// The style of tables: `default`, `paper`, or a TOML file
    #[arg(long, value_name = "STYLE", default_value = "default")]
    pub style: PathBuf,
    /// Print what was written as JSON
    #[arg(long)]
    pub json: bool,
}

/// The format of another program; a bundle if `None`.
type FolderFormat = Option<ExportFormat>;

const FORMATS: [Described<FolderFormat>; 3] = [
    (None, "bundle", "Everything, as described above"),
    (
        Some(ExportFormat::EveryEvalEver),
        "every-eval-ever",
        "Results with intervals and a line per episode and rate, for Every Eval Ever 0.3",
    ),
    (Some(ExportFormat::InspectScout), "inspect-scout", "A row per episode with its messages, for Inspect Scout"),
];

const FRAMES: [Described<Frames>; 3] = [
    (Frames::None, "none", "No frames"),
    (Frames::Decisive, "decisive", "The frames of the steps that decided a metric"),
    (Frames::All, "all", "All frames, and the logs"),
];

/// The answer for a program.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct PublishAnswer {
    /// The folder, as typed.
    pub out: String,
    /// The number of files with a hash in the manifest.
    pub files: usize,
    /// Their bytes.
    pub bytes: u64,
    /// The number of counted episodes.
    pub episodes: usize,
    /// The parts that were left out, by their hashes.
    pub withheld: Vec<Withheld>,
    /// Statements about missing parts.
    pub notes: Vec<String>,
}

/// The answer for a program, of another format than a bundle.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ExportAnswer {
    /// The folder, as typed.
    pub out: String,
    /// The files in it.
    pub files: Vec<String>,
    /// What the format cannot hold.
    pub left_out: Vec<String>,
}

impl PublishArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let about = self.about.as_deref().map(About::read).transpose()?.unwrap_or_default();
        let study = self.traces.study(&self.scoring, &self.grouping)?;
        if let Some(format) = self.format {
            return self.export(&study, format, &about);
        }
        let request = PublishRequest {
            out: self.out.clone(),
            style: self.style,
            frames: self.frames,
            about,
            prompts: self.prompts,
            threads: self.traces.threads.count(),
        };
        let has_license = request.about.license.is_some();
        let published = publish(&study, &request, &progress)?;
        let outputs = &published.manifest.outputs;
        let answer = PublishAnswer {
            out: self.out.display().to_string(),
            files: outputs.len(),
            bytes: outputs.iter().map(|output| output.bytes).sum(),
            episodes: published.manifest.episodes,
            withheld: published.manifest.withheld().to_vec(),
            notes: published.notes,
        };
        if self.json {
            return output::print_json(&answer);
        }
        output::notes(&answer.notes);
        if !has_license {
            output::note(
                "the bundle has no licence: name one in the file of --about, such as `license = \"CC-BY-4.0\"`",
            );
        }
        let (files, episodes) = (counted(answer.files as u64, "file"), counted(answer.episodes as u64, "episode"));
        output::say(&format!("{files}, {episodes}; the bundle is in {}", answer.out));
        output::say(&format!("next: `mirrorstats verify {}` computes everything again", answer.out));
        Ok(Outcome::Done)
    }

    fn export(&self, study: &Study, format: ExportFormat, about: &About) -> Result<Outcome, Failure> {
        let (files, left_out) = formats::export(study, format, about, &self.out, &progress)?;
        let out = self.out.display().to_string();
        if self.json {
            return output::print_json(&ExportAnswer { out, files, left_out });
        }
        for what in &left_out {
            output::note(&format!("the format cannot hold {what}"));
        }
        output::say(&format!("{} in {out}", counted(files.len() as u64, "file")));
        Ok(Outcome::Done)
    }
}

/// Shows the current part on one line of a terminal.
pub fn progress(part: &str) {
    if io::stderr().is_terminal() {
        let _ = write!(io::stderr(), "\r{part:<40}\r");
    }
}
