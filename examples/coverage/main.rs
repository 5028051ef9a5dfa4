//! Simulates the promises of `statistics`: error rates of tests, coverage of intervals.
//!
//! `cargo run --release --example coverage > benches/COVERAGE.md`; seeded, the same bytes on every machine.

mod durations;
mod errors;
mod intervals;
mod looks;
mod tarone;
mod units;

use mirrorstats_statistics::intervals::random::SplitMix64;

/// Every table draws from its own stream, so that a new table changes no other.
const SEED: u64 = 20_260_101;
const LEVEL: f64 = 0.05;
const CONFIDENCE: f64 = 0.95;
/// Episodes per model and experiment in the paper.
const N: u64 = 21;

fn main() {
    println!("# Coverage and errors, simulated\n");
    println!(
        "`cargo run --release --example coverage > benches/COVERAGE.md`, seed {SEED}. Tests at level 0.05, intervals at 95 %"
    );
    println!(
        "confidence; 21 episodes per model and experiment unless stated otherwise. The standard error of a share of s studies"
    );
    println!("is sqrt(x (1 - x) / s): 0.002 for 0.05 of 10,000.");
    errors::sizes();
    errors::families();
    errors::shared_models();
    intervals::common_differences();
    intervals::improvements();
    looks::singles();
    looks::pairs();
    units::repeats();
    durations::unequal();
}

fn heading(title: &str, note: &str, columns: &[&str]) {
    println!("\n## {title}\n\n{note}\n\n| {} |", columns.join(" | "));
    println!("|{}", " --- |".repeat(columns.len()));
}

fn row(name: &str, numbers: &[f64]) {
    let numbers: Vec<String> = numbers.iter().map(|number| format!("{number:.4}")).collect();
    println!("| {name} | {} |", numbers.join(" | "));
}

fn happens(random: &mut SplitMix64, rate: f64) -> bool {
    random.unit() < rate
}

fn successes(random: &mut SplitMix64, n: u64, rate: f64) -> u64 {
    (0..n).map(|_| u64::from(happens(random, rate))).sum()
}

#[expect(clippy::cast_precision_loss, reason = "counts of a simulation")]
fn share(count: usize, of: usize) -> f64 {
    count as f64 / of as f64
}

fn tally(counts: &mut [usize], happened: &[bool]) {
    counts.iter_mut().zip(happened).for_each(|(count, it)| *count += usize::from(*it));
}

/// The probabilities of 0 to n successes.
fn binomial(n: u64, rate: f64) -> Vec<f64> {
    let mut probabilities = vec![1.0];
    for _ in 0..n {
        let mut next = vec![0.0; probabilities.len() + 1];
        for (at, probability) in probabilities.iter().enumerate() {
            next[at] += probability * (1.0 - rate);
            next[at + 1] += probability * rate;
        }
        probabilities = next;
    }
    probabilities
}

fn rates() -> impl Iterator<Item = f64> {
    (1..=50).map(|percent| f64::from(percent) / 100.0)
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}
