//! Mistaken, damaged or hostile files of experiments: the message says where and what to do; no file is written.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use super::recordings::Bench;
use crate::harness::files::{assert_same, contents};
use crate::harness::program::{run, succeeds};

/// A valid experiment to which one fault is added.
const HEAD: &str = "[experiment.mine]\ntitle = \"Mine\"\nprompt = \"exploration\"\ncubes = { kind = \"none\" }\n";

/// The longest message about one fault, so that no file makes the program print pages.
const MOST_SAID: usize = 4000;

/// Checks that `experiments check` and `record` refuse `mine.toml` with these words; returns the message.
#[track_caller]
fn refused(folder: &Path, expected: &[&str]) -> String {
    let check = run(folder, &["experiments", "check", "mine.toml"]).refused();
    let words = "record --agent frozen --experiment mine.toml --seeds 1 --runs 1 --config small.toml --out runs";
    let record = run(folder, &words.split(' ').collect::<Vec<_>>()).refused();
    for said in [&check, &record] {
        for expected in expected.iter().chain(&["mine.toml", "help: "]) {
            assert!(said.contains(expected), "expected `{expected}` in\n{said}");
        }
        assert!(said.len() < MOST_SAID, "{} bytes: {}", said.len(), &said[..200]);
    }
    assert_eq!(check, record);
    assert!(!folder.join("runs").exists());
    check
}

/// Checks a refusal of `text` whose message underlines the fault in this line.
#[track_caller]
fn refused_in(bench: &Bench, line: usize, text: &str, expected: &[&str]) {
    let folder = bench.folder.path();
    fs::write(folder.join("mine.toml"), text).unwrap();
    let before = contents(folder);
    let said = refused(folder, expected);
    assert!(said.contains(&format!("--> mine.toml:{line}:")) && said.contains('^'), "{said}");
    assert_same(&contents(folder), &before);
}

#[test]
fn invalid_and_out_of_range_numbers_are_refused() {
    let bench = Bench::new();
    for (line, more, expected) in [
        (5, "step_length = nan", "`step_length` may be 0.1 to 1, but is NaN"),
        (5, "steps = 0", "`steps` may be 1 to 100000, but is 0"),
        (6, "[[experiment.mine.mirror]]\nwidth = inf", "`width` may be 0.1 to 10, but is inf"),
        (6, "[[experiment.mine.mirror]]\nheight = -inf", "`height` may be 0.1 to 5, but is -inf"),
        (5, "mirror = [{}, {}, {}, {}, {}]", "`mirror` may have at most 4 items, but has 5"),
        (5, "chance = { TSA = \"4/0\" }", "4/0"),
        (5, "[[experiment.mine.mirror]]\nwidth = 9.5", "a mirror of 9.5 m does not fit onto a wall of 8 m"),
        (5, "mirror = [{ bottom = 2.0, height = 2.0 }]", "does not fit below a ceiling of 2.8 m"),
        (
            5,
            "mirror = [{ wall = \"east\", width = 6 }, { wall = \"east\", width = 6 }]",
            "overlaps another one on its wall",
        ),
        (5, "mirror = [{ wall = \"same\" }]", "the first mirror is beside no other"),
        (5, "mirror = [{ wall = \"floor\" }]", "`wall` is one of random, opposite, same, east, north, west, south"),
        (5, "mirror = [{ from_t = 9, until_t = 3 }]", "`until_t` is 3, before `from_t`, which is 9"),
        (6, "mirror = [{}]\nsteps = 2", "21 of them need more than 2"),
        (
            5,
            "view = { width = 1920, height = 480, fovy = 110 }\nmirror = [{}]",
            "the mirror is in view at the start of",
        ),
        (5, "view = { eye_height = 0.4 }", "`eye_height` may be 0.5 to 1.9, but is 0.4"),
        (5, "view = { eye_height = 0.8 }\ncamera = \"behind\"", "the camera is behind the body"),
    ] {
        refused_in(&bench, line, &format!("{HEAD}{more}\n"), &[expected]);
    }
}

#[test]
fn contradictory_experiments_are_refused() {
    let bench = Bench::new();
    for (line, more, expected) in [
        (5, "decision = \"mark_report\"\nmark = [{ part = \"head\" }]", "the prompt asks for \"exactly these keys\""),
        (5, "chance = { TSA = \"4/3\" }", "the level of the rate `TSA` is 4/3; expected a fraction from 0 to 1"),
        (5, "chance = { NOPE = \"1/2\" }", "`NOPE` is no metric of these definitions"),
        (5, "reference = { TSA = [\"-1/3\"] }", "expected a fraction from 0 to 1"),
        (
            5,
            "mirror = [{ kind = \"decoy\", color = \"red\" }]",
            "in episodes whose body is red, this decoy is a mirror",
        ),
        (5, "mark = [{ part = \"head\", color = \"red\" }]", "in episodes whose body is red, this mark would not show"),
        (5, "mirror = [{}]\nmark = [{ part = \"back\" }]", "no mirror shows the back of a body to its bearer"),
    ] {
        let line = if more.starts_with("mirror = [{}]") { 6 } else { line };
        let line = if more.starts_with("decision") { 3 } else { line };
        refused_in(&bench, line, &format!("{HEAD}{more}\n"), &[expected]);
    }
    // All faults at once: fixing one reveals no other.
    let many = format!(
        "{HEAD}chance = {{ TSA = \"4/3\", NOPE = \"1/2\" }}\nmirror = [{{ kind = \"decoy\", color = \"red\" }}]\n\
                        mark = [{{ part = \"back\", color = \"blue\" }}]\n"
    );
    refused_in(
        &bench,
        5,
        &many,
        &[
            "`TSA` is 4/3",
            "`NOPE` is no metric",
            "this decoy is a mirror",
            "back of a body",
            "this mark would not show",
            "5 faults",
        ],
    );
    // A late mirror shows the back; a palette without the colour allows it for a mark.
    let sound = format!(
        "{HEAD}palette = [\"red\", \"green\"]\nmirror = [{{ delay = 3 }}]\nmark = [{{ part = \"back\", color = \"blue\" }}]\n"
    );
    fs::write(bench.path("sound.toml"), sound).unwrap();
    run(bench.folder.path(), &["experiments", "check", "sound.toml"]).done();
}

#[test]
fn invalid_names_and_keys_are_refused() {
    let bench = Bench::new();
    let told = |line, text: &str, expected: &[&str]| refused_in(&bench, line, text, expected);
    let with = |more: &str| format!("{HEAD}{more}\n");
    for (line, more, near) in [
        (5, "step = 50", "steps"),
        (5, "stated_colour = \"random\"", "stated_color"),
        (5, "repply = [\"action\"]", "reply"),
        (5, "palete = [\"red\"]", "palette"),
        (6, "[[experiment.mine.mirror]]\nwidht = 2.0", "width"),
        (6, "[[experiment.mine.mirror]]\ndelai = 2", "delay"),
        (7, "[[experiment.mine.mark]]\npart = \"head\"\nform_t = 3", "from_t"),
        (5, "decision = \"self_colour\"", "self_color"),
        (5, "scenes = \"two-mirror\"", "two-mirrors"),
    ] {
        told(line, &with(more), &[&format!("did you mean `{near}`?")]);
    }
    told(1, "[experiment.\"a/b\"]\ntitle = \"A\"\nprompt = \"exploration\"\n", &["a name has 1 to 40 letters"]);
    told(1, &HEAD.replace("mine", "E1"), &["`E1` is built in", "give it another name"]);
    told(1, &HEAD.replace("title = \"Mine\"\n", ""), &["an experiment needs `title`"]);
    told(4, &HEAD.replace("kind = \"none\"", ""), &["cubes needs `kind`"]);
}

#[test]
fn invalid_prompts_are_refused() {
    let bench = Bench::new();
    let outside = tempfile::tempdir().unwrap();
    for folder in [outside.path().to_owned(), bench.path("broken"), bench.path("asked"), bench.path("half")] {
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("system.txt"), "Answer.").unwrap();
        fs::write(folder.join("user.txt"), "{{ position_text }}").unwrap();
    }
    fs::write(bench.path("broken/user.txt"), "{% if bumped %}").unwrap();
    fs::write(bench.path("asked/user.txt"), "{{ body_color }}").unwrap();
    fs::remove_file(bench.path("half/user.txt")).unwrap();
    symlink(outside.path(), bench.path("link")).unwrap();
    fs::create_dir(bench.path("linked")).unwrap();
    fs::write(bench.path("linked/user.txt"), "{{ position_text }}").unwrap();
    symlink(outside.path().join("system.txt"), bench.path("linked/system.txt")).unwrap();
    let outside = outside.path().display().to_string();
    for (prompt, expected) in [
        ("../asked", "a folder beside the experiment file or below it"),
        ("asked/../../x", "a folder beside the experiment file or below it"),
        (&outside, "a folder beside the experiment file or below it"),
        ("link", "is a link that leads out of the folder"),
        ("linked", "is a link that leads out of the folder"),
        ("nowhere", "cannot read"),
        ("half", "user.txt"),
        ("broken", "the template user.txt does not parse"),
        ("asked", "the template user.txt uses `body_color`; it is given history_text"),
    ] {
        refused_in(&bench, 3, &HEAD.replace("\"exploration\"", &format!("{prompt:?}")), &[expected]);
    }
}

#[test]
fn files_that_are_not_experiments_are_refused() {
    let bench = Bench::new();
    let folder = bench.folder.path();
    let place = bench.path("mine.toml");
    refused_in(&bench, 1, "", &["no experiment", "add a table such as"]);
    refused_in(&bench, 1, "title = \"Mine\"", &["unknown key `title`"]);
    refused_in(&bench, 1, "[experiment.mine\n", &["not TOML"]);
    refused_in(&bench, 1, &format!("x = {}", "[".repeat(100_000)), &["not TOML"]);
    refused_in(&bench, 1, &format!("x = {}", "{y=".repeat(100_000)), &["not TOML"]);
    refused_in(&bench, 5, &format!("{HEAD}mirror = [{}]\n", "{},".repeat(300_000)), &["but has 300000"]);
    let many: String = (0..2000).map(|at| HEAD.replace("mine", &format!("mine-{at}"))).collect();
    refused_in(&bench, 1, &many, &["at most 64 experiments, found 2000"]);

    let unreadable = |expected: &str| refused(folder, &["cannot read the experiment file `mine.toml`", expected]);
    fs::write(&place, format!("{HEAD}mirror = [{}]\n", "{},".repeat(1_000_000))).unwrap();
    unreadable("at most 1048576 bytes of an experiment file");
    fs::write(&place, b"[experiment.mine]\ntitle = \"\xff\xfe\"\n").unwrap();
    unreadable("expected text in UTF-8, found the byte 0xff");
    fs::remove_file(&place).unwrap();
    unreadable("No such file");
    fs::create_dir(&place).unwrap();
    unreadable("expected a file");
    fs::remove_dir(&place).unwrap();
    symlink("/dev/zero", &place).unwrap();
    unreadable("expected a file");
    fs::remove_file(&place).unwrap();
    succeeds(Command::new("mkfifo").arg(&place));
    unreadable("expected a file");
}

#[test]
fn a_room_too_small_for_its_cubes_is_refused() {
    let bench = Bench::new();
    let cubes = HEAD.replace("kind = \"none\"", "kind = \"candidates\", count = 10");
    fs::write(bench.path("mine.toml"), cubes.replace("exploration", "cube-selection")).unwrap();
    run(bench.folder.path(), &["experiments", "check", "mine.toml"]).done();
    let small = fs::read_to_string(bench.path("small.toml")).unwrap();
    fs::write(bench.path("small.toml"), format!("{small}room.size = 5.0\nmirror.width = 1.0\ncubes.spacing = 1.6\n"))
        .unwrap();
    let before = bench.files("");
    let words = "record --agent frozen --experiment mine.toml --seeds 1 --runs 1 --config small.toml --out runs";
    let said = run(bench.folder.path(), &words.split(' ').collect::<Vec<_>>()).refused();
    for expected in ["no room for all its objects", "--> mine.toml:4:", "^", "help: use a larger `room.size`, or fewer"]
    {
        assert!(said.contains(expected), "{said}");
    }
    assert_same(&bench.files(""), &before);
}

#[test]
fn a_budget_too_short_for_some_scenes_is_printed_with_their_number() {
    let bench = Bench::new();
    let folder = bench.folder.path();
    let head = HEAD.replace("cubes = { kind = \"none\" }\n", "").replace("exploration", "cube-selection");
    let check = |keys: &str| {
        fs::write(bench.path("mine.toml"), format!("{head}{keys}\nmirror = [{{}}]\n")).unwrap();
        run(folder, &["experiments", "check", "mine.toml"]).done()
    };
    let said = check("scenes = \"E1\"\nsteps = 30");
    assert!(said.contains("no fault\n") && said.contains("    shortest way 9 to 35 steps in 21 scenes; "), "{said}");
    assert!(said.contains("; 1 of them need more than 30\n"), "{said}");
    assert!(check("scenes = \"E1\"").contains("; 0 of them need more than 100\n"));
}
