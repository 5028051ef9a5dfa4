//! The help of every command, as a new user reads it.

use std::fmt::Write as _;
use std::path::Path;

use crate::assert_shown;
use crate::run;

/// The commands that a help text lists, `help` itself apart.
fn commands(help: &str) -> Vec<String> {
    let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
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
fn the_version_is_that_of_the_package() {
    let version = run(Path::new("."), &["--version"]).done();
    assert_eq!(version, format!("mirrorstats {}\n", env!("CARGO_PKG_VERSION")));
}
