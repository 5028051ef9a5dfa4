//! Compares later episodes with earlier ones: one verdict per cell, with the deciding steps and frames of each flip.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::slice;

use serde_json::Value;

use crate::error::StudyError;
use crate::inputs::Source;
use crate::output::statistics::{check_verdicts, design_of};
use crate::{Study, pooled};
use mirrorstats_analysis::gate::{FlippedPair, Gate, GateOptions, Played};
use mirrorstats_metric::catalogs::catalog::{Better, Metric};
use mirrorstats_metric::definitions::UnknownMetric;
use mirrorstats_score::evidence;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_trace::inputs::{self, Input};
use mirrorstats_trace::read::open::TraceSet;

/// The file that identifies a page of `view --export`, and the file that lists its episodes.
const PAGE: [&str; 2] = ["assets/view.js", "data/list.js"];

impl Study {
    /// The verdicts on this (later) study against an earlier one: improved, held, regressed, or why there is none.
    /// Errors: as [`Study::score`] for either study; a metric that a side lacks, or without a better direction; a cell
    /// that mixes episodes recorded differently; sums of squares beyond 128 bits.
    pub fn gate(&self, base: &Self, options: &GateOptions) -> Result<Gate, StudyError> {
        let (old, new) = (base.gated(options)?, self.gated(options)?);
        let design = design_of(&old.declared.clone().joined(new.declared.clone()));
        let mut gate = Gate::between([&old, &new], design, options)?;
        gate.caveats.extend(self.selection(&new).map(|selection| selection.sentence()));
        for (study, table) in [(base, &old), (self, &new)].into_iter().filter(|_| options.pool) {
            gate.caveats.extend(pooled::told(table, &study.question.by_over(table))?);
        }
        for (side, study, table) in [("base", base, &old), ("new", self, &new)] {
            gate.caveats.extend(study.copies(table)?.map(|copies| format!("{side}: {}", copies.sentence)));
        }
        let flips = || gate.cells.iter().flat_map(|cell| &cell.flips);
        let ids = |of: fn(&FlippedPair) -> &Played| {
            flips().map(|flip| of(flip).episode_id.clone()).collect::<BTreeSet<String>>()
        };
        let (before, after) = (ids(|flip| &flip.base), ids(|flip| &flip.new));
        let (before, after) = (base.shown(&before, &options.metric)?, self.shown(&after, &options.metric)?);
        for flip in gate.cells.iter_mut().flat_map(|cell| &mut cell.flips) {
            before.add_to(&mut flip.base);
            after.add_to(&mut flip.new);
        }
        let unshown = |of: fn(&FlippedPair) -> &Played| {
            gate.cells.iter().flat_map(|cell| &cell.flips).any(|flip| of(flip).timesteps.is_none())
        };
        let sides = [("base", base, unshown(|flip| &flip.base)), ("new", self, unshown(|flip| &flip.new))];
        for (side, ..) in sides.into_iter().filter(|(_, study, is_unshown)| *is_unshown && study.traces().is_err()) {
            gate.caveats.push(format!(
                "{side}: scores do not say which steps decided a flip; traces in their folder do, if they give the same value."
            ));
        }
        Ok(gate)
    }

    /// The first metric with a better direction. Errors: as [`Study::score`]; definitions without such a metric.
    pub fn leading_metric(&self) -> Result<String, StudyError> {
        let catalog = match &self.source {
            Source::Traces(traces) => self.question.bind(traces)?.catalog,
            Source::Scores(_) => self.score()?.episodes.catalog,
        };
        let mut metrics = catalog.metric.iter();
        let found = metrics.find(|(_, metric)| metric.better != Better::Neither).map(|(name, _)| name.clone());
        let first = || catalog.metric.keys().next().cloned().unwrap_or_default();
        found.ok_or_else(|| StudyError::NoDirection { metric: first() })
    }

    fn gated(&self, options: &GateOptions) -> Result<EpisodeTable, StudyError> {
        let table = self.score()?.episodes;
        self.check_filter(table.len())?;
        check_verdicts(&table)?;
        if check_metric(&table, &options.metric)?.better == Better::Neither {
            return Err(StudyError::NoDirection { metric: options.metric.clone() });
        }
        if !options.pool {
            pooled::check(&table, &self.question.by_over(&table))?;
        }
        Ok(table)
    }

    fn shown(&self, ids: &BTreeSet<String>, metric: &str) -> Result<Shown, StudyError> {
        match &self.source {
            _ if ids.is_empty() => Ok(Shown::default()),
            Source::Traces(traces) => self.shown_by(traces, ids, metric),
            // Files beside scores may belong to other episodes, which is no fault of the scores.
            Source::Scores(_) => {
                Ok(self.traces_beside().and_then(|traces| self.shown_by(&traces, ids, metric).ok()).unwrap_or_default())
            }
        }
    }

    fn folders(&self) -> BTreeSet<PathBuf> {
        self.inputs.iter().filter_map(|input| input.path.parent().map(Path::to_owned)).collect()
    }

    fn traces_beside(&self) -> Option<TraceSet> {
        let inside = |folder: &PathBuf| {
            let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
            inputs::resolve(&[folder.into()], std::io::empty()).unwrap_or_default()
        };
        let is_trace = |input: &Input| matches!(Source::open(slice::from_ref(input)), Ok(Source::Traces(_)));
        let traces: Vec<Input> = self.folders().iter().flat_map(inside).filter(is_trace).collect();
        TraceSet::open(&traces).ok().filter(|_| !traces.is_empty())
    }

    fn shown_by(&self, traces: &TraceSet, ids: &BTreeSet<String>, metric: &str) -> Result<Shown, StudyError> {
        let mut definitions = self.question.bind(traces)?;
        definitions.select(&[metric.to_owned()])?;
        let evidence = evidence::explain_each(traces, &definitions, ids, self.threads)?;
        let evidence =
            evidence.into_values().filter_map(|found| Some((found.episode_id, found.metrics.into_iter().next()?)));
        let evidence = evidence.map(|(id, found)| (id, (found.value, found.timesteps))).collect();
        let pages = self.folders().iter().flat_map(|folder| pages_beside(folder, metric)).collect();
        Ok(Shown { evidence, pages })
    }
}

pub(crate) fn check_metric<'t>(table: &'t EpisodeTable, name: &str) -> Result<&'t Metric, StudyError> {
    let found = table.catalog.metric.get(name).filter(|_| table.metric(name).is_some());
    found.ok_or_else(|| {
        UnknownMetric::new(name, table.metrics.iter().map(|column| column.name.clone()).collect()).into()
    })
}

#[derive(Default)]
struct Shown {
    evidence: BTreeMap<String, (Option<i64>, Vec<i64>)>,
    pages: Vec<PageBeside>,
}

/// A page written by `view --export`, and its value for each episode.
struct PageBeside {
    folder: PathBuf,
    values: BTreeMap<String, i64>,
}

impl Shown {
    fn add_to(&self, played: &mut Played) {
        let found = self.evidence.get(&played.episode_id).filter(|(value, _)| *value == Some(played.value));
        played.timesteps = found.map(|(_, steps)| steps.clone());
        let is_of = |page: &&PageBeside| page.values.get(&played.episode_id) == Some(&played.value);
        let Some(page) = self.pages.iter().find(is_of) else { return };
        let step = played.timesteps.iter().flatten().next().map_or_else(String::new, |t| format!("&t={t}"));
        let id = percent(&played.episode_id);
        played.frames = Some(format!("{}?view=episode&id={id}{step}", page.folder.join("index.html").display()));
    }
}

fn pages_beside(folder: &Path, metric: &str) -> Vec<PageBeside> {
    let inside = |folder: &Path| {
        let entries = fs::read_dir(if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
        let names = entries.into_iter().flatten().flatten().map(|entry| folder.join(entry.file_name()));
        names.collect::<BTreeSet<PathBuf>>()
    };
    let beside = if folder.as_os_str().is_empty() { PathBuf::from("..") } else { folder.with_file_name("") };
    let pages = inside(folder).into_iter().chain(inside(&beside)).filter(|path| path.join(PAGE[0]).is_file());
    pages.filter_map(|folder| Some(PageBeside { values: listed(&folder, metric)?, folder })).collect()
}

fn listed(page: &Path, metric: &str) -> Option<BTreeMap<String, i64>> {
    let text = fs::read_to_string(page.join(PAGE[1])).ok()?;
    let list: Value = serde_json::from_str(text.get(text.find('{')?..=text.rfind('}')?)?).ok()?;
    let at = list["metrics"].as_array()?.iter().position(|name| name == metric)?;
    let value = |row: &Value| Some((row["id"].as_str()?.to_owned(), row["values"][at].as_str()?.parse().ok()?));
    Some(list["rows"].as_array()?.iter().filter_map(value).collect())
}

fn percent(text: &str) -> String {
    let spelled = |byte: u8| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'/' => char::from(byte).to_string(),
        other => format!("%{other:02X}"),
    };
    text.bytes().map(spelled).collect()
}
