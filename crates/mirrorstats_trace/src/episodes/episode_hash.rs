//! The hash of an episode's rows: equal in its trace and its log, so that mismatches are found.
//!
//! The rows are hashed in a separate form that does not depend on their storage; the schema's text of the column
//! describes it.
//!
//! Rule: later versions of the schema give today's episodes the same hash. Columns without
//! values and derived columns are therefore left out.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write as _;

use sha2::{Digest as _, Sha256};

use crate::episodes::answers::Answered;
use crate::episodes::episode::Episode;
use crate::schema::{self, COLUMNS, Value};
use mirrorstats_exact::hash::hex;

pub(crate) const EPISODE_HASH: &str = "episode_hash";
/// An attribution, derived from a text if there is one.
pub(crate) const SELF_COLOR: &str = "self_color";
pub(crate) const IDENTIFICATION: &str = "identification";

/// The hash of an episode, 64 hexadecimal digits; ignores the field for the hash.
pub fn hash_of(episode: &Episode) -> String {
    let (mut form, mut lines) = (CanonicalForm::new(), Vec::new());
    for column in columns().filter_map(schema::column) {
        let derived = |at: usize| column.name == SELF_COLOR && episode.steps[at].extra.identification.is_some();
        let values = column.of_steps(episode).enumerate();
        form.add(&mut lines, column.name, values.map(|(at, value)| value.filter(|_| !derived(at))));
    }
    let answers = || episode.steps.iter().map(|step| &step.extra.answers);
    let names: BTreeSet<&String> = answers().flat_map(BTreeMap::keys).collect();
    for name in names {
        form.add(&mut lines, name, answers().map(|cells| cells.get(name).map(Answered::value)));
    }
    form.finish()
}

pub(crate) fn columns() -> impl Iterator<Item = &'static str> {
    let mut names: Vec<_> = COLUMNS.iter().map(|column| column.name).collect();
    names.retain(|name| !["t", EPISODE_HASH].contains(name));
    names.sort_unstable();
    names.into_iter()
}

pub(crate) struct CanonicalForm(Sha256);

impl CanonicalForm {
    pub(crate) fn new() -> Self {
        Self(Sha256::new_with_prefix("mirrorstats.episode 1\n"))
    }

    /// Adds a column; `lines` is room for its text.
    pub(crate) fn add<'a>(&mut self, lines: &mut Vec<u8>, name: &str, values: impl Iterator<Item = Option<Value<'a>>>) {
        lines.clear();
        lines.extend_from_slice(format!("column {name}\n").as_bytes());
        let (mut run, mut has_value) = (None, false);
        for value in values {
            has_value |= value.is_some();
            run = match run {
                Some((before, count)) if same(before, value) => Some((before, count + 1)),
                before => {
                    line(lines, before);
                    Some((value, 1))
                }
            };
        }
        line(lines, run);
        if has_value {
            self.0.update(&lines);
        }
    }

    pub fn finish(self) -> String {
        hex(&self.0.finalize())
    }
}

fn line(lines: &mut Vec<u8>, run: Option<(Option<Value<'_>>, usize)>) {
    let Some((value, count)) = run else { return };
    let written = match value {
        None => writeln!(lines, "{count} null"),
        Some(Value::Bool(truth)) => writeln!(lines, "{count} {truth}"),
        Some(Value::Int(number)) => writeln!(lines, "{count} {number}"),
        Some(Value::Float(number)) => writeln!(lines, "{count} {:016x}", number.to_bits()),
        Some(Value::Text(text)) => writeln!(lines, "{count} {}:{text}", text.len()),
    };
    written.expect("a vector takes all bytes");
}

/// Returns true if two values have the same bits.
pub(crate) fn same(a: Option<Value<'_>>, b: Option<Value<'_>>) -> bool {
    match (a, b) {
        (Some(Value::Float(a)), Some(Value::Float(b))) => a.to_bits() == b.to_bits(),
        _ => a == b,
    }
}

#[cfg(test)]
mod tests {
    use super::{columns, hash_of};
    use crate::episodes::episode::{Action, Episode, Extra, Step};
    use mirrorstats_exact::hash::of_bytes;

    fn step(t: i32) -> Step {
        Step {
            action: Some(Action::TurnLeft),
            self_color: (t > 1).then(|| "red".to_owned()),
            mirror_visible: t == 3,
            extra: Extra { pose_x: Some(0.5), ..Extra::default() },
            ..Step::default()
        }
    }

    fn episode() -> Episode {
        Episode {
            episode_id: "ä".into(),
            model: "m".into(),
            experiment: "E1".into(),
            seed: -1,
            run: 2,
            body_color: "red".into(),
            steps: (1..=3).map(step).collect(),
            ..Episode::default()
        }
    }

    #[test]
    fn the_hashed_text_has_the_documented_form() {
        let lines = "mirrorstats.episode 1\n\
            column action\n3 9:turn_left\n\
            column body_color\n3 3:red\n\
            column episode_id\n3 2:ä\n\
            column experiment\n3 2:E1\n\
            column mirror_visible\n2 false\n1 true\n\
            column model\n3 1:m\n\
            column pose_x\n3 3fe0000000000000\n\
            column run\n3 2\n\
            column seed\n3 -1\n\
            column self_color\n1 null\n2 3:red\n";
        assert_eq!(hash_of(&episode()), of_bytes(lines.as_bytes()));
    }

    #[test]
    fn derived_attributions_and_the_hash_itself_are_not_hashed() {
        let mut with_text = episode();
        with_text.steps[1].extra.identification = Some("red one".into());
        let hash = hash_of(&with_text);
        with_text.steps[1].self_color = None;
        with_text.episode_hash = Some(hash.clone());
        assert_eq!(hash_of(&with_text), hash);
        with_text.steps[2].self_color = None;
        assert_ne!(hash_of(&with_text), hash);
    }

    #[test]
    fn every_value_and_its_row_are_hashed() {
        let hash = hash_of(&episode());
        let change = |change: fn(&mut Episode)| {
            let mut changed = episode();
            change(&mut changed);
            hash_of(&changed)
        };
        let changes: [fn(&mut Episode); 5] = [
            |episode| episode.steps.swap(0, 2),
            |episode| drop(episode.steps.pop()),
            |episode| episode.steps[0].extra.pose_x = Some(-0.5),
            |episode| episode.steps[0].extra.reply = Some(String::new()),
            |episode| episode.repetition = Some(1),
        ];
        for (at, changed) in changes.into_iter().enumerate() {
            assert_ne!(change(changed), hash, "{at}");
        }
    }

    #[test]
    fn columns_are_hashed_by_name() {
        let names: Vec<_> = columns().collect();
        assert!(names.is_sorted() && !names.contains(&"t") && names.contains(&"action"));
    }
}
