//! The help of every command, as a new user reads it.

use std::fmt::Write as _;
use std::path::Path;

use crate::assert_shown;
use crate::run;

/// The commands that a help text lists, `help` itself apart: below headings, two spaces before the name.
fn commands(help: &str) -> Vec<String> {
    let listed = help.lines().skip_while(|line| !line.starts_with("Usage:")).skip(1);
    let listed = listed.take_while(|line| !line.starts_with("Options") && !line.starts_with("Arguments"));
    let names = listed.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    names.map(|line| line.split_whitespace().next().unwrap().to_owned()).filter(|name| name != "help").collect()
}

fn collect(command: &[&str], all: &mut String) {
    let help = run(Path::new("."), &[command, &["--help"]].concat()).done();
    writeln!(all, "$ mirrorstats {}\n{help}", [command, &["--help"]].concat().join(" ")).unwrap();
    for name in commands(&help) {
        collect(&[command, &[name.as_str()]].concat(), all);
    }
}

#[test]
fn every_command_tells_its_options() {
    let mut all = String::new();
    collect(&[], &mut all);
    assert_shown!("the help of every command, as it is listed by those above it", all);
}

#[test]
fn the_version_is_that_of_the_package_and_the_long_one_tells_the_features() {
    let version = run(Path::new("."), &["-V"]).done();
    assert_eq!(version, format!("mirrorstats {}\n", env!("CARGO_PKG_VERSION")));
    let long = run(Path::new("."), &["--version"]).done();
    let (first, features) = long.split_once('\n').unwrap();
    assert_eq!(format!("{first}\n"), version);
    assert_eq!(features.contains("sim"), cfg!(feature = "sim"));
    assert_eq!(features.contains("polars"), cfg!(feature = "polars"));
}
