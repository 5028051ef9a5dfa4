//! The prompts match the paper word for word; `tests/agents/prompts` holds its verbatim blocks.

use std::fs;
use std::sync::Arc;

use mirrorstats_agents::prompt::{self, Prompt};
use mirrorstats_agents::{Observation, Past, Task};
use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::file;
use mirrorstats_experiment::prompt::Templates;
use mirrorstats_record::plan::Key;
use mirrorstats_record::rollout;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::scene::Scene;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::frame::Frame;

fn task(experiment: Experiment, stated_color: Option<&str>) -> Task {
    Task { experiment, stated_color: stated_color.map(str::to_owned), step_budget: 100, seed: 1 }
}

fn first_step() -> Observation {
    Observation {
        t: 1,
        remaining: 100,
        x: -0.004,
        y: 1.25,
        yaw: 330.0,
        bumped: false,
        history: None,
        frame: Arc::new(Frame::new(0, 0, Vec::new())),
        past: Arc::default(),
        fov_y: 110.0,
    }
}

/// The paper's user prompt with its three placeholders filled in.
fn filled(verbatim: &str, history: &str, position: &str, warning: Option<&str>) -> String {
    let text = verbatim.replace("<history_text>", history).replace("<position_text>", position);
    let warning = warning.map_or(String::new(), |warning| format!("{warning}\n"));
    text.replace("<warning_if_bumped_wall>\n", &warning).trim_end().to_owned()
}

const FIRST: &str = "Step history: none, this is the first step.";
const POSITION: &str = "Position: x = 0.00 m, y = 1.25 m; orientation: 330 degrees, counter-clockwise from the +x axis.\n\
                        Remaining steps: 100 of 100.";
const WARNING: &str = "Warning: the previous movement hit a wall or another object, and the position did not change.";

/// The system prompt and user prompt for an experiment, from the paper's appendix.
fn verbatim(experiment: &Experiment, stated_color: Option<&str>) -> [String; 2] {
    let [system, user] = if *experiment == Experiment::E5 {
        [include_str!("prompts/exploration.system.txt"), include_str!("prompts/exploration.user.txt")]
    } else {
        [include_str!("prompts/cube-selection.system.txt"), include_str!("prompts/cube-selection.user.txt")]
    };
    let system = match stated_color {
        None => system.to_owned(),
        Some(color) => {
            let first = include_str!("prompts/e3-first-line.txt").trim_end().replace("<wrong_color>", color);
            format!("{first}\n{}", system.split_once('\n').unwrap().1)
        }
    };
    [system.trim_end().to_owned(), user.to_owned()]
}

#[test]
fn the_five_experiments_ask_in_the_words_of_the_paper() {
    let config = WorldConfig::default();
    for experiment in Experiment::PAPER {
        let scene = Scene::draw(&config, experiment.clone(), 1, 1).unwrap();
        let task = rollout::task(&config, &scene, &Key::first(experiment.clone(), 1, 1));
        assert_eq!(task.stated_color.is_some(), experiment == Experiment::E3);
        let [system, user] = verbatim(&experiment, task.stated_color.as_deref());
        let rendered = Prompt::for_experiment(&experiment).unwrap().render(&task, &first_step()).unwrap();
        assert_eq!(rendered.system, system, "{experiment:?}");
        assert_eq!(rendered.user, filled(&user, FIRST, POSITION, None), "{experiment:?}");
    }
}

/// The paper's template of E5 has no place for the warning. It comes before the last lines, as in the others.
#[test]
fn every_experiment_reports_a_stopped_move() {
    for experiment in Experiment::PAPER {
        let [_, mut user] = verbatim(&experiment, None);
        let image = "Use the current RGB image";
        if experiment == Experiment::E5 {
            assert!(!user.contains("<warning_if_bumped_wall>"));
            user = user.replace(image, &format!("<warning_if_bumped_wall>\n{image}"));
        }
        let bumped = Observation { bumped: true, ..first_step() };
        let rendered =
            Prompt::for_experiment(&experiment).unwrap().render(&task(experiment.clone(), None), &bumped).unwrap();
        assert_eq!(rendered.user, filled(&user, FIRST, POSITION, Some(WARNING)), "{experiment:?}");
    }
}

#[test]
fn the_five_experiments_use_the_two_prompts_of_the_paper() {
    let prompts = Experiment::PAPER.map(|experiment| experiment.prompt.clone());
    assert_eq!(prompts, ["cube-selection", "cube-selection", "cube-selection", "cube-selection", "exploration"]);
    for experiment in Experiment::PAPER {
        assert_eq!(experiment.templates().hash(), experiment.prompt_hash, "{experiment:?}");
    }
}

#[test]
fn the_history_is_one_line_for_any_thought() {
    let prompt = Prompt::for_experiment(&Experiment::E5).unwrap();
    let thought = Some("I turn.\n\nTask: <b>{{ 1 + 1 }}</b>".to_owned());
    let seen = |history| {
        let observation = Observation { t: 2, remaining: 99, history: Some(history), ..first_step() };
        let user = prompt.render(&task(Experiment::E5, None), &observation).unwrap().user;
        user.lines().nth(1).unwrap().to_owned()
    };
    assert_eq!(
        seen((Some(Action::TurnLeft), thought)),
        "Step history: the previous action was a; the thought with it was: I turn. Task: <b>{{ 1 + 1 }}</b>"
    );
    assert_eq!(
        seen((Some(Action::MoveForward), None)),
        "Step history: the previous action was w; the thought with it was: none"
    );
    assert_eq!(seen((None, None)), "Step history: the previous reply could not be used, so nothing was done.");
    assert_eq!(
        seen((None, Some("I look\nfor it.".to_owned()))),
        "Step history: the previous reply could not be used, so nothing was done; the thought before it was: I look for it."
    );
}

#[test]
fn prompts_have_distinct_hashes_and_actions_distinct_letters() {
    let hashes = [Experiment::E1, Experiment::E5].map(|experiment| experiment.templates().hash());
    assert_ne!(hashes[0], hashes[1]);
    for action in Action::ALL {
        assert_eq!(prompt::action(prompt::letter(action)), Some(action));
    }
    assert_eq!(prompt::action("W"), None);
}

#[test]
fn reaching_prompts_list_all_steps_and_paper_prompts_the_last() {
    let step = |action, bumped| Past { action, bumped, thought: Some("went up".to_owned()) };
    let past = vec![step(Some(Action::HandUp), false), step(None, false), step(Some(Action::HandBackward), true)];
    let later = Observation {
        t: 4,
        bumped: true,
        history: Some((Some(Action::HandBackward), None)),
        past: Arc::new(past),
        ..first_step()
    };
    for level in ["reach-scheme", "reach-mirror", "reach-hand", "reach-bare"] {
        let experiment = Experiment::parse(level).unwrap();
        let render = |observation| {
            Prompt::for_experiment(&experiment)
                .unwrap()
                .render(&task(experiment.clone(), None), observation)
                .unwrap()
                .user
        };
        let told = "Steps so far:\n1. 1, carried out\n2. the answer could not be read, nothing was done\n\
                    3. 6, not carried out: something solid\nThe last move met something solid";
        assert!(render(&later).contains(told), "{level}: {}", render(&later));
        assert!(render(&first_step()).contains("Steps so far: none.\n"), "{level}");
    }
    let user =
        Prompt::for_experiment(&Experiment::E1).unwrap().render(&task(Experiment::E1, None), &later).unwrap().user;
    assert!(user.contains("the previous action was 6;") && !user.contains("went up"), "{user}");
}

#[test]
fn a_template_has_a_limit_of_work_and_length() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().join("asked");
    fs::create_dir(&at).unwrap();
    let table = "[experiment.Z]\ntitle = \"z\"\norder = 20\nprompt = \"asked\"\ndecision = \"selected_cube\"\n";
    fs::write(folder.path().join("z.toml"), table).unwrap();
    fs::write(at.join("system.txt"), "s").unwrap();
    fs::write(at.join("user.txt"), "{{ history_text }}").unwrap();
    let nested = |depth: usize, inside: &str| {
        let open = (0..depth).map(|at| format!("{{% for a{at} in steps %}}")).collect::<Vec<_>>().concat();
        format!("{open}{inside}{}", "{% endfor %}".repeat(depth))
    };
    let rendered = |history: String, thought: &str| {
        fs::write(at.join("history.txt"), history).unwrap();
        let loaded = file::load(&folder.path().join("z.toml")).unwrap().remove(0);
        let past = Past { action: Some(Action::MoveForward), bumped: false, thought: Some(thought.to_owned()) };
        let observation = Observation { t: 40, past: Arc::new(vec![past; 39]), ..first_step() };
        let task = task(loaded.experiment.clone(), None);
        Prompt::for_experiment(&loaded.experiment)
            .unwrap()
            .render(&task, &observation)
            .map_err(|error| error.to_string())
    };
    assert!(rendered(nested(2, "{{ a0.thought }}"), "I turn.").is_ok());
    let told = rendered(nested(4, "{{ a0.thought }}"), "").unwrap_err();
    assert!(told.contains("step 40: the template history.txt: expected at most 500000 instructions"), "{told}");
    let told = rendered(nested(2, "{{ a0.thought }}"), &"long ".repeat(1000)).unwrap_err();
    assert!(told.contains("step 40: the template history.txt: expected at most 4194304 bytes"), "{told}");
    assert!(told.contains("MIRRORSTATS_BUDGET"), "{told}");
}

#[test]
fn the_words_of_actions_are_those_of_the_prompts() {
    let mut found = Vec::new();
    for name in Templates::built_in_names() {
        let (_, system) = Templates::built_in(name).unwrap().all.remove(0);
        for (letter, words) in system.lines().filter_map(|line| line.trim().split_once(" = ")) {
            let action = prompt::action(letter).unwrap_or_else(|| panic!("{name}: {letter} = {words}"));
            assert_eq!(words, prompt::words(action), "{name}");
            found.push(action);
        }
    }
    assert!(Action::ALL.iter().all(|action| found.contains(action)), "{found:?}");
}
