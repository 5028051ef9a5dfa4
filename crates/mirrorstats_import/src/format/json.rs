//! JSON as Python writes it: `NaN` becomes null, its word for a missing number, and infinities become texts, which no
//! column of numbers takes. Numbers that the parser would round become marked texts.

use std::borrow::Cow;
use std::io::{self, BufReader, Read};

use memchr::memmem;
use serde::de::DeserializeOwned;

use crate::cell;
use crate::value::LineValue;

/// The mark before a number in a text. Unicode reserves this character for use inside of programs.
pub(crate) const UNHELD: char = '\u{fdd0}';

/// JSON in which numbers that neither 64-bit integers nor floats hold are marked texts.
pub(crate) fn marked(json: &str) -> Cow<'_, str> {
    if !may_round(json.as_bytes()) {
        return Cow::Borrowed(json);
    }
    let mut text = String::with_capacity(json.len());
    match PythonJson::numbers(json.as_bytes()).read_to_string(&mut text) {
        Ok(_) => Cow::Owned(text),
        Err(_) => Cow::Borrowed(json),
    }
}

/// Returns true for many digits in a row, and for negative exponents: without them no number is rounded.
fn may_round(json: &[u8]) -> bool {
    let is_part = |byte: &u8| byte.is_ascii_digit() || *byte == b'.';
    json.split(|byte| !is_part(byte)).any(|digits| digits.len() > 15)
        || json.windows(2).any(|pair| matches!(pair, b"e-" | b"E-"))
}

pub(super) fn from_bytes<T: DeserializeOwned>(bytes: Vec<u8>) -> io::Result<T> {
    match serde_json::from_slice(&bytes) {
        Err(_) if [&b"NaN"[..], b"Infinity"].iter().any(|word| memmem::find(&bytes, word).is_some()) => {
            let mut strict = Vec::with_capacity(bytes.len());
            PythonJson::new(&bytes[..]).read_to_end(&mut strict)?;
            drop(bytes);
            Ok(serde_json::from_slice(&strict)?)
        }
        read => Ok(read?),
    }
}

/// Replaces `NaN` outside of texts by `null`, and puts `Infinity`, `-Infinity` and unheld numbers in quotes.
pub(super) struct PythonJson<R> {
    bytes: io::Bytes<BufReader<R>>,
    /// False to leave `NaN` and infinities, which the parser refuses.
    takes_words: bool,
    pending: Vec<u8>,
    in_text: bool,
    escaped: bool,
}

impl<R: Read> PythonJson<R> {
    pub(super) fn new(reader: R) -> Self {
        Self { takes_words: true, ..Self::numbers(reader) }
    }

    /// Strict JSON, whose numbers alone are changed.
    pub(super) fn numbers(reader: R) -> Self {
        let bytes = BufReader::new(reader).bytes();
        Self { bytes, takes_words: false, pending: Vec::new(), in_text: false, escaped: false }
    }

    fn next(&mut self) -> io::Result<Option<u8>> {
        if let Some(byte) = self.pending.pop() {
            return Ok(Some(byte));
        }
        let Some(byte) = self.bytes.next().transpose()? else { return Ok(None) };
        if self.in_text {
            self.in_text = byte != b'"' || self.escaped;
            self.escaped = byte == b'\\' && !self.escaped;
            return Ok(Some(byte));
        }
        self.in_text = byte == b'"';
        match byte {
            b'N' | b'I' if self.takes_words => self.word(vec![byte]),
            b'-' | b'0'..=b'9' => self.number(byte),
            _ => Ok(Some(byte)),
        }
    }

    fn number(&mut self, first: u8) -> io::Result<Option<u8>> {
        let mut number = vec![first];
        let after = loop {
            match self.bytes.next().transpose()? {
                Some(byte @ (b'0'..=b'9' | b'.' | b'e' | b'E' | b'+' | b'-')) => number.push(byte),
                after => break after,
            }
        };
        if after == Some(b'I') && number == b"-" && self.takes_words {
            return self.word(b"-I".to_vec());
        }
        let spelling = String::from_utf8_lossy(&number);
        // Every number with so few digits and no exponent is held.
        let is_short = number.len() <= 15 && !number.contains(&b'e') && !number.contains(&b'E');
        if !is_short && is_json(&number) && matches!(cell::number(&spelling), LineValue::Unheld(_)) {
            number = format!("\"{UNHELD}{spelling}\"").into_bytes();
        }
        self.in_text = after == Some(b'"');
        self.pending = number.into_iter().chain(after).rev().collect();
        Ok(self.pending.pop())
    }

    /// The first byte of what replaces the word, or of the text if it is not one of the words.
    fn word(&mut self, mut word: Vec<u8>) -> io::Result<Option<u8>> {
        while ["NaN", "Infinity", "-Infinity"].iter().any(|whole| whole.as_bytes().starts_with(&word)) {
            if ["NaN", "Infinity", "-Infinity"].iter().any(|whole| whole.as_bytes() == word) {
                word = if word == b"NaN" { b"null".to_vec() } else { [b"\"", &word[..], b"\""].concat() };
                break;
            }
            match self.bytes.next().transpose()? {
                Some(byte) => word.push(byte),
                None => break,
            }
        }
        self.in_text = word.last() == Some(&b'"') && !word.starts_with(b"\"");
        self.pending = word.into_iter().rev().collect();
        Ok(self.pending.pop())
    }
}

/// Returns true for a number of JSON; the parser refuses other spellings.
fn is_json(number: &[u8]) -> bool {
    serde_json::from_slice::<serde::de::IgnoredAny>(number).is_ok()
}

impl<R: Read> Read for PythonJson<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        for (at, slot) in out.iter_mut().enumerate() {
            match self.next()? {
                Some(byte) => *slot = byte,
                None => return Ok(at),
            }
        }
        Ok(out.len())
    }
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
