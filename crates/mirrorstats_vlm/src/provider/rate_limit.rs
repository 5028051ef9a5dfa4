//! The waits stated by providers: in headers, in error bodies, and as used-up rate limits.

use std::time::{Duration, SystemTime};

use arrow::compute::kernels::cast_utils::string_to_timestamp_nanos;
use reqwest::header::{HeaderMap, RETRY_AFTER};
use serde_json::Value;

use crate::wire_format::error_of;

/// The name of a limit's header, by the unit that it counts: `OpenAI` and compatible servers, then Anthropic.
const HEADERS: [fn(&str, &str) -> String; 2] = [
    |counts, what| format!("x-ratelimit-{what}-{counts}"),
    |counts, what| format!("anthropic-ratelimit-{counts}-{what}"),
];

/// The time until all used-up limits are renewed; `None` if no limit is used up.
pub(super) fn used_up(headers: &HeaderMap) -> Option<Duration> {
    let until_renewed = |header: fn(&str, &str) -> String, counts: &str| {
        let text = |what: &str| headers.get(header(counts, what))?.to_str().ok().map(str::trim);
        let is_used_up = text("remaining").and_then(decimal).is_some_and(|remaining| remaining <= 0.0);
        until(text("reset").filter(|_| is_used_up)?)
    };
    let of_units =
        HEADERS.into_iter().flat_map(|header| ["requests", "tokens"].map(|counts| until_renewed(header, counts)));
    of_units.flatten().max()
}

/// The time until a limit is renewed: `6m0s`, `20ms`, or an RFC 3339 date.
fn until(reset: &str) -> Option<Duration> {
    if let Ok(at) = string_to_timestamp_nanos(reset) {
        let at = SystemTime::UNIX_EPOCH + Duration::from_nanos(u64::try_from(at).ok()?);
        return Some(at.duration_since(SystemTime::now()).unwrap_or_default());
    }
    let (mut left, mut all) = (reset, 0.0);
    while !left.is_empty() {
        let unit_at = left.find(|c: char| !c.is_ascii_digit() && c != '.')?;
        let number: f64 = left[..unit_at].parse().ok()?;
        let unit = &left[unit_at..];
        let length = unit.find(|c: char| c.is_ascii_digit()).unwrap_or(unit.len());
        let seconds = match &unit[..length] {
            "ms" => 1e-3,
            "s" => 1.0,
            "m" => 60.0,
            "h" => 3_600.0,
            "d" => 86_400.0,
            _ => return None,
        };
        all += number * seconds;
        left = &unit[length..];
    }
    Duration::try_from_secs_f64(all).ok().filter(|_| !reset.is_empty())
}

/// A number of digits, with a point or without. Rust's parser also takes `1e3` and `inf`, which no header means.
fn decimal(text: &str) -> Option<f64> {
    let is_decimal = text.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
    text.parse().ok().filter(|_| is_decimal)
}

/// The wait requested in an error's body: Gemini sends `google.rpc.RetryInfo`, in seconds with an `s`. Source:
/// <https://github.com/googleapis/googleapis/blob/master/google/rpc/error_details.proto>, duration in JSON.
pub(super) fn retry_info(body: &str) -> Option<Duration> {
    let body: Value = serde_json::from_str(body).ok()?;
    let info = error_of(&body)?["details"]
        .as_array()?
        .iter()
        .find(|detail| detail["@type"].as_str().is_some_and(|name| name.ends_with("google.rpc.RetryInfo")))?;
    let seconds = info["retryDelay"].as_str()?.strip_suffix('s').and_then(decimal)?;
    Duration::try_from_secs_f64(seconds).ok()
}

/// The wait in headers: milliseconds, as `OpenAI`'s own client reads them; seconds, whole or not; or a date. A past
/// date means no wait, other text is ignored, and a number too large for a duration means the longest.
pub(super) fn retry_after(headers: &HeaderMap) -> Option<Duration> {
    let milliseconds = headers.get("retry-after-ms").and_then(|value| decimal(value.to_str().ok()?.trim()));
    if let Some(wait) = milliseconds.and_then(|wait| Duration::try_from_secs_f64(wait / 1e3).ok()) {
        return Some(wait);
    }
    let value = headers.get(RETRY_AFTER)?.to_str().ok()?.trim();
    if let Some(seconds) = decimal(value) {
        return Some(Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX));
    }
    let date = httpdate::parse_http_date(value).ok()?;
    Some(date.duration_since(SystemTime::now()).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use reqwest::header::{HeaderMap, HeaderName, HeaderValue, RETRY_AFTER};

    use super::{retry_after, until, used_up};

    #[test]
    fn a_valid_retry_after_is_read_and_an_invalid_one_ignored() {
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
        for nothing in ["-1", "NaN", "inf", "infinity", "1e3", "1E3", "0x10", "+5", "1_000", "2s", ".", "soon", ""] {
            assert_eq!(asked(nothing), None, "{nothing:?}");
        }
        assert_eq!(retry_after(&HeaderMap::new()), None);
    }

    #[test]
    fn the_reset_time_of_an_exhausted_limit_is_read() {
        let headers = |pairs: &[(&'static str, &'static str)]| -> HeaderMap {
            pairs.iter().map(|(name, value)| (HeaderName::from_static(name), HeaderValue::from_static(value))).collect()
        };
        let tokens_left = [
            ("x-ratelimit-remaining-requests", "0"),
            ("x-ratelimit-reset-requests", "1m0.5s"),
            ("x-ratelimit-remaining-tokens", "149984"),
            ("x-ratelimit-reset-tokens", "6h"),
        ];
        assert_eq!(used_up(&headers(&tokens_left)), Some(Duration::from_millis(60_500)));
        let anthropic = [
            ("anthropic-ratelimit-tokens-remaining", "0"),
            ("anthropic-ratelimit-tokens-reset", "2199-01-01T00:00:00Z"),
        ];
        assert!(used_up(&headers(&anthropic)).is_some_and(|wait| wait > Duration::from_hours(24)));
        assert_eq!(used_up(&headers(&[("x-ratelimit-remaining-requests", "0")])), None);
        assert_eq!(used_up(&HeaderMap::new()), None);
    }

    #[test]
    fn durations_and_dates_are_parsed_and_other_texts_ignored() {
        assert_eq!(until("20ms"), Some(Duration::from_millis(20)));
        assert_eq!(until("2000-01-01T00:00:00Z"), Some(Duration::ZERO));
        for nothing in ["", "soon", "5", "1w", "s", "1..0s", "-1s", "9999999999999999999999999999d"] {
            assert_eq!(until(nothing), None, "{nothing:?}");
        }
    }
}
