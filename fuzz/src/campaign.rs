//! A campaign of page mutants: runs the given number of mutants, which depend on the seed alone, and counts their
//! outcomes.

use std::collections::BTreeMap;
use std::panic::{self, AssertUnwindSafe};
use std::process::ExitCode;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use mirrorstats_fuzz::pages::{self, Outcome, mutate::CHANGE};

/// Draws (`SplitMix64`).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
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
