//! One provider: sends requests and returns answers or named failures.
//!
//! A temporary failure is retried after a growing, jittered delay, or after the requested wait. A permanent one (a
//! rejected key, an unknown model, a malformed request) is reported at once. A refusal of the request's content counts
//! as an answer, whatever the status.

pub mod concurrency;
pub mod failure;
mod parameter;
mod preflight;
mod rate_limit;
mod waiting;

use std::net::IpAddr;
use std::time::{Duration, Instant};

use reqwest::header::{CONTENT_TYPE, HeaderMap, HeaderName, HeaderValue};
use reqwest::{Client, Response, StatusCode, Url};
use serde_json::Value;
pub(super) use waiting::Waiting;

use super::models::Backend;
use super::wire_format::{ModelAnswer, WireFormat};
use concurrency::{ConcurrencyLimiter, Permit};
use failure::{Failure, broken, failed, no_answer, server};
use mirrorstats_agents::secrets::Secret;
pub use preflight::Unreachable;
use preflight::connect;
use rate_limit::{retry_after, retry_info, used_up};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patience {
    /// Attempts per step, including the first.
    pub attempts: u32,
    /// From sending a request to the end of its answer.
    pub timeout: Duration,
    pub connect_timeout: Duration,
    /// The delay before the second attempt; it doubles with each further one.
    pub first_delay: Duration,
    /// The maximum delay, unless a provider requests a longer one.
    pub longest_delay: Duration,
    /// The maximum delay that a provider may request after a failure.
    pub longest_asked_delay: Duration,
    /// The maximum total wait of a step for rate limits and an overloaded provider.
    pub longest_wait: Duration,
    pub largest_answer: usize,
    /// The minimum time between two requests of an account.
    pub interval: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        Self {
            attempts: 6,
            timeout: Duration::from_mins(3),
            connect_timeout: Duration::from_secs(15),
            first_delay: Duration::from_secs(1),
            longest_delay: Duration::from_mins(1),
            longest_asked_delay: Duration::from_mins(10),
            longest_wait: Duration::from_hours(1),
            largest_answer: 4 * 1024 * 1024,
            interval: Duration::ZERO,
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Received {
    pub answer: ModelAnswer,
    /// The body without keys.
    pub body: String,
    /// From sending the request to the end of the answer.
    pub latency: Duration,
}

#[derive(Debug)]
pub struct Provider {
    client: Client,
    url: Url,
    wire_format: WireFormat,
    secret: Option<Secret>,
    patience: Patience,
    limiter: ConcurrencyLimiter,
}

#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    #[error("`{url}` is no base address: {fault}\n  help: it looks like https://host/v1")]
    Address { url: String, fault: String },
    #[error("the base address holds a user name or password\n  help: keys come from the environment alone")]
    Credentials,
    #[error(
        "the base address has a query or a fragment\n  help: it looks like https://host/v1; keys come from the environment alone"
    )]
    Query,
    #[error(
        "the key would go to another machine over `http://`, where everyone on the way reads it\n  help: give an address \
         that begins with https://, unset the variable `{key}`, or, in a network of your own, write `plain_http = true` \
         into the backend in a file for --models"
    )]
    Plain { key: String },
    #[error("the key has characters that no header can carry")]
    Key,
    #[error("cannot set up HTTP: {0}")]
    Client(String),
}

/// Rejects an unencrypted address for a key, unless it is local or the backend permits it.
pub fn check_transport(base_url: &str, backend: &Backend) -> Result<(), SetupError> {
    // Errors in an address are reported where it is used.
    let Ok(url) = address(base_url, "") else { return Ok(()) };
    let host = url.host_str().unwrap_or_default().trim_start_matches('[').trim_end_matches(']');
    let is_own = host == "localhost" || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback());
    if url.scheme() == "https" || is_own || backend.plain_http {
        return Ok(());
    }
    Err(SetupError::Plain { key: backend.key.clone() })
}

impl Provider {
    /// A provider at a base address; without a secret, requests carry no key (local servers).
    pub fn new(
        base_url: &str,
        wire_format: WireFormat,
        model: &str,
        secret: Option<Secret>,
        patience: Patience,
        at_once: usize,
    ) -> Result<Self, SetupError> {
        let shown = |text: String| match &secret {
            Some(secret) => secret.without(&text),
            None => text,
        };
        let url = address(base_url, &wire_format.path(model)).map_err(|error| match error {
            SetupError::Address { url, fault } => SetupError::Address { url: shown(url), fault: shown(fault) },
            other => other,
        })?;
        // Fails if the process already has a provider, which serves as well.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let client = Client::builder()
            .default_headers(headers(wire_format, secret.as_ref())?)
            .connect_timeout(patience.connect_timeout)
            .timeout(patience.timeout)
            .redirect(reqwest::redirect::Policy::none())
            .user_agent(concat!("mirrorstats/", env!("CARGO_PKG_VERSION")))
            .build()
            .map_err(|fault| SetupError::Client(fault.to_string()))?;
        Ok(Self {
            client,
            url,
            wire_format,
            secret,
            patience,
            limiter: ConcurrencyLimiter::new(at_once, patience.interval),
        })
    }

    /// Opens a connection to the address and closes it again without sending anything.
    pub fn connect(&self) -> Result<(), Unreachable> {
        connect(&self.url, self.patience.connect_timeout)
            .map_err(|Unreachable { address, fault }| Unreachable { address: self.without_secret(&address), fault })
    }

    pub fn patience(&self) -> Patience {
        self.patience
    }

    pub(crate) fn without_secret(&self, text: &str) -> String {
        self.secret.as_ref().map_or_else(|| text.to_owned(), |secret| secret.without(text))
    }

    pub async fn turn(&self) -> Permit<'_> {
        self.limiter.turn().await
    }

    pub async fn ask(&self, turn: Permit<'_>, body: &Value) -> Result<Received, Failure> {
        let result = self.exchange(body).await;
        drop(turn);
        match &result {
            Ok(_) => self.limiter.good(),
            Err(failure) if failure.kind.is_busy() => {
                self.limiter.too_many();
                self.pause(failure.after);
            }
            Err(_) => {}
        }
        result.map_err(|failure| Failure { detail: self.without_secret(&failure.detail), ..failure })
    }

    /// Blocks requests until the provider's stated wait is over. A wait longer than any step may take ends the
    /// recording instead.
    fn pause(&self, wait: Option<Duration>) {
        if let Some(wait) = wait.filter(|wait| *wait <= self.patience.longest_wait) {
            self.limiter.pause(wait);
        }
    }

    async fn exchange(&self, body: &Value) -> Result<Received, Failure> {
        let start = Instant::now();
        let response = self.client.post(self.url.clone()).json(body).send().await.map_err(broken)?;
        let (status, after) = (response.status(), retry_after(response.headers()));
        let renewed = used_up(response.headers());
        self.pause(renewed);
        let kind =
            response.headers().get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or("none").to_owned();
        if !status.is_success() {
            // The status counts even if the message cannot be read.
            let said = whole(response, self.patience.largest_answer).await.unwrap_or_default();
            let said = String::from_utf8_lossy(&said).into_owned();
            return match self.declined(status, &said) {
                Some(answer) => Ok(received(self.secret.as_ref(), answer, said, start.elapsed())),
                None => {
                    Err(failed(status, after.or_else(|| retry_info(&said)).or(renewed), &self.without_secret(&said)))
                }
            };
        }
        let bytes = whole(response, self.patience.largest_answer).await?;
        let latency = start.elapsed();
        // A billed answer counts regardless of its content type, or without one.
        let text = String::from_utf8(bytes).map_err(|fault| server(format!("the answer is not UTF-8: {fault}")))?;
        let no_answer = |fault: &str| no_answer(self.wire_format, &self.without_secret(&text), fault);
        let answer = self.wire_format.read(&text);
        let answer = answer.map_err(|fault| no_answer(&format!("the content type {kind} and no JSON ({fault})")))?;
        let answer = answer.ok_or_else(|| no_answer("other JSON"))?;
        Ok(received(self.secret.as_ref(), answer, text, latency))
    }

    /// The answer in an error about the content. Providers send it as a bad request, routers also as a
    /// forbidden one.
    fn declined(&self, status: StatusCode, said: &str) -> Option<ModelAnswer> {
        const ABOUT_CONTENT: [StatusCode; 3] =
            [StatusCode::BAD_REQUEST, StatusCode::FORBIDDEN, StatusCode::UNPROCESSABLE_ENTITY];
        if !ABOUT_CONTENT.contains(&status) {
            return None;
        }
        self.wire_format.declined(said)
    }
}

fn received(secret: Option<&Secret>, answer: ModelAnswer, body: String, latency: Duration) -> Received {
    let kept = |text: String| match secret {
        Some(secret) => secret.without_in_answer(&text),
        None => text,
    };
    let answer = ModelAnswer { text: kept(answer.text), model: answer.model.map(kept), ..answer };
    Received { answer, body: kept(body), latency }
}

async fn whole(mut response: Response, most: usize) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    while let Some(chunk) = response.chunk().await.map_err(broken)? {
        if bytes.len() + chunk.len() > most {
            return Err(server(format!("the answer is larger than {most} bytes")));
        }
        bytes.extend_from_slice(&chunk);
    }
    Ok(bytes)
}

fn address(base_url: &str, path: &str) -> Result<Url, SetupError> {
    let fault = |fault: String| SetupError::Address { url: base_url.to_owned(), fault };
    // Messages do not repeat an address that may hold credentials.
    if base_url.contains('@') {
        return Err(SetupError::Credentials);
    }
    if base_url.contains(['?', '#']) {
        return Err(SetupError::Query);
    }
    let base = base_url.trim_end_matches('/');
    let url = Url::parse(&format!("{base}/{path}"));
    match url {
        Ok(url) if !matches!(url.scheme(), "http" | "https") => Err(fault(format!("the scheme is {}", url.scheme()))),
        Ok(url) => Ok(url),
        Err(error) => Err(fault(error.to_string())),
    }
}

fn headers(wire_format: WireFormat, secret: Option<&Secret>) -> Result<HeaderMap, SetupError> {
    let mut headers = HeaderMap::new();
    for (name, value) in wire_format.headers() {
        headers.insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    if let Some(secret) = secret {
        let (name, prefix) = wire_format.key_header();
        let value = HeaderValue::from_str(&format!("{prefix}{}", secret.for_header()));
        let mut value = value.map_err(|_| SetupError::Key)?;
        // No client prints a header that is marked so.
        value.set_sensitive(true);
        headers.insert(HeaderName::from_static(name), value);
    }
    Ok(headers)
}

#[cfg(test)]
mod tests {
    use super::{Backend, SetupError, WireFormat, address, check_transport};

    #[test]
    fn keys_are_sent_over_plain_http_only_if_the_backend_allows_it() {
        let (wire_format, key) = (WireFormat::OpenaiCompatible, "KEY".to_owned());
        let strict =
            Backend { wire_format, base_url: None, key, plain_http: false, extra_body: serde_json::Map::new() };
        let free = Backend { plain_http: true, ..strict.clone() };
        for own in [
            "http://127.0.0.1:8/v1",
            "http://localhost/v1",
            "http://[::1]:8/v1",
            "https://host/v1",
            "http://127.9.9.9/",
        ] {
            assert!(check_transport(own, &strict).is_ok(), "{own}");
        }
        for other in ["http://host/v1", "http://192.0.2.1/v1", "http://localhost.host/v1", "http://[2001:db8::1]/"] {
            assert!(matches!(check_transport(other, &strict), Err(SetupError::Plain { .. })), "{other}");
            assert!(check_transport(other, &free).is_ok(), "{other}");
        }
    }

    #[test]
    fn addresses_take_paths_and_refuse_credentials() {
        assert_eq!(address("http://host:8/v1/", "a/b").unwrap().as_str(), "http://host:8/v1/a/b");
        assert!(matches!(address("https://me:secret@host/v1", "a"), Err(SetupError::Credentials)));
        assert!(matches!(address("me:secret@host", "a"), Err(SetupError::Credentials)));
        assert!(matches!(address("host/v1", "a"), Err(SetupError::Address { .. })));
        assert!(matches!(address("ftp://host/v1", "a"), Err(SetupError::Address { .. })));
        assert!(matches!(address("http://host/v1?key=secret", "a"), Err(SetupError::Query)));
    }
}
