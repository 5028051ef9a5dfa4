//! Wrong and right verdicts of `gate`: whole families of cells, run through the command.
//!
//! `cargo build && cargo run --example gate_errors -- target/debug/mirrorstats > benches/COVERAGE-GATE.md`; seeded, the
//! same bytes everywhere. Each study is two files of scores. Titles after the program select the tables to simulate.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use mirrorstats_analysis::gate::{Gate, GateVerdict};
use mirrorstats_statistics::intervals::random::SplitMix64;

const SEED: u64 = 20_261_124;
const STUDIES: u64 = 150;
const MODELS: usize = 4;
const SIZES: [usize; 6] = [3, 5, 7, 12, 21, 60];
/// The verdicts of a table's columns.
const VERDICTS: [GateVerdict; 3] = [GateVerdict::Improved, GateVerdict::Held, GateVerdict::Regressed];

/// The design of both sides' episodes.
#[derive(Clone, Copy)]
struct Design {
    metric: &'static str,
    margin: &'static str,
    /// The earlier and the later success rate; the mean duration is 50 minus 40 times the rate.
    rates: [f64; 2],
    scenes: usize,
    /// Episodes per scene and side; all copy the first.
    repeats: usize,
    is_paired: bool,
    /// The share of the later side's values that copy the scene's earlier value.
    shared: f64,
}

const INTRODUCTION: &str = "
# Errors and power of the gate, through the command

`cargo build && cargo run --example gate_errors -- target/debug/mirrorstats > benches/COVERAGE-GATE.md`, seed 20261124. Each
row has 150 studies: two files of scores of 4 models, given to `mirrorstats gate BASE NEW --format json`. The first three
columns are the share of studies in which any of the 4 cells has the verdict; the last three are the share of cells. A share
in bold is an error: the verdict is false. Three standard errors above 0.05 are 0.103.

At the margin, NEW is worse by exactly the margin, so `held` is false and `regressed` is true.
";

fn main() {
    let program = std::env::args().nth(1).map_or_else(|| PathBuf::from("target/debug/mirrorstats"), PathBuf::from);
    let wanted: Vec<String> = std::env::args().skip(2).collect();
    if wanted.is_empty() {
        println!("{}", INTRODUCTION.trim());
    }
    let rate =
        |rates| Design { metric: "TSA", margin: "0.1", rates, scenes: 0, repeats: 1, is_paired: true, shared: 0.0 };
    let apart = |design| Design { is_paired: false, ..design };
    let repeated = |design| Design { repeats: 3, ..design };
    let duration = |rates| Design { metric: "TTD", margin: "4", ..rate(rates) };
    for (title, design) in [
        ("Pairs, no difference", rate([0.6, 0.6])),
        ("Pairs of which half agree, no difference", Design { shared: 0.5, ..rate([0.6, 0.6]) }),
        ("Pairs, at the margin", rate([0.6, 0.5])),
        ("Pairs, at the margin, high rates", rate([0.95, 0.85])),
        ("No pairs, no difference", apart(rate([0.6, 0.6]))),
        ("No pairs, at the margin", apart(rate([0.6, 0.5]))),
        ("No pairs, at the margin, high rates", apart(rate([0.95, 0.85]))),
        ("3 repeats that copy the first, no difference", repeated(rate([0.6, 0.6]))),
        ("3 repeats that copy the first, at the margin", repeated(rate([0.6, 0.5]))),
        ("Pairs, better by 0.4", rate([0.5, 0.9])),
        ("Pairs, worse by 0.4", rate([0.9, 0.5])),
        ("Durations in pairs, no difference", duration([0.6, 0.6])),
        ("Durations in pairs, at the margin", duration([0.6, 0.5])),
    ]
    .into_iter()
    .filter(|(title, _)| wanted.is_empty() || wanted.iter().any(|wanted| wanted == title))
    {
        let columns = "| scenes | improved | held | regressed | improved, cells | held, cells | regressed, cells |";
        println!("\n## {title}\n\n{columns}\n|{}", " --- |".repeat(7));
        for scenes in SIZES {
            println!("{}", Design { scenes, ..design }.row(&program));
        }
    }
}

impl Design {
    fn row(self, program: &Path) -> String {
        let (mut studies, mut cells) = ([0_u32; 3], [0_u32; 3]);
        for study in 0..STUDIES {
            let gate = self.gate(program, SEED + study);
            for (at, verdict) in VERDICTS.into_iter().enumerate() {
                let found = gate.cells.iter().filter(|cell| cell.verdict == verdict).count();
                studies[at] += u32::from(found > 0);
                cells[at] += u32::try_from(found).expect("few cells");
            }
        }
        let [before, after] = self.rates;
        let is_false = [after <= before, after < before, after >= before];
        let of = |count: u32, all: f64, at: usize| {
            let share = format!("{:.3}", f64::from(count) / all);
            if is_false[at] { format!("**{share}**") } else { share }
        };
        #[expect(clippy::cast_precision_loss, reason = "counts of a simulation")]
        let (all, each) = (STUDIES as f64, (STUDIES * MODELS as u64) as f64);
        let shares = (0..3).map(|at| of(studies[at], all, at)).chain((0..3).map(|at| of(cells[at], each, at)));
        let name = if self.repeats == 1 { String::new() } else { format!(" x {}", self.repeats) };
        format!("| {}{name} | {} |", self.scenes, shares.collect::<Vec<_>>().join(" | "))
    }

    fn gate(self, program: &Path, seed: u64) -> Gate {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let files = ["base.csv", "new.csv"].map(|name| folder.path().join(name));
        for (file, text) in files.iter().zip(self.csv(&mut SplitMix64::seeded(seed))) {
            std::fs::write(file, text).expect("a temporary file");
        }
        let [base, new] = &files;
        let options = ["--format", "json", "--metric", self.metric, "--margin", self.margin];
        let output = Command::new(program).arg("gate").args([base, new]).args(options).output();
        let output = output.unwrap_or_else(|error| panic!("{}: {error}", program.display()));
        let told = || String::from_utf8_lossy(&output.stderr).into_owned();
        serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {}", told()))
    }

    fn csv(self, random: &mut SplitMix64) -> [String; 2] {
        let header = "episode_id,model,experiment,seed,run,scene,TSA,TTD,TSA-C\n";
        let mut texts = [0, 1].map(|_| header.to_owned());
        for (model, scene) in (0..MODELS).flat_map(|model| (0..self.scenes).map(move |scene| (model, scene))) {
            let common = random.unit();
            for (side, text) in texts.iter_mut().enumerate() {
                let drawn = if random.unit() < self.shared { common } else { random.unit() };
                let solved = u8::from(drawn < self.rates[side]);
                let steps = self.duration(side, drawn);
                let own = if self.is_paired { String::new() } else { format!("{side}-") };
                for repeat in 0..self.repeats {
                    let run = scene * self.repeats + repeat;
                    let _ =
                        writeln!(text, "E1-m{model}-{run},m{model},E1,1,{run},{own}{scene},{solved},{steps},{solved}");
                }
            }
        }
        texts
    }

    /// 10 for a success and 50 for a failure, so that both sides reach the same latest step and have one horizon.
    fn duration(self, side: usize, drawn: f64) -> u8 {
        if drawn < self.rates[side] { 10 } else { 50 }
    }
}
