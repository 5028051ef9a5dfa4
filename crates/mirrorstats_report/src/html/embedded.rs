//! The data of the page's script: metrics, groups, episodes and tests as JSON inside a `<script>` element.
//!
//! Rule: the JSON has no `<`, `>` or `&`, so it cannot end the element or begin a comment. Integers that JavaScript
//! would round are strings.

use std::collections::BTreeMap;

use serde::{Serialize, Serializer};
use serde_json::Value as Json;

use super::command::{Recordings, quoted};
use super::filter::shown;
use super::pair::pairs;
use super::{HtmlError, Page};
use mirrorstats_exact::escape::visible;

/// JavaScript's largest safe integer: it represents all smaller ones exactly.
const LARGEST_SAFE: u64 = (1 << 53) - 1;

#[derive(Debug, Serialize)]
struct Embedded<'a> {
    undefined: &'a str,
    metrics: BTreeMap<&'a str, &'a Json>,
    groups: Vec<String>,
    episodes: EmbeddedEpisodes,
    commands: Json,
    pairs: Json,
}

#[derive(Debug, Serialize)]
struct EmbeddedEpisodes {
    id: Vec<String>,
    word: BTreeMap<usize, String>,
    seed: Vec<i32>,
    run: Vec<i32>,
    group: Vec<usize>,
    values: BTreeMap<String, Vec<Option<Integer>>>,
}

/// An integer that JavaScript gets exactly.
#[derive(Clone, Copy, Debug)]
struct Integer(i64);

impl Serialize for Integer {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.unsigned_abs() <= LARGEST_SAFE {
            serializer.serialize_i64(self.0)
        } else {
            serializer.collect_str(&self.0)
        }
    }
}

pub(super) fn json(page: &Page<'_>, metrics: &[Json], undefined: &str) -> Result<String, HtmlError> {
    let Page { episodes, cells, .. } = *page;
    let label = |key: &[_]| key.iter().map(|value| shown(value, undefined)).collect::<Vec<_>>().join(" · ");
    let undefined = visible(undefined);
    let embedded = Embedded {
        undefined: &undefined,
        metrics: metrics.iter().filter_map(|metric| Some((metric["name"].as_str()?, metric))).collect(),
        groups: cells.groups.iter().map(|group| label(&group.key)).collect(),
        episodes: EmbeddedEpisodes {
            id: episodes.keys.iter().map(|key| visible(key.episode_id)).collect(),
            word: (episodes.keys.iter().enumerate())
                .filter_map(|(at, key)| Some((at, quoted(key.episode_id)?)))
                .collect(),
            seed: episodes.keys.iter().map(|key| key.seed).collect(),
            run: episodes.keys.iter().map(|key| key.run).collect(),
            group: cells.membership(episodes)?,
            values: episodes
                .metrics
                .iter()
                .map(|column| (visible(&column.name), column.iter().map(|value| value.map(Integer)).collect()))
                .collect(),
        },
        commands: page.recordings.map_or_else(|| Json::Array(Vec::new()), Recordings::commands),
        pairs: pairs(page.statistics),
    };
    let json =
        serde_json::to_string(&embedded).expect("strings, integers and maps with names as keys have a JSON text");
    Ok(inert(&json))
}

fn inert(json: &str) -> String {
    json.replace('&', "\\u0026").replace('<', "\\u003c").replace('>', "\\u003e")
}

#[cfg(test)]
mod tests {
    use super::{Integer, inert};

    #[test]
    fn embedded_text_cannot_close_its_element() {
        for text in ["</script>", "<!--<script>", "a & b", "]]>", "\\u003c", "plain"] {
            let json = inert(&serde_json::to_string(text).unwrap());
            assert!(!json.contains(['<', '>', '&']), "{json}");
            assert_eq!(serde_json::from_str::<String>(&json).unwrap(), text);
        }
    }

    #[test]
    fn integers_beyond_those_of_javascript_are_strings() {
        for (value, expected) in [
            (9_007_199_254_740_991, "9007199254740991"),
            (9_007_199_254_740_992, "\"9007199254740992\""),
            (-9_007_199_254_740_991, "-9007199254740991"),
            (i64::MIN, "\"-9223372036854775808\""),
        ] {
            assert_eq!(serde_json::to_string(&Integer(value)).unwrap(), expected);
        }
    }
}
