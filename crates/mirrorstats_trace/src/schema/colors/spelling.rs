//! The spelling of colours: lower case, single spaces between words, no invisible characters.

use std::sync::LazyLock;

use regex::Regex;
use unicode_security::skeleton;

use crate::schema::colors::Color;
use mirrorstats_exact::suggest::nearest;

/// Words that some columns allow in place of a colour.
pub const WORDS: [&str; 2] = ["none", "unknown"];

/// A pattern that finds violations of the normal form, except upper case, for engines that match patterns.
pub const STRAY: &str = r"^ | $|  |[\s&&[^ ]]|[\p{Cc}\u{ad}\u{61c}\u{200b}-\u{200f}\u{2028}-\u{202e}\u{2060}-\u{206f}\u{feff}\u{e0000}-\u{e007f}]";

/// A pattern for names that mix Latin letters with those of other scripts, many of which look the same.
pub const MIXED: &str =
    r"\p{Latin}.*[\p{L}&&[^\p{Latin}\p{Common}\p{Inherited}]]|[\p{L}&&[^\p{Latin}\p{Common}\p{Inherited}]].*\p{Latin}";

pub(crate) fn is_well_spelled(name: &str) -> bool {
    // True for nearly all names, which need no normal form.
    name.bytes().all(|byte| byte.is_ascii_lowercase())
        || normal(name) == name && !is_mixed(name) && study_color(name).is_none_or(|color| color == name)
}

fn is_mixed(name: &str) -> bool {
    static PATTERN: LazyLock<Option<Regex>> = LazyLock::new(|| Regex::new(MIXED).ok());
    !name.is_ascii() && PATTERN.as_ref().is_some_and(|pattern| pattern.is_match(name))
}

/// The ASCII characters that a character looks like, by Unicode's table of confusables; itself if there are none.
fn look_of(c: char) -> String {
    let look: String = skeleton(c.encode_utf8(&mut [0; 4])).collect();
    match look.as_str() {
        _ if c.is_ascii() => c.to_string(),
        // That table maps `m` to `rn`.
        "rn" => "m".to_owned(),
        _ => look.to_lowercase(),
    }
}

fn disguise(name: &str) -> Option<String> {
    let (c, look) = name
        .chars()
        .map(|c| (c, look_of(c)))
        .find(|(c, look)| c.is_alphanumeric() && !c.is_ascii() && look.is_ascii())?;
    Some(format!(" its `{c}` is U+{:04X}, which only looks like `{look}`", u32::from(c)))
}

/// A name in lower case, with single spaces between words and without invisible characters.
pub fn normal(name: &str) -> String {
    let shown: String = name.chars().filter(|c| c.is_whitespace() || !hides(*c)).collect();
    let words: Vec<&str> = shown.split_whitespace().collect();
    words.join(" ").to_lowercase()
}

/// Returns true for an invisible character, as [`STRAY`] lists them for engines that match patterns.
fn hides(c: char) -> bool {
    let is_mark = matches!(c, '\u{ad}' | '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}');
    c.is_control() || is_mark || matches!(c, '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{e0000}'..='\u{e007f}')
}

pub(crate) fn spelling_key(name: &str) -> String {
    let key = normal(name).replace(' ', "");
    if key.is_ascii() { key } else { key.chars().map(look_of).collect() }
}

pub(crate) fn study_color(name: &str) -> Option<&'static str> {
    Color::named(&spelling_key(name)).map(Color::name)
}

pub(crate) fn most_like<'a>(text: &str, names: impl Iterator<Item = &'a str> + Clone) -> Option<&'a str> {
    let key = spelling_key(text);
    names.clone().find(|name| spelling_key(name) == key).or_else(|| nearest(&normal(text), names))
}

pub(crate) fn did_you_mean(name: &str) -> String {
    format!("did you mean `{}`?", name.escape_debug())
}

pub(crate) fn meant_by(text: &str, name: &str) -> String {
    did_you_mean(name) + &disguise(text).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use regex::Regex;

    use super::{STRAY, normal};

    #[test]
    fn the_pattern_agrees_with_the_normal_form() {
        let stray = Regex::new(STRAY).unwrap();
        for c in ('\0'..='\u{ffff}').chain('\u{e0000}'..='\u{e00ff}') {
            let lower = c.to_lowercase().collect::<String>();
            for text in [format!("a{lower}b"), format!("{lower}b"), format!("a{lower}")] {
                assert_eq!(stray.is_match(&text), normal(&text) != text.to_lowercase(), "{text:?}");
            }
        }
        assert!(stray.is_match("a  b") && !stray.is_match("a b c"));
    }
}
