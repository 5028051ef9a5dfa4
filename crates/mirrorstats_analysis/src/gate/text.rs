//! The verdicts of a gate for people, for pages, and for CI programs.

use std::fmt::Write as _;

use super::{FlippedPair, Gate, GateCell, GateSide, GateVerdict, Played};
use crate::statistics::text::{beside, percent};
use crate::study::named;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::{UNDEFINED, fixed};
use mirrorstats_tables::{Table, escape_markdown, push_wrapped};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GateFormat {
    /// A table for a terminal of this width, and the flipped episodes.
    Text(Option<usize>),
    Markdown,
    /// Workflow commands of GitHub Actions, one line per cell.
    Github,
    /// `JUnit` XML: a regression is a failure, an incomparable cell an error, a cell without a verdict skipped.
    Junit,
}

/// The verdict for people, as a workflow command, and as an element of `JUnit`.
const fn spelled(verdict: GateVerdict) -> [&'static str; 3] {
    match verdict {
        GateVerdict::Improved => ["improved", "notice", "system-out"],
        GateVerdict::Held => ["held", "notice", "system-out"],
        GateVerdict::CannotSay => ["cannot say", "warning", "skipped"],
        GateVerdict::NotComparable => ["not comparable", "error", "error"],
        GateVerdict::Regressed => ["regressed", "error", "failure"],
    }
}

pub(super) const fn name(verdict: GateVerdict) -> &'static str {
    spelled(verdict)[0]
}

impl Gate {
    /// The verdicts in a format; the last line of text is a summary.
    pub fn render(&self, format: GateFormat) -> String {
        match format {
            GateFormat::Text(width) => self.text(width),
            GateFormat::Markdown => self.markdown(),
            GateFormat::Github => self.cells.iter().map(|cell| self.workflow_command(cell)).collect(),
            GateFormat::Junit => self.junit(),
        }
    }

    fn title(&self) -> String {
        format!("{}, margin {}, {} confidence", self.metric, self.margin, percent(self.confidence))
    }

    fn count(&self, verdict: GateVerdict) -> usize {
        self.cells.iter().filter(|cell| cell.verdict == verdict).count()
    }

    fn table(&self) -> Table {
        let texts = ["experiment", "model", "verdict", "why"];
        let rows = self.cells.iter().map(|cell| {
            let sides = [side(cell.base), side(cell.new)];
            let numbers = [fixed(cell.difference, 3), cell.flips.len().to_string()];
            let names = [cell.experiment.clone(), cell.name(), name(cell.verdict).to_owned(), cell.why.clone()];
            names.into_iter().chain(sides).chain(numbers).collect::<Vec<_>>()
        });
        Table::plain(&texts, &["base", "new", "difference", "flips"]).with(rows)
    }

    fn text(&self, width: Option<usize>) -> String {
        let mut text = self.table().titled(self.title()).within(width);
        for cell in self.cells.iter().filter(|cell| !cell.flips.is_empty()) {
            let _ = writeln!(text, "\n{}, {}: flipped episodes", visible(&cell.experiment), visible(&cell.name()));
            for flip in &cell.flips {
                push_wrapped(&mut text, &format!("  - {}", visible(&words(flip))), width, 4);
            }
        }
        for sentence in &self.caveats {
            text.push('\n');
            push_wrapped(&mut text, &visible(sentence), width, 0);
        }
        let _ = writeln!(text, "\n{}", self.sum());
        text
    }

    fn markdown(&self) -> String {
        let mut text = self.table().titled(self.title()).markdown();
        let cells = self.cells.iter().flat_map(|cell| cell.flips.iter().map(move |flip| (cell, flip)));
        for (at, (cell, flip)) in cells.enumerate() {
            let about = format!("{}, {}: {}", cell.experiment, cell.name(), words(flip));
            let _ = writeln!(text, "{}- {}", if at == 0 { "\n" } else { "" }, escape_markdown(&visible(&about)));
        }
        for sentence in &self.caveats {
            let _ = writeln!(text, "\n{}", escape_markdown(&visible(sentence)));
        }
        text + "\n" + &self.sum() + "\n"
    }

    fn workflow_command(&self, cell: &GateCell) -> String {
        let [name, command, _] = spelled(cell.verdict);
        let data = |text: &str| visible(text).replace('%', "%25");
        let title = format!("{} {} {}: {name}", cell.experiment, cell.name(), self.metric);
        let title = data(&title).replace(':', "%3A").replace(',', "%2C");
        let lines = std::iter::once(self.sentence(cell)).chain(cell.flips.iter().map(words));
        let message = lines.map(|line| data(&line)).collect::<Vec<_>>().join("%0A");
        format!("::{command} title={title}::{message}\n")
    }

    fn junit(&self) -> String {
        let counts = format!(
            "tests=\"{}\" failures=\"{}\" errors=\"{}\" skipped=\"{}\"",
            self.cells.len(),
            self.count(GateVerdict::Regressed),
            self.count(GateVerdict::NotComparable),
            self.count(GateVerdict::CannotSay)
        );
        let cases: String = self.cells.iter().map(|cell| self.test_case(cell)).collect();
        let title = xml(&self.title());
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"mirrorstats gate\" {counts}>\n  \
             <testsuite name=\"{title}\" {counts}>\n{cases}  </testsuite>\n</testsuites>\n"
        )
    }

    fn test_case(&self, cell: &GateCell) -> String {
        let head = format!(
            "    <testcase classname=\"{}\" name=\"{} {}\"",
            xml(&cell.experiment),
            xml(&cell.name()),
            xml(&self.metric)
        );
        let [.., element] = spelled(cell.verdict);
        let flips: Vec<String> = cell.flips.iter().map(|flip| xml(&words(flip))).collect();
        let sentence = xml(&self.sentence(cell));
        let inner = if element == "system-out" {
            format!("<system-out>{}</system-out>", [vec![sentence], flips].concat().join("\n"))
        } else {
            format!("<{element} message=\"{sentence}\">{}</{element}>", flips.join("\n"))
        };
        format!("{head}>{inner}</testcase>\n")
    }

    fn sentence(&self, cell: &GateCell) -> String {
        let own = format!("{}: {}; base {}, new {}.", name(cell.verdict), cell.why, side(cell.base), side(cell.new));
        std::iter::once(&own).chain(&self.caveats).cloned().collect::<Vec<_>>().join(" ")
    }

    fn sum(&self) -> String {
        let order = [
            GateVerdict::Improved,
            GateVerdict::Held,
            GateVerdict::Regressed,
            GateVerdict::NotComparable,
            GateVerdict::CannotSay,
        ];
        let counts =
            order.into_iter().map(|verdict| (self.count(verdict), name(verdict))).filter(|(count, _)| *count > 0);
        let counts: Vec<String> = counts.map(|(count, name)| format!("{count} {name}")).collect();
        format!("verdict: {}; cells: {}", name(self.verdict), counts.join(", "))
    }
}

impl GateCell {
    /// The model and its condition, with the model's earlier name if it differs.
    pub fn name(&self) -> String {
        let model = named(&self.model, self.condition.as_deref());
        self.base_model.as_ref().map_or_else(|| model.clone(), |base| format!("{model} (was {base})"))
    }
}

fn side(side: GateSide) -> String {
    let lost = if side.lost > 0 { format!(" ({} lost)", side.lost) } else { String::new() };
    let counted = match (side.successes, side.n) {
        (_, 0) => UNDEFINED.to_owned(),
        (Some(successes), n) => beside(&format!("{successes}/{n}"), side.unit_mean, 3),
        (None, n) => beside(&format!("{} (n = {n})", fixed(side.mean, 1)), side.unit_mean, 1),
    };
    counted + &lost
}

/// `E1/ant/s1/r2 1 (step 4) -> E1/ant/s1/r2 0 (step 7)`.
fn words(flip: &FlippedPair) -> String {
    let played = |played: &Played| {
        let steps = played.timesteps.as_ref().filter(|steps| !steps.is_empty()).map_or_else(String::new, |steps| {
            let noun = if steps.len() == 1 { "step" } else { "steps" };
            format!(" ({noun} {})", steps.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "))
        });
        format!("{} {}{steps}", played.episode_id, played.value)
    };
    format!("{} -> {}", played(&flip.base), played(&flip.new))
}

/// Text escaped for XML; characters that XML forbids are spelled out.
fn xml(text: &str) -> String {
    let text = visible(text);
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
