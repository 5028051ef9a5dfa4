//! Every file system call of every writing verb fails once. Afterwards an output is the old or the new one, byte for
//! byte, and an error names the file and the cause.
//!
//! Exit code 0 means that the new output is complete, so the failed call did not matter. Examples are removing a
//! temporary file, which the next run does, and looking for leftovers.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use tempfile::TempDir;

use super::{Round, all_at_once, check_all, check_words, copy, faults, leftovers, sample};
use crate::harness::faults::{Call, ENOMEM, Fault, calls, failing, watched};
use crate::harness::files::{Contents, contents, write_small_world};
use crate::harness::program::{run, stderr, typed};

/// A verb that writes.
struct Verb {
    words: &'static str,
    /// The command that makes the outputs to be replaced; empty if there are none.
    before: &'static str,
    /// Files, or folders whose files are replaced together.
    outputs: &'static [&'static str],
}

const fn verb(before: &'static str, words: &'static str, outputs: &'static [&'static str]) -> Verb {
    Verb { words, before, outputs }
}

/// The verbs and their outputs. `world sheet` and `replay --frames` take long to draw, and write like `figure`.
const VERBS: &[Verb] = &[
    verb("score b.parquet -o s.csv", "score in -o s.csv", &["s.csv"]),
    verb("score b.parquet -o s.parquet", "score in -o s.parquet", &["s.parquet"]),
    verb("", "score in -o s.jsonl", &["s.jsonl"]),
    verb("report b.parquet --no-figures --out rep", "report in --no-figures --out rep", &["rep"]),
    verb("", "report in --no-figures --out new/deep/rep", &["new/deep/rep"]),
    verb("report b.parquet --no-figures --out link", "report in --no-figures --out link", &["link"]),
    verb("report b.parquet --no-figures --out r2", "table rescore r1 --definitions extended --out r2", &["r2"]),
    verb("import b.jsonl -o i.parquet", "import a.jsonl -o i.parquet", &["i.parquet"]),
    verb("trace seal b.parquet sealed.parquet", "trace seal a.parquet sealed.parquet", &["sealed.parquet"]),
    verb("definitions sensitivity b.parquet --out man", "setup man man", &["man"]),
    verb("score b.parquet -o rec.parquet", "trace recover a.mcap -o rec.parquet", &["rec.parquet"]),
    verb("figure spider b.parquet -o f.svg", "figure spider a.parquet -o f.svg", &["f.svg"]),
    verb("", "plan --runs 7 --register p.json", &["p.json"]),
    verb("definitions sensitivity b.parquet --out sens", "definitions sensitivity a.parquet --out sens", &["sens"]),
    verb("definitions sensitivity b.parquet --out link", "definitions sensitivity a.parquet --out link", &["link"]),
    #[cfg(feature = "view")]
    verb("view b.parquet --export page", "view a.parquet --export page", &["page"]),
    #[cfg(feature = "polars")]
    verb("query SELECT*FROM(steps) b.parquet -o q.csv", "query SELECT*FROM(steps) a.parquet -o q.csv", &["q.csv"]),
    #[cfg(feature = "polars")]
    verb("", "query SELECT*FROM(steps) a.parquet -o q.parquet", &["q.parquet"]),
];

/// The folder that every run copies: two recordings, one with a list of lost episodes, and the other inputs of verbs.
fn prepared() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_small_world(path, "episode.steps = 20\n");
    for (name, agent, runs) in [("a", "random", 2), ("b", "frozen", 1)] {
        typed(path, &format!("record --config small.toml --agent {agent} --experiment E1 --seeds 1 --no-frames --threads 1 --runs {runs} --out {name}"))
            .output()
            .unwrap();
        for ending in ["parquet", "mcap"] {
            fs::copy(path.join(name).join(format!("E1-{agent}.{ending}")), path.join(format!("{name}.{ending}")))
                .unwrap();
        }
        fs::remove_dir_all(path.join(name)).unwrap();
        let step = |t: u32| {
            format!(
                r#"{{"episode_id":"{name}","model":"m","experiment":"E1","seed":1,"run":1,"body_color":"red","t":{t},"action":"turn_left","self_color":null,"selected_cube":"none","mirror_visible":false}}"#
            )
        };
        fs::write(path.join(format!("{name}.jsonl")), format!("{}\n{}\n", step(1), step(2))).unwrap();
    }
    fs::create_dir(path.join("in")).unwrap();
    fs::copy(path.join("a.parquet"), path.join("in/a.parquet")).unwrap();
    let lost = r#"{"episode_id":"E1/random/s1/r3","model":"random","experiment":"E1","seed":1,"run":3,"step":2,"status":"timeout","reason":"slow"}"#;
    fs::write(path.join("in/lost.jsonl"), format!("{lost}\n")).unwrap();
    run(path, &["report", "a.parquet", "--no-figures", "--out", "r1"]).done();
    // Like `a` and `b`, but with attributions that will change.
    fs::create_dir(path.join("there")).unwrap();
    std::os::unix::fs::symlink("there", path.join("link")).unwrap();
    folder
}

/// The contents of an output: a file, or all files of a folder.
fn held(home: &Path, output: &str) -> Option<Contents> {
    let path = home.join(output);
    if path.is_file() {
        return Some(Contents::from([(String::new(), fs::read(path).unwrap())]));
    }
    let mut files = path.is_dir().then(|| contents(&path))?;
    // Ignore temporary files and leftovers.
    files.retain(|name, _| !name.split('/').any(|part| part.starts_with(".mirrorstats-")));
    Some(files)
}

fn all_held(home: &Path, verb: &Verb) -> Vec<Option<Contents>> {
    verb.outputs.iter().map(|output| held(home, output)).collect()
}

/// A verb in its folder before it runs.
struct Case<'a> {
    verb: &'a Verb,
    home: TempDir,
    old: Vec<Option<Contents>>,
    new: Vec<Option<Contents>>,
    calls: Vec<Call>,
}

impl<'a> Case<'a> {
    fn new(prepared: &Path, verb: &'a Verb) -> Self {
        let home = tempfile::tempdir().unwrap();
        copy(prepared, home.path());
        if !verb.before.is_empty() {
            let output = command(home.path(), verb.before).output().unwrap();
            assert!(output.status.success(), "{}: {}", verb.before, stderr(&output));
        }
        let old = all_held(home.path(), verb);
        let round = Round::new(home.path());
        let log = round.log();
        let output = watched(&mut command(&round.home(), verb.words), &round.home(), &log).output().unwrap();
        assert!(output.status.success(), "{}: {}", verb.words, stderr(&output));
        let new = all_held(&round.home(), verb);
        assert!(new.iter().all(Option::is_some) && new != old, "{} writes what it is said to", verb.words);
        assert_eq!(leftovers(&round.home()), Vec::<String>::new());
        Self { verb, home, old, new, calls: calls(&log) }
    }

    /// Runs the verb with a fault and checks the result.
    fn check(&self, fault: Fault) {
        let round = Round::new(self.home.path());
        let (home, log) = (round.home(), round.log());
        let output = failing(&mut command(&home, self.verb.words), &home, &log, fault).output().unwrap();
        let told = || format!("{} with {fault}: {:?}\n{}", self.verb.words, output.status, stderr(&output));
        let found = all_held(&home, self.verb);
        for (at, found) in found.iter().enumerate() {
            // A folder that cannot be exchanged is marked as unfinished; no command reads it until the verb runs again.
            let is_unfinished = self.verb.outputs[at] == "link" && home.join("link/.mirrorstats-unfinished").is_file();
            assert!(
                *found == self.old[at] || *found == self.new[at] || is_unfinished,
                "{}: {} is neither the old one nor the new one",
                told(),
                self.verb.outputs[at]
            );
        }
        if fault.error != 0 {
            check_words(&output, fault, found == self.new, &calls(&log), self.verb.outputs)
                .unwrap_or_else(|words| panic!("{}: {words}", told()));
        }
        if found != self.new && found != self.old || !leftovers(&home).is_empty() {
            self.check_again(&home, &told());
        }
    }

    /// Runs the verb once more after a fault, without one.
    fn check_again(&self, home: &Path, told: &str) {
        let again = command(home, self.verb.words).output().unwrap();
        // A plan that is already registered is not replaced.
        let is_registered =
            self.verb.words.starts_with("plan") && stderr(&again).contains("a registered plan is not replaced");
        assert!(again.status.success() || is_registered, "{told}: again: {}", stderr(&again));
        assert!(all_held(home, self.verb) == self.new, "{told}: again");
        // If the plan is registered, the command stops before it looks for leftovers.
        assert!(is_registered || leftovers(home).is_empty(), "{told}: again: {:?}", leftovers(home));
    }
}

/// An allocation that fails. The number 0 counts allocations and fails none.
const fn refused(at: usize) -> Fault {
    Fault { kind: "memory", at, error: ENOMEM, stays: false }
}

impl Case<'_> {
    fn allocations(&self) -> usize {
        let round = Round::new(self.home.path());
        let log = round.log();
        let output = failing(&mut command(&round.home(), self.verb.words), &round.home(), &log, refused(0)).output();
        assert!(output.unwrap().status.success(), "{}", self.verb.words);
        let count =
            calls(&log).iter().find_map(|call| if let Call::Allocations(count) = call { Some(*count) } else { None });
        count.expect("the count, written at the end of the process")
    }

    /// Runs the verb while one allocation fails; returns true if the verb ended because of it.
    fn check_memory(&self, at: usize) -> bool {
        let round = Round::new(self.home.path());
        let home = round.home();
        let output = failing(&mut command(&home, self.verb.words), &home, &round.log(), refused(at)).output().unwrap();
        let said = stderr(&output);
        let told = || format!("{}, allocation {at}: {:?}\n{said}", self.verb.words, output.status);
        assert!(!said.contains("panicked"), "{}", told());
        for (number, found) in all_held(&home, self.verb).iter().enumerate() {
            let is_unfinished =
                self.verb.outputs[number] == "link" && home.join("link/.mirrorstats-unfinished").is_file();
            assert!(*found == self.old[number] || *found == self.new[number] || is_unfinished, "{}", told());
        }
        if output.status.success() {
            return false;
        }
        // Rust's own end of a process: SIGABRT, which removes nothing.
        assert!(said.contains("memory") || said.contains("allocat"), "{}", told());
        assert!([Some(2), Some(101), None].contains(&output.status.code()), "{}", told());
        if !leftovers(&home).is_empty() {
            self.check_again(&home, &told());
        }
        true
    }
}

/// Fails this many allocations of each verb, spread evenly over all; or all of them if there are fewer.
fn check_memory(most: usize) {
    let prepared = prepared();
    let ended = AtomicUsize::new(0);
    let tried = AtomicUsize::new(0);
    let verbs: Vec<&Verb> = VERBS.iter().collect();
    all_at_once(&verbs, |verb| {
        let case = Case::new(prepared.path(), verb);
        let mut rounds: Vec<usize> = (1..=case.allocations()).collect();
        sample(&mut rounds, most);
        tried.fetch_add(rounds.len(), Ordering::Relaxed);
        let by_it = rounds.iter().filter(|at| case.check_memory(**at)).count();
        ended.fetch_add(by_it, Ordering::Relaxed);
    });
    let (ended, tried) = (ended.into_inner(), tried.into_inner());
    println!("{tried} refused allocations in {} verbs, {ended} of which ended the program", verbs.len());
    assert!(ended * 2 > tried, "{ended} of {tried}: the faults do not reach the program");
}

#[test]
fn refused_memory_leaves_old_or_new_outputs() {
    check_memory(12);
}

#[test]
#[ignore = "soak: two hundred allocations of every verb"]
fn soak_refused_memory_leaves_old_or_new_outputs() {
    check_memory(200);
}

fn command(home: &Path, words: &str) -> Command {
    let mut command = typed(home, words);
    // With one thread the calls are the same each time.
    let scanning = ["score", "report", "table rescore", "definitions sensitivity", "view"];
    if scanning.iter().any(|verb| words.starts_with(verb)) {
        command.args(["--threads", "1"]);
    }
    command
}

/// Runs this many faults, spread evenly over all; or all of them if there are fewer.
fn check(most: usize) {
    let prepared = prepared();
    let cases = Mutex::new(Vec::new());
    all_at_once(VERBS, |verb| {
        let case = Case::new(prepared.path(), verb);
        cases.lock().unwrap().push(case);
    });
    let mut cases = cases.into_inner().unwrap();
    cases.sort_by_key(|case| case.verb.words);
    let mut rounds: Vec<(&Case<'_>, Fault)> =
        cases.iter().flat_map(|case| faults(&case.calls).into_iter().map(move |fault| (case, fault))).collect();
    println!("{} faults in {} verbs", rounds.len(), cases.len());
    sample(&mut rounds, most);
    check_all(&rounds, |(case, fault)| case.check(*fault));
}

#[test]
fn outputs_are_old_or_new_whatever_call_fails() {
    check(400);
}

#[test]
#[ignore = "soak: every call of every verb with every error"]
fn soak_outputs_are_old_or_new_whatever_call_fails() {
    check(usize::MAX);
}
