//! Checks for contradictions in a file: prompt against reply, levels without a metric, coinciding colours, marks that
//! nothing shows.

use super::super::prompt::Templates;
use super::super::schema::ExperimentTable;
use super::super::spec::{BodyShown, MarkColor, Paint, PaneKind, Part, Spec, Wearer};
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_metric::file::Document;
use mirrorstats_toml_spec::{At, Fault};
use mirrorstats_trace::schema::colors::Color;

/// The words before a prompt's list of reply keys.
const EXACTLY: &str = "exactly these keys";

pub(super) fn prompt(spec: &Spec, templates: &Templates, at: &At<'_>, faults: &mut Vec<Fault>) {
    let texts: String = templates.all.iter().map(|(_, text)| text.as_str()).collect::<Vec<_>>().join("\n");
    let Some((_, list)) = texts.split_once(EXACTLY) else { return };
    let list = list.split_once('.').map_or(list, |(list, _)| list);
    // Every other piece between quotes is a key.
    let mut asked: Vec<&str> = list.split('"').skip(1).step_by(2).collect();
    if asked.is_empty() {
        return;
    }
    let mut reply = spec.keys();
    asked.sort_unstable();
    reply.sort_unstable();
    if asked != reply {
        let only = |some: &[&str], others: &[&str]| -> String {
            let only: Vec<&str> = some.iter().copied().filter(|key| !others.contains(key)).collect();
            if only.is_empty() { "none".to_owned() } else { only.join(", ") }
        };
        let message = format!(
            "the prompt asks for \"{EXACTLY}\", which are not those of a reply: only in the prompt {}, only in a reply {}",
            only(&asked, &reply),
            only(&reply, &asked)
        );
        let at = at.get("reply").unwrap_or_else(|| at.key("prompt"));
        faults.push(at.fault(message).help("choose another `prompt`, `reply` or `decision`, or correct the prompt"));
    }
}

/// Checks that each mark and each mirror appears before the last step.
pub(super) fn first_steps(table: &ExperimentTable, at: &At<'_>, faults: &mut Vec<Fault>) {
    let Some(steps) = table.steps else { return };
    let marks = table.mark.iter().enumerate().map(|(n, mark)| ("mark", n, Some(mark.from_t)));
    let mirrors = table.mirror.iter().enumerate().map(|(n, mirror)| ("mirror", n, mirror.from_t));
    for (list, n, from_t) in marks.chain(mirrors) {
        if let Some(from_t) = from_t.filter(|from_t| *from_t > steps) {
            let at = at.key(list).item(n).key("from_t");
            faults.push(at.fault(format!("`from_t` may be 1 to {steps}, but is {from_t}")));
        }
    }
}

/// Checks that a chance or reference level belongs to a metric, and is a probability for a rate.
pub(super) fn level(
    metric: &str,
    level: Option<Ratio>,
    at: &At<'_>,
    document: Option<&Document>,
    faults: &mut Vec<Fault>,
) {
    let Some(document) = document else { return };
    faults.extend(document.unknown_metric(metric, &at.name_place()));
    let is_rate = document.metrics.get(metric).is_some_and(|entry| entry.said.unit.as_deref() == Some("rate"));
    let improbable = |level: &Ratio| level.numerator() < 0 || level.numerator() > level.denominator();
    if let Some(level) = level.filter(|level| is_rate && improbable(level)) {
        let message = format!("the level of the rate `{metric}` is {level}; expected a fraction from 0 to 1");
        faults.push(at.fault(message));
    }
}

/// Rejects named colours that the body has in some episodes, where they would change the meaning.
pub(super) fn colors(spec: &Spec, at: &At<'_>, faults: &mut Vec<Fault>) {
    let is_bodys = |color: Color| spec.layout.palette.contains(&color);
    let mut refuse = |at: &At<'_>, color: Color, what: &str, instead: &str| {
        let name = color.name();
        let message = format!("in episodes whose body is {name}, {what}");
        faults.push(at.fault(message).help(format!("use `color = \"{instead}\"`, or a `palette` without {name}")));
    };
    for (n, pane) in spec.panes.iter().enumerate() {
        let is_of_own = pane.kind == PaneKind::Decoy && pane.body == BodyShown::Own;
        if let Paint::Named(color) = pane.color
            && is_of_own
            && is_bodys(color)
        {
            let at = at.key("mirror").item(n).key("color");
            refuse(&at, color, "this decoy is a mirror", "other");
        }
    }
    for (n, mark) in spec.marks.iter().enumerate() {
        if let MarkColor::Named(color) = mark.color
            && is_bodys(color)
        {
            let at = at.key("mark").item(n).key("color");
            refuse(&at, color, "this mark would not show", "random");
        }
    }
}

/// Checks that a mirror can show each mark on the own body to its wearer.
pub(super) fn marks(spec: &Spec, at: &At<'_>, faults: &mut Vec<Fault>) {
    let is_late = spec.panes.iter().any(|pane| pane.delay > 0);
    for (n, mark) in spec.marks.iter().enumerate() {
        if mark.part == Part::Back && mark.on == Wearer::Own && !is_late {
            let at = at.key("mark").item(n).key("part");
            let fault =
                at.fault("no mirror shows the back of a body to its bearer, who would have to look away from it");
            let help = "use `part = \"head\"` or `\"chest\"`, or a mirror with a `delay`: it shows the back to one who has turned round";
            faults.push(fault.help(help));
        }
    }
}
