//! `rescore`: makes a report again from its traces, under other definitions or with replies read again.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::args::ThreadArgs;
use crate::cli::{Failure, Outcome, output, terminal};
use mirrorstats_agents::reparse::{Diverged, ReparseAnswer};
use mirrorstats_analysis::changes::Changes;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::counted;
use mirrorstats_exact::replace::{Content, TemporaryFolder, folder_of};
use mirrorstats_report::bundle::Manifest;
use mirrorstats_study::report::WrittenReport;
use mirrorstats_study::rescore::{RescoreRequest, Rescored, folder_of_rescored, traces_of};
use mirrorstats_tables::Table;
use mirrorstats_trace::inputs::Input;

/// Make a report again from the traces that it was made of, under other definitions or with replies read again
///
/// The new report keeps the filter, the grouping, the style and the choice of metrics of the old one, which stays as
/// it is. Traces are found by their hashes: below the current folder, the report's folder and the folders above it,
/// or where --traces says.
#[derive(Clone, Debug, clap::Args)]
pub struct RescoreArgs {
    /// The folder of the report
    #[arg(value_name = "REPORT_DIR")]
    pub report: PathBuf,
    /// The definitions to score under: `paper`, `extended`, or a TOML file [default with --reparse: those that the traces name]
    #[arg(long, value_name = "NAME|FILE", required_unless_present = "reparse")]
    pub definitions: Option<PathBuf>,
    /// Read the kept raw replies again with the parser of this program, and score that: recorded actions stay, what changes is
    /// listed, and the new traces are in a folder beside that of the new report, `OUT-traces`
    #[arg(long)]
    pub reparse: bool,
    /// The folder to write [default: REPORT_DIR-rescored]
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// The traces: folders or files
    #[arg(long, value_name = "PLACE", num_args = 1..)]
    pub traces: Vec<PathBuf>,
    /// The style of tables; required if the report's style was a file [default: the report's]
    #[arg(long, value_name = "STYLE")]
    pub style: Option<PathBuf>,
    /// Other metrics than the report's, separated by commas
    #[arg(long, value_name = "METRICS", value_delimiter = ',')]
    pub metrics: Option<Vec<String>>,
    /// The most lines of each list of changes; --json has all
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub limit: usize,
    /// Print what was written and what changed as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// The answer for a program.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct RescoreAnswer {
    /// The new folder, as typed.
    pub out: String,
    /// The files in it that were written, by path inside the folder.
    pub files: Vec<String>,
    /// The number of counted episodes.
    pub episodes: usize,
    /// The origin of everything; the same as the new `manifest.json`.
    pub manifest: Manifest,
    /// The changes by another reading of the replies; null without --reparse.
    pub reparsed: Option<ReparseAnswer>,
    /// The changes from the old report; null if its scores are not readable.
    pub changes: Option<Changes>,
}

impl RescoreArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let out = folder_of_rescored(&self.report, self.out.as_deref())?;
        let traces = traces_of(&self.report, &self.traces)?;
        let reread = self.reparse.then(|| reparse(&traces, &out)).transpose()?;
        let traces = reread.as_ref().map_or(traces, |reread| reread.traces.clone());
        let Self { report, definitions, style, metrics, .. } = self.clone();
        let threads = self.threads.count();
        let rescored =
            RescoreRequest { report, definitions, traces, out: out.clone(), style, metrics, threads }.run()?;
        output::notes(&rescored.report.notes);
        let written = rescored.report.write(&out)?;
        // A kill between the two leaves a report without its traces, which the same command makes again.
        let reparsed = reread.map(|reread| reread.put().map(|()| reread.answer)).transpose()?;
        match &rescored.changes {
            Ok(diff) => output::notes(&diff.notes),
            Err(reason) => output::note(&format!("no comparison with the old report: {reason}")),
        }
        self.print(&out, written, rescored, reparsed)
    }

    fn print(
        &self,
        out: &Path,
        written: WrittenReport,
        rescored: Rescored,
        reparsed: Option<ReparseAnswer>,
    ) -> Result<Outcome, Failure> {
        let Rescored { report, changes } = rescored;
        let changes = changes.ok().map(|diff| diff.changes);
        let (out, episodes) = (out.display().to_string(), report.results.episodes.len());
        if self.json {
            let WrittenReport { files, manifest } = written;
            return output::print_json(&RescoreAnswer { out, files, episodes, manifest, reparsed, changes });
        }
        if let Some(reparsed) = &reparsed {
            write_reparsed(&mut io::stdout().lock(), reparsed, self.limit)?;
        }
        if let Some(changes) = &changes {
            io::stdout().lock().write_all(changes.render(self.limit, terminal::width()).as_bytes())?;
        }
        output::say(&format!("{}; the report is in {out}", counted(episodes as u64, "episode")));
        Ok(Outcome::Done)
    }
}

/// Traces with replies read again, beside the folder that they get.
struct Reread {
    _stage: TemporaryFolder,
    folder: PathBuf,
    answer: ReparseAnswer,
    traces: Vec<Input>,
}

impl Reread {
    /// Puts all traces into their folder together.
    fn put(&self) -> Result<(), Failure> {
        let names = self.traces.iter().filter_map(|trace| Some((Path::new(trace.path.file_name()?), &trace.path)));
        let new: Vec<_> = names.map(|(name, path)| (name, Content::File(path))).collect();
        output::write_folder(&self.folder, &new)
    }
}

/// Reads the replies of traces again, for a folder beside `out`.
fn reparse(traces: &[Input], out: &Path) -> Result<Reread, Failure> {
    let mut folder = out.as_os_str().to_owned();
    folder.push("-traces");
    let folder = PathBuf::from(folder);
    for (at, trace) in traces.iter().enumerate() {
        let target = folder.join(trace.path.file_name().unwrap_or_default());
        output::check_target(&target, [&trace.path])?;
        if let Some(other) = traces[..at].iter().find(|other| other.path.file_name() == trace.path.file_name()) {
            let (one, other) = (visible(&other.name), visible(&trace.name));
            return Err(Failure::input(format!("`{one}` and `{other}` have one name")));
        }
    }
    if out.exists() != folder.exists() {
        let (there, missing) = if out.exists() { (out, &*folder) } else { (&*folder, out) };
        let [there, missing] = [there, missing].map(|path| visible(&path.display().to_string()));
        output::note(&format!("{there} is there without {missing}, as after an interrupted run; both are made again"));
    }
    output::make_folder(folder_of(&folder))?;
    let stage = TemporaryFolder::create(folder_of(&folder), "traces")
        .map_err(|error| output::unwritable(folder_of(&folder), error))?;
    let (answer, traces) = ReparseAnswer::reparse(traces, stage.path(), &folder)?;
    Ok(Reread { _stage: stage, folder, answer, traces })
}

fn write_reparsed(out: &mut impl io::Write, answer: &ReparseAnswer, most: usize) -> io::Result<()> {
    let mut table =
        Table { names: 2, ..Table::of_texts(["episode", "t", "column", "before", "after"]).aligned_right([1]) };
    let name = |value: &Option<String>| visible(value.as_deref().unwrap_or("--"));
    for change in answer.changes.iter().take(most) {
        let label = change.coder.as_ref().map_or_else(String::new, |coder| format!(" (label by {})", visible(coder)));
        let (before, after) = (name(&change.before), name(&change.after) + &label);
        table.push([visible(&change.episode_id), change.t.to_string(), change.column.clone(), before, after]);
    }
    if !answer.changes.is_empty() {
        writeln!(out, "{}", table.within(terminal::width()))?;
    }
    for Diverged { episode_id, t, recorded, parsed } in answer.diverged.iter().take(most) {
        let [recorded, parsed] = [recorded, parsed].map(|action| action.unwrap_or("none"));
        writeln!(
            out,
            "{} would have gone on otherwise from t = {t}: the action was {recorded} and would be {parsed}",
            visible(episode_id)
        )?;
    }
    let (changes, steps) = (counted(answer.changes.len() as u64, "value"), counted(answer.replies, "step"));
    let diverged = counted(answer.diverged.len() as u64, "episode");
    writeln!(out, "{changes} changed in {steps} with a reply; {diverged} would have gone on otherwise")
}
