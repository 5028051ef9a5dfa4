//! The index of steps, and the check that episodes are complete: t = 1, 2, ... once each, with constant names.

use std::collections::HashMap;

use arrow::array::{ArrayRef, RecordBatch};

use super::error::{Fault, Faults, Location};
use super::mapping::Order;
use super::text::Text;
use super::value::Cell;
use mirrorstats_exact::escape::visible;
use mirrorstats_trace::schema::{COLUMNS, DeclaredColumn, Kind};

/// A step by its place: the batch of a text, and the row in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct IndexedStep {
    pub(super) episode: u32,
    t: i64,
    pub(super) text: u32,
    pub(super) batch: u32,
    pub(super) row: u32,
}

#[derive(Debug)]
struct Head {
    id: String,
    place: Location,
    constants: Vec<Cell<'static>>,
}

#[derive(Debug)]
pub(super) struct Index {
    constants: Vec<(String, Kind)>,
    heads: Vec<Head>,
    by_id: HashMap<String, u32>,
    steps: Vec<IndexedStep>,
}

impl Index {
    pub(super) fn new(declared: &[DeclaredColumn]) -> Self {
        let known = COLUMNS.iter().filter(|column| column.constant && column.name != "episode_id");
        let known = known.map(|column| (column.name.to_owned(), column.stored.kind()));
        let declared = declared.iter().filter(|column| column.constant);
        let declared = declared.map(|column| (column.name.clone(), column.kind));
        Self { constants: known.chain(declared).collect(), heads: Vec::new(), by_id: HashMap::new(), steps: Vec::new() }
    }

    /// Adds the rows of a batch without those that have a fault; returns the rows whose constants change.
    pub(super) fn add(
        &mut self,
        (text, batch): (usize, usize),
        rows: &RecordBatch,
        place: impl Fn(usize) -> Location,
        is_faulty: impl Fn(usize) -> bool,
    ) -> Vec<(usize, Fault)> {
        let (Some(ids), Some(ts)) = (rows.column_by_name("episode_id"), rows.column_by_name("t")) else {
            return Vec::new();
        };
        let constants: Vec<_> = self.constants.iter().map(|(name, kind)| (rows.column_by_name(name), *kind)).collect();
        let mut faults = Vec::new();
        for row in (0..rows.num_rows()).filter(|row| !is_faulty(*row)) {
            let (Cell::Text(id), Cell::Int(t)) =
                (Cell::at(ids, row).typed(Kind::String), Cell::at(ts, row).typed(Kind::Int))
            else {
                continue;
            };
            let known = self.by_id.get(&*id).copied();
            let episode = known.unwrap_or_else(|| {
                let constants = constants.iter().map(|column| constant(*column, row).into_owned()).collect();
                self.heads.push(Head { id: id.to_string(), place: place(row), constants });
                let episode = narrow(self.heads.len() - 1);
                self.by_id.insert(id.to_string(), episode);
                episode
            });
            let [text, batch, at] = [text, batch, row].map(narrow);
            self.steps.push(IndexedStep { episode, t, text, batch, row: at });
            let head = &self.heads[episode as usize];
            let changed =
                self.constants.iter().zip(&constants).zip(&head.constants).find_map(|((name, column), first)| {
                    let now = constant(*column, row);
                    let expected = || format!("{}, as in the episode's first line ({})", first.shown(), head.place);
                    let help = "correct the lines, or give the episodes ids of their own";
                    (!now.is_same(first)).then(|| Fault::new(expected(), now.shown(), help).of_key(&name.0))
                });
            faults.extend(changed.map(|fault| (row, fault)));
        }
        faults
    }

    /// The steps of each episode in turn, in their order; adds a fault for each incomplete episode.
    pub(super) fn into_steps(self, texts: &[Text], faults: &mut Faults) -> Vec<IndexedStep> {
        let Self { heads, mut steps, .. } = self;
        steps.sort_unstable();
        for episode in steps.chunk_by(|a, b| a.episode == b.episode) {
            faults.extend(sequence_fault(&heads[episode[0].episode as usize].id, episode, texts));
        }
        steps
    }
}

fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("an index of less than 4 billion entries fits into memory")
}

fn constant((column, kind): (Option<&ArrayRef>, Kind), row: usize) -> Cell<'_> {
    column.map_or(Cell::Null, |column| Cell::at(column, row).typed(kind))
}

fn sequence_fault(id: &str, episode: &[IndexedStep], texts: &[Text]) -> Option<Fault> {
    let text = |step: &IndexedStep| &texts[step.text as usize];
    let place = |step: &IndexedStep| text(step).place(step.batch as usize, step.row as usize);
    let of = format!("of episode `{}`", visible(id));
    let order = text(episode.first()?).read.as_ref().map_or(Order::Numbers, |read| read.order);
    let mut before: Option<&IndexedStep> = None;
    for step in episode {
        let wanted = before.map_or(1, |before| before.t.saturating_add(1));
        let is_again = before.is_some_and(|before| before.t == step.t);
        let is_right = match order {
            Order::Numbers => step.t == wanted && !is_again,
            Order::Column => !is_again,
            Order::Rows => true,
        };
        if is_right {
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
