//! The effects of other definitions: every cell and every flip.

use serde_json::{Value, json};

use crate::{Snapshot, ViewError};
use mirrorstats_analysis::changes::Flip;
use mirrorstats_exact::escape::visible;
use mirrorstats_study::diff::{DiffRequest, Side, diff};

pub(crate) fn answer(snapshot: &Snapshot) -> Result<Value, ViewError> {
    let options = &snapshot.options;
    let Some(against) = &options.against else {
        return Err(ViewError::Absent("no other definitions were named; `mirrorstats view --against` does".to_owned()));
    };
    let scored = snapshot.table()?;
    if !scored.study.question.parts.is_empty() {
        let words = "the experiments have different definitions; `mirrorstats diff` holds one against another";
        return Err(ViewError::Absent(words.to_owned()));
    }
    let own = scored.study.question.definitions_name();
    let request = DiffRequest {
        metrics: options.question.metrics.clone(),
        filter: options.question.filter.clone(),
        threads: options.threads,
        ..DiffRequest::default()
    };
    let found = diff(&Side::of(own)?, &Side::of(against)?, &scored.inputs, &request)?;
    let changes = found.changes;
    let cells = changes.cells.iter().map(|cell| json!(cell));
    Ok(json!({
        "before": visible(&changes.definitions.before.name),
        "after": visible(&changes.definitions.after.name),
        "cells_compared": changes.cells_compared,
        "rewritten": changes.rewritten,
        "cells": cells.collect::<Vec<_>>(),
        "flips": changes.flips.iter().map(entry).collect::<Vec<_>>(),
        "notes": found.notes,
    }))
}

fn entry(flip: &Flip) -> Value {
    let mut entry = json!(flip);
    // A browser would round large numbers.
    entry["value"] = json!({
        "before": flip.value.before.map(|value| value.to_string()),
        "after": flip.value.after.map(|value| value.to_string()),
    });
    entry["id"] = json!(flip.episode.episode_id);
    entry["name"] = json!(visible(&flip.episode.episode_id));
    entry
}
