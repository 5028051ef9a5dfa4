//! JSON as Python writes it: `NaN` becomes null, its word for a missing number, and infinities become texts, which no
//! column of numbers takes. Numbers that the parser would round become marked texts.

use std::borrow::Cow;
use std::io::{self, Read};

use memchr::{memchr2, memmem};
use serde::de::DeserializeOwned;

use crate::spelling;
use crate::value::Cell;

/// The mark before a number in a text. Unicode reserves this character for use inside of programs.
pub(crate) const UNHELD: char = '\u{fdd0}';

pub(crate) const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// Words of Python that JSON lacks, and their replacements.
const WORDS: [(&[u8], &[u8]); 3] =
    [(b"NaN", b"null"), (b"Infinity", b"\"Infinity\""), (b"-Infinity", b"\"-Infinity\"")];

/// JSON in which numbers that neither 64-bit integers nor floats hold are marked texts.
pub(crate) fn marked(json: &str) -> Cow<'_, str> {
    match strict(json.as_bytes(), false) {
        Cow::Borrowed(_) => Cow::Borrowed(json),
        Cow::Owned(marked) => String::from_utf8(marked).map_or(Cow::Borrowed(json), Cow::Owned),
    }
}

/// The value of a whole file, with or without words of Python.
pub(crate) fn from_reader<T: DeserializeOwned>(mut reader: impl Read, takes_words: bool) -> io::Result<T> {
    let mut bytes = Vec::new();
    reader.read_to_end(&mut bytes)?;
    let json = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&bytes);
    Ok(serde_json::from_slice(&strict(json, takes_words))?)
}

pub(crate) fn from_bytes<T: DeserializeOwned>(bytes: Vec<u8>) -> io::Result<T> {
    match serde_json::from_slice(&bytes) {
        Err(_) if [&b"NaN"[..], b"Infinity"].iter().any(|word| memmem::find(&bytes, word).is_some()) => {
            let strict = strict(&bytes, true).into_owned();
            drop(bytes);
            Ok(serde_json::from_slice(&strict)?)
        }
        read => Ok(read?),
    }
}

/// The JSON with marked numbers and, if `takes_words`, without words of Python, which the parser refuses.
fn strict(json: &[u8], takes_words: bool) -> Cow<'_, [u8]> {
    let (mut changed, mut copied, mut at) = (Vec::new(), 0, 0);
    while let Some(byte) = json.get(at) {
        let (end, other) = match byte {
            b'"' => (after_text(json, at + 1), None),
            b'N' | b'I' | b'-' | b'0'..=b'9' => token(&json[at..], takes_words, at),
            _ => (at + 1, None),
        };
        if let Some(other) = other {
            changed.extend(&json[copied..at]);
            changed.extend(&*other);
            copied = end;
        }
        at = end;
    }
    if copied == 0 {
        return Cow::Borrowed(json);
    }
    changed.extend(&json[copied..]);
    Cow::Owned(changed)
}

/// The end of a number or word that begins here, and its replacement if it has one.
fn token(json: &[u8], takes_words: bool, at: usize) -> (usize, Option<Cow<'static, [u8]>>) {
    let word = WORDS.iter().find(|(word, _)| takes_words && json.starts_with(word));
    if let Some((word, other)) = word {
        return (at + word.len(), Some(Cow::Borrowed(other)));
    }
    let is_part = |byte: &&u8| matches!(byte, b'0'..=b'9' | b'.' | b'e' | b'E' | b'+' | b'-');
    let length = json.iter().take_while(is_part).count();
    let number = &json[..length];
    // Every number with so few digits and no exponent is held.
    let is_short = length <= 15 && !number.iter().any(|byte| matches!(byte, b'e' | b'E'));
    let spelling = String::from_utf8_lossy(number);
    // The parser refuses other spellings, and numbers that are too large for floats.
    let is_unheld = !is_short
        && serde_json::from_slice::<f64>(number).is_ok()
        && matches!(spelling::number(&spelling), Cell::Unheld(_));
    (at + length.max(1), is_unheld.then(|| Cow::Owned(format!("\"{UNHELD}{spelling}\"").into_bytes())))
}

/// The position behind a text that begins at this one.
pub(crate) fn after_text(json: &[u8], mut at: usize) -> usize {
    while let Some(found) = json.get(at..).and_then(|rest| memchr2(b'"', b'\\', rest)) {
        at += found + 1;
        if json[at - 1] == b'"' {
            return at;
        }
        at += 1;
    }
    json.len()
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::from_bytes;

    #[test]
    fn nan_becomes_null_and_infinities_become_texts() {
        let text = r#"{"a":NaN,"b":[-Infinity,Infinity,-1.5],"c":"NaN \" Infinity \\","d":"-","e":NaN}"#;
        let expected =
            json!({"a": null, "b": ["-Infinity", "Infinity", -1.5], "c": "NaN \" Infinity \\", "d": "-", "e": null});
        assert_eq!(from_bytes::<Value>(text.into()).unwrap(), expected);
        for wrong in ["{\"a\":Nan,\"b\":NaN}", "{\"a\":-\"x\",\"b\":NaN}", "{\"a\":NaN", "-Inf"] {
            from_bytes::<Value>(wrong.into()).unwrap_err();
        }
    }
}
