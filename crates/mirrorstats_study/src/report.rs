//! The report of a study: tables, figures, a page, and the folder that contains them.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::thread;

use crate::caveats::{departed, selection};
use crate::copies::copies;
use crate::design::remove_labels;
use crate::figure::{Drawings, FigureInputs};
use crate::inputs::Source;
use crate::losses::{Counted, LostAs, lost_episodes};
use crate::own_definitions::DEFAULT_DEFINITIONS;
use crate::results::{Outputs, Results};
use crate::statistics::{design_audit, statistics};
use crate::study::Grouped;
use crate::tables::tables;
use crate::{ErrorKind, Study, StudyError, scores};
use mirrorstats_analysis::plan::departures::Looks;
use mirrorstats_analysis::statistics::{DesignAudit, Options, Statistics};
use mirrorstats_exact::replace;
use mirrorstats_exact::suggest::hint;
use mirrorstats_figures::FigureName;
use mirrorstats_report::bundle::{self, Bundle, BundleError, Manifest, OutputFile};
use mirrorstats_report::html::{self, Page, Recordings};
use mirrorstats_report::layout::MetricTable;
use mirrorstats_report::style::{MAIN_TABLE, OTHER_TABLE, Style};
use mirrorstats_score::cells::Cells;
use mirrorstats_score::format::Format;
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_tables::ListTable;
use mirrorstats_trace::footers::checksums::missing_note;
use mirrorstats_trace::footers::{answered, renderer};
use mirrorstats_trace::schema::SCHEMA_VERSION;

pub(crate) const MOST_LISTED: usize = 20_000;

/// The options of a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReportOptions {
    /// `default`, `paper`, or the path of a style file.
    pub style: PathBuf,
    /// True to include figures and `report.html`.
    pub figures: bool,
    /// True to include figures as PNG too.
    pub png: bool,
}

impl Default for ReportOptions {
    fn default() -> Self {
        Self { style: PathBuf::from("default"), figures: true, png: false }
    }
}

/// A report, in memory.
#[derive(Debug)]
pub struct Report {
    /// The results of the scan.
    pub results: Results,
    /// All episodes, if some were lost; `results` has the counted ones.
    all: Option<EpisodeTable>,
    /// The cells, grouped as requested.
    pub cells: Cells,
    /// The tables, as the style lays them out.
    pub tables: Vec<MetricTable>,
    /// Ranks, if the style marks ties; reply quality, if the inputs are traces.
    pub lists: Vec<ListTable>,
    pub manifest: Manifest,
    /// The number of replies without a decision; `None` without any, or if not recorded.
    pub replies: Option<String>,
    /// The missing parts of the folder with their reasons, one sentence each.
    pub notes: Vec<String>,
    pub(crate) style: Style,
    threads: NonZeroUsize,
    recordings: Option<Recordings>,
    illustrations: Vec<OutputFile>,
    read: Vec<PathBuf>,
    inputs: usize,
}

#[derive(Clone, Debug)]
pub struct WrittenReport {
    pub files: Vec<String>,
    pub manifest: Manifest,
}

/// Refuses a folder whose report contains a file that this study reads, before anything is read. Errors: an input in
/// the folder.
pub fn check_folder(study: &Study, out: &Path, options: &ReportOptions) -> Result<(), StudyError> {
    bundle::check_old(out, &study.files_read(Some(&options.style)))?;
    study.check_out(out)
}

/// Makes the report of a study.
pub fn report(study: &Study, options: &ReportOptions) -> Result<Report, StudyError> {
    // Small files first: a mistake in the style should not cost a scan of the traces.
    let style = Style::load(&options.style)?;
    let figures: &[FigureName] = if options.figures { &FigureName::ALL } else { &[] };
    let outputs =
        Outputs { quality: true, hashes: true, copy_candidates: true, design: true, ..Outputs::of_figures(figures) };
    let grouped = study.grouped_with(outputs)?;
    let illustrations = options.figures.then(|| Illustrations::of(&grouped, &style, options.png)).transpose()?;
    let (tables, lists) = tables(&grouped, &style)?;
    let audit = design_audit(&grouped)?;
    let Grouped { mut counted, cells, .. } = grouped;
    let asked = study.question.labels();
    remove_labels(&mut counted.results.episodes, &asked);
    counted.all.iter_mut().for_each(|all| remove_labels(all, &asked));
    let replies = counted.replies().and_then(|replies| replies.sentence());
    let Counted { results, all, lost } = counted;
    let filter = study.question.filter.clone();
    let manifest = Manifest::new(&cells, &style, SCHEMA_VERSION, filter, results.inputs.clone());
    let mut report = Report {
        notes: notes(study, &results, &lost, &audit)?,
        recordings: recordings(study, &manifest),
        results,
        all,
        cells,
        tables,
        lists,
        manifest,
        replies,
        style,
        threads: study.threads,
        illustrations: Vec::new(),
        read: study.files_read(Some(&options.style)),
        inputs: study.inputs.len(),
    };
    if let Some(illustrations) = illustrations {
        report.illustrate(illustrations)?;
    }
    Ok(report)
}

/// The parts of a report that take longest. Figures do not wait for the statistics beside them.
struct Illustrations {
    statistics: Statistics,
    figures: Result<(Drawings, Vec<OutputFile>), StudyError>,
}

impl Illustrations {
    fn of(grouped: &Grouped<'_>, style: &Style, png: bool) -> Result<Self, StudyError> {
        thread::scope(|scope| {
            let statistics = scope.spawn(|| statistics(grouped, &Options::default()));
            let inputs = FigureInputs::of_a_report(&grouped.counted.results, style)?;
            let drawn = |statistics: Option<&Statistics>| {
                let drawings = inputs.draw_all(statistics);
                let files = drawings.files(grouped.study.threads, png)?;
                Ok::<_, StudyError>((drawings, files))
            };
            let others = drawn(None);
            let statistics = statistics.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
            let both = drawn(Some(&statistics)).and_then(|(forest, files)| {
                let (others, mut all) = others?;
                all.extend(files);
                Ok((others.and(forest), all))
            });
            Ok(Self { statistics, figures: both })
        })
    }
}

fn recordings(study: &Study, manifest: &Manifest) -> Option<Recordings> {
    let Source::Traces(_) = &study.source else { return None };
    // As in manifests: without absolute paths.
    let named = |path: &PathBuf| bundle::InputFile::new(path, String::new(), 0).path;
    Some(Recordings {
        paths: manifest.inputs.iter().map(|input| input.path.clone()).collect(),
        definitions: study.question.definitions.as_ref().map(named).filter(|name| name != DEFAULT_DEFINITIONS),
    })
}

fn notes(study: &Study, results: &Results, lost: &LostCounts, audit: &DesignAudit) -> Result<Vec<String>, StudyError> {
    let episodes = &results.episodes;
    let mut notes: Vec<String> = undeclared(episodes).into_iter().chain(registered(episodes)).collect();
    if let Source::Traces(set) = &study.source {
        notes.extend(missing_note(set.files()));
        notes.extend(answered::by_others(set.files()));
        notes.extend(renderer::note(&renderer::of_files(set.files())));
    }
    if lost.total() > 0 {
        let counted = match study.question.lost {
            LostAs::Nothing => "in no denominator (--lost as-failure counts them)",
            LostAs::Failure => "counted as failures",
        };
        notes.push(format!("{}: {counted}; see tables/quality.md", lost_episodes(lost.total())));
    }
    notes.extend(audit.findings.iter().map(|it| it.finding.clone()));
    notes.extend(copies(study, results)?.map(|copies| copies.sentence));
    let own = Options { selection: selection(study, episodes), ..Options::default() };
    let departures = departed(study, episodes, &own, Looks::Once).into_iter().flatten();
    notes.extend(departures.map(|departure| format!("departure from the registered plan: {departure}")));
    Ok(notes)
}

/// Says whether the analysis matches the plan registered before the recording; `None` without a plan.
fn registered(episodes: &EpisodeTable) -> Option<String> {
    let plan = episodes.declared.registration.as_ref()?;
    let short = |hash: &str| hash.chars().take(12).collect::<String>();
    let own = &episodes.catalog.hash;
    let verdict = match &plan.definitions {
        None => "it names no definitions".to_owned(),
        Some(hash) if hash == own => "the definitions are those that it names".to_owned(),
        Some(hash) => format!("the definitions ({}) differ from those that it names ({})", short(own), short(hash)),
    };
    Some(format!("the recording follows the registered plan {}: {verdict}", short(&plan.sha256)))
}

fn undeclared(episodes: &EpisodeTable) -> Option<String> {
    let lacks = |label: &str| episodes.label(label).is_none();
    let what = match (lacks("fingerprint"), lacks("scene")) {
        (true, true) => "what they were recorded with, nor which episodes share a scene",
        (true, false) => "what they were recorded with",
        (false, true) => "which episodes share a scene",
        (false, false) => return None,
    };
    Some(format!("the traces do not declare {what}: pooled and unpaired as they are"))
}

impl Report {
    /// The first table.
    pub fn main_table(&self) -> Option<&MetricTable> {
        self.tables.iter().find(|table| table.name == MAIN_TABLE).or(self.tables.first())
    }

    /// The metrics that the style does not name, if there are too many for the main table.
    pub fn other_table(&self) -> Option<&MetricTable> {
        self.tables.iter().find(|table| table.name == OTHER_TABLE)
    }

    /// The table of this name. Errors: a name that the style lacks; the error lists its tables.
    pub fn table(&self, name: &str) -> Result<&MetricTable, StudyError> {
        let found = self.tables.iter().find(|table| table.name == name);
        found.ok_or_else(|| {
            let known = || self.tables.iter().map(|table| table.name.as_str());
            let (style, hint, known) = (&self.style.name, hint(name, known()), known().collect::<Vec<_>>().join(", "));
            let words = format!("no table of the style `{style}` is named `{name}`; it has {known}{hint}");
            StudyError::new(ErrorKind::Argument, words)
        })
    }

    /// Writes the folder of the report and replaces an existing report. Errors: `out` is not a folder or cannot be
    /// written: the folder is then unchanged, or has no manifest. The old report contains a file that this one is made
    /// from.
    pub fn write(&self, out: &Path) -> Result<WrittenReport, StudyError> {
        bundle::check_old(out, &self.read)?;
        replace::check_folder(out, &self.read[..self.inputs]).map_err(BundleError::from)?;
        let mut episodes = Vec::new();
        let all = self.all.as_ref().unwrap_or(&self.results.episodes);
        scores::write(all, Format::Parquet, &mut episodes, self.threads)?;
        let Self { cells, tables, lists, manifest, illustrations: others, read, .. } = self;
        let written =
            bundle::write(out, &Bundle { cells, tables, lists, episodes: &episodes, manifest, read, others })?;
        let inside = |path: &PathBuf| path.strip_prefix(out).unwrap_or(path).display().to_string();
        Ok(WrittenReport { files: written.files.iter().map(inside).collect(), manifest: written.manifest })
    }

    fn illustrate(&mut self, illustrations: Illustrations) -> Result<(), StudyError> {
        let (drawings, files) = illustrations.figures?;
        self.notes.extend(drawings.left_out.iter().map(|(name, reason)| format!("no figure `{name}`: {reason}")));
        self.illustrations = files;
        if self.results.episodes.len() > MOST_LISTED {
            self.notes.push(format!("no report.html: it lists at most {MOST_LISTED} episodes"));
        } else {
            let bytes = self.page(&drawings, &illustrations.statistics)?.into_bytes();
            self.illustrations.push(OutputFile { path: "report.html".into(), bytes });
        }
        Ok(())
    }

    fn page(&self, drawings: &Drawings, statistics: &Statistics) -> Result<String, StudyError> {
        Ok(html::render(&Page {
            tables: &self.tables,
            cells: &self.cells,
            episodes: &self.results.episodes,
            manifest: &self.manifest,
            figures: &drawings.drawn,
            statistics: Some(statistics),
            lists: &self.lists,
            recordings: self.recordings.as_ref(),
        })?)
    }
}
