//! A key, and texts without it.
//!
//! A provider may repeat a key in an error or a header. Everything that is written, printed or kept passes through
//! [`Secret::without`] first.

use secrecy::{ExposeSecret as _, SecretString};

const PLACEHOLDER: &str = "[key]";

/// A key from the environment; it is never printed.
#[derive(Clone, Debug)]
pub struct Secret(SecretString);

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the environment variable {0} is not set; it holds the key of the provider\n  help: export {0}=... and run the command again"
)]
pub struct NoKey(pub String);

impl Secret {
    pub fn from_environment(variable: &str) -> Result<Self, NoKey> {
        let value = std::env::var(variable).unwrap_or_default();
        let value = value.trim();
        if value.is_empty() { Err(NoKey(variable.to_owned())) } else { Ok(Self(value.to_owned().into())) }
    }

    pub fn new(key: String) -> Self {
        Self(key.into())
    }

    /// The text without the key, plain or percent-encoded.
    pub fn without(&self, text: &str) -> String {
        let key = self.0.expose_secret();
        if key.is_empty() {
            return text.to_owned();
        }
        let encoded: String = key
            .bytes()
            .map(|byte| match byte {
                b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => char::from(byte).to_string(),
                other => format!("%{other:02X}"),
            })
            .collect();
        let escaped = serde_json::Value::from(key).to_string();
        [key, escaped.trim_matches('"'), &encoded]
            .iter()
            .fold(text.to_owned(), |text, form| text.replace(form, PLACEHOLDER))
    }

    /// The text of an answer without the key. For servers without keys, users set words such as `EMPTY` or `none`;
    /// these are not secrets, and removing them would change the model's words.
    pub(crate) fn without_in_answer(&self, text: &str) -> String {
        const SHORTEST_KEY: usize = 6;
        if self.0.expose_secret().len() < SHORTEST_KEY { text.to_owned() } else { self.without(text) }
    }

    /// The header value with the key, marked so that no client prints it.
    pub(super) fn header(&self, prefix: &str) -> Option<reqwest::header::HeaderValue> {
        let value = format!("{prefix}{}", self.0.expose_secret());
        let mut value = reqwest::header::HeaderValue::from_str(&value).ok()?;
        value.set_sensitive(true);
        Some(value)
    }
}

/// The values of all environment variables whose names indicate a key: these are removed from a program's output, since
/// it inherits them. Values too short for a key are ignored, since they may be ordinary words.
pub(crate) fn from_every_key_variable() -> Vec<Secret> {
    const SHORTEST: usize = 8;
    let held = std::env::vars_os().filter(|(name, _)| names_a_key(&name.to_string_lossy()));
    let values = held.filter_map(|(_, value)| value.into_string().ok()).map(|value| value.trim().to_owned());
    values.filter(|value| value.len() >= SHORTEST).map(Secret::new).collect()
}

fn names_a_key(variable: &str) -> bool {
    let last = variable.rsplit('_').next().unwrap_or_default().to_ascii_uppercase();
    ["KEY", "APIKEY", "TOKEN", "SECRET", "PASSWORD", "PASSPHRASE"].contains(&last.as_str())
}

#[cfg(test)]
mod tests {
    use super::{Secret, names_a_key};

    #[test]
    fn variables_with_keys_are_known_by_their_names() {
        for name in ["OPENAI_API_KEY", "hf_token", "KEY", "DB_PASSWORD"] {
            assert!(names_a_key(name), "{name}");
        }
        for name in ["PATH", "KEYBOARD", "TOKENIZERS_PARALLELISM", "KEY_FILE_PATH", ""] {
            assert!(!names_a_key(name), "{name}");
        }
    }

    #[test]
    fn no_form_of_a_key_stays() {
        let secret = Secret::new("sk/a+\"b".to_owned());
        let said = r#"got sk/a+"b, as "sk/a+\"b", as sk%2Fa%2B%22b"#;
        assert_eq!(secret.without(said), r#"got [key], as "[key]", as [key]"#);
        assert_eq!(secret.without_in_answer("sk/a+\"b"), "[key]");
        assert!(!format!("{secret:?}").contains("sk/a"));
    }

    #[test]
    fn a_placeholder_key_is_not_removed_from_answers() {
        let answer = r#"{"selected_cube": "none"}"#;
        assert_eq!(Secret::new("none".to_owned()).without_in_answer(answer), answer);
    }
}
