//! The pages for participants.
//!
//! Rule: it serves what a model gets to callers with a participant's link, and has no other route. Nothing here opens a
//! trace or knows the ground truth.

use std::net::TcpListener;
use std::sync::Arc;
use std::thread::JoinHandle;

use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Query, State};
use axum::http::{StatusCode, header};
use axum::middleware::map_response;
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use tokio::sync::oneshot;

use super::hub::Hub;
use super::journal::Leaving;
use mirrorstats_web::{self, Guard};

const BODY: &str = include_str!("../../../../assets/player/body.html");
const STYLE: &str = include_str!("../../../../assets/player/player.css");
const SCRIPT: &str = include_str!("../../../../assets/player/player.js");

/// The maximum size of a reply in bytes.
const LONGEST: usize = 1 << 20;

#[derive(Debug, Deserialize)]
struct Link {
    p: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sent {
    number: u64,
    reply: Map<String, Value>,
}

/// A participant's request to leave, and the choice to delete their data.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Withdrawal {
    delete: bool,
}

/// A server on its own thread; dropping it stops the server.
#[derive(Debug)]
pub struct Server {
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Server {
    fn drop(&mut self) {
        self.end = None;
        // The next recording of a study may need the same port.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

pub fn start(hub: Arc<Hub>, listener: TcpListener, guard: Guard) -> std::io::Result<Server> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
    let (end, ended) = oneshot::channel::<()>();
    let thread = std::thread::Builder::new().name("people".to_owned()).spawn(move || {
        runtime.block_on(async {
            let served = mirrorstats_web::serve(listener, mirrorstats_web::guarded(routes(hub), guard.taking_posts()));
            // If the server fails, the episodes wait until Ctrl-C.
            tokio::select! { _ = served => {}, _ = ended => {} }
        });
    })?;
    Ok(Server { end: Some(end), thread: Some(thread) })
}

fn routes(hub: Arc<Hub>) -> Router {
    Router::new()
        .route(
            "/",
            get(|| async {
                file(mirrorstats_web::page("Mirror room", "player.css", BODY), "text/html; charset=utf-8")
            }),
        )
        .route("/player.css", get(|| async { file(STYLE, "text/css; charset=utf-8") }))
        .route("/player.js", get(|| async { file(SCRIPT, "text/javascript; charset=utf-8") }))
        .route("/state", get(|hub, link| async { state_after(hub, link, |_, _| ()) }))
        .route("/frame", get(frame))
        .route("/agree", post(agree))
        .route("/decline", post(|State(hub), Query(link)| leave(hub, link, Leaving::Declined)))
        .route("/withdraw", post(withdraw))
        .route("/begin", post(|hub, link| async { state_after(hub, link, Hub::begin) }))
        .route("/pause", post(|hub, link| async { state_after(hub, link, |hub, seat| hub.seat(seat).pause(true)) }))
        .route("/resume", post(|hub, link| async { state_after(hub, link, |hub, seat| hub.seat(seat).pause(false)) }))
        .route("/reply", post(reply))
        .layer(DefaultBodyLimit::max(LONGEST))
        // Pages poll constantly: a kept connection would make another page wait.
        .layer(map_response(|response: Response| async { ([(header::CONNECTION, "close")], response) }))
        .with_state(hub)
}

fn file(text: impl IntoResponse, kind: &'static str) -> Response {
    ([(header::CONTENT_TYPE, kind)], text).into_response()
}

fn json_response(value: &Value) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], value.to_string()).into_response()
}

fn for_person(hub: &Hub, link: &Link, does: impl FnOnce(usize) -> Response) -> Response {
    match link.p.as_deref().and_then(|token| hub.seat_of(token)) {
        Some(seat) => does(seat),
        None => stranger(),
    }
}

fn stranger() -> Response {
    (StatusCode::UNAUTHORIZED, "open the link that you were given").into_response()
}

fn state_after(State(hub): State<Arc<Hub>>, Query(link): Query<Link>, does: fn(&Hub, usize)) -> Response {
    for_person(&hub, &link, |seat| {
        does(&hub, seat);
        json_response(&hub.state(seat))
    })
}

async fn frame(State(hub): State<Arc<Hub>>, Query(link): Query<Link>) -> Response {
    for_person(&hub, &link, |seat| {
        let frame = hub.seat(seat).frame(&hub.terms);
        match frame.as_ref().and_then(|frame| frame.to_png().ok()) {
            Some(png) => ([(header::CONTENT_TYPE, "image/png")], png.to_vec()).into_response(),
            None => (StatusCode::NOT_FOUND, "no frame").into_response(),
        }
    })
}

async fn agree(State(hub): State<Arc<Hub>>, Query(link): Query<Link>) -> Response {
    for_person(&hub, &link, |seat| match hub.agree(seat) {
        Ok(()) => json_response(&hub.state(seat)),
        Err(_) => unwritten(),
    })
}

fn unwritten() -> Response {
    (StatusCode::INTERNAL_SERVER_ERROR, "it could not be written down; tell the lab").into_response()
}

async fn withdraw(State(hub): State<Arc<Hub>>, Query(link): Query<Link>, body: Bytes) -> Response {
    match serde_json::from_slice(&body) {
        Ok(Withdrawal { delete: true }) => leave(hub, link, Leaving::Deleted).await,
        Ok(Withdrawal { delete: false }) => leave(hub, link, Leaving::Stopped).await,
        Err(_) => (StatusCode::BAD_REQUEST, "no withdrawal").into_response(),
    }
}

/// Deletion waits for a step under way and for the disk, so it runs on a separate thread.
async fn leave(hub: Arc<Hub>, link: Link, how: Leaving) -> Response {
    let Some(seat) = link.p.as_deref().and_then(|token| hub.seat_of(token)) else { return stranger() };
    let leaving = Arc::clone(&hub);
    match tokio::task::spawn_blocking(move || leaving.leave(seat, how)).await {
        Ok(Ok(())) => json_response(&hub.state(seat)),
        _ => unwritten(),
    }
}

async fn reply(State(hub): State<Arc<Hub>>, Query(link): Query<Link>, body: Bytes) -> Response {
    for_person(&hub, &link, |seat| {
        let Ok(Sent { number, reply }) = serde_json::from_slice(&body) else {
            return (StatusCode::BAD_REQUEST, "no reply").into_response();
        };
        let taken = hub.seat(seat).answer(&hub.terms, number, Value::Object(reply).to_string());
        json_response(&json!({ "taken": taken }))
    })
}
