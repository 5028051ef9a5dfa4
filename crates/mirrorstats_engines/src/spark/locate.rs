//! Finds Spark: in `SPARK_HOME`, else by the `spark-submit` on `PATH`, else in Python's package `pyspark`.

use std::env;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::SparkError;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Spark {
    pub(super) program: PathBuf,
    pub(super) home: Option<PathBuf>,
}

const PROGRAM: &str = "bin/spark-submit";

pub(super) fn locate() -> Result<Spark, SparkError> {
    if let Some(home) = env::var_os("SPARK_HOME").filter(|home| !home.is_empty()) {
        let program = Path::new(&home).join(PROGRAM);
        return if program.is_file() {
            Ok(Spark { program, home: None })
        } else {
            Err(SparkError::Home { home: home.to_string_lossy().into_owned() })
        };
    }
    if let Some(program) = on_path(&env::var_os("PATH").unwrap_or_default()) {
        return Ok(Spark { program, home: None });
    }
    let python = python();
    package(&python).ok_or(SparkError::NoSpark { python })
}

fn on_path(path: &OsStr) -> Option<PathBuf> {
    env::split_paths(path).map(|folder| folder.join("spark-submit")).find(|program| program.is_file())
}

fn python() -> String {
    let chosen = ["PYSPARK_DRIVER_PYTHON", "PYSPARK_PYTHON"].into_iter().find_map(|name| env::var(name).ok());
    chosen.unwrap_or_else(|| "python3".to_owned())
}

/// The Spark inside the package `pyspark`, which is found without importing it.
fn package(python: &str) -> Option<Spark> {
    let ask =
        "import importlib.util as u; s = u.find_spec('pyspark'); print(s.submodule_search_locations[0] if s else '')";
    let asked = Command::new(python).args(["-c", ask]).stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
    let home = PathBuf::from(String::from_utf8(asked.stdout).ok()?.trim());
    let program = home.join(PROGRAM);
    program.is_file().then_some(Spark { program, home: Some(home) })
}

#[cfg(test)]
mod tests {
    use std::env::join_paths;
    use std::fs;

    use super::on_path;

    #[test]
    fn the_first_match_on_the_path_wins() {
        let folder = tempfile::tempdir().unwrap();
        let [none, first, second] = ["none", "first", "second"].map(|name| folder.path().join(name));
        for place in [&none, &first, &second] {
            fs::create_dir(place).unwrap();
        }
        for place in [&first, &second] {
            fs::write(place.join("spark-submit"), "").unwrap();
        }
        assert_eq!(on_path(&join_paths([&none, &first, &second]).unwrap()), Some(first.join("spark-submit")));
        assert_eq!(on_path(&join_paths([&none]).unwrap()), None);
    }
}
