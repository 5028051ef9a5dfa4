//! Attributions of old traces made anew: `self_color` from the text of `identification`, by the rule of this program.
//!
//! Rule: a step without a text keeps what it has; every step whose attribution changes is a flip, and told.

use std::io::Write;

use serde_json::{Map, Value};

use super::diagnostic::{Code, Finding};
use super::error::TraceError;
use super::identification::{VERSION, normal_form};
use super::inputs::Input;
use super::open::{TraceFile, TraceSet};
use super::schema::RECORDING_KEY;
use super::write::rewrite::{Before, rewrite};

/// The free text, as replied.
const SOURCE: &str = "identification";
const TARGET: &str = "self_color";
/// The key of a recording that tells the version of the rule.
const VERSION_KEY: &str = "identification_version";

/// An attribution that changes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flip {
    /// The episode.
    pub episode_id: String,
    /// The timestep.
    pub t: i64,
    /// The attribution that the trace has.
    pub before: Option<String>,
    /// The attribution by the rule of this program.
    pub after: Option<String>,
    /// The text behind both.
    pub identification: String,
}

/// What a trace's texts give.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Renormalized {
    /// The version of the rule that the recording tells, if it tells any.
    pub version_before: Option<String>,
    /// How many steps the trace has.
    pub steps: u64,
    /// How many of them have a text.
    pub texts: u64,
    /// The steps that change, in the order of the trace.
    pub flips: Vec<Flip>,
}

/// A trace whose attributions can be made anew.
#[derive(Debug)]
pub struct Old {
    set: TraceSet,
    recording: Value,
}

impl Old {
    pub fn open(input: &Input) -> Result<Self, TraceError> {
        let file = TraceFile::open(input).map_err(|findings| match TraceError::of(findings) {
            Some(error) => error,
            None => unexplained(input),
        })?;
        if file.column(SOURCE).is_none() {
            let finding = Finding::new(Code::MissingColumn, &input.name, "a column of texts to read", "none");
            let help = "the trace keeps no text behind its attributions: leave it out";
            return Err(finding.in_column(SOURCE).with_help(help).into());
        }
        let text = file.metadata_value(RECORDING_KEY).unwrap_or("{}");
        let Ok(recording @ Value::Object(_)) = serde_json::from_str(text) else {
            let expected = format!("a JSON object as `{RECORDING_KEY}`");
            let finding = Finding::new(Code::InvalidMetadata, &input.name, expected, "something else");
            return Err(finding.with_help("correct or remove that key in the footer").into());
        };
        Ok(Self { set: TraceSet::of(vec![file]), recording })
    }

    /// Writes the trace with its attributions made anew, all else as it is, to `out`.
    pub fn renormalize<W: Write + Send>(&self, out: W) -> Result<(W, Renormalized), TraceError> {
        let mut recording = self.recording.clone();
        let mut result = Renormalized { version_before: put_version(&mut recording), ..Renormalized::default() };
        let out = rewrite(&self.set, [SOURCE, TARGET], |step| result.attribution(step), &recording, out)?;
        Ok((out, result))
    }
}

impl Renormalized {
    /// The attribution of a step, noted if it is another one than before.
    fn attribution(&mut self, (episode_id, t, source, target): Before<'_>) -> Option<String> {
        self.steps += 1;
        let before = target.map(str::to_owned);
        let Some(text) = source else { return before };
        self.texts += 1;
        let after = normal_form(text).map(str::to_owned);
        if before != after {
            let (episode_id, identification) = (episode_id.to_owned(), text.to_owned());
            self.flips.push(Flip { episode_id, t, before, after: after.clone(), identification });
        }
        after
    }
}

/// Writes the version of the rule to where a recording tells it, else beside its other keys; what stood there before.
fn put_version(recording: &mut Value) -> Option<String> {
    let text = |value: Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    if let Some(place) = find(recording) {
        return Some(text(std::mem::replace(place, VERSION.into())));
    }
    recording[VERSION_KEY] = VERSION.into();
    None
}

/// The first place that tells the version.
fn find(value: &mut Value) -> Option<&mut Value> {
    let members: &mut Map<String, Value> = value.as_object_mut()?;
    if members.contains_key(VERSION_KEY) {
        return members.get_mut(VERSION_KEY);
    }
    members.iter_mut().find_map(|(_, inner)| find(inner))
}

fn unexplained(input: &Input) -> TraceError {
    Finding::new(Code::Unreadable, &input.name, "a trace that can be opened", "one that cannot").into()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::{VERSION, put_version};

    #[test]
    fn the_version_is_replaced_where_it_stands() {
        let mut recording = json!({ "version": 1, "agent": { "vlm": { "id": "x", "identification_version": "0" } } });
        assert_eq!(put_version(&mut recording), Some("0".to_owned()));
        assert_eq!(recording["agent"]["vlm"]["identification_version"], VERSION);
        assert_eq!(recording.as_object().unwrap().len(), 2);
    }

    #[test]
    fn a_recording_that_tells_none_is_told_it() {
        let mut recording = json!({ "kind": "import" });
        assert_eq!(put_version(&mut recording), None);
        assert_eq!(recording, json!({ "kind": "import", "identification_version": VERSION }));
        assert_eq!(put_version(&mut recording), Some(VERSION.to_owned()));
    }
}
