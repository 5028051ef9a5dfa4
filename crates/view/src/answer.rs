//! Queries and answers: one function for the server and for files.

use super::error::ViewError;
use super::filter::{Query, number, required};
use super::snapshot::Snapshot;
use super::{View, changes, compare, episode, export, film, list, map, overview};
use study::Part;

pub(super) enum Answer {
    Json(Vec<u8>),
    Png(Vec<u8>),
    /// A page to save as a file.
    Page(String),
}

/// Answers a query of the page; `None` if the query is unknown.
pub(super) fn answer(view: &View, name: &str, query: &Query) -> Option<Result<Answer, ViewError>> {
    if name == "live" {
        return Some(Ok(Answer::Json(view.live().to_string().into_bytes())));
    }
    let snapshot = view.newest();
    if name == "frame" {
        return Some(frame(&snapshot, query).map(Answer::Png));
    }
    if name == "file" {
        return Some(required(query, "id").and_then(|id| export::episode_page(view, id)).map(Answer::Page));
    }
    if name == "film" {
        return Some(required(query, "id").and_then(|id| film::film(view, id)).map(Answer::Png));
    }
    let told = match name {
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
    Some(told.map(|value| Answer::Json(value.to_string().into_bytes())))
}

fn frame(snapshot: &Snapshot, query: &Query) -> Result<Vec<u8>, ViewError> {
    let opened = snapshot.episode(required(query, "id")?)?;
    let t = number(query, "t")?.unwrap_or(1);
    snapshot.frame(&opened, t)?.ok_or_else(|| ViewError::Absent(format!("no frame of t = {t}")))
}
