//! JSON as Python writes it: `NaN` becomes null, its word for a missing number, and infinities become texts, which no
//! column of numbers takes.

use std::io::{self, BufReader, Read};

use memchr::memmem;
use serde::de::DeserializeOwned;

pub(super) fn from_bytes<T: DeserializeOwned>(bytes: Vec<u8>) -> io::Result<T> {
    match serde_json::from_slice(&bytes) {
        Err(_) if [&b"NaN"[..], b"Infinity"].iter().any(|word| memmem::find(&bytes, word).is_some()) => {
            let mut strict = Vec::with_capacity(bytes.len());
            WithoutNan::new(&bytes[..]).read_to_end(&mut strict)?;
            drop(bytes);
            Ok(serde_json::from_slice(&strict)?)
        }
        read => Ok(read?),
    }
}

/// Replaces `NaN` outside of texts by `null`, and puts `Infinity` and `-Infinity` in quotes.
pub(super) struct WithoutNan<R> {
    bytes: io::Bytes<BufReader<R>>,
    pending: Vec<u8>,
    in_text: bool,
    escaped: bool,
}

impl<R: Read> WithoutNan<R> {
    pub(super) fn new(reader: R) -> Self {
        Self { bytes: BufReader::new(reader).bytes(), pending: Vec::new(), in_text: false, escaped: false }
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
        if !matches!(byte, b'N' | b'I' | b'-') {
            return Ok(Some(byte));
        }
        self.word(byte)
    }

    /// The first byte of what replaces the word, or of the text if it is not one of the words.
    fn word(&mut self, first: u8) -> io::Result<Option<u8>> {
        let mut word = vec![first];
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

impl<R: Read> Read for WithoutNan<R> {
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
