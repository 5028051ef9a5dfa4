use super::super::spec::{Answer, AnswerType, Fact, PaneKind, ReplyKey, Spec, UNKNOWN};
use mirrorstats_toml_spec::{At, Fault};
use mirrorstats_trace::episodes::answers::{MOST_ANSWERS, columns_of};
use mirrorstats_trace::schema::colors::spelling;

/// The maximum number of characters of a key, and of an option.
const LONGEST: [usize; 2] = [24, 40];
const MOST_OPTIONS: usize = 12;

pub(super) fn check(answers: &[Answer], at: &At<'_>, faults: &mut Vec<Fault>) {
    if answers.len() > MOST_ANSWERS {
        faults.push(at.fault(format!("at most {MOST_ANSWERS} answers, found {}", answers.len())));
    }
    for (n, answer) in answers.iter().enumerate() {
        let at = at.item(n);
        key(answer, &answers[..n], &at.key("key"), faults);
        options(answer, &at, faults);
        truth(answer, &at, faults);
    }
}

fn key(answer: &Answer, before: &[Answer], at: &At<'_>, faults: &mut Vec<Fault>) {
    let key = &answer.key;
    let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    let begins = key.chars().next().is_some_and(|first| first.is_ascii_lowercase());
    if !begins || key.len() > LONGEST[0] || !key.chars().all(is_plain) {
        let message = format!("a key has 1 to {} lower-case letters, digits and `_`, a letter first", LONGEST[0]);
        faults.push(at.fault(message).help("for example `side`"));
    } else if ReplyKey::named(key).is_some() {
        faults.push(at.fault(format!("a reply already has the key `{key}`")).help("choose another name"));
    } else if columns_of(key).iter().any(|column| mirrorstats_trace::schema::column(column).is_some()) {
        faults.push(at.fault(format!("`{key}` would have a column of the schema")).help("choose another name"));
    } else if before.iter().any(|other| other.key == *key) {
        faults.push(at.fault(format!("two answers have the key `{key}`")));
    }
}

fn options(answer: &Answer, at: &At<'_>, faults: &mut Vec<Fault>) {
    let count = answer.options.len();
    if answer.kind != AnswerType::OneOf {
        if count > 0 {
            let message = format!("an answer of type `{}` has no options", answer.kind.name());
            faults.push(at.key("options").fault(message).help("leave them out, or use `type = \"one_of\"`"));
        }
        return;
    }
    if !(2..=MOST_OPTIONS).contains(&count) {
        let message = format!("an answer of type `one_of` has 2 to {MOST_OPTIONS} options, found {count}");
        let at = at.get("options").unwrap_or_else(|| at.key("type"));
        faults.push(at.fault(message).help("for example `options = [\"left\", \"right\"]`"));
    }
    for (n, option) in answer.options.iter().enumerate() {
        let is_plain =
            !option.is_empty() && option.chars().count() <= LONGEST[1] && spelling::normal(option) == *option;
        let at = at.key("options").item(n);
        if !is_plain {
            let message = format!("an option has 1 to {} characters in lower case, with single spaces", LONGEST[1]);
            faults.push(at.fault(message).help("letter case and white space in a reply are ignored"));
        } else if option == UNKNOWN {
            faults.push(at.fault("`unknown` says that there is no evidence").help("use `unknown = true`"));
        }
    }
}

fn truth(answer: &Answer, at: &At<'_>, faults: &mut Vec<Fault>) {
    let given = [answer.truth.is_some(), answer.constant.is_some(), !answer.conditions.is_empty()];
    let count = given.iter().filter(|given| **given).count();
    if count != 1 {
        let facts = Fact::ALL.map(Fact::name).join(", ");
        let message = format!("an answer has one of `truth`, `constant` and `conditions`, found {count}");
        faults.push(at.key("key").fault(message).help(format!("`truth` is a fact of the world: {facts}")));
        return;
    }
    if let Some(fact) = answer.truth.filter(|fact| fact.kind() != answer.kind) {
        let [fact, of_fact, of_answer] = [fact.name(), fact.kind().name(), answer.kind.name()];
        let message = format!("`{fact}` is of type `{of_fact}`, the answer of type `{of_answer}`");
        faults.push(at.key("truth").fault(message).help("change `type` or `truth`"));
    }
    let mut text = |text: &str, at: &At<'_>| {
        if answer.read(text).is_none() {
            faults.push(at.fault(format!("expected {}, found `{text}`", answer.expected())));
        }
    };
    if let Some(constant) = &answer.constant {
        text(constant, &at.key("constant"));
    }
    for (condition, truth) in &answer.conditions {
        text(truth, &at.key("conditions").key(condition));
    }
}

/// Checks that a place among the bodies in the mirror has an option for each body.
pub(super) fn relations(spec: &Spec, at: &At<'_>, faults: &mut Vec<Fault>) {
    for (n, answer) in spec.answers.iter().enumerate().filter(|(_, answer)| answer.truth == Some(Fact::MirrorPlace)) {
        let at = at.key("answer").item(n).key("truth");
        let others = spec.layout.others;
        let count = others.least.filter(|least| others.most == Some(*least)).map(|count| count as usize + 1);
        if count != Some(answer.options.len()) {
            let options = answer.options.len();
            let message = format!(
                "`mirror_place` needs as many options as there are bodies, the own one among them; {options} options"
            );
            let help = "say `others` with equal `least` and `most`, one less than the options";
            faults.push(at.fault(message).help(help));
        } else if spec.panes.first().is_none_or(|pane| pane.kind == PaneKind::Window) {
            faults.push(at.fault("`mirror_place` needs a first mirror that is no window"));
        }
    }
}
