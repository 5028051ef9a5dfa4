//! One provider: requests go out, answers come in, or a failure with a name.
//!
//! A failure that may pass is tried again after a growing, jittered delay, or after what the provider asks for; one
//! that will not pass (a refused key, an unknown model, a malformed request) is told at once.

use std::time::{Duration, Instant, SystemTime};

use reqwest::header::{CONTENT_TYPE, HeaderMap, HeaderName, HeaderValue, RETRY_AFTER};
use reqwest::{Client, Response, StatusCode, Url};
use serde_json::Value;

use super::dialect::{Answer, Dialect};
use super::pace::Pace;
use super::secrets::Secret;
use crate::agent::Status;

/// How patient a provider is dealt with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patience {
    /// Attempts for one step, the first one included.
    pub attempts: u32,
    /// From sending a request to the end of its answer.
    pub timeout: Duration,
    /// For making a connection.
    pub connect_timeout: Duration,
    /// The delay before the second attempt; it doubles from there.
    pub first_delay: Duration,
    /// The longest delay, unless a provider asks for a longer one.
    pub longest_delay: Duration,
    /// The longest delay that a provider gets by asking.
    pub longest_asked_delay: Duration,
    /// Bytes of an answer.
    pub largest_answer: usize,
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
            largest_answer: 4 * 1024 * 1024,
        }
    }
}

/// Why there is no answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// What it counts as.
    pub kind: FailureKind,
    /// What happened, without any key.
    pub detail: String,
    /// How long the provider asks to wait.
    pub after: Option<Duration>,
}

/// The kinds of failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureKind {
    /// Too many requests.
    RateLimited,
    /// The provider failed, the connection broke, or what came is no answer.
    Server,
    /// Nothing whole came in time.
    Timeout,
    /// The provider refuses this request, and will again.
    Rejected,
}

impl FailureKind {
    /// The status of a step that ends in this failure.
    pub const fn status(self) -> Status {
        match self {
            Self::RateLimited => Status::RateLimited,
            Self::Server | Self::Rejected => Status::ServerError,
            Self::Timeout => Status::Timeout,
        }
    }
}

/// An answer, and how it came.
#[derive(Clone, Debug, PartialEq)]
pub struct Received {
    /// What it says.
    pub answer: Answer,
    /// The body, without any key.
    pub body: String,
    /// From sending the request to the end of the answer.
    pub latency: Duration,
}

/// A provider that requests can be sent to.
#[derive(Debug)]
pub struct Provider {
    client: Client,
    url: Url,
    dialect: Dialect,
    secret: Option<Secret>,
    patience: Patience,
    pace: Pace,
}

/// A provider that cannot be set up.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum SetupError {
    #[error("`{url}` is no base address: {fault}\n  help: it looks like https://host/v1")]
    Address { url: String, fault: String },
    #[error("the base address holds a user name or password\n  help: keys come from the environment alone")]
    Credentials,
    #[error(
        "the base address has a query or a fragment\n  help: it looks like https://host/v1; keys come from the environment alone"
    )]
    Query,
    #[error("the key has characters that no header can carry")]
    Key,
    #[error("cannot set up HTTP: {0}")]
    Client(String),
}

impl SetupError {
    /// The same without the key, which may stand where an address should.
    fn without(self, secret: Option<&Secret>) -> Self {
        match (self, secret) {
            (Self::Address { url, fault }, Some(secret)) => {
                Self::Address { url: secret.without(&url), fault: secret.without(&fault) }
            }
            (other, _) => other,
        }
    }
}

impl Provider {
    /// A provider at a base address; without a secret, requests carry no key (servers of one's own).
    ///
    /// # Errors
    /// For an address that is none or holds credentials, and a key that no header can carry.
    pub fn new(
        base_url: &str,
        dialect: Dialect,
        model: &str,
        secret: Option<Secret>,
        patience: Patience,
        at_once: usize,
    ) -> Result<Self, SetupError> {
        let url = address(base_url, &dialect.path(model)).map_err(|fault| fault.without(secret.as_ref()))?;
        let client = Client::builder()
            .default_headers(headers(dialect, secret.as_ref())?)
            .connect_timeout(patience.connect_timeout)
            .timeout(patience.timeout)
            .redirect(reqwest::redirect::Policy::none())
            .user_agent(concat!("mirrorstats/", env!("CARGO_PKG_VERSION")))
            .build()
            .map_err(|fault| SetupError::Client(fault.to_string()))?;
        Ok(Self { client, url, dialect, secret, patience, pace: Pace::new(at_once) })
    }

    /// The language it speaks.
    pub fn dialect(&self) -> Dialect {
        self.dialect
    }

    /// How patient it is dealt with.
    pub fn patience(&self) -> Patience {
        self.patience
    }

    /// How many requests may be out now.
    pub fn at_once(&self) -> usize {
        self.pace.limit()
    }

    /// The text without the key.
    pub fn without_secret(&self, text: &str) -> String {
        self.secret.as_ref().map_or_else(|| text.to_owned(), |secret| secret.without(text))
    }

    /// Sends a request once, when its turn comes.
    ///
    /// # Errors
    /// Whatever kept the answer from coming.
    pub async fn ask(&self, body: &Value) -> Result<Received, Failure> {
        let turn = self.pace.turn().await;
        let result = self.exchange(body).await;
        drop(turn);
        match &result {
            Ok(_) => self.pace.good(),
            Err(failure) if failure.kind == FailureKind::RateLimited => self.pace.too_many(),
            Err(_) => {}
        }
        result.map_err(|failure| Failure { detail: self.without_secret(&failure.detail), ..failure })
    }

    async fn exchange(&self, body: &Value) -> Result<Received, Failure> {
        let start = Instant::now();
        let response = self.client.post(self.url.clone()).json(body).send().await.map_err(broken)?;
        let (status, after) = (response.status(), retry_after(response.headers()));
        let kind = response.headers().get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).map(str::to_owned);
        if !status.is_success() {
            // The status stands, whatever becomes of the words beside it.
            let said = self.whole(response).await.unwrap_or_default();
            return Err(refused(status, after, &self.without_secret(&String::from_utf8_lossy(&said))));
        }
        let bytes = self.whole(response).await?;
        let latency = start.elapsed();
        if !kind.as_deref().is_some_and(is_json) {
            let found = kind.unwrap_or_else(|| "none".to_owned());
            return Err(server(format!("expected the content type application/json, found {found}")));
        }
        let text = String::from_utf8(bytes).map_err(|fault| server(format!("the answer is not UTF-8: {fault}")))?;
        let value: Value =
            serde_json::from_str(&text).map_err(|fault| server(format!("the answer is not JSON: {fault}")))?;
        let answer = self.dialect.answer(&value).ok_or_else(|| server(unexpected(&self.without_secret(&text))))?;
        let kept = |text: String| match &self.secret {
            Some(secret) => secret.without_in_answer(&text),
            None => text,
        };
        let answer = Answer { text: kept(answer.text), model: answer.model.map(kept), ..answer };
        Ok(Received { answer, body: kept(text), latency })
    }

    /// The body, up to the limit.
    async fn whole(&self, mut response: Response) -> Result<Vec<u8>, Failure> {
        let mut bytes = Vec::new();
        while let Some(chunk) = response.chunk().await.map_err(broken)? {
            if bytes.len() + chunk.len() > self.patience.largest_answer {
                return Err(server(format!("the answer is larger than {} bytes", self.patience.largest_answer)));
            }
            bytes.extend_from_slice(&chunk);
        }
        Ok(bytes)
    }
}

fn address(base_url: &str, path: &str) -> Result<Url, SetupError> {
    let fault = |fault: String| SetupError::Address { url: base_url.to_owned(), fault };
    // An address that may hold credentials is not repeated in a message.
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

fn headers(dialect: Dialect, secret: Option<&Secret>) -> Result<HeaderMap, SetupError> {
    let mut headers = HeaderMap::new();
    for (name, value) in dialect.headers() {
        headers.insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    if let Some(secret) = secret {
        let (name, prefix) = dialect.key_header();
        headers.insert(HeaderName::from_static(name), secret.header(prefix).ok_or(SetupError::Key)?);
    }
    Ok(headers)
}

fn is_json(kind: &str) -> bool {
    let kind = kind.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    kind == "application/json" || kind.ends_with("+json")
}

fn server(detail: String) -> Failure {
    Failure { kind: FailureKind::Server, detail, after: None }
}

/// What the provider says in place of an answer, shortened.
fn unexpected(text: &str) -> String {
    format!("the answer is not of the provider's language: {}", shortened(text))
}

fn shortened(text: &str) -> String {
    const LONGEST: usize = 300;
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line,
    }
}

/// A failure below HTTP. The address is left out: it may be a private one.
fn broken(error: reqwest::Error) -> Failure {
    let kind = if error.is_timeout() { FailureKind::Timeout } else { FailureKind::Server };
    let error = error.without_url();
    let mut detail = error.to_string();
    let mut cause = std::error::Error::source(&error);
    while let Some(inner) = cause {
        let words = inner.to_string();
        if !detail.contains(&words) {
            detail = format!("{detail}: {words}");
        }
        cause = inner.source();
    }
    Failure { kind, detail, after: None }
}

/// A status that is not success.
fn refused(status: StatusCode, after: Option<Duration>, body: &str) -> Failure {
    let kind = match status {
        StatusCode::TOO_MANY_REQUESTS if is_out_of_credit(body) => FailureKind::Rejected,
        StatusCode::TOO_MANY_REQUESTS => FailureKind::RateLimited,
        StatusCode::REQUEST_TIMEOUT | StatusCode::GATEWAY_TIMEOUT => FailureKind::Timeout,
        status if status.is_server_error() => FailureKind::Server,
        StatusCode::CONFLICT | StatusCode::TOO_EARLY => FailureKind::Server,
        _ => FailureKind::Rejected,
    };
    let detail = match shortened(body) {
        said if said.is_empty() => format!("HTTP {status}"),
        said => format!("HTTP {status}: {said}"),
    };
    Failure { kind, detail, after }
}

/// Whether too many requests means that there is no money left, which waiting does not mend.
fn is_out_of_credit(body: &str) -> bool {
    const CODE: &str = "insufficient_quota";
    let error = serde_json::from_str::<Value>(body).map(|mut body| body["error"].take()).unwrap_or_default();
    error["code"] == CODE || error["type"] == CODE
}

/// The wait that a provider asks for: seconds, whole or not, or a date. A date that is over asks for none, what is
/// neither asks for nothing, and what no duration can hold asks for the longest.
fn retry_after(headers: &HeaderMap) -> Option<Duration> {
    let value = headers.get(RETRY_AFTER)?.to_str().ok()?.trim();
    if let Ok(seconds) = value.parse::<f64>() {
        let is_wait = seconds >= 0.0;
        return is_wait.then(|| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX));
    }
    let date = httpdate::parse_http_date(value).ok()?;
    Some(date.duration_since(SystemTime::now()).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use reqwest::StatusCode;
    use reqwest::header::{HeaderMap, HeaderValue, RETRY_AFTER};

    use super::{FailureKind, SetupError, address, is_json, refused, retry_after};

    #[test]
    fn addresses_take_paths_and_refuse_credentials() {
        assert_eq!(address("http://host:8/v1/", "a/b").unwrap().as_str(), "http://host:8/v1/a/b");
        assert!(matches!(address("https://me:secret@host/v1", "a"), Err(SetupError::Credentials)));
        assert!(matches!(address("me:secret@host", "a"), Err(SetupError::Credentials)));
        assert!(matches!(address("host/v1", "a"), Err(SetupError::Address { .. })));
        assert!(matches!(address("ftp://host/v1", "a"), Err(SetupError::Address { .. })));
        assert!(matches!(address("http://host/v1?key=secret", "a"), Err(SetupError::Query)));
    }

    #[test]
    fn the_wait_asked_for_is_read_or_left() {
        let asked = |value: &'static str| {
            let mut headers = HeaderMap::new();
            headers.insert(RETRY_AFTER, HeaderValue::from_static(value));
            retry_after(&headers)
        };
        assert_eq!(asked(" 7 "), Some(Duration::from_secs(7)));
        assert_eq!(asked("0.25"), Some(Duration::from_millis(250)));
        assert_eq!(asked("Sun, 06 Nov 1994 08:49:37 GMT"), Some(Duration::ZERO));
        assert!(asked("Fri, 31 Dec 9999 23:59:59 GMT").is_some_and(|wait| wait > Duration::from_hours(24)));
        assert_eq!(asked("99999999999999999999999999"), Some(Duration::MAX));
        for nothing in ["-1", "NaN", "soon", ""] {
            assert_eq!(asked(nothing), None, "{nothing:?}");
        }
        assert_eq!(retry_after(&HeaderMap::new()), None);
    }

    #[test]
    fn no_money_left_is_not_too_many_requests() {
        let kind = |body| refused(StatusCode::TOO_MANY_REQUESTS, None, body).kind;
        assert_eq!(kind(r#"{"error": {"code": "insufficient_quota"}}"#), FailureKind::Rejected);
        assert_eq!(kind(r#"{"error": {"code": "rate_limit_exceeded"}}"#), FailureKind::RateLimited);
        assert_eq!(kind("slow down"), FailureKind::RateLimited);
    }

    #[test]
    fn json_comes_with_parameters_and_in_families() {
        assert!(is_json("application/json; charset=utf-8") && is_json("application/problem+json"));
        assert!(!is_json("text/html") && !is_json(""));
    }
}
