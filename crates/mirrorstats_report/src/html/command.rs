//! The commands that look into one episode, for readers at a terminal.
//!
//! Rule: names as in a manifest, so that no page reveals its maker's folders; each is one shell word, whatever its
//! characters.

use std::collections::BTreeSet;

use serde_json::{Value as Json, json};

use mirrorstats_exact::escape::visible;

/// The most folders or files that a command names; if there are more, it names their folder.
const MOST_NAMED: usize = 3;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recordings {
    pub paths: Vec<String>,
    /// The definitions, by name or path; `None` for the default ones.
    pub definitions: Option<String>,
}

impl Recordings {
    pub(super) fn commands(&self) -> Json {
        let runs = self.runs();
        let definitions = self.definitions.as_deref().map(|name| format!(" --definitions {}", word(name)));
        let definitions = definitions.unwrap_or_default();
        let score = format!("mirrorstats score {runs}{definitions} --explain ");
        let view = format!("mirrorstats view {runs}{definitions} --episode ");
        let to_file = format!(" {runs} --out filmstrip.png");
        json!([
            { "title": "why it has its values", "before": score, "after": "" },
            { "title": "step by step in the browser", "before": view, "after": "" },
            { "title": "a film strip", "before": "mirrorstats world filmstrip ", "after": to_file },
        ])
    }

    fn runs(&self) -> String {
        let folder = |path: &str| path.rsplit_once('/').map_or(".", |(folder, _)| folder).to_owned();
        let mut named: BTreeSet<String> = self.paths.iter().cloned().collect();
        while named.len() > MOST_NAMED {
            let fewer: BTreeSet<String> = named.iter().map(|path| folder(path)).collect();
            if fewer == named {
                break;
            }
            named = fewer;
        }
        named.iter().map(|name| word(name)).collect::<Vec<_>>().join(" ")
    }
}

pub(super) fn quoted(id: &str) -> Option<String> {
    let word = word(id);
    (word != id).then_some(word)
}

/// A text as one shell word: bash and zsh read it back unchanged, and nothing in it acts or hides.
pub fn word(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:@%+,".contains(c);
    if !text.is_empty() && !text.starts_with('-') && text.chars().all(is_plain) {
        return text.to_owned();
    }
    if visible(text) == text {
        return format!("'{}'", text.replace('\'', r"'\''"));
    }
    let spelled = |c: char| match c {
        '\'' | '\\' => format!("\\{c}"),
        c if visible(c.encode_utf8(&mut [0; 4])) == c.to_string() => c.to_string(),
        c => format!("\\U{:08X}", u32::from(c)),
    };
    format!("$'{}'", text.chars().map(spelled).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::{Recordings, word};

    #[test]
    fn words_are_quoted_for_the_shell() {
        for (text, expected) in [
            ("E1/gpt-5-1/s1/r1", "E1/gpt-5-1/s1/r1"),
            ("a b", "'a b'"),
            ("$(rm -rf ~)", "'$(rm -rf ~)'"),
            ("it's", r"'it'\''s'"),
            ("", "''"),
            ("--json", "'--json'"),
            ("a\u{202e}b'c\n", r"$'a\U0000202Eb\'c\U0000000A'"),
        ] {
            assert_eq!(word(text), expected);
        }
    }

    #[test]
    fn many_files_are_named_by_their_folders() {
        let runs = |paths: &[&str]| {
            Recordings { paths: paths.iter().map(|path| (*path).to_owned()).collect(), definitions: None }.runs()
        };
        assert_eq!(runs(&["a.parquet"]), "a.parquet");
        assert_eq!(runs(&["x/a", "x/b", "x/c", "x/d"]), "x");
        assert_eq!(runs(&["x/a/1", "x/b/1", "y/a/1", "y/b/1", "y/b/2"]), "x y");
        assert_eq!(runs(&["a", "b", "c", "d"]), ".");
        assert_eq!(runs(&["my runs/a"]), "'my runs/a'");
    }
}
