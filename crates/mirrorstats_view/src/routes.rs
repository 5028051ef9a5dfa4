//! The server: GET for the page and its answers, POST for a label if there is a coder.

use std::net::TcpListener;
use std::sync::Arc;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{DefaultBodyLimit, Path, Query, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use axum::routing::{get, post};

use super::answers::{Answer, answer, labels};
use super::{View, ViewError, page};
use mirrorstats_web::{self, Guard};

/// The maximum number of concurrent answers; further ones wait.
const MOST_ANSWERS: usize = 4;

/// The maximum size in bytes of a label with its note.
const LARGEST_LABEL: usize = 64 << 10;

/// Serves until the process ends.
pub fn serve(view: Arc<View>, listener: TcpListener, guard: Guard) -> std::io::Result<()> {
    let has_coder = view.options.coder.is_some();
    let routes = Router::new()
        .route("/", get(document))
        .route("/assets/{name}", get(asset))
        .route("/api/{name}", get(api))
        .route("/label", post(label).layer(DefaultBodyLimit::max(LARGEST_LABEL)))
        .route("/robots.txt", get(robots))
        .with_state(view);
    let mut builder = tokio::runtime::Builder::new_multi_thread();
    // Each answer may read an episode: more at once would take more memory and save no time.
    let guard = if has_coder { guard.taking_posts() } else { guard };
    let runtime = builder.worker_threads(2).max_blocking_threads(MOST_ANSWERS).enable_all().build()?;
    runtime.block_on(mirrorstats_web::serve(listener, mirrorstats_web::guarded(routes, guard)))
}

async fn document() -> Response {
    file("")
}

async fn asset(Path(name): Path<String>) -> Response {
    file(&format!("assets/{name}"))
}

async fn robots() -> &'static str {
    super::export::ROBOTS
}

fn file(name: &str) -> Response {
    match page::file(name) {
        Some((text, kind)) => ([(header::CONTENT_TYPE, kind)], text).into_response(),
        None => refused(StatusCode::NOT_FOUND, "no such file"),
    }
}

async fn api(
    State(view): State<Arc<View>>,
    Path(name): Path<String>,
    Query(query): Query<Vec<(String, String)>>,
) -> Response {
    // Reading and scoring take time and must not block other requests.
    let answered = tokio::task::spawn_blocking(move || answer(&view, &name, &query)).await;
    match answered {
        Ok(Some(Ok(Answer::Json(bytes)))) => ([(header::CONTENT_TYPE, "application/json")], bytes).into_response(),
        Ok(Some(Ok(Answer::Png(bytes)))) => {
            let kept = (header::CACHE_CONTROL, "private, max-age=600");
            ([(header::CONTENT_TYPE, "image/png"), kept], bytes).into_response()
        }
        Ok(Some(Ok(Answer::Page(page)))) => {
            let kept = (header::CONTENT_DISPOSITION, "attachment; filename=\"episode.html\"");
            ([(header::CONTENT_TYPE, "text/html; charset=utf-8"), kept], page).into_response()
        }
        Ok(Some(Err(error))) => failed(&error),
        Ok(None) => refused(StatusCode::NOT_FOUND, "no such question"),
        Err(_) => not_made(),
    }
}

async fn label(State(view): State<Arc<View>>, body: Bytes) -> Response {
    match tokio::task::spawn_blocking(move || labels::put(&view, &body)).await {
        Ok(Ok(labels)) => ([(header::CONTENT_TYPE, "application/json")], labels.to_string()).into_response(),
        Ok(Err(error)) => failed(&error),
        Err(_) => not_made(),
    }
}

fn failed(error: &ViewError) -> Response {
    let status = match error {
        ViewError::Absent(_) => StatusCode::NOT_FOUND,
        ViewError::Request(_) | ViewError::Study(_) => StatusCode::BAD_REQUEST,
        _ => StatusCode::INTERNAL_SERVER_ERROR,
    };
    refused(status, &error.words())
}

fn not_made() -> Response {
    refused(StatusCode::INTERNAL_SERVER_ERROR, "the answer could not be made; this is a fault of mirrorstats")
}

fn refused(status: StatusCode, words: &str) -> Response {
    let text = [(header::CONTENT_TYPE, "text/plain; charset=utf-8")];
    (status, text, Body::from(words.to_owned())).into_response()
}
