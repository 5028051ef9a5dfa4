//! One sentence on how an episode ended, and the step of its end.

use serde_json::{Value, json};

use crate::logs::Opened;
use mirrorstats_exact::escape::visible;
use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::spec::Decision;
use mirrorstats_trace::episodes::episode::{Action, Episode, Step};

/// The name of a kind of decision, and the decision at a step.
type Choice = (&'static str, fn(&Step) -> Option<&str>);

/// The sentence, whether the decision names the true colour, and the step to open first. Null if the trace is from
/// another domain.
pub(crate) fn answer(opened: &Opened) -> Value {
    let episode = &opened.episode;
    if opened.own.is_some() || episode.steps.is_empty() {
        return Value::Null;
    }
    let (outcome, words, t) = if episode.start_distance.is_some() { reached(episode) } else { decided(episode) };
    let words = if opened.running.is_some() { format!("under way: {words}") } else { words };
    json!({"outcome": outcome, "words": words, "t": t})
}

fn decided(episode: &Episode) -> (&'static str, String, usize) {
    let body = &episode.body_color;
    let (verb, chosen) = choice(episode);
    let last = episode.steps.len();
    let done = episode.steps.iter().position(|step| step.action == Some(Action::Done));
    let sight = match episode.steps.iter().position(|step| step.mirror_visible) {
        None => "never saw the mirror".to_owned(),
        Some(at) => format!("saw the mirror first at t = {}", at + 1),
    };
    let Some(at) = done else {
        let named =
            episode.steps.iter().rev().find_map(|step| step.self_color.as_deref().filter(|name| is_color(name)));
        let claim =
            named.map_or_else(|| "claimed no colour".to_owned(), |name| format!("last claimed {}", visible(name)));
        return ("open", format!("never decided in {last} steps, {claim}, is {}; {sight}", visible(body)), last);
    };
    let named = chosen(&episode.steps[at]).filter(|name| is_color(name));
    let outcome = if named == Some(body) { "right" } else { "wrong" };
    let named = named.map_or_else(|| "nothing".to_owned(), visible);
    (outcome, format!("{verb} {named}, is {}: {outcome} at t = {}; {sight}", visible(body), at + 1), at + 1)
}

fn choice(episode: &Episode) -> Choice {
    let is_claim = match episode.decision.as_deref() {
        Some(column) => column == "self_color",
        None => Experiment::parse(&episode.experiment).is_ok_and(|known| known.decision == Decision::SelfColor),
    };
    if is_claim { ("said", |step| step.self_color.as_deref()) } else { ("chose", |step| step.selected_cube.as_deref()) }
}

fn is_color(name: &str) -> bool {
    !matches!(name, "none" | "unknown")
}

/// The outcome of reaching for a mark: the smallest distance.
fn reached(episode: &Episode) -> (&'static str, String, usize) {
    let distances =
        episode.steps.iter().enumerate().filter_map(|(at, step)| Some((step.extra.target_distance?, at + 1)));
    let last = episode.steps.len();
    match distances.min() {
        Some((nearest, t)) => ("open", format!("the hand came nearest at t = {t}: {nearest} mm from the mark"), t),
        None => ("open", format!("no distance is recorded in {last} steps"), last),
    }
}

#[cfg(test)]
mod tests {
    use super::answer;
    use crate::logs::Opened;
    use mirrorstats_trace::episodes::episode::{Action, Episode, Step};

    fn entry(change: impl Fn(&mut Episode)) -> (String, String, u64) {
        let mut steps = vec![Step::default(); 5];
        steps[3] = Step { action: Some(Action::Done), selected_cube: Some("brown".into()), ..Step::default() };
        let mut episode = Episode { body_color: "green".into(), steps, ..Episode::default() };
        change(&mut episode);
        let entry = answer(&Opened { episode, running: None, input: None, own: None });
        let text = |key: &str| entry[key].as_str().unwrap().to_owned();
        (text("outcome"), text("words"), entry["t"].as_u64().unwrap())
    }

    #[test]
    fn a_verdict_names_choice_truth_step_and_mirror() {
        let (outcome, words, t) = entry(|_| ());
        assert_eq!((outcome.as_str(), t), ("wrong", 4));
        assert_eq!(words, "chose brown, is green: wrong at t = 4; never saw the mirror");
        let (_, words, _) = entry(|episode| {
            episode.steps[1].mirror_visible = true;
            episode.steps[3].selected_cube = Some("green".into());
        });
        assert_eq!(words, "chose green, is green: right at t = 4; saw the mirror first at t = 2");
        let (_, words, _) = entry(|episode| episode.decision = Some("self_color".into()));
        assert_eq!(words, "said nothing, is green: wrong at t = 4; never saw the mirror");
    }

    #[test]
    fn an_episode_without_a_decision_opens_at_its_end() {
        let (outcome, words, t) = entry(|episode| {
            episode.steps[3].action = None;
            episode.steps[2].self_color = Some("red".into());
            episode.steps[4].self_color = Some("unknown".into());
        });
        assert_eq!((outcome.as_str(), t), ("open", 5));
        assert_eq!(words, "never decided in 5 steps, last claimed red, is green; never saw the mirror");
    }

    #[test]
    fn the_verdict_on_a_hand_names_the_nearest_step() {
        let (_, words, t) = entry(|episode| {
            episode.start_distance = Some(900);
            for (at, step) in episode.steps.iter_mut().enumerate() {
                step.extra.target_distance = Some([800, 300, 100, 100, 400][at]);
            }
        });
        assert_eq!((words.as_str(), t), ("the hand came nearest at t = 3: 100 mm from the mark", 3));
    }
}
