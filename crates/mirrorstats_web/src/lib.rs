//! A small web server for people on this machine: who may ask, and what each answer carries.
//!
//! Rule: a page of another site must not be able to ask, whatever name it has resolved to this address. So the names in
//! `Host` and `Origin` are checked on every request, and where other machines can ask, a token too.
//!
//! ```
//! use mirrorstats_web::{Guard, check_token};
//!
//! let token = "0123456789abcdef";
//! check_token(token)?;
//! let guard = Guard::new("127.0.0.1:7000".parse().unwrap(), None, Some(token));
//! assert_eq!(guard.link(), "http://127.0.0.1:7000/?token=0123456789abcdef");
//! # Ok::<(), String>(())
//! ```

#![warn(clippy::print_stdout, clippy::print_stderr)]

use std::fmt::Write as _;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::header::{self, HeaderMap, HeaderName, HeaderValue};
use axum::http::{Method, StatusCode};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse as _, Response};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio::time::timeout;

/// The page's permissions: to show what this server has, and nothing else.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; style-src-attr 'unsafe-inline'; \
                      img-src 'self' data:; font-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// Connections at once; a browser opens six.
const MOST_CONNECTIONS: usize = 64;
/// The time for the head of a request; an idle connection ends after it too.
const SLOWEST_HEAD: Duration = Duration::from_secs(10);
/// The time for the body of a request, and for the answer.
const SLOWEST_ANSWER: Duration = Duration::from_mins(2);
/// A browser opens another connection after it.
const LONGEST_CONNECTION: Duration = Duration::from_mins(10);
const LARGEST_HEAD: usize = 64 << 10;

/// The frame of every page.
const PAGE: &str = include_str!("../../../assets/web/page.html");

/// A page with this title, style sheet and `<body>`, all of them the program's own words.
pub fn page(title: &str, style: &str, body: &str) -> String {
    let parts = [("<!-- title -->", title), ("<!-- style -->", style), ("<!-- body -->", body.trim_end())];
    parts.into_iter().fold(PAGE.to_owned(), |page, (mark, text)| page.replace(mark, text))
}

/// The headers of each answer.
const HEADERS: [(HeaderName, &str); 7] = [
    (header::CONTENT_SECURITY_POLICY, POLICY),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (HeaderName::from_static("x-robots-tag"), "noindex, noai"),
];

/// The check of who may ask.
#[derive(Clone, Debug)]
pub struct Guard {
    address: SocketAddr,
    name: Option<String>,
    token: Option<String>,
    takes_posts: bool,
}

impl Guard {
    /// Of a server at this address; `name` is what `--host` said, where that is a name.
    pub fn new(address: SocketAddr, name: Option<&str>, token: Option<&str>) -> Self {
        let name = name.filter(|name| name.parse::<IpAddr>().is_err()).map(str::to_ascii_lowercase);
        Self { address, name, token: token.map(str::to_owned), takes_posts: false }
    }

    /// True if only this machine reaches the server.
    pub fn is_local(&self) -> bool {
        self.address.ip().is_loopback()
    }

    /// The same for a server that takes what people send.
    #[must_use]
    pub fn taking_posts(self) -> Self {
        Self { takes_posts: true, ..self }
    }

    /// The address to open, with the token if there is one.
    pub fn link(&self) -> String {
        let host = match self.address.ip() {
            ip if ip.is_unspecified() => self.name.clone().unwrap_or_else(|| "localhost".to_owned()),
            IpAddr::V6(ip) => format!("[{ip}]"),
            IpAddr::V4(ip) => ip.to_string(),
        };
        let token = self.token.as_ref().map_or_else(String::new, |token| format!("?token={token}"));
        format!("http://{host}:{}/{token}", self.address.port())
    }

    /// The same with a query behind it.
    pub fn link_with(&self, query: &[(&str, &str)]) -> String {
        let link = self.link();
        let query: Vec<String> = query.iter().map(|(key, value)| format!("{key}={}", percent_encoded(value))).collect();
        format!("{link}{}{}", if link.contains('?') { '&' } else { '?' }, query.join("&"))
    }

    /// Returns true if a request may be answered; what to say otherwise.
    fn check(&self, method: &Method, headers: &HeaderMap, query: &str) -> Result<(), (StatusCode, &'static str)> {
        let text = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
        let mut hosts = headers.get_all(header::HOST).iter();
        let host = hosts.next().and_then(|host| host.to_str().ok()).filter(|_| hosts.next().is_none());
        let Some(host) = host.filter(|host| self.is_own(host)) else {
            return Err((StatusCode::FORBIDDEN, "this server is not known by that name"));
        };
        let origins = headers.get_all(header::ORIGIN).iter().count();
        if origins > 0 && (origins > 1 || text(header::ORIGIN) != Some(&format!("http://{host}"))) {
            return Err((StatusCode::FORBIDDEN, "another site may not ask"));
        }
        let site = text(HeaderName::from_static("sec-fetch-site"));
        let is_page = text(HeaderName::from_static("sec-fetch-mode")) == Some("navigate");
        if site.is_some_and(|site| site != "same-origin" && site != "none") && !is_page {
            return Err((StatusCode::FORBIDDEN, "another site may not ask"));
        }
        match *method {
            Method::GET | Method::HEAD => {}
            Method::POST if self.takes_posts && origins == 1 => {}
            _ => return Err((StatusCode::METHOD_NOT_ALLOWED, "this server is asked by GET")),
        }
        if !self.has_token(headers, query) {
            return Err((
                StatusCode::UNAUTHORIZED,
                "the link of this server has a token: open the link as it was printed",
            ));
        }
        Ok(())
    }

    /// Returns true if `Host` names this server and nothing else.
    fn is_own(&self, host: &str) -> bool {
        let (name, port) = match host.rsplit_once(':') {
            Some((name, port)) if !port.ends_with(']') => (name, port.parse().ok()),
            _ => (host, Some(80)),
        };
        if port != Some(self.address.port()) {
            return false;
        }
        let name = name.to_ascii_lowercase();
        let ip = name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>().ok();
        // A name can be made to point anywhere, an address cannot.
        let own = self.address.ip();
        ip.is_some_and(|ip| own.is_unspecified() || ip == own)
            || name == "localhost" && (own.is_loopback() || own.is_unspecified())
            || self.name.as_ref() == Some(&name)
    }

    fn has_token(&self, headers: &HeaderMap, query: &str) -> bool {
        let Some(token) = &self.token else { return true };
        let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
        let name = self.cookie();
        let of_cookie = cookies
            .flat_map(|cookies| cookies.split(';'))
            .filter_map(|pair| pair.trim().split_once('='))
            .any(|(key, value)| key == name && is_same(value, token));
        of_cookie || token_of(query).is_some_and(|found| is_same(found, token))
    }

    fn cookie(&self) -> String {
        format!("mirrorstats-{}", self.address.port())
    }

    fn cookie_to_set(&self, query: &str) -> Option<HeaderValue> {
        let token = self.token.as_ref()?;
        token_of(query)?;
        HeaderValue::from_str(&format!("{}={token}; HttpOnly; SameSite=Strict; Path=/", self.cookie())).ok()
    }
}

/// A value of a query: what RFC 3986 reserves or does not know is written as its bytes.
fn percent_encoded(value: &str) -> String {
    value.bytes().fold(String::new(), |mut text, byte| {
        if byte.is_ascii_alphanumeric() || b"-_.~/".contains(&byte) {
            text.push(char::from(byte));
        } else {
            let _ = write!(text, "%{byte:02X}");
        }
        text
    })
}

fn token_of(query: &str) -> Option<&str> {
    query.split('&').find_map(|pair| pair.strip_prefix("token="))
}

fn is_same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |all, (a, b)| all | (a ^ b)) == 0
}

/// Returns true if a token is one that a link and a cookie can hold, and that nobody guesses.
pub fn check_token(token: &str) -> Result<(), String> {
    let is_plain = token.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_.~".contains(&byte));
    if token.len() < 16 || !is_plain {
        return Err("expected at least 16 letters, digits, `-`, `_`, `.` or `~`, such as `openssl rand -hex 16` gives"
            .to_owned());
    }
    Ok(())
}

/// A listener on this machine alone, or under a name or address that others reach, and its guard.
pub fn listen(host: Option<&str>, port: u16, token: Option<&str>) -> std::io::Result<(std::net::TcpListener, Guard)> {
    let listener = std::net::TcpListener::bind((host.unwrap_or("127.0.0.1"), port))?;
    let guard = Guard::new(listener.local_addr()?, host, token);
    Ok((listener, guard))
}

/// The message if a server cannot listen.
pub fn cannot_listen(host: Option<&str>, port: u16, error: &std::io::Error) -> String {
    format!("cannot listen on {}:{port}: {error}", host.unwrap_or("127.0.0.1"))
}

/// A token that nobody can guess: 32 hexadecimal digits.
pub fn new_token() -> Result<String, std::io::Error> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes).map_err(std::io::Error::other)?;
    Ok(format!("{:032x}", u128::from_be_bytes(bytes)))
}

/// The routes behind the guard, each answer with the headers of all.
pub fn guarded(routes: Router, guard: Guard) -> Router {
    routes.layer(middleware::from_fn_with_state(Arc::new(guard), pass))
}

async fn pass(State(guard): State<Arc<Guard>>, request: Request, next: Next) -> Response {
    let query = request.uri().query().unwrap_or_default().to_owned();
    let mut response = match guard.check(request.method(), request.headers(), &query) {
        Ok(()) => {
            let late = || (StatusCode::REQUEST_TIMEOUT, "the request took too long\n").into_response();
            let mut response = timeout(SLOWEST_ANSWER, next.run(request)).await.unwrap_or_else(|_| late());
            if let Some(cookie) = guard.cookie_to_set(&query) {
                response.headers_mut().insert(header::SET_COOKIE, cookie);
            }
            response
        }
        Err((status, words)) => (status, Body::from(format!("{words}\n"))).into_response(),
    };
    let headers = response.headers_mut();
    for (name, value) in HEADERS {
        headers.insert(name, HeaderValue::from_static(value));
    }
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    headers.entry(header::CONTENT_TYPE).or_insert(HeaderValue::from_static("text/plain; charset=utf-8"));
    response
}

/// Answers until the process ends. A connection that sends no whole request head in time is closed; further connections wait
/// until one of the open ones ends.
pub async fn serve(listener: std::net::TcpListener, routes: Router) -> std::io::Result<()> {
    listener.set_nonblocking(true)?;
    let listener = TcpListener::from_std(listener)?;
    let places = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    loop {
        let place = places.clone().acquire_owned().await.map_err(std::io::Error::other)?;
        let Ok((stream, _)) = listener.accept().await else {
            // Out of file descriptors, or the client has gone: others may still come.
            tokio::time::sleep(Duration::from_millis(50)).await;
            continue;
        };
        let service = TowerToHyperService::new(routes.clone());
        tokio::spawn(async move {
            let mut builder = http1::Builder::new();
            builder.timer(TokioTimer::new()).header_read_timeout(SLOWEST_HEAD).max_buf_size(LARGEST_HEAD);
            let _ = timeout(LONGEST_CONNECTION, builder.serve_connection(TokioIo::new(stream), service)).await;
            drop(place);
        });
    }
}

#[cfg(test)]
mod tests {
    use axum::http::header::{HeaderMap, HeaderName, HeaderValue};
    use axum::http::{Method, StatusCode};

    use super::{Guard, check_token};

    fn asked(guard: &Guard, headers: &[(&'static str, &'static str)], query: &str) -> Option<StatusCode> {
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.append(HeaderName::from_static(name), HeaderValue::from_static(value));
        }
        guard.check(&Method::GET, &map, query).err().map(|(status, _)| status)
    }

    #[test]
    fn requests_for_another_host_or_from_another_site_are_refused() {
        let guard = Guard::new("127.0.0.1:7000".parse().unwrap(), None, None);
        for (headers, refused) in [
            (&[("host", "127.0.0.1:7000")][..], None),
            (&[("host", "localhost:7000")], None),
            (&[("host", "LOCALHOST:7000"), ("origin", "http://LOCALHOST:7000")], None),
            (&[], Some(403)),
            (&[("host", "mirror.invalid:7000")], Some(403)),
            (&[("host", "127.0.0.1.mirror.invalid:7000")], Some(403)),
            (&[("host", "127.0.0.1")], Some(403)),
            (&[("host", "127.0.0.1:7001")], Some(403)),
            (&[("host", "192.168.0.9:7000")], Some(403)),
            (&[("host", "127.0.0.1:7000"), ("host", "mirror.invalid:7000")], Some(403)),
            (&[("host", "127.0.0.1:7000"), ("origin", "http://mirror.invalid")], Some(403)),
            (&[("host", "127.0.0.1:7000"), ("origin", "null")], Some(403)),
            (&[("host", "127.0.0.1:7000"), ("origin", "http://localhost:7000")], Some(403)),
            (&[("host", "127.0.0.1:7000"), ("sec-fetch-site", "cross-site")], Some(403)),
            (&[("host", "127.0.0.1:7000"), ("sec-fetch-site", "cross-site"), ("sec-fetch-mode", "navigate")], None),
            (&[("host", "127.0.0.1:7000"), ("sec-fetch-site", "same-origin")], None),
        ] {
            let found = asked(&guard, headers, "").map(|status| status.as_u16());
            assert_eq!(found, refused, "{headers:?}");
        }
    }

    #[test]
    fn a_token_is_asked_for_in_the_link_or_the_cookie() {
        let token = "0123456789abcdef";
        let guard = Guard::new("0.0.0.0:7000".parse().unwrap(), Some("lab.example"), Some(token));
        let host = ("host", "lab.example:7000");
        assert_eq!(asked(&guard, &[host], ""), Some(StatusCode::UNAUTHORIZED));
        assert_eq!(asked(&guard, &[host], "token=0123456789abcdeX"), Some(StatusCode::UNAUTHORIZED));
        assert_eq!(asked(&guard, &[host], "view=episodes&token=0123456789abcdef"), None);
        assert_eq!(asked(&guard, &[host, ("cookie", "a=b; mirrorstats-7000=0123456789abcdef")], ""), None);
        assert_eq!(
            asked(&guard, &[host, ("cookie", "mirrorstats-7001=0123456789abcdef")], "").map(|s| s.as_u16()),
            Some(401)
        );
        assert_eq!(
            asked(&guard, &[("host", "other.example:7000")], "token=0123456789abcdef").map(|s| s.as_u16()),
            Some(403)
        );
        assert_eq!(guard.link(), "http://lab.example:7000/?token=0123456789abcdef");
        let query = [("view", "episode"), ("id", "E1/a b&c=é/s1/r1")];
        assert_eq!(guard.link_with(&query), format!("{}&view=episode&id=E1/a%20b%26c%3D%C3%A9/s1/r1", guard.link()));
        assert!(check_token(token).is_ok());
        assert!(check_token("short").is_err() && check_token("with a space in it").is_err());
    }

    #[test]
    fn requests_from_other_sites_change_nothing() {
        let guard = Guard::new("[::1]:7000".parse().unwrap(), None, None);
        let mut headers = HeaderMap::new();
        headers.insert("host", HeaderValue::from_static("[::1]:7000"));
        for method in [Method::POST, Method::PUT, Method::DELETE, Method::OPTIONS] {
            assert!(guard.check(&method, &headers, "").is_err(), "{method}");
        }
        let players = guard.taking_posts();
        assert!(players.check(&Method::POST, &headers, "").is_err(), "a browser names the origin of what it sends");
        headers.insert("origin", HeaderValue::from_static("http://[::1]:7000"));
        assert!(players.check(&Method::POST, &headers, "").is_ok());
    }
}
