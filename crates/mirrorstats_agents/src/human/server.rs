//! The pages for participants.
//!
//! Rule: it serves what a model gets to callers with a participant's link, and has no other route. Nothing here opens a
//! trace or knows the ground truth.

use std::net::TcpListener;
use std::sync::Arc;
use std::thread::JoinHandle;

use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, FromRequestParts, Query};
use axum::http::request::Parts;
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
    let page = || file(mirrorstats_web::page("Mirror room", "player.css", BODY), "text/html; charset=utf-8");
    Router::new()
        .route("/", get(move || async move { page() }))
        .route("/player.css", get(|| async { file(STYLE, "text/css; charset=utf-8") }))
        .route("/player.js", get(|| async { file(SCRIPT, "text/javascript; charset=utf-8") }))
        .route("/state", get(|person: LinkHolder| async move { person.state() }))
        .route("/frame", get(frame))
        .route("/agree", post(agree))
        .route("/decline", post(|person: LinkHolder| person.leave(Leaving::Declined)))
        .route("/withdraw", post(withdraw))
        .route("/begin", post(|person: LinkHolder| async move { person.after(Hub::begin) }))
        .route("/pause", post(|person: LinkHolder| async move { person.after(|hub, seat| hub.seat(seat).pause(true)) }))
        .route(
            "/resume",
            post(|person: LinkHolder| async move { person.after(|hub, seat| hub.seat(seat).pause(false)) }),
        )
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
    file(value.to_string(), "application/json")
}

/// The participant whose link a request has.
struct LinkHolder {
    hub: Arc<Hub>,
    seat: usize,
}

impl FromRequestParts<Arc<Hub>> for LinkHolder {
    type Rejection = Response;

    async fn from_request_parts(parts: &mut Parts, hub: &Arc<Hub>) -> Result<Self, Response> {
        let link = Query::<Link>::from_request_parts(parts, hub).await.map_err(IntoResponse::into_response)?;
        let seat = link.p.as_deref().and_then(|token| hub.seat_of(token));
        let stranger = || (StatusCode::UNAUTHORIZED, "open the link that you were given").into_response();
        Ok(Self { hub: Arc::clone(hub), seat: seat.ok_or_else(stranger)? })
    }
}

impl LinkHolder {
    fn state(&self) -> Response {
        json_response(&self.hub.state(self.seat))
    }

    fn after(self, does: fn(&Hub, usize)) -> Response {
        does(&self.hub, self.seat);
        self.state()
    }

    /// Deletion waits for a step under way and for the disk, so it runs on a separate thread.
    async fn leave(self, how: Leaving) -> Response {
        let (hub, seat) = (Arc::clone(&self.hub), self.seat);
        match tokio::task::spawn_blocking(move || hub.leave(seat, how)).await {
            Ok(Ok(())) => self.state(),
            _ => unwritten(),
        }
    }
}

async fn frame(LinkHolder { hub, seat }: LinkHolder) -> Response {
    let frame = hub.seat(seat).frame(&hub.terms);
    match frame.as_ref().and_then(|frame| frame.to_png().ok()) {
        Some(png) => file(png.to_vec(), "image/png"),
        None => (StatusCode::NOT_FOUND, "no frame").into_response(),
    }
}

async fn agree(person: LinkHolder) -> Response {
    if person.hub.agree(person.seat).is_ok() { person.state() } else { unwritten() }
}

fn unwritten() -> Response {
    (StatusCode::INTERNAL_SERVER_ERROR, "it could not be written down; tell the lab").into_response()
}

async fn withdraw(person: LinkHolder, body: Bytes) -> Response {
    match serde_json::from_slice(&body) {
        Ok(Withdrawal { delete: true }) => person.leave(Leaving::Deleted).await,
        Ok(Withdrawal { delete: false }) => person.leave(Leaving::Stopped).await,
        Err(_) => (StatusCode::BAD_REQUEST, "no withdrawal").into_response(),
    }
}

async fn reply(LinkHolder { hub, seat }: LinkHolder, body: Bytes) -> Response {
    let Ok(Sent { number, reply }) = serde_json::from_slice(&body) else {
        return (StatusCode::BAD_REQUEST, "no reply").into_response();
    };
    let taken = hub.seat(seat).answer(&hub.terms, number, Value::Object(reply).to_string());
    json_response(&json!({ "taken": taken }))
}
