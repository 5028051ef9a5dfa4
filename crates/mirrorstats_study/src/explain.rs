//! The timesteps that decided the scores of an episode.

use std::collections::{BTreeMap, BTreeSet};
use std::slice;

use crate::inputs::labelled;
use crate::question::Question;
use crate::{Study, StudyError, own_definitions};
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_score::evidence::{self, Evidence};
use mirrorstats_score::score_traces;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceSet;

/// The scores of one episode, and the timesteps that decided them. Errors: as [`Study::score`]; scores in the place of
/// traces; an unknown episode.
pub fn explain(study: &Study, episode_id: &str) -> Result<Evidence, StudyError> {
    let traces = study.traces()?;
    let definitions = study.question.bind(traces)?;
    if own_definitions::unscored(&definitions, traces, |_| true).is_some() {
        let filter = Some(format!("episode_id = '{}'", episode_id.replace('\'', "''")));
        let one = Question { filter, ..study.question.clone() }.bind(traces)?;
        own_definitions::check_scored(&one, traces, &score_traces::score(traces, &one, &[], study.threads)?)?;
    }
    let found = evidence::explain(traces, &definitions, episode_id, study.threads);
    study.check_unchanged()?;
    Ok(found?)
}

/// Like [`explain`], for an episode that is known to be in this input: reads no other input.
pub fn explain_in(study: &Study, input: &Input, episode_id: &str) -> Result<Evidence, StudyError> {
    let (one, definitions) = alone(study, input)?;
    Ok(evidence::explain(&one, &definitions, episode_id, study.threads)?)
}

/// Like [`explain_in`], for each of these episodes that the input has, by id, in one scan.
pub fn explain_each_in(
    study: &Study,
    input: &Input,
    ids: &BTreeSet<String>,
) -> Result<BTreeMap<String, Evidence>, StudyError> {
    let (one, definitions) = alone(study, input)?;
    Ok(evidence::explain_each(&one, &definitions, ids, study.threads)?)
}

/// One input, with definitions bound to its own columns: a trace beside other tasks may lack their columns.
fn alone(study: &Study, input: &Input) -> Result<(TraceSet, Definitions), StudyError> {
    let one = labelled(slice::from_ref(input))?;
    let definitions = Question { filter: None, ..study.question.clone() }.bind(&one)?;
    Ok((one, definitions))
}
