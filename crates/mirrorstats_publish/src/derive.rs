//! Makes every file of a bundle that is a function of its sources and settings.

use std::collections::BTreeMap;
use std::fs;
use std::num::NonZeroUsize;
use std::path::Path;

use mirrorstats_exact::hash;
use mirrorstats_study::Study;
use mirrorstats_study::losses::LostAs;
use mirrorstats_study::pairs::pairs;
use mirrorstats_study::question::Question;
use mirrorstats_study::report::{ReportOptions, report};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_view::export;
use serde_json::Value;

use crate::card::{self, Card};
use crate::manifest::{Frames, Settings, list};
use crate::sources::{TRACES, definitions_text, prompt, write_prompt};
use crate::{Progress, PublishError, croissant, frames, write};

pub(crate) struct Derived {
    /// The number of counted episodes.
    pub episodes: usize,
    pub notes: Vec<String>,
}

/// The traces of a bundle, by their names in it.
pub(crate) fn inputs(base: &Path) -> Result<Vec<Input>, PublishError> {
    let folder = base.join(TRACES);
    let mut inputs = Vec::new();
    for entry in fs::read_dir(&folder).map_err(PublishError::file(&folder))? {
        let path = entry.map_err(PublishError::file(&folder))?.path();
        if path.extension().is_some_and(|ending| ending == "parquet") {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            inputs.push(Input { name: format!("{TRACES}/{name}"), path: path.clone() });
        }
    }
    inputs.sort();
    Ok(inputs)
}

/// The question of these settings. A path of the bundle is a path in `base`.
pub(crate) fn question(base: &Path, settings: &Settings) -> Question {
    let definitions = settings.definitions.as_ref();
    Question {
        definitions: definitions.map(|name| if name.contains('/') { base.join(name) } else { name.into() }),
        filter: settings.filter.clone(),
        metrics: settings.metrics.clone(),
        by: settings.by.clone(),
        pool: settings.pool,
        lost: if settings.lost_as_failures { LostAs::Failure } else { LostAs::Nothing },
        ..Question::default()
    }
}

/// Writes the derived files into `out`. `base` has the sources and may be the same folder.
pub(crate) fn derive(
    base: &Path,
    out: &Path,
    settings: &Settings,
    threads: NonZeroUsize,
    progress: Progress<'_>,
) -> Result<Derived, PublishError> {
    let question = question(base, settings);
    let study = Study::of(inputs(base)?)?.threads(threads).asked(question.clone())?;
    let traces = study.traces()?;
    let (name, text) = definitions_text(&study.question, traces)?;
    if settings.definitions.as_deref() != Some(&*name) {
        write(&out.join(name), text)?;
    }
    write_recordings(base, out, traces)?;
    let mut notes = Vec::new();
    if settings.frames != Frames::None {
        progress("frames");
        frames::write_frames(&study, base, out, settings.frames, &mut notes)?;
    }
    if settings.frames == Frames::Decisive {
        // The viewer would show all frames of a log.
        remove_logs(&out.join(TRACES))?;
    }
    progress("report");
    let style = if settings.style.contains('/') { base.join(&settings.style) } else { settings.style.clone().into() };
    let report = report(&study, &ReportOptions { style: style.clone(), figures: true, png: false })?;
    report.write(&out.join("report"))?;
    let scores = out.join("report/episodes.parquet");
    fs::copy(&scores, out.join("scores.parquet")).map_err(PublishError::file(&scores))?;
    progress("viewer");
    let options = mirrorstats_view::Options {
        runs: vec![base.join(TRACES).into()],
        question,
        against: None,
        style: style.to_string_lossy().into_owned(),
        coder: None,
        threads,
    };
    let shown = |done, all| progress(&format!("viewer: {done} of {all} episodes"));
    export::write(&options, &out.join("viewer"), &shown).map_err(|error| PublishError::Refused(error.to_string()))?;
    notes.extend(report.notes.clone());
    let episodes = report.results.episodes.len();
    let pairs = pairs(&study)?.map(|pairs| pairs.to_string());
    notes.extend(pairs.clone());
    let table = report.main_table().map(|table| table.printed().markdown()).unwrap_or_default();
    let card = Card { settings, base, out, episodes, table: &table, pairs: pairs.as_deref(), traces };
    write(&out.join("README.md"), card.readme()?)?;
    write(&out.join("CITATION.cff"), card::citation(&settings.about))?;
    write(&out.join(croissant::NAME), croissant::text(base, settings, traces)?)?;
    Ok(Derived { episodes, notes })
}

fn remove_logs(folder: &Path) -> Result<(), PublishError> {
    for name in if folder.is_dir() { list(folder)? } else { Vec::new() } {
        if Path::new(&name).extension().is_some_and(|ending| ending == "mcap") {
            let log = folder.join(name);
            fs::remove_file(&log).map_err(PublishError::file(&log))?;
        }
    }
    Ok(())
}

/// Writes experiments, worlds and prompts as the footers of the traces declare them.
fn write_recordings(base: &Path, out: &Path, traces: &TraceSet) -> Result<(), PublishError> {
    let mut files: BTreeMap<String, String> = BTreeMap::new();
    for file in traces.files() {
        let recording = file.recording();
        for (folder, value) in [("experiments", &recording["experiment"]), ("world", &recording["world"])] {
            if value.is_object() {
                let text = serde_json::to_string_pretty(value).unwrap_or_default() + "\n";
                let name = value["name"].as_str().unwrap_or("world").replace(['/', '\\'], "-");
                let path = format!("{folder}/{name}.json");
                let is_other = files.get(&path).is_some_and(|known| *known != text);
                let short = &hash::of_bytes(text.as_bytes())[..12];
                files.insert(if is_other { format!("{folder}/{name}-{short}.json") } else { path }, text);
            }
        }
        if let Some((name, sha256)) = prompt_of(&recording)
            && let Some(templates) = prompt(base, name, sha256)
        {
            write_prompt(&templates, name, out)?;
        }
    }
    files.iter().try_for_each(|(path, text)| write(&out.join(path), text))
}

/// The name and the hash of a recording's prompt.
pub(crate) fn prompt_of(recording: &Value) -> Option<(&str, &str)> {
    let experiment = &recording["experiment"];
    Some((experiment["prompt"].as_str()?, experiment["prompt_hash"].as_str()?))
}
