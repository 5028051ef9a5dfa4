//! A loopback server that answers as configured: whole, in pieces, with faults, or not at all.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use mirrorstats_vlm::wire_format::WireFormat;
use serde_json::{Value, json};

pub const JSON: &str = "content-type: application/json\r\n";

/// A request as received.
#[derive(Clone, Debug)]
pub struct Request {
    /// The request line and the headers.
    pub head: String,
    /// The body.
    pub body: String,
}

impl Request {
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap()
    }
}

/// The server's answer to a request: bytes to send in pieces, with a pause before each.
#[derive(Clone, Debug)]
pub struct Conduct {
    bytes: Vec<u8>,
    piece: usize,
    pause: Duration,
}

impl Conduct {
    /// Sends these bytes in pieces.
    pub fn dripping(bytes: Vec<u8>, piece: usize, pause: Duration) -> Self {
        Self { bytes, piece, pause }
    }
}

impl From<Vec<u8>> for Conduct {
    fn from(bytes: Vec<u8>) -> Self {
        Self { piece: bytes.len().max(1), bytes, pause: Duration::ZERO }
    }
}

type Script = dyn Fn(usize, &Request) -> Conduct + Send + Sync;

pub struct Server {
    pub address: String,
    requests: Arc<Mutex<Vec<Request>>>,
}

impl Server {
    /// Starts a server whose script gets each request and its number, from 0.
    pub fn start<C: Into<Conduct>>(script: impl Fn(usize, &Request) -> C + Send + Sync + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}/v1", listener.local_addr().unwrap());
        let requests = Arc::new(Mutex::new(Vec::new()));
        let script: Arc<Script> = Arc::new(move |at, request| script(at, request).into());
        let seen = Arc::clone(&requests);
        thread::spawn(move || {
            for stream in listener.incoming() {
                let (seen, script) = (Arc::clone(&seen), Arc::clone(&script));
                thread::spawn(move || serve(stream.unwrap(), &seen, &*script));
            }
        });
        Self { address, requests }
    }

    pub fn requests(&self) -> Vec<Request> {
        self.requests.lock().unwrap().clone()
    }

    pub fn count(&self) -> usize {
        self.requests.lock().unwrap().len()
    }
}

/// Answers one request and closes the connection.
fn serve(mut stream: TcpStream, seen: &Mutex<Vec<Request>>, script: &Script) {
    let Some(request) = receive(&stream) else { return };
    let at = {
        let mut seen = seen.lock().unwrap();
        seen.push(request.clone());
        seen.len() - 1
    };
    let conduct = script(at, &request);
    if conduct.bytes.is_empty() {
        thread::sleep(conduct.pause);
    }
    for piece in conduct.bytes.chunks(conduct.piece) {
        thread::sleep(conduct.pause);
        // The client has heard enough and closed the connection.
        if stream.write_all(piece).is_err() {
            return;
        }
    }
    let _ = stream.shutdown(Shutdown::Write);
}

/// One whole request; `None` if the client closed the connection early.
fn receive(stream: &TcpStream) -> Option<Request> {
    let mut reader = BufReader::new(stream);
    let (mut head, mut length) = (String::new(), 0);
    loop {
        let mut line = String::new();
        if reader.read_line(&mut line).ok()? == 0 {
            return None;
        }
        if line == "\r\n" {
            break;
        }
        if let Some(value) = line.to_ascii_lowercase().strip_prefix("content-length:") {
            length = value.trim().parse().unwrap();
        }
        head.push_str(&line);
    }
    let mut body = vec![0; length];
    reader.read_exact(&mut body).ok()?;
    Some(Request { head, body: String::from_utf8(body).unwrap() })
}

/// An HTTP answer.
pub fn http(status: &str, headers: &str, body: &[u8]) -> Vec<u8> {
    let head = format!("HTTP/1.1 {status}\r\nconnection: close\r\n{headers}content-length: {}\r\n\r\n", body.len());
    [head.as_bytes(), body].concat()
}

/// An HTTP answer with a JSON body.
pub fn ok(body: &Value) -> Vec<u8> {
    http("200 OK", JSON, body.to_string().as_bytes())
}

/// A reply in the form that the prompt asks for.
pub fn decision(action: &str) -> String {
    json!({
        "view-description": "a wall", "reasoning": "none", "action": action, "summary": "went on",
        "selected_cube": "none", "identification": "I am red",
    })
    .to_string()
}

/// The body of an answer in the provider's wire format; `ending` is its word for how the text ended.
pub fn spoken(wire_format: WireFormat, text: &str, ending: &str) -> Value {
    match wire_format {
        WireFormat::OpenaiChat | WireFormat::OpenaiCompatible => json!({
            "id": "1", "object": "chat.completion", "model": "model-1-0601",
            "choices": [{ "index": 0, "finish_reason": ending, "message": { "role": "assistant", "content": text } }],
            "usage": { "prompt_tokens": 1000, "completion_tokens": 100 },
        }),
        WireFormat::Gemini => json!({
            "candidates": [{ "finishReason": ending, "content": { "role": "model", "parts": [
                { "text": "hm", "thought": true }, { "text": text },
            ] } }],
            "modelVersion": "model-1-0601",
            "usageMetadata": { "promptTokenCount": 1000, "candidatesTokenCount": 60, "thoughtsTokenCount": 40 },
        }),
        WireFormat::AnthropicMessages => json!({
            "id": "1", "type": "message", "role": "assistant", "model": "model-1-0601",
            "content": [{ "type": "text", "text": text }], "stop_reason": ending,
            "usage": { "input_tokens": 1000, "output_tokens": 100 },
        }),
    }
}

/// A whole answer in the provider's wire format.
pub fn whole(wire_format: WireFormat, text: &str) -> Vec<u8> {
    ok(&spoken(wire_format, text, endings(wire_format).0))
}

/// The provider's words for a normal end, and for an end by the token limit.
pub const fn endings(wire_format: WireFormat) -> (&'static str, &'static str) {
    match wire_format {
        WireFormat::OpenaiChat | WireFormat::OpenaiCompatible => ("stop", "length"),
        WireFormat::Gemini => ("STOP", "MAX_TOKENS"),
        WireFormat::AnthropicMessages => ("end_turn", "max_tokens"),
    }
}
