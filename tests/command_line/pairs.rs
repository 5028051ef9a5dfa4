//! Every verb on small files that ask for much work, of every kind that it reads: its peak memory, or a refusal that
//! names the limit. A verb without a case fails the test by its name.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::harness::bombs::{
    MEMORY, definitions, large_log, long_episode, long_texts, many_colors, many_episodes, many_models, measured,
    wide_episode,
};
use crate::harness::files::{fixture, repository};

/// The option that raises every limit.
const SETTING: &str = "MIRRORSTATS_BUDGET";

/// The end of a command within the limits of memory and time.
#[derive(Clone, Copy)]
enum End {
    /// It succeeds, or a check fails.
    Answer,
    /// Its input is invalid, whatever its size.
    Invalid,
    /// It is refused by this limit.
    Limit(&'static str),
}
use End::{Answer, Invalid, Limit};

/// Inputs of one kind, and the commands that read them.
struct Walk {
    inputs: fn(&Path),
    cases: &'static [(&'static str, End)],
}

/// Verbs that read no file of others.
const WITHOUT_INPUT: [(&str, &str); 8] = [
    ("definitions show", "prints what is built in"),
    ("experiments show", "prints what is built in"),
    ("plan", "numbers of its command line"),
    ("setup completions", "prints what is built in"),
    ("setup man", "writes what is built in"),
    ("style show", "prints what is built in"),
    ("trace schema", "prints what is built in"),
    ("world config", "prints what is built in"),
];

const EPISODE: Walk = Walk {
    inputs: |at| {
        long_episode(&at.join("a.parquet"), 4_000_000);
        wide_episode(&at.join("wide.parquet"), 3_000_000);
        definitions(&at.join("some.toml"), 20, |at| format!("sum(t * {})", at + 2));
        definitions(&at.join("many.toml"), 500, |at| format!("sum(t * {})", at + 2));
    },
    cases: &[
        ("trace info a.parquet", Answer),
        ("trace validate a.parquet", Answer),
        ("trace check a.parquet --max-unreadable 0.05", Answer),
        ("trace validate wide.parquet", Answer),
        ("trace seal a.parquet sealed.parquet", Answer),
        ("trace seal wide.parquet sealed.parquet", Limit("steps times columns of an episode")),
        ("score a.parquet -o scores.csv", Answer),
        ("score wide.parquet -o scores.csv", Answer),
        ("definitions sensitivity a.parquet", Invalid),
        ("view a.parquet --export page", Limit("steps times columns of an episode")),
        ("score a.parquet --definitions some.toml -o s.csv", Limit("bytes of values of the definitions")),
        ("score a.parquet --definitions many.toml -o s.csv", Limit("rows times values of the definitions")),
        ("world filmstrip e a.parquet -o strip.png", Invalid),
        ("world replay a.parquet", Invalid),
    ],
};

const TEXTS: Walk = Walk {
    inputs: |at| {
        long_texts(&at.join("a.parquet"), 1_000_000);
        definitions(&at.join("few.toml"), 5, |at| format!("sum(t * {})", at + 2));
        definitions(&at.join("branches.toml"), 100, |at| {
            let one = |branch: usize| format!("when t = {} then {branch}", at * 7 + branch);
            format!("sum(case {} else t end)", (0..60).map(one).collect::<Vec<_>>().join(" "))
        });
    },
    cases: &[
        ("trace info a.parquet", Answer),
        ("trace validate a.parquet", Answer),
        ("score a.parquet -o scores.csv", Answer),
        ("score a.parquet --definitions few.toml -o few.csv", Answer),
        ("score a.parquet --definitions branches.toml -o s.csv", Limit("values of the definitions")),
        ("view a.parquet --export page", Limit("steps times columns of an episode")),
    ],
};

const TOO_MANY_EPISODES: Walk = Walk {
    inputs: |at| {
        many_episodes(&at.join("a.parquet"), 0..900_000);
        for number in 0..4 {
            many_episodes(&at.join(format!("{number}.parquet")), number * 290_000..(number + 1) * 290_000);
        }
    },
    cases: &[
        ("trace validate a.parquet", Answer),
        ("trace info a.parquet", Limit("episodes in")),
        ("trace info a.parquet --episodes", Limit("episodes in")),
        ("score a.parquet -o s.csv", Limit("episodes in")),
        ("report a.parquet --by episode_id", Limit("episodes in")),
        ("score 0.parquet 1.parquet 2.parquet 3.parquet -o s.csv", Limit("episodes in files of their size")),
    ],
};

const EPISODES: Walk = Walk {
    inputs: |at| {
        many_episodes(&at.join("a.parquet"), 0..290_000);
        many_episodes(&at.join("few.parquet"), 0..100_000);
        definitions(&at.join("sums.toml"), 500, |at| format!("sum(t * {} + length() % {})", at + 2, at + 3));
    },
    cases: &[
        ("trace info a.parquet", Answer),
        ("trace info few.parquet --episodes", Answer),
        ("trace info few.parquet --episodes --json", Answer),
        ("trace info a.parquet --episodes", Limit("episodes in a list")),
        ("trace info a.parquet --episodes --json", Limit("episodes in a list")),
        ("trace validate a.parquet --json", Answer),
        ("score a.parquet -o scores.csv", Answer),
        ("score a.parquet --definitions sums.toml -o s.csv", Limit("values of the definitions")),
        ("report a.parquet -o report", Answer),
        ("verify report", Answer),
        ("table rescore report --definitions paper --out again", Answer),
        ("report a.parquet --by episode_id -o other", Limit("cells, groups times metrics")),
        ("figure intervals a.parquet -o figure.svg", Answer),
        ("diff paper extended a.parquet", Answer),
        ("view a.parquet --export page", Limit("episodes of a page as files")),
        ("publish a.parquet -o bundle", Limit("episodes of a page as files")),
    ],
};

const MODELS: Walk = Walk {
    inputs: |at| {
        many_models(&at.join("a.parquet"), 290_000);
        many_models(&at.join("b.parquet"), 90_000);
    },
    cases: &[
        ("trace info a.parquet", Limit("bytes of models in experiments")),
        ("trace info a.parquet --json", Limit("bytes of models in experiments")),
        ("trace validate a.parquet", Answer),
        ("score a.parquet -o scores.csv", Answer),
        ("report a.parquet -o report", Limit("whose replies are counted")),
        ("stats a.parquet", Limit("comparisons of two models")),
        ("gate a.parquet a.parquet", Limit("cells of a gate")),
        ("trace info b.parquet", Answer),
        ("report b.parquet -o report", Limit("comparisons of two models")),
        ("table compare b.parquet --published table.csv", Invalid),
    ],
};

const COLORS: Walk = Walk {
    inputs: |at| {
        many_colors(&at.join("a.parquet"), 40_000);
        let names = |count: usize| (0..count).map(|at| format!("colour {at}\n")).collect::<Vec<_>>().concat();
        fs::write(at.join("many.txt"), names(60_000)).unwrap();
        fs::write(at.join("steps.jsonl"), "{}\n").unwrap();
    },
    cases: &[
        ("trace validate a.parquet", Answer),
        ("import steps.jsonl --palette many.txt -o x.parquet", Limit("colours of a palette")),
    ],
};

/// Lists of labels: pairs of coders times labels, and lines of one coder.
const LABELS: Walk = Walk {
    inputs: |at| {
        for (name, coders, labels, episodes) in
            [("coders", 1000, 9, 1), ("labels", 40, 200, 1), ("episodes", 2, 10, 450), ("pairs", 90, 5, 20)]
        {
            fs::create_dir(at.join(name)).unwrap();
            many_episodes(&at.join(name).join("a.parquet"), 0..episodes);
            let mut lines = String::new();
            for number in 0..coders * labels * episodes {
                let (coder, label) = (number % coders, number / coders % labels);
                let episode = number / coders / labels;
                let line = format!("{{\"coder\":\"c{coder}\",\"episode_id\":\"{episode:07}\",\"label\":\"l{label}\"}}");
                writeln!(lines, "{line}").unwrap();
            }
            fs::write(at.join(name).join("labels.jsonl"), lines).unwrap();
        }
    },
    cases: &[
        ("trace labels coders", Limit("pairs of coders times labels")),
        ("trace labels labels", Limit("pairs of coders times labels")),
        ("trace labels pairs", Limit("pairs of coders times labels")),
        ("trace labels episodes", Answer),
    ],
};

/// Conditions times models of a study, and its options in each of them.
const STUDIES: Walk = Walk {
    inputs: |at| {
        let study = |name: &str, options: &str, conditions: usize, models: usize| {
            let of = |kind: &str, count: usize| {
                (0..count).map(|at| format!("[{kind}.{kind}{at}]\n")).collect::<Vec<_>>().concat()
            };
            let text = format!("{options}\n{}{}", of("condition", conditions), of("model", models));
            fs::write(at.join(name), text).unwrap();
        };
        study("square.toml", "", 1000, 1000);
        study("long.toml", &format!("base-url = \"http://127.0.0.1/{}\"", "x".repeat(500_000)), 40, 40);
        study("episodes.toml", "seeds = 4000\nruns = 9\nagent = \"oracle\"", 1, 2);
        study("seeds.toml", "seeds = 4000\nruns = 999\nrepeats = 99\nagent = \"oracle\"", 1, 1);
    },
    cases: &[
        ("record square.toml --dry-run", Limit("recordings of a study, conditions times models")),
        ("record long.toml --dry-run", Limit("bytes of options of a study")),
        ("record episodes.toml --dry-run", Limit("episodes to record")),
        ("record seeds.toml --dry-run", Limit("episodes to record")),
    ],
};

/// Texts that are read whole: tables, definitions, styles, experiments; a log; a folder of a recording.
const FILES: Walk = Walk {
    inputs: |at| {
        let mut table = "experiment,model,metric,mean,se,emphasis\n".to_owned();
        for row in 0..30_000 {
            let metric = ["TSA-C,0.505", "TTD,5000000", "TSA,0.57,0.15"][row % 3];
            writeln!(table, "E1,m{row},{metric}{}", ",".repeat(5 - 2 - metric.matches(',').count())).unwrap();
        }
        fs::write(at.join("table.csv"), table).unwrap();
        fs::copy(fixture("recorded/E1-oracle.parquet"), at.join("a.parquet")).unwrap();
        let mut nested = "[let]\nx0 = \"t < coalesce(first(action = 'done'), 9)\"\n".to_owned();
        for at in 0..40 {
            writeln!(nested, "x{} = \"x{at} and x{at}\"", at + 1).unwrap();
        }
        fs::write(at.join("nested.toml"), nested + "[metric.M]\nvalue = \"any(x40)\"\n").unwrap();
        let keys = |start: &str| (0..60_000).fold(start.to_owned(), |text, at| text + &format!("a{at} = \"t\"\n"));
        fs::write(at.join("keys.toml"), keys("[let]\n")).unwrap();
        fs::write(at.join("style.toml"), keys("")).unwrap();
        fs::write(at.join("long.toml"), keys("") + &"#".repeat(1 << 20)).unwrap();
        let long = "x".repeat(300_000);
        fs::write(at.join("names.toml"), format!("[let]\n{long}a = \"{long}b\"\n[metric.M]\nvalue = \"{long}c\"\n"))
            .unwrap();
        large_log(&at.join("bomb.mcap"));
    },
    cases: &[
        ("table audit table.csv --n 2000", Limit("sums that the cells of published tables are tried with")),
        ("table compare a.parquet --published table.csv", Invalid),
        ("definitions check nested.toml", Answer),
        ("definitions check keys.toml", Limit("keys in a definition file")),
        ("definitions check names.toml", Invalid),
        ("definitions explain M --definitions nested.toml", Answer),
        ("definitions sql --definitions nested.toml", Answer),
        ("query SELECT(1) a.parquet --definitions keys.toml", Limit("keys in a definition file")),
        ("style check style.toml", Limit("keys in a style")),
        ("experiments check long.toml", Limit("bytes of an experiment file")),
        ("experiments explain long.toml", Limit("bytes of an experiment file")),
        ("world scene long.toml", Limit("bytes of an experiment file")),
        ("world visibility long.toml", Limit("bytes of an experiment file")),
        ("world sheet --experiment long.toml", Limit("bytes of an experiment file")),
        ("trace recover bomb.mcap -o x.parquet", Answer),
        ("participants remove P01 .", Invalid),
    ],
};

const WALKS: [&Walk; 9] =
    [&EPISODE, &TEXTS, &TOO_MANY_EPISODES, &EPISODES, &MODELS, &COLORS, &LABELS, &STUDIES, &FILES];

fn is_there(words: &str) -> bool {
    let built = [
        ("view", cfg!(feature = "view")),
        ("record", cfg!(feature = "sim")),
        ("world", cfg!(feature = "sim")),
        ("participants", cfg!(all(feature = "sim", feature = "view"))),
        ("query", cfg!(feature = "polars")),
    ];
    let verb = words.split_whitespace().next();
    built.iter().find(|(name, _)| Some(*name) == verb).is_none_or(|(_, is_built)| *is_built)
}

fn walk(walk: &Walk) {
    let folder = tempfile::tempdir().unwrap();
    (walk.inputs)(folder.path());
    let faults: Vec<String> = walk
        .cases
        .iter()
        .filter(|(words, _)| is_there(words))
        .filter_map(|(words, end)| fault(folder.path(), words, *end))
        .collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

fn fault(at: &Path, words: &str, end: End) -> Option<String> {
    let arguments: Vec<&str> = words.split_whitespace().collect();
    let (answer, most) = measured(at, &arguments);
    if most >= MEMORY {
        return Some(format!("{words}: {} MB", most >> 10));
    }
    let is_refused = answer.code == 2 && answer.stdout.is_empty() && !answer.stderr.contains("panicked");
    let is_expected = match end {
        Answer => [0, 1, 3, 4].contains(&answer.code),
        Invalid => is_refused && !answer.stderr.contains(SETTING),
        Limit(limit) => is_refused && answer.stderr.contains(limit) && answer.stderr.contains(SETTING),
    };
    let told: String = answer.stderr.chars().take(600).collect();
    (!is_expected).then(|| format!("{words}: exit {}, {told}", answer.code))
}

#[test]
fn an_episode_of_millions_of_steps() {
    walk(&EPISODE);
}

#[test]
fn texts_of_a_million_steps() {
    walk(&TEXTS);
}

#[test]
fn too_many_episodes_in_one_file_or_in_several() {
    walk(&TOO_MANY_EPISODES);
}

#[test]
fn hundreds_of_thousands_of_episodes() {
    walk(&EPISODES);
}

#[test]
fn hundreds_of_thousands_of_models() {
    walk(&MODELS);
}

#[test]
fn tens_of_thousands_of_colors() {
    walk(&COLORS);
}

#[test]
fn coders_times_labels() {
    walk(&LABELS);
}

#[test]
fn conditions_times_models() {
    walk(&STUDIES);
}

#[test]
fn files_that_are_read_whole() {
    walk(&FILES);
}

/// The commands without subcommands, from the reference page; another test compares that page with the program.
pub fn verbs() -> BTreeSet<String> {
    let page = fs::read_to_string(repository().join("docs/reference/commands.md")).unwrap();
    let all: BTreeSet<&str> = page.lines().filter_map(|line| line.strip_prefix("## mirrorstats ")).collect();
    let is_noun = |verb: &str| all.iter().any(|other| other.starts_with(&format!("{verb} ")));
    all.iter().filter(|verb| !is_noun(verb)).map(|verb| (*verb).to_owned()).collect()
}

/// The verbs that no command line begins with.
pub fn missing<'c>(commands: &(impl Iterator<Item = &'c str> + Clone)) -> Vec<String> {
    let is_there = |verb: &str| commands.clone().any(|words| format!("{words} ").starts_with(&format!("{verb} ")));
    verbs().into_iter().filter(|verb| !is_there(verb)).collect()
}

#[test]
fn every_verb_is_walked() {
    let cases = WALKS.iter().flat_map(|walk| walk.cases.iter().map(|(words, _)| *words));
    let missing = missing(&cases.chain(WITHOUT_INPUT.iter().map(|(verb, _)| *verb)));
    assert!(verbs().len() > 35 && missing.is_empty(), "no input that asks for much work: {missing:?}");
}
