//! Episodes that were recorded differently are not compared; the output names the setting that differs.

use std::path::Path;

use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::write::write_episodes;
use serde_json::{Value, json};

use crate::harness;
use crate::harness::program::run;

/// The episodes of one model in one experiment, one scene each, and their recording settings.
#[derive(Clone)]
pub struct Cell<'a> {
    pub model: &'a str,
    pub experiment: &'a str,
    /// The width of the mirror, in m.
    pub mirror: f64,
    /// The step budget.
    pub steps: u32,
    pub prompt: &'a str,
    /// The name of the fingerprint; derived from the settings if absent.
    pub named: Option<&'a str>,
    /// The number of episodes that declare the fingerprint.
    pub declared: usize,
    /// The number of scenes; the episodes use them in turn.
    pub scenes: usize,
    /// The number of lost episodes, the last ones.
    pub lost: usize,
    /// Every n-th episode takes one step more; 0 for none.
    pub long: usize,
    /// The number of episodes with an unreadable reply, the first ones.
    pub unread: usize,
    /// The kind of the recording, and the unit of its clusters.
    pub kind: &'a str,
    pub cluster: Option<&'a str>,
    /// True for each solved episode.
    pub solved: Vec<bool>,
}

pub const LIKE: Cell<'_> = Cell {
    model: "ant",
    experiment: "E1",
    mirror: 3.0,
    steps: 40,
    prompt: "p",
    named: None,
    declared: usize::MAX,
    scenes: usize::MAX,
    lost: 0,
    long: 0,
    unread: 0,
    kind: "recording",
    cluster: None,
    solved: Vec::new(),
};

/// `n` outcomes: `successes` solved episodes first, then unsolved ones.
pub fn solved(successes: usize, n: usize) -> Vec<bool> {
    (0..n).map(|at| at < successes).collect()
}

impl Cell<'_> {
    fn fingerprint(&self) -> String {
        let Self { model, experiment, mirror, steps, prompt, .. } = self;
        self.named.map_or_else(|| format!("{model}/{experiment}/{mirror}/{steps}/{prompt}"), str::to_owned)
    }

    fn recording(&self) -> Value {
        let Self { model, experiment, mirror, steps, prompt, .. } = self;
        json!({
            "kind": self.kind,
            "design": { "pairs": "scene", "cluster": self.cluster },
            "world": { "mirror": { "width": mirror }, "episode": { "steps": steps } },
            "fingerprints": { self.fingerprint(): {
                "world": format!("{experiment} {mirror} {steps}"), "prompts": format!("{experiment} {prompt}"),
                "reply_schema": null, "agent": *model, "sampling": null, "model": *model,
            } },
        })
    }

    fn episode(&self, at: usize) -> Episode {
        let choice = if self.solved[at] { "red" } else { "blue" };
        let is_lost = at + self.lost >= self.solved.len();
        let status = |is_last| match is_last {
            true if is_lost => "timeout",
            false if at < self.unread => "parse_failed",
            _ => "ok",
        };
        let is_long = self.long > 0 && at.is_multiple_of(self.long);
        let step = |action, is_last: bool| Step {
            action: Some(action),
            self_color: Some(choice.into()),
            selected_cube: Some(choice.into()),
            mirror_visible: !is_last,
            extra: Extra { reply_status: Some(status(is_last).into()), ..Extra::default() },
        };
        let last = if is_lost { Action::TurnLeft } else { Action::Done };
        let (model, experiment, run) = (self.model, self.experiment, i32::try_from(at).unwrap() + 1);
        Episode {
            model: model.into(),
            experiment: experiment.into(),
            run,
            scene: Some(format!("scene {}", at % self.scenes)),
            fingerprint: (at < self.declared).then(|| self.fingerprint()),
            ..harness::traces::episode(
                &format!("{experiment}/{model}/s1/r{run}"),
                [vec![step(Action::MoveForward, false); 1 + usize::from(is_long)], vec![step(last, true)]].concat(),
            )
        }
    }

    /// Writes the trace `EXPERIMENT-MODEL.parquet`.
    pub fn write(&self, folder: &Path) {
        std::fs::create_dir_all(folder).unwrap();
        let episodes: Vec<Episode> = (0..self.solved.len()).map(|at| self.episode(at)).collect();
        let name = format!("{}-{}.parquet", self.experiment, self.model);
        write_episodes(&folder.join(name), Some(self.recording()), &episodes).unwrap();
    }
}

/// Two models that differ in every scene; `change` alters the second one's recording.
fn two(change: impl FnOnce(&mut Cell)) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    Cell { solved: solved(21, 21), ..LIKE }.write(&folder.path().join("runs"));
    let mut other = Cell { model: "bee", solved: solved(0, 21), ..LIKE };
    change(&mut other);
    other.write(&folder.path().join("runs"));
    folder
}

fn differs(folder: &Path, words: &[&str]) -> (String, Value) {
    let found = run(folder, &[&["stats", "--json"], words].concat()).json();
    let answers = found["answers"].as_array().unwrap().iter();
    let differs = answers.filter(|answer| answer["question"] == "Who differs from whom?" && answer["metric"] == "TSA");
    (differs.map(|answer| answer["answer"].as_str().unwrap()).collect(), found)
}

/// A change to a cell's recording settings.
type Change = fn(&mut Cell);

#[test]
fn models_of_two_worlds_prompts_or_step_budgets_are_not_compared() {
    let like = two(|_| ());
    assert_eq!(differs(like.path(), &["runs"]).0, "E1 ant better than bee");
    let changes: [(Change, &str); 4] = [
        (|cell| cell.mirror = 1.2, "world.mirror.width is 3.0 and 1.2"),
        (|cell| cell.steps = 60, "world.episode.steps is 40 and 60"),
        (|cell| cell.prompt = "q", "prompts (E1 p, E1 q)"),
        (|cell| cell.declared = 0, "21 of 42 episodes have no fingerprint"),
    ];
    for (change, setting) in changes {
        let folder = two(change);
        let (answer, found) = differs(folder.path(), &["runs"]);
        assert_eq!(answer, format!("E1 not comparable ({setting})"));
        let test = &found["models"][0]["tests"][0];
        assert_eq!((&test["p"], &test["difference"], &test["separated"]), (&Value::Null, &Value::Null, &json!(false)));
        assert_eq!(test["incomparable"], setting);
        let apart = json!([{ "within": "E1", "between": ["ant", "bee"] }]);
        assert_eq!(found["not_comparable"], json!([{ "setting": setting, "comparisons": apart }]));
        // With `--pool` they are compared, and every output names the ignored setting.
        let (answer, found) = differs(folder.path(), &["runs", "--pool"]);
        assert_eq!(answer, "E1 ant better than bee");
        let sentence = format!("Compared though they differ (--pool): {setting}.");
        assert_eq!((&found["pooled"], &found["not_comparable"]), (&json!([sentence]), &Value::Null));
        let sequential = run(folder.path(), &["stats", "runs", "--pool", "--sequential", "--json"]).json();
        assert_eq!(sequential["pooled"], json!([sentence]));
        assert!(run(folder.path(), &["stats", "runs", "--pool"]).done().contains("(--pool)"));
    }
    // Of one name for two recordings, the contents decide, as they do of two names.
    let one_name = |mirror| two(|cell| (cell.named, cell.mirror) = (Some("ant/E1/3/40/p"), mirror));
    assert_eq!(differs(one_name(3.0).path(), &["runs"]).0, "E1 ant better than bee");
    let answer = differs(one_name(1.2).path(), &["runs"]).0;
    assert_eq!(answer, "E1 not comparable (world.mirror.width is 3.0 and 1.2)");
}

#[test]
fn cells_show_lost_episodes_and_unreadable_replies() {
    // The last reply of a lost episode has no decision either.
    let folder = two(|cell| (cell.lost, cell.unread) = (2, 3));
    let at = folder.path();
    let found = run(at, &["stats", "runs", "--json"]).json();
    for cell in found["cells"].as_array().unwrap() {
        let expected = if cell["key"]["model"] == "bee" { (json!(2), json!(5)) } else { (Value::Null, Value::Null) };
        assert_eq!((&cell["lost"], &cell["unusable_replies"]), (&expected.0, &expected.1), "{cell}");
    }
    let shown = run(at, &["stats", "runs", "--tables"]).done();
    let rates = shown.lines().skip_while(|line| !line.contains("Wilson"));
    let rates: Vec<&str> = rates.take_while(|line| !line.is_empty()).collect();
    assert!(rates[1].ends_with("lost  no decision"), "{shown}");
    let row = |model: &str| rates.iter().find(|line| line.contains(model) && line.contains("TSA")).unwrap();
    assert_eq!(row("bee").split_whitespace().rev().take(2).collect::<Vec<_>>(), ["5", "2"], "{shown}");
    run(at, &["report", "runs", "--no-figures", "--out", "out"]).done();
    let table = std::fs::read_to_string(at.join("out/tables/main.md")).unwrap();
    assert!(table.contains("Beside the numbers: E1 bee 2 lost, 5 of 42 replies without a decision."), "{table}");
    // Without losses and unreadable replies the columns are absent.
    let like = two(|_| ());
    assert!(!run(like.path(), &["stats", "runs", "--tables"]).done().contains("no decision"));
}

#[test]
fn scores_in_parquet_are_refused_like_their_traces() {
    let folder = two(|cell| cell.mirror = 1.2);
    run(folder.path(), &["score", "runs", "-o", "scores.parquet"]).done();
    let (answer, _) = differs(folder.path(), &["scores.parquet"]);
    assert_eq!(answer, "E1 not comparable (world (E1 3 40, E1 1.2 40))");
}

#[test]
fn a_cell_partly_without_fingerprints_is_refused_unless_pooled() {
    let folder = tempfile::tempdir().unwrap();
    Cell { declared: 10, solved: solved(21, 21), ..LIKE }.write(&folder.path().join("runs"));
    let message = run(folder.path(), &["stats", "runs"]).refused();
    assert!(message.contains("11 of none declared") && message.contains("some have no fingerprint"), "{message}");
    let words = "E1, ant: pooled with --pool: some have no fingerprint.";
    let found = run(folder.path(), &["stats", "runs", "--pool", "--json"]).json();
    assert!(found["pooled"][0] == words, "{found}");
    run(folder.path(), &["report", "runs", "--pool", "--out", "out", "--no-figures"]).done();
    let table = std::fs::read_to_string(folder.path().join("out/tables/main.md")).unwrap();
    assert!(table.contains(words), "{table}");
}

#[test]
fn only_experiments_of_one_world_and_similar_tasks_are_contrasted() {
    let contrast = |mirror, against| {
        let folder = tempfile::tempdir().unwrap();
        Cell { solved: solved(21, 21), ..LIKE }.write(folder.path());
        Cell { experiment: against, mirror, solved: solved(0, 21), ..LIKE }.write(folder.path());
        run(folder.path(), &["stats", ".", "--json"]).json()
    };
    let changes = |found: &Value| {
        let all = found["answers"].as_array().unwrap().iter();
        let mirror =
            all.filter(|answer| answer["question"] == "What does the mirror change?" && answer["metric"] == "TSA");
        mirror.map(|answer| answer["answer"].as_str().unwrap().to_owned()).collect::<String>()
    };
    assert_eq!(changes(&contrast(3.0, "E2")), "E1 - E2 higher for ant");
    assert_eq!(changes(&contrast(1.2, "E2")), "E1 - E2 not comparable (world.mirror.width is 3.0 and 1.2)");
    let other = contrast(3.0, "E5");
    assert_eq!((changes(&other), &other["conditions"]), (String::new(), &json!([])));
    let words = json!("E5 is not contrasted with E1: the chance level of TSA is 1/3 and none.");
    assert!(other["warnings"].as_array().unwrap().contains(&words), "{}", other["warnings"]);
}

#[test]
fn bold_marks_the_models_that_no_test_shows_to_be_worse() {
    let folder = tempfile::tempdir().unwrap();
    let write = |mirror| {
        for (model, successes) in [("ant", 21), ("bee", 19), ("cow", 0)] {
            Cell { model, mirror, solved: solved(successes, 21), ..LIKE }.write(folder.path());
        }
        run(folder.path(), &["report", ".", "--no-figures", "--out", "out"]).done();
        std::fs::read_to_string(folder.path().join("out/tables/main.md")).unwrap()
    };
    let table = write(3.0);
    assert!(table.contains("**21/21") && table.contains("**19/21") && !table.contains("**0/21"), "{table}");
    assert!(table.contains("In bold: models that no test shows to be worse"), "{table}");
    let found = run(folder.path(), &["stats", ".", "--json"]).json();
    let of = found["ranks"].as_array().unwrap().iter().filter(|row| row["metric"] == "TSA");
    let ranks: Vec<(u64, u64)> =
        of.map(|row| (row["best"].as_u64().unwrap(), row["worst"].as_u64().unwrap())).collect();
    assert_eq!(ranks, [(1, 2), (1, 2), (3, 3)]);
    assert!(run(folder.path(), &["stats", ".", "--full"]).done().contains("Ranks that the tests leave open"));
    // A model without a value is not bold.
    let definitions = folder.path().join("some.toml");
    let some = "include = [\"paper\"]\n[metric.SOME]\nbetter = \"higher\"\nmeasures = \"rate\"\nvalue = \"any(selected_cube = body_color)\"\nwhen = \"any(model <> 'elk')\"\n";
    std::fs::write(definitions, some).unwrap();
    Cell { model: "elk", solved: solved(21, 21), ..LIKE }.write(folder.path());
    run(
        folder.path(),
        &["report", ".", "--no-figures", "--definitions", "some.toml", "--metrics", "SOME", "--out", "out"],
    )
    .done();
    let table = std::fs::read_to_string(folder.path().join("out/tables/main.md")).unwrap();
    assert!(table.contains("**21/21") && table.contains(" -- |") && !table.contains("**--**"), "{table}");
    std::fs::remove_dir_all(folder.path().join("out")).unwrap();
    // The best mean is not bold if models are not comparable.
    Cell { model: "dog", mirror: 1.2, solved: solved(1, 21), ..LIKE }.write(folder.path());
    let table = write(3.0);
    assert!(!table.contains("**21/21"), "{table}");
}

#[test]
fn a_report_shows_ranks_and_lost_episodes() {
    let folder = two(|_| ());
    let at = folder.path();
    Cell { experiment: "E2", solved: solved(21, 21), ..LIKE }.write(&at.join("runs"));
    Cell { experiment: "E2", model: "bee", lost: 2, solved: solved(0, 21), ..LIKE }.write(&at.join("runs"));
    run(at, &["report", "runs", "--out", "out"]).done();
    let read = |name: &str| std::fs::read_to_string(at.join("out").join(name));
    let ranks = read("tables/ranks.csv").unwrap();
    for line in
        ["experiment,metric,model,best,worst", "E1,TSA,ant,1,1", "E1,TSA,bee,2,2", ",TSA,ant,1,1", ",TSA,bee,2,2"]
    {
        assert!(ranks.lines().any(|found| found == line), "{line}: {ranks}");
    }
    // Every episode takes two steps, so no model decides earlier.
    assert!(ranks.contains("E1,TTD,ant,1,2"), "{ranks}");
    let printed = read("tables/ranks.md").unwrap();
    assert!(printed.contains("| all | ant | 1 | --") && printed.contains("rank 1 are tied for the best"), "{printed}");
    assert!(read("report.html").unwrap().contains("<section id=\"ranks\">"));
    run(at, &["report", "runs", "--out", "out", "--style", "paper"]).done();
    assert!(read("tables/ranks.csv").is_err() && !read("report.html").unwrap().contains("id=\"ranks\""));
    let stats = run(at, &["stats", "runs", "--full"]).done();
    let (_, overall) = stats.split_once(" metric  first  second  test").unwrap();
    assert!(overall.lines().next().unwrap().contains("p with lost episodes"), "{stats}");
    assert!(
        overall.lines().any(|line| line.contains("ant    bee") && line.contains("<0.0001, <0.0001   better")),
        "{stats}"
    );
}
