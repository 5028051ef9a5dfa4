//! Other programs' packages open what `publish` writes. `scripts/get-datasets.sh` installs them.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::harness::files::{fixture, repository};
use crate::harness::need;
use crate::harness::program::{clean, run, stdout, succeeds};
use crate::publish::published;

/// Runs a script under an interpreter with a folder of packages; returns its output.
fn python(interpreter: &str, packages: &str, folder: &Path, script: &str, arguments: &[&str]) -> String {
    let mut command = clean(Command::new(interpreter), folder);
    command.env("PYTHONPATH", need::packages(packages)).env("PYTHONDONTWRITEBYTECODE", "1");
    command.env("HF_HUB_OFFLINE", "1").env("HF_HOME", folder.join("hub")).env("HOME", folder);
    stdout(&succeeds(command.args(["-W", "ignore", "-c", script]).args(arguments)))
}

const LOAD: &str = "
import sys
from datasets import load_dataset, get_dataset_config_names
import mlcroissant
for name in get_dataset_config_names(sys.argv[1]):
    rows = load_dataset(sys.argv[1], name, split='train')
    print(name, len(rows), len(rows.column_names))
    if name == 'frames':
        print(rows[0]['episode_id'], rows[0]['t'], rows[0]['image'].size, len(set(rows[0]['image'].convert('RGB').getdata())) > 9)
found = mlcroissant.Dataset(jsonld=sys.argv[1] + '/croissant.json')
print(sorted(found.metadata.ctx.issues.errors), found.metadata.name, len(found.metadata.distribution))
print(found.metadata.data_limitations)
";

#[test]
fn datasets_and_mlcroissant_open_a_bundle() {
    let folder = published("all");
    let told = python("python3", "python-datasets", folder.path(), LOAD, &["out"]);
    let expected = "episodes 4 19\nsteps 17 40\nframes 4 8\nE1/guesser/s1/r1 1 (640, 480) True\n";
    assert!(told.starts_with(expected), "{told}");
    assert!(told.contains("[] Two agents: \"mirrors\" ") && told.ends_with("['Four episodes.']\n"), "{told}");
    // All traces of the fixture: their columns differ by experiment.
    let recorded = fixture("recorded").display().to_string();
    run(folder.path(), &["publish", &recorded, "-o", "recorded"]).done();
    let told = python("python3", "python-datasets", folder.path(), LOAD, &["recorded"]);
    assert!(told.starts_with("episodes 33 ") && told.contains("\nsteps 745 "), "{told}");
}

/// A study of another domain, from another program's log.
fn robots(folder: &Path) {
    let steps: String = (1..=4)
        .flat_map(|run| {
            (1..=6).map(move |t| {
                format!(
                    "{{\"episode_id\": \"act-{run}\", \"t\": {t}, \"model\": \"lab/act\", \"experiment\": \"pusht\", \
                     \"seed\": 1, \"run\": {run}, \"task\": \"push\", \"reward\": 0.5, \"action\": 7, \
                     \"action_change\": 0.25, \"success\": {}}}\n",
                    t == 6 && run < 4
                )
            })
        })
        .collect();
    fs::write(folder.join("steps.jsonl"), steps).unwrap();
    let definitions = repository().join("examples/domains/robots.toml").display().to_string();
    run(folder, &["import", "steps.jsonl", "-o", "robots.parquet", "--definitions", &definitions]).done();
}

#[test]
fn a_bundle_of_another_domain_opens_and_verifies() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    robots(at);
    let style = repository().join("examples/domains/robots.style.toml").display().to_string();
    run(at, &["publish", "robots.parquet", "-o", "out", "--style", &style]).done();
    let told = run(at, &["verify", "out"]).done();
    assert!(told.ends_with("all numbers of 4 episodes are equal\n"), "{told}");
    let told = python("python3", "python-datasets", at, LOAD, &["out"]);
    assert!(told.starts_with("episodes 4 ") && told.contains("\nsteps 24 ") && told.contains("\n[] "), "{told}");
}

const SCOUT: &str = "
import asyncio, sys
from click.testing import CliRunner
from inspect_scout._cli.db import db_command
answer = CliRunner().invoke(db_command, ['validate', sys.argv[1]])
print(answer.output.strip(), answer.exit_code)
from inspect_scout import transcripts_from
from inspect_scout._transcript.types import TranscriptContent
async def read():
    async with transcripts_from(sys.argv[1]).reader() as reader:
        async for info in reader.index():
            whole = await reader.read(info, TranscriptContent(messages='all'))
            print(info.transcript_id, info.task_set, info.model, info.score, info.success, [m.role for m in whole.messages][:3], len(whole.messages))
asyncio.run(read())
";

#[test]
fn inspect_scout_opens_transcripts() {
    let folder = published("none");
    let at = folder.path();
    let answer = run(at, &["publish", "runs", "-o", "scout", "--format", "inspect-scout"]);
    assert!(answer.stderr.contains("note: the format cannot hold frames"), "{}", answer.stderr);
    answer.done();
    let told = python("python3", "python-scout", at, SCOUT, &["scout"]);
    assert!(told.starts_with("Schema validation passed. 0\n"), "{told}");
    assert!(
        told.contains("E1/guesser/s1/r1 E1 guesser {") && told.contains("['user', 'assistant', 'assistant']"),
        "{told}"
    );
    assert_eq!(told.lines().count(), 5, "{told}");
}

/// Validates with the package's own schemas; needs only `jsonschema`, which comes with Scout.
const SCHEMAS: &str = "
import glob, json, sys, jsonschema
schemas = sys.argv[2] + '/every_eval_ever/schemas/'
load = lambda name: jsonschema.Draft7Validator(json.load(open(schemas + name)))
whole, line = load('eval.schema.json'), load('instance_level_eval.schema.json')
for path in sorted(glob.glob(sys.argv[1] + '/data/*/*/*/*')):
    if path.endswith('.json'):
        whole.validate(json.load(open(path)))
    else:
        for text in open(path):
            line.validate(json.loads(text))
    print('valid', path.split('/')[-2], path.endswith('.jsonl'))
";

#[test]
fn every_eval_ever_accepts_results_and_lines() {
    let folder = published("none");
    let at = folder.path();
    robots(at);
    for (traces, out) in [("runs", "mirrors"), ("robots.parquet", "robots")] {
        run(at, &["publish", traces, "-o", out, "--format", "every-eval-ever", "--about", "about.toml"]).done();
    }
    let packages = need::packages("python-every-eval-ever");
    for (out, files) in [("mirrors", 4), ("robots", 2)] {
        let told = python("python3", "python-scout", at, SCHEMAS, &[out, packages.to_str().unwrap()]);
        assert_eq!(told.lines().count(), files, "{told}");
        // Where an interpreter runs the package, its own command decides too. It warns of models without a developer.
        if out == "robots"
            && let Ok(interpreter) = fs::read_to_string(packages.join(".python"))
        {
            let mut command = clean(Command::new(interpreter.trim()), &at.join(out));
            command.env("PYTHONPATH", &packages).env("PYTHONDONTWRITEBYTECODE", "1");
            let paths: Vec<String> = crate::harness::files::contents(&at.join(out)).into_keys().collect();
            succeeds(command.args(["-m", "every_eval_ever", "validate"]).args(paths));
        }
    }
    let text = crate::harness::files::contents(&at.join("mirrors"));
    let (_, results) = text.iter().find(|(name, _)| name.contains("/guesser/") && !name.contains("_samples")).unwrap();
    let results: serde_json::Value = serde_json::from_slice(results).unwrap();
    let first = &results["evaluation_results"][0];
    assert_eq!(first["evaluation_name"], "E1: TSA");
    assert_eq!(first["score_details"]["score"], 0.5);
    assert_eq!(first["score_details"]["uncertainty"]["confidence_interval"]["method"], "wilson");
}
