//! Campaigns without a fuzzer: the given number of mutants, which depend on the seed alone. The mutants of pages have
//! counted outcomes; those of any other target are changed inputs of its corpus.

use std::collections::BTreeMap;
use std::fs;
use std::panic::{self, AssertUnwindSafe};
use std::path::Path;
use std::process::ExitCode;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use mirrorstats_fuzz::pages::{self, Outcome, mutate::CHANGE};
use mirrorstats_fuzz::pairs::{joined, parted};

/// The targets of two inputs.
const PAIRS: [&str; 6] = ["defined", "grouped", "filtered", "asked", "logged", "styled"];

/// Draws (`SplitMix64`).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
    }

    fn below(&mut self, end: usize) -> usize {
        usize::try_from(self.next() >> 32).unwrap_or_default() % end.max(1)
    }

    /// Mostly a changed first input with a sound trace, or with scores; else the second of an input, changed or not.
    fn pair(&mut self, [first, second]: &[Vec<Vec<u8>>; 2], is_scored: bool) -> Vec<u8> {
        let other = match self.below(8) {
            0 => self.mutated(second),
            1.. if is_scored => second[self.below(second.len())].clone(),
            1 => second[self.below(second.len())].clone(),
            _ => Vec::new(),
        };
        joined(&self.mutated(first), &other)
    }

    /// One of the inputs with one to three changes: bytes, digits, a part left out, doubled, or taken from another input.
    fn mutated(&mut self, inputs: &[Vec<u8>]) -> Vec<u8> {
        let mut data = inputs[self.below(inputs.len())].clone();
        for _ in 0..=self.below(8).saturating_sub(5) {
            let (at, length) = (self.below(data.len() + 1), 1 + self.below(4));
            let end = (at + length).min(data.len());
            match self.below(6) {
                0 if at < end => data[at] ^= 1 << self.below(8),
                1 if at < end => {
                    data[at] = [0, 1, 0x7f, 0x80, 0xff, b'0', b'9', b'-', b'"', b'(', b' ', b','][self.below(12)];
                }
                2 => drop(data.drain(at..end)),
                3 => {
                    let doubled = data[at..end].to_vec();
                    drop(data.splice(at..at, doubled));
                }
                4 => {
                    let other = &inputs[self.below(inputs.len())];
                    let from = self.below(other.len() + 1);
                    let part = other[from..(from + length).min(other.len())].to_vec();
                    drop(data.splice(at..end, part));
                }
                _ => data.insert(at, b"0123456789"[self.below(10)]),
            }
        }
        data
    }

    /// Mostly one change, up to four.
    fn mutant(&mut self) -> Vec<u8> {
        let changes = 1 + (self.next() % 8).saturating_sub(4);
        let length = 3 + CHANGE * usize::try_from(changes).unwrap_or(1);
        (0..length.div_ceil(8)).flat_map(|_| self.next().to_le_bytes()).take(length).collect()
    }
}

/// Time limit of a mutant. Decoding some hundred rows takes less than a millisecond. The library takes seconds to skip
/// a field that declares 2^31 elements, which the program refuses earlier.
const LONGEST: Duration = Duration::from_mins(2);

/// Ends the campaign if a mutant takes too long, before it uses up the memory.
fn watch(under_way: &Mutex<(Instant, Vec<u8>)>) {
    loop {
        thread::sleep(Duration::from_millis(500));
        let (since, data) = under_way.lock().expect("nothing panics with it").clone();
        if since.elapsed() > LONGEST && !data.is_empty() {
            eprintln!("takes long: {data:02x?}");
            std::process::exit(1);
        }
    }
}

/// Runs `count` mutants on `threads` threads and prints the counts as a table.
pub fn run(count: u64, seed: u64, threads: u64) -> ExitCode {
    let of_thread = |thread: u64| {
        let under_way = Arc::new(Mutex::new((Instant::now(), Vec::new())));
        thread::spawn({
            let under_way = Arc::clone(&under_way);
            move || watch(&under_way)
        });
        move || {
            let mut random = Random(seed.wrapping_mul(1000) + thread);
            let mut outcomes = BTreeMap::<Outcome, u64>::new();
            let mut disagreements = Vec::new();
            for _ in (thread..count).step_by(usize::try_from(threads).unwrap_or(1)) {
                let data = random.mutant();
                *under_way.lock().expect("nothing panics with it") = (Instant::now(), data.clone());
                match panic::catch_unwind(AssertUnwindSafe(|| pages::outcome(&data))) {
                    Ok(outcome) => *outcomes.entry(outcome).or_default() += 1,
                    Err(_) => disagreements.push(data),
                }
            }
            (outcomes, disagreements)
        }
    };
    let running: Vec<_> = (0..threads.max(1)).map(|at| thread::spawn(of_thread(at))).collect();
    let (mut outcomes, mut disagreements) = (BTreeMap::<Outcome, u64>::new(), Vec::new());
    for thread in running {
        let (some, found) = thread.join().expect("disagreements are counted, other panics end the campaign");
        for (outcome, count) in some {
            *outcomes.entry(outcome).or_default() += count;
        }
        disagreements.extend(found);
    }
    println!("| outcome | mutants |\n|---|--:|");
    for (outcome, count) in &outcomes {
        println!("| {outcome:?} | {count} |");
    }
    println!("| disagreements | {} |", disagreements.len());
    println!("| all | {} |", outcomes.values().sum::<u64>() + disagreements.len() as u64);
    for data in disagreements.iter().take(20) {
        eprintln!("disagreement: {data:02x?}");
    }
    if disagreements.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Runs a target on `count` mutants of the inputs in a folder, which depend on the seed alone. A panic counts as a
/// finding, and its input is written to the folder `findings`.
pub fn run_mutated(name: &str, corpus: &Path, count: u64, seed: u64) -> ExitCode {
    let mut files: Vec<_> =
        fs::read_dir(corpus).expect("a folder of inputs").map(|file| file.expect("a file").path()).collect();
    files.sort();
    let inputs: Vec<Vec<u8>> = files.iter().map(|file| fs::read(file).expect("a file that can be read")).collect();
    let target = mirrorstats_fuzz::target(name);
    let is_pair = PAIRS.contains(&name);
    let parts: Vec<(&[u8], &[u8])> = inputs.iter().filter_map(|input| parted(input)).collect();
    let parts = [0, 1]
        .map(|side| parts.iter().map(|part| if side == 0 { part.0 } else { part.1 }.to_vec()).collect::<Vec<_>>());
    let mut random = Random(seed);
    let (mut findings, begun) = (0, Instant::now());
    let mut depths = BTreeMap::<String, u64>::new();
    for at in 0..count {
        let data = if is_pair { random.pair(&parts, name == "styled") } else { random.mutated(&inputs) };
        if panic::catch_unwind(AssertUnwindSafe(|| target(&data))).is_err() {
            findings += 1;
            fs::create_dir_all("findings").expect("a folder for findings");
            fs::write(format!("findings/{name}-{seed}-{at}"), &data).expect("a file for a finding");
        }
        *depths.entry(mirrorstats_fuzz::depth::taken().to_string()).or_default() += 1;
    }
    let depths: Vec<String> = depths.iter().map(|(depth, count)| format!("{depth} {count}")).collect();
    println!("| {name} | {count} | {} | {findings} |", depths.join(", "));
    eprintln!("{name}: {:?}", begun.elapsed());
    if findings == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
