//! The answers of the page, one file each: one function for the server and for files.

pub(super) mod changes;
mod compare;
pub(super) mod episode;
pub(super) mod labels;
pub(super) mod list;
pub(super) mod live;
pub(super) mod map;
pub(super) mod overview;
mod verdict;

use crate::filter::{Query, number, required};
use crate::{Snapshot, View, ViewError, export};
use mirrorstats_study::overview::Part;

pub(super) enum Answer {
    Json(Vec<u8>),
    Png(Vec<u8>),
    /// A page to save as a file.
    Page(String),
}

/// Answers a query of the page; `None` if the query is unknown.
pub(super) fn answer(view: &View, name: &str, query: &Query) -> Option<Result<Answer, ViewError>> {
    let snapshot = view.newest();
    let entry = match name {
        "frame" => return Some(frame(&snapshot, query).map(Answer::Png)),
        "file" => return Some(required(query, "id").and_then(|id| export::episode_page(view, id)).map(Answer::Page)),
        "live" => Ok(view.live()),
        "study" => Ok(overview::study(&snapshot)),
        "overview" => overview::sections(&snapshot, query, Part::Tables),
        "figures" => overview::sections(&snapshot, query, Part::Figures),
        "statistics" => overview::sections(&snapshot, query, Part::Statistics),
        "episodes" => list::answer(&snapshot, query),
        "episode" => episode::answer(&snapshot, query),
        "text" => episode::text(&snapshot, query),
        "map" => map::answer(&snapshot, query),
        "compare" => compare::answer(&snapshot, query),
        "scene" => compare::scene(&snapshot, query),
        "same_frame" => compare::same_frame(&snapshot, query),
        "changes" => changes::answer(&snapshot),
        _ => return None,
    };
    Some(entry.map(|value| Answer::Json(value.to_string().into_bytes())))
}

fn frame(snapshot: &Snapshot, query: &Query) -> Result<Vec<u8>, ViewError> {
    let opened = snapshot.episode(required(query, "id")?)?;
    let t = number(query, "t")?.unwrap_or(1);
    snapshot.frame(&opened, t)?.ok_or_else(|| ViewError::Absent(format!("no frame of t = {t}")))
}
