//! A key, and texts without it.
//!
//! A provider may repeat a key in an error or a header. Everything that is written, printed or kept passes through
//! [`Secret::without`] first. It covers the forms in which text carries a key: plain or reversed, also with JSON's
//! escapes or percent-encoded; hexadecimal; Base64, also of a longer text with the key inside. Letter case is ignored.

use std::fmt;

use base64::engine::general_purpose::{STANDARD_NO_PAD, URL_SAFE_NO_PAD};
use regex::{Regex, RegexBuilder};
use secrecy::{ExposeSecret as _, SecretString};

const PLACEHOLDER: &str = "[key]";

/// A key from the environment; it is never printed.
#[derive(Clone)]
pub struct Secret {
    key: SecretString,
    forms: Option<Regex>,
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret")
    }
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the environment variable {0} is not set; it holds the key of the provider\n  help: export {0}=... and run the command again"
)]
pub struct NoKey(pub String);

impl Secret {
    pub fn from_environment(variable: &str) -> Result<Self, NoKey> {
        let value = std::env::var(variable).unwrap_or_default();
        let value = value.trim();
        if value.is_empty() { Err(NoKey(variable.to_owned())) } else { Ok(Self::new(value.to_owned())) }
    }

    pub fn new(key: String) -> Self {
        let forms = (!key.is_empty()).then(|| forms(&key)).flatten();
        Self { key: key.into(), forms }
    }

    pub fn without(&self, text: &str) -> String {
        match &self.forms {
            Some(forms) => forms.replace_all(text, PLACEHOLDER).into_owned(),
            None if self.key.expose_secret().is_empty() => text.to_owned(),
            // A key too long for a pattern could stay in some form.
            None => PLACEHOLDER.to_owned(),
        }
    }

    /// The text of an answer without the key. For servers without keys, users set words such as `EMPTY` or `none`;
    /// these are not secrets, and removing them would change the model's words.
    pub fn without_in_answer(&self, text: &str) -> String {
        const SHORTEST_KEY: usize = 6;
        if self.key.expose_secret().len() < SHORTEST_KEY { text.to_owned() } else { self.without(text) }
    }

    /// The key, for a request header and nothing else.
    pub fn for_header(&self) -> &str {
        self.key.expose_secret()
    }
}

fn forms(key: &str) -> Option<Regex> {
    // A shorter encoded form may be part of an ordinary word.
    const SHORTEST: usize = 8;
    let bytes = key.as_bytes();
    let hex = bytes.iter().fold(String::new(), |text, byte| format!("{text}{byte:02x}"));
    let base64 =
        [STANDARD_NO_PAD, URL_SAFE_NO_PAD].map(|engine| (0..3).map(move |before| in_base64(&engine, bytes, before)));
    let encoded = base64.into_iter().flatten().chain([hex]).filter(|form| form.len() >= SHORTEST);
    let reversed = (key.len() >= SHORTEST).then(|| key.chars().rev().collect());
    let all: Vec<String> = [key.to_owned()]
        .into_iter()
        .chain(reversed)
        .chain(encoded)
        .map(|form| form.chars().map(escaped).collect())
        .collect();
    RegexBuilder::new(&all.join("|")).case_insensitive(true).size_limit(1 << 28).build().ok()
}

/// The characters of Base64 that only these bytes determine, after `before` other bytes.
fn in_base64(engine: &impl base64::Engine, bytes: &[u8], before: usize) -> String {
    let text = engine.encode([&vec![0; before], bytes].concat());
    let end = (before + bytes.len()) * 8 / 6;
    text.get((before * 8).div_ceil(6)..end).unwrap_or_default().to_owned()
}

/// A pattern of a character: itself, percent-encoded once or more, or escaped in JSON once or more.
fn escaped(c: char) -> String {
    let mut utf8 = [0; 4];
    let percent =
        c.encode_utf8(&mut utf8).bytes().fold(String::new(), |text, byte| format!("{text}%(?:25)*{byte:02x}"));
    let mut units = [0; 2];
    let json = c.encode_utf16(&mut units).iter().fold(String::new(), |text, unit| format!(r"{text}\\+u{unit:04x}"));
    let backslashes = if c.is_alphanumeric() { "" } else { r"\\*" };
    format!("(?:{backslashes}{}|{percent}|{json})", regex::escape(c.encode_utf8(&mut [0; 4])))
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
    use base64::Engine as _;
    use base64::engine::general_purpose::{STANDARD, URL_SAFE};

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
    fn no_encoded_form_of_a_key_stays() {
        const KEY: &str = "sk-Own/0123+456789_abcdef";
        let secret = Secret::new(KEY.to_owned());
        let hex = |byte: u8| if byte.is_multiple_of(2) { format!("{byte:02x}") } else { format!("{byte:02X}") };
        let percent = KEY.bytes().fold(String::new(), |text, byte| text + "%" + &hex(byte));
        let plain = [
            KEY.to_owned(),
            KEY.to_uppercase(),
            KEY.chars().rev().collect(),
            KEY.replace('/', r"\/"),
            KEY.replace('/', r"\\\/"),
            KEY.replace('/', r"\u002f").replace('+', r"\u002B"),
            KEY.replace('/', "%2f").replace('+', "%2B"),
            percent.replace('%', "%25"),
            percent,
            KEY.bytes().map(hex).collect(),
        ];
        for form in plain {
            assert_eq!(secret.without(&format!("a {form} b")), "a [key] b", "{form}");
        }
        for before in ["", "a", "ab", "Bearer ", "{\"key\": \""] {
            for engine in [STANDARD, URL_SAFE] {
                let said = secret.without(&engine.encode(format!("{before}{KEY}\"}}")));
                // At most the four characters at each end that belong to other bytes too.
                assert!(said.contains("[key]") && said.len() <= before.len() * 4 / 3 + 16, "{before}: {said}");
            }
        }
        assert_eq!(secret.without("sk-Own"), "sk-Own");
        assert_eq!(Secret::new(String::new()).without("text"), "text");
    }

    #[test]
    fn a_placeholder_key_is_not_removed_from_answers() {
        let answer = r#"{"selected_cube": "none"}"#;
        assert_eq!(Secret::new("none".to_owned()).without_in_answer(answer), answer);
    }
}
