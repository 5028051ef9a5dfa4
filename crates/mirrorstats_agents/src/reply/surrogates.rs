//! Escapes of characters beyond U+FFFF in JSON: two halves, `\ud83d\ude00`. A single half is no character, and strict
//! parsers reject the whole text. Models write one if a limit or a filter cuts between the halves.

const REPLACEMENT: &str = "\\ufffd";
/// The bytes of `\uXXXX`.
const ESCAPE: usize = 6;

/// JSON with each lone surrogate's escape replaced by that of U+FFFD; `None` without one. Pairs stay.
pub fn without_lone_surrogates(json: &str) -> Option<String> {
    let (mut changed, mut is_changed) = (String::with_capacity(json.len()), false);
    let mut rest = json;
    while let Some(at) = rest.find('\\') {
        changed.push_str(&rest[..at]);
        rest = &rest[at..];
        let (length, is_lone) = escape(rest);
        changed.push_str(if is_lone { REPLACEMENT } else { &rest[..length] });
        is_changed |= is_lone;
        rest = &rest[length..];
    }
    changed.push_str(rest);
    is_changed.then_some(changed)
}

fn escape(text: &str) -> (usize, bool) {
    match unit(text) {
        Some(0xd800..=0xdbff) => match unit(&text[ESCAPE..]) {
            Some(0xdc00..=0xdfff) => (2 * ESCAPE, false),
            _ => (ESCAPE, true),
        },
        Some(0xdc00..=0xdfff) => (ESCAPE, true),
        Some(_) => (ESCAPE, false),
        // A backslash and the escaped character.
        None => (text.chars().take(2).map(char::len_utf8).sum(), false),
    }
}

/// The code unit of a text that begins with `\uXXXX`.
fn unit(text: &str) -> Option<u16> {
    let digits = text.strip_prefix("\\u")?.get(..4)?;
    let is_hex = digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_hex.then(|| u16::from_str_radix(digits, 16).ok())?
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::without_lone_surrogates;

    /// The code units of a JSON string, decoded as UTF-16: an independent way to the same text.
    fn decoded(units: &[u16]) -> String {
        char::decode_utf16(units.iter().copied()).map(|unit| unit.unwrap_or('\u{fffd}')).collect()
    }

    #[test]
    fn lone_halves_are_replaced_and_pairs_stay() {
        // Every sequence of up to four units that are plain, high or low.
        let kinds = [0x41_u16, 0xd83d, 0xde00];
        for length in 0..=4_u32 {
            for number in 0..3_usize.pow(length) {
                let units: Vec<u16> = (0..length).map(|at| kinds[number / 3_usize.pow(at) % 3]).collect();
                let escapes: Vec<String> = units.iter().map(|unit| format!("\\u{unit:04x}")).collect();
                let json = format!("\"{}\"", escapes.concat());
                let read = |text: &str| serde_json::from_str::<Value>(text).ok();
                let expected = Some(Value::String(decoded(&units)));
                match without_lone_surrogates(&json) {
                    Some(changed) => {
                        assert_eq!(read(&json), None, "{json}");
                        assert_eq!(read(&changed), expected, "{json}");
                    }
                    None => assert_eq!(read(&json), expected, "{json}"),
                }
            }
        }
    }

    #[test]
    fn other_text_than_escapes_is_kept() {
        for text in ["", "\\", "\\u", "\\ud8", "\\ud80g", "\\\\ud800", "\\u00e9", "\\n", "\\é", "ud800", "\\u+123"] {
            assert_eq!(without_lone_surrogates(text), None, "{text}");
        }
        assert_eq!(without_lone_surrogates(r"a\\\uD800\n").as_deref(), Some(r"a\\\ufffd\n"));
        assert_eq!(without_lone_surrogates(r"\ud83d\ud83d\ude00é").as_deref(), Some(r"\ufffd\ud83d\ude00é"));
    }
}
