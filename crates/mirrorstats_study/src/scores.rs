//! Reads files of scores instead of traces, joins and filters them; and writes them.

use std::collections::HashSet;
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::Path;

use crate::inputs::{InputError, ScoreFile};
use crate::question::Question;
use crate::results::Outputs;
use crate::{Study, StudyError, copies, design};
use mirrorstats_analysis::comparable::divide_scenes_by_color;
use mirrorstats_exact::input;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_score::format::{self, Format, Partition};
use mirrorstats_score::tables::declared_experiments::Declarations;
use mirrorstats_score::tables::select::select;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_score::vocabulary;
use mirrorstats_trace::footers::declared::Declared;
use mirrorstats_trace::inputs;
use mirrorstats_trace::read::in_order::in_order;

/// The episodes of some files as one table, filtered by the question.
pub(crate) fn read(files: &[ScoreFile], question: &Question) -> Result<EpisodeTable, StudyError> {
    let (mut whole, mut declarations) = (None::<EpisodeTable>, Declarations::default());
    let tables = files.iter().map(|file| read_one(file, question)).collect::<Result<Vec<_>, _>>()?;
    let declared: Vec<Declared> = tables.iter().map(|table| table.declared.clone()).collect();
    for (at, (file, mut table)) in files.iter().zip(tables).enumerate() {
        for (name, experiment) in table.catalog.declared() {
            declarations.add(&file.input.name, &name, experiment)?;
        }
        design::by_file(&mut table, &declared, |_| Some(at));
        whole = Some(match whole {
            None => table,
            Some(whole) => whole.joined(&table).map_err(|error| InputError::unreadable(&file.input, error))?,
        });
    }
    let mut table = whole.ok_or(InputError::NoScores)?;
    divide_scenes_by_color(&mut table);
    Ok(select(table, question.metrics.as_deref(), question.filter.as_deref())?)
}

fn read_one(file: &ScoreFile, question: &Question) -> Result<EpisodeTable, StudyError> {
    let failed = |error| InputError::unreadable(&file.input, error);
    let bytes = input::open(&file.input.path).map_err(|error| InputError::unreadable(&file.input, error))?;
    let named = || Definitions::load(question.definitions_name(), &vocabulary::schema_columns());
    if file.format != Format::Parquet {
        return Ok(format::read_text(file.format, &named()?.catalog, bytes).map_err(failed)?);
    }
    let named = if file.carries_definitions { None } else { Some(named()?.catalog) };
    let folders = inputs::folder_values(&file.input.path);
    let partition = Partition { folders: &folders, definitions: named.as_ref() };
    let table = format::read_parquet(bytes, &partition).map_err(failed)?;
    match &question.definitions {
        Some(name) => under(name, file, table),
        None => Ok(table),
    }
}

/// Scores keep the definitions that they were computed with; requesting others is an error.
fn under(name: &Path, file: &ScoreFile, table: EpisodeTable) -> Result<EpisodeTable, StudyError> {
    let wanted = Definitions::load(name, &vocabulary::schema_columns())?.catalog;
    if wanted.hash == table.catalog.hash {
        return Ok(table);
    }
    let short = |hash: &str| hash.get(..12).unwrap_or_default().to_owned();
    Err(InputError::OtherDefinitions {
        file: file.input.name.clone(),
        wanted: name.display().to_string(),
        wanted_hash: short(&wanted.hash),
        found: table.catalog.name.clone(),
        found_hash: short(&table.catalog.hash),
    }
    .into())
}

/// The episode table as a file keeps it: with the labels of the design and the hashes of the steps. Errors: as
/// [`Study::score`].
pub fn score(study: &Study) -> Result<EpisodeTable, StudyError> {
    for_a_file(study, study.scan(Outputs { design: true, ..Outputs::default() })?.episodes)
}

pub(crate) fn for_a_file(study: &Study, mut table: EpisodeTable) -> Result<EpisodeTable, StudyError> {
    design::remove_plain_labels(&mut table, &study.question.labels());
    let kept: HashSet<&str> = table.keys.iter().map(|key| key.episode_id).collect();
    let mut steps = copies::steps(study, &table)?;
    steps.retain(|episode, _| kept.contains(episode.as_str()));
    table.declared.steps = steps;
    Ok(table)
}

pub fn write(
    table: &EpisodeTable,
    format: Format,
    out: impl Write + Send,
    threads: NonZeroUsize,
) -> Result<(), StudyError> {
    if format != Format::Parquet {
        return Ok(format::write(table, format, out)?);
    }
    let (encoder, mut writer) = format::parquet::encoder(table, out)?;
    let jobs: Vec<_> = encoder.jobs().collect();
    in_order(threads, &jobs, |job| encoder.encode(*job), |column| writer.append(column?))?;
    Ok(writer.finish()?)
}
