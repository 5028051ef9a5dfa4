//! The index of steps, and the check that episodes are complete: t = 1, 2, ... once each, with constant names.

use arrow::array::{ArrayRef, RecordBatch};
use indexmap::IndexMap;

use super::arrays::changes;
use super::error::{Fault, Faults, Location};
use super::mapping::Order;
use super::text::Text;
use super::value::Cell;
use mirrorstats_exact::escape::visible;
use mirrorstats_trace::schema::{COLUMNS, DeclaredColumn, Kind};

/// Steps of an episode by their place: rows one after the other in a batch of a text.
///
/// Most files have whole episodes in order, so that runs of steps take far less memory than steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct IndexedSteps {
    pub(super) episode: u32,
    /// The number of the first step. The numbers of the others follow, or are the same if the rows alone have an order.
    t: i64,
    pub(super) text: u32,
    pub(super) batch: u32,
    pub(super) row: u32,
    pub(super) rows: u32,
}

#[derive(Debug)]
struct Head {
    place: Location,
    constants: Vec<Cell<'static>>,
}

#[derive(Debug)]
pub(super) struct Index {
    constants: Vec<(String, Kind)>,
    heads: IndexMap<String, Head>,
    steps: Vec<IndexedSteps>,
}

impl Index {
    pub(super) fn new(declared: &[DeclaredColumn]) -> Self {
        let known = COLUMNS.iter().filter(|column| column.constant && column.name != "episode_id");
        let known = known.map(|column| (column.name.to_owned(), column.stored.kind()));
        let declared = declared.iter().filter(|column| column.constant);
        let declared = declared.map(|column| (column.name.clone(), column.kind));
        Self { constants: known.chain(declared).collect(), heads: IndexMap::new(), steps: Vec::new() }
    }

    /// Adds the rows of a batch without those that have a fault; returns the rows whose constants change.
    pub(super) fn add(
        &mut self,
        (text, batch, order): (usize, usize, Order),
        rows: &RecordBatch,
        place: impl Fn(usize) -> Location,
        is_faulty: impl Fn(usize) -> bool,
    ) -> Vec<(usize, Fault)> {
        let (Some(ids), Some(ts)) = (rows.column_by_name("episode_id"), rows.column_by_name("t")) else {
            return Vec::new();
        };
        let constants: Vec<_> = self.constants.iter().map(|(name, kind)| (rows.column_by_name(name), *kind)).collect();
        let compared = constants.iter().filter_map(|(column, _)| *column);
        // Rows that repeat the one before belong to the same episode and have the same constants.
        let is_new = compared.map(changes).fold(changes(ids), |one, other| &one | &other);
        let (mut faults, mut verdict) = (Vec::new(), None);
        let (mut current, mut is_due) = (None, false);
        for row in 0..rows.num_rows() {
            is_due |= is_new.value(row);
            let Cell::Int(t) = Cell::at(ts, row).typed(Kind::Int) else { continue };
            if is_faulty(row) {
                continue;
            }
            if is_due {
                current = self.episode(ids, &constants, row, &place);
                verdict = current.and_then(|episode| self.changed(episode, &constants, row));
                is_due = false;
            }
            let Some(episode) = current else { continue };
            faults.extend(verdict.clone().map(|fault| (row, fault)));
            let [text, batch, row] = [text, batch, row].map(narrow);
            self.push(IndexedSteps { episode, t, text, batch, row, rows: 1 }, order);
        }
        faults
    }

    /// The episode of a row; `None` if its id is no text.
    fn episode(
        &mut self,
        ids: &ArrayRef,
        constants: &[(Option<&ArrayRef>, Kind)],
        row: usize,
        place: &dyn Fn(usize) -> Location,
    ) -> Option<u32> {
        let Cell::Text(id) = Cell::at(ids, row).typed(Kind::String) else { return None };
        let known = self.heads.get_index_of(&*id);
        Some(narrow(known.unwrap_or_else(|| {
            let constants = constants.iter().map(|column| constant(*column, row).into_owned()).collect();
            self.heads.insert_full(id.into_owned(), Head { place: place(row), constants }).0
        })))
    }

    /// The fault of the first constant that differs from that in the episode's first row.
    fn changed(&self, episode: u32, constants: &[(Option<&ArrayRef>, Kind)], row: usize) -> Option<Fault> {
        let head = &self.heads[episode as usize];
        let mut compared = self.constants.iter().zip(constants).zip(&head.constants);
        compared.find_map(|((name, column), first)| {
            let now = constant(*column, row);
            let expected = || format!("{}, as in the episode's first line ({})", first.shown(), head.place);
            let help = "correct the lines, or give the episodes ids of their own";
            (!now.is_same(first)).then(|| Fault::new(expected(), now.shown(), help).of_key(&name.0))
        })
    }

    /// Adds a step to the run before, if it follows there.
    fn push(&mut self, step: IndexedSteps, order: Order) {
        if let Some(last) = self.steps.last_mut()
            && (last.episode, last.text, last.batch) == (step.episode, step.text, step.batch)
            && last.row + last.rows == step.row
            && last.number(last.rows, order) == Some(step.t)
        {
            last.rows += 1;
        } else {
            self.steps.push(step);
        }
    }

    /// The steps of each episode in turn, in their order; adds a fault for each incomplete episode.
    pub(super) fn into_steps(self, texts: &[Text], faults: &mut Faults) -> Vec<IndexedSteps> {
        let Self { heads, mut steps, .. } = self;
        steps.sort_unstable();
        for episode in steps.chunk_by(|a, b| a.episode == b.episode) {
            if !is_complete(episode, texts) {
                let (id, _) = heads.get_index(episode[0].episode as usize).expect("each step is of a known episode");
                faults.extend(sequence_fault(id, episode, texts));
            }
        }
        steps
    }
}

impl IndexedSteps {
    /// The number of the step after this many others.
    fn number(&self, after: u32, order: Order) -> Option<i64> {
        if order == Order::Rows { Some(self.t) } else { self.t.checked_add(i64::from(after)) }
    }

    /// Each of the steps.
    fn each(self, order: Order) -> impl Iterator<Item = Self> {
        let step = move |after| Self {
            t: self.number(after, order).unwrap_or(i64::MAX),
            row: self.row + after,
            rows: 1,
            ..self
        };
        (0..self.rows).map(step)
    }
}

fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("an index of less than 4 billion entries fits into memory")
}

fn constant((column, kind): (Option<&ArrayRef>, Kind), row: usize) -> Cell<'_> {
    column.map_or(Cell::Null, |column| Cell::at(column, row).typed(kind))
}

fn order_of(text: &Text) -> Order {
    text.read.as_ref().map_or(Order::Numbers, |read| read.order)
}

/// Returns true if the numbers run from 1 without a gap or a repetition, which is so in most files.
fn is_complete(episode: &[IndexedSteps], texts: &[Text]) -> bool {
    let order = |steps: &IndexedSteps| order_of(&texts[steps.text as usize]);
    let mut next = Some(1);
    episode.iter().all(|steps| {
        let is_next = order(steps) == Order::Numbers && next == Some(steps.t);
        next = steps.number(steps.rows, order(steps));
        is_next
    })
}

fn sequence_fault(id: &str, episode: &[IndexedSteps], texts: &[Text]) -> Option<Fault> {
    let text = |step: &IndexedSteps| &texts[step.text as usize];
    let place = |step: &IndexedSteps| text(step).place(step.batch as usize, step.row as usize);
    let of = format!("of episode `{}`", visible(id));
    let order = order_of(text(episode.first()?));
    let mut steps: Vec<_> = episode.iter().flat_map(|steps| steps.each(order_of(text(steps)))).collect();
    steps.sort_unstable();
    let mut before: Option<&IndexedSteps> = None;
    for step in &steps {
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
