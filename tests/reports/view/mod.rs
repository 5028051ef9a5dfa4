//! `mirrorstats view`: the server as a process, its page in a browser, and a copy from disk.

pub mod accessible;
mod copy;
mod find;
mod first_screen;
mod hostile;
mod labels;
#[cfg(feature = "sim")]
mod live;
mod mixture;
mod pages;
#[cfg(feature = "sim")]
mod people;
mod server;
mod values;

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::Stdio;

use crate::harness::program::{Running, program};

const RECORDED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/recorded");
const PAPER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/paper");

/// A server that is killed when this is dropped.
pub struct Server {
    process: Running,
    /// Its address: `http://127.0.0.1:PORT/`, with the token if there is one.
    pub link: String,
    pub port: u16,
}

impl Server {
    pub fn start(folder: &Path, arguments: &[&str]) -> Self {
        Self::start_by_link(folder, &[arguments, &["--no-token"]].concat())
    }

    /// Starts a server with the default: a token in the link.
    pub fn start_by_link(folder: &Path, arguments: &[&str]) -> Self {
        let mut command = program(folder);
        command.args(["view", "--no-open", "--port", "0"]).args(arguments);
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut link = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut link).unwrap();
        let link = link.trim().to_owned();
        assert!(link.starts_with("http://"), "the server says where it is: {link:?}");
        let port = link.split('/').nth(2).unwrap().rsplit_once(':').unwrap().1.parse().unwrap();
        Self { process: Running(process), link, port }
    }

    pub fn process_id(&self) -> u32 {
        self.process.0.id()
    }

    /// The answer to a browser on this machine.
    pub fn get(&self, path: &str) -> Response {
        let host = format!("127.0.0.1:{}", self.port);
        self.ask("GET", path, &[("Host", &host)], "")
    }

    pub fn ask(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> Response {
        ask(self.port, method, path, headers, body)
    }
}

/// Sends a raw request, without a library that would correct it.
pub fn ask(port: u16, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> Response {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    let headers = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect::<Vec<_>>().concat();
    let length = body.len();
    let request =
        format!("{method} {path} HTTP/1.1\r\n{headers}Connection: close\r\nContent-Length: {length}\r\n\r\n{body}");
    stream.write_all(request.as_bytes()).unwrap();
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    Response::parse(&bytes)
}

/// An answer.
#[derive(Debug)]
pub struct Response {
    pub status: u16,
    pub head: String,
    pub body: Vec<u8>,
}

impl Response {
    fn parse(bytes: &[u8]) -> Self {
        let end = bytes.windows(4).position(|four| four == b"\r\n\r\n").unwrap_or(bytes.len());
        let head = String::from_utf8_lossy(&bytes[..end]).to_ascii_lowercase();
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or_default();
        Self { status, head, body: bytes.get(end + 4..).unwrap_or_default().to_vec() }
    }

    pub fn text(&self) -> String {
        String::from_utf8(self.body.clone()).unwrap()
    }

    pub fn json(&self) -> serde_json::Value {
        assert_eq!(self.status, 200, "{}", self.text());
        serde_json::from_slice(&self.body).unwrap()
    }
}
