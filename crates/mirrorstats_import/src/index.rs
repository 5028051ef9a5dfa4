//! The index of steps, and the check that episodes are complete: t = 1, 2, ... once each, with constant names.

use std::collections::HashMap;

use super::error::{Fault, Location};
use super::line::Line;
use super::text::Text;
use super::value::{LineValue, Members};
use mirrorstats_exact::escape::visible;
use mirrorstats_trace::schema::{COLUMNS, DeclaredColumn};

#[derive(Clone, Copy, Debug)]
pub(super) struct IndexedStep {
    pub(super) episode: usize,
    t: i64,
    pub(super) text: usize,
    pub(super) offset: u64,
    line: u64,
}

#[derive(Debug)]
struct Head {
    id: String,
    place: Location,
    constants: Vec<LineValue>,
}

#[derive(Debug)]
pub(super) struct Index {
    constants: Vec<String>,
    heads: Vec<Head>,
    by_id: HashMap<String, usize>,
    steps: Vec<IndexedStep>,
}

fn value<'a>(members: &'a Members, name: &str) -> &'a LineValue {
    members.iter().find(|(key, _)| key == name).map_or(&LineValue::Null, |(_, value)| value)
}

impl Index {
    pub(super) fn new(declared: &[DeclaredColumn]) -> Self {
        let known = COLUMNS.iter().filter(|column| column.constant && column.name != "episode_id");
        let declared = declared.iter().filter(|column| column.constant).map(|column| column.name.as_str());
        let constants = known.map(|column| column.name).chain(declared).map(str::to_owned).collect();
        Self { constants, heads: Vec::new(), by_id: HashMap::new(), steps: Vec::new() }
    }

    pub(super) fn add(&mut self, text: usize, line: &Line, members: &Members) -> Option<Fault> {
        let (LineValue::Text(id), LineValue::Int(t)) = (value(members, "episode_id"), value(members, "t")) else {
            return None;
        };
        let known = self.by_id.get(id).copied();
        let episode = known.unwrap_or_else(|| self.begin(id, line, members));
        self.steps.push(IndexedStep { episode, t: *t, text, offset: line.offset, line: line.place.line });
        let head = &self.heads[episode];
        let mut pairs = self.constants.iter().zip(&head.constants);
        pairs.find_map(|(column, first)| {
            let now = value(members, column);
            if now.is_same(first) {
                return None;
            }
            let expected = format!("{}, as in the episode's first line ({})", first.shown(), head.place);
            let help = "correct the lines, or give the episodes ids of their own";
            Some(Fault::new(expected, now.shown(), help).of_key(column).at(&line.place))
        })
    }

    fn begin(&mut self, id: &str, line: &Line, members: &Members) -> usize {
        let constants = self.constants.iter().map(|column| value(members, column).clone()).collect();
        self.heads.push(Head { id: id.to_owned(), place: line.place.clone(), constants });
        self.by_id.insert(id.to_owned(), self.heads.len() - 1);
        self.heads.len() - 1
    }

    /// The steps of each episode in turn, ordered by t; adds a fault for each incomplete episode.
    pub(super) fn into_steps(self, texts: &[Text], faults: &mut super::error::Faults) -> Vec<IndexedStep> {
        let Self { heads, mut steps, .. } = self;
        steps.sort_by_key(|step| (step.episode, step.t));
        for episode in steps.chunk_by(|a, b| a.episode == b.episode) {
            let id = &heads[episode[0].episode].id;
            faults.extend(sequence_fault(id, episode, texts));
        }
        steps
    }
}

fn sequence_fault(id: &str, episode: &[IndexedStep], texts: &[Text]) -> Option<Fault> {
    let place = |step: &IndexedStep| texts[step.text].place(step.line);
    let of = format!("of episode `{}`", visible(id));
    let mut before: Option<&IndexedStep> = None;
    for step in episode {
        let wanted = before.map_or(1, |before| before.t.saturating_add(1));
        let is_again = before.is_some_and(|before| before.t == step.t);
        if step.t == wanted && !is_again {
            before = Some(step);
            continue;
        }
        let (expected, words, help) = match before {
            None => {
                (format!("t = 1 as the first {of}"), String::new(), "add the first steps, or number the steps from 1")
            }
            Some(before) if is_again => (
                format!("one line for each t {of}"),
                format!(" again, as in {}", place(before)),
                "keep one line for each t",
            ),
            Some(before) => {
                let expected = format!("t = {wanted} {of}, one more than in {}", place(before));
                (expected, String::new(), "add the missing steps, or leave the episode out")
            }
        };
        let fault = Fault::new(expected, format!("t = {}{words}", step.t), help);
        return Some(fault.of_key("t").at(&place(step)));
    }
    None
}
