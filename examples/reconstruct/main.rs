//! Rebuilds the paper's 840 episodes from its published tables and writes them as traces.
//!
//! `cargo run --example reconstruct -- fixtures/paper` writes the fixture again. With `--check` it only compares, and
//! exits with 1 on a difference. In both cases it first lists the published cells that contradict each other.

mod reconstruction;

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;

use reconstruction::files;

/// Rebuild the paper's 840 episodes from its published tables.
#[derive(Parser)]
struct Arguments {
    /// The folder of the 40 trace files.
    out_dir: PathBuf,
    /// Compare the folder with what would be written, and write nothing.
    #[arg(long)]
    check: bool,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<ExitCode, Box<dyn Error>> {
    show_contradictions();
    let traces = files::traces()?;
    let episodes: usize = traces.iter().map(|trace| trace.episodes.len()).sum();
    let steps: usize = traces.iter().flat_map(|trace| &trace.episodes).map(|episode| episode.steps.len()).sum();
    let amount = format!("{} files, {episodes} episodes, {steps} steps", traces.len());
    if !arguments.check {
        files::write(&arguments.out_dir, &traces)?;
        println!("wrote {amount} to {}", arguments.out_dir.display());
        return Ok(ExitCode::SUCCESS);
    }
    let differences = files::differences(&arguments.out_dir, &traces)?;
    if differences.is_empty() {
        println!("{amount}: as they would be written now");
        return Ok(ExitCode::SUCCESS);
    }
    println!("{}", differences.join("\n"));
    Ok(ExitCode::from(1))
}

/// Prints the cells that no episodes can explain as printed, and the values to read instead.
fn show_contradictions() {
    for (contradiction, erratum) in reconstruction::contradictions() {
        println!("contradiction: {contradiction}");
        match erratum {
            Some(erratum) => println!("  {erratum}"),
            None => println!("  no erratum says how to read it"),
        }
    }
}
