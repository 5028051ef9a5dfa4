//! Runs fuzz targets. Built for libFuzzer (`--cfg mirrorstats_libfuzzer`, as in `make fuzz`), it runs the target named
//! by the variable `FUZZ_TARGET`. Otherwise it has its own verbs, which the usage lists.
#![cfg_attr(mirrorstats_libfuzzer, no_main)]

#[cfg(mirrorstats_libfuzzer)]
mod fuzzed {
    use std::sync::LazyLock;

    static TARGET: LazyLock<fn(&[u8])> = LazyLock::new(|| {
        let name = std::env::var("FUZZ_TARGET").unwrap_or_default();
        mirrorstats_fuzz::target(&name)
    });

    static TELLS_DEPTH: LazyLock<bool> = LazyLock::new(|| std::env::var_os("FUZZ_DEPTH").is_some());

    libfuzzer_sys::fuzz_target!(|data: &[u8]| {
        TARGET(data);
        if *TELLS_DEPTH {
            eprintln!("depth: {}", mirrorstats_fuzz::depth::taken());
        }
    });
}

#[cfg(not(mirrorstats_libfuzzer))]
mod campaign;

#[cfg(not(mirrorstats_libfuzzer))]
fn main() -> std::process::ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments.as_slice() {
        ["targets"] => mirrorstats_fuzz::TARGETS.iter().for_each(|(name, _)| println!("{name}")),
        ["seeds", out] => mirrorstats_fuzz::seeds::write(out.as_ref()).expect("a folder that can be written"),
        ["run", target, files @ ..] => {
            for file in files {
                mirrorstats_fuzz::target(target)(&std::fs::read(file).expect("a file that can be read"));
            }
        }
        ["pages", count, seed, threads] => {
            let number = |text: &&str| text.parse().expect("a number");
            return campaign::run(number(count), number(seed), number(threads));
        }
        ["mutate", target, corpus, count, seed] => {
            let number = |text: &str| text.parse().expect("a number");
            return campaign::run_mutated(target, corpus.as_ref(), number(count), number(seed));
        }
        _ => {
            eprintln!(
                "usage: mirrorstats-fuzz targets | seeds FOLDER | run TARGET FILE... | pages MUTANTS SEED THREADS | mutate TARGET CORPUS MUTANTS SEED"
            );
            return std::process::ExitCode::from(2);
        }
    }
    std::process::ExitCode::SUCCESS
}
