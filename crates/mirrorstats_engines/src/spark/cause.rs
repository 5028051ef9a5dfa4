//! Spark's own errors, shortened to their cause: one line, without stack, plan, secrets or users in URIs.

use serde::Deserialize;

use super::setting::Setting;
use super::source::without_user;
use super::{Cluster, SparkError};

const LONGEST: usize = 400;

#[derive(Debug, Deserialize)]
pub(super) struct Failed {
    pub(super) name: String,
    pub(super) message: String,
}

pub(super) fn of_failure(failed: &Failed, cluster: &Cluster) -> SparkError {
    let cause = shortened(&failed.message, &cluster.settings);
    let named = cause.is_empty();
    SparkError::Failed { cause: if named { failed.name.clone() } else { cause } }
}

pub(super) fn of_log(log: &[u8], cluster: &Cluster) -> SparkError {
    let log = String::from_utf8_lossy(log);
    let line = |word: &str| log.lines().find(|line| line.contains(word)).map(|line| shortened(line, &cluster.settings));
    let java = [
        "JAVA_HOME is not set",
        "java: command not found",
        "UnsupportedClassVersionError",
        "Unable to locate a Java Runtime",
    ];
    if let Some(words) = java.into_iter().find_map(line) {
        return SparkError::Java { words };
    }
    if let Some(words) = line("All masters are unresponsive") {
        return SparkError::Master { master: cluster.master.clone().unwrap_or_default(), words };
    }
    let last = |word: &str| log.lines().rfind(|line| line.starts_with(word));
    let cause = ["Caused by: ", "Exception in thread", "Error: "].into_iter().find_map(last);
    let cause = cause.or_else(|| log.lines().rfind(|line| !line.trim().is_empty()));
    let cause = cause.map_or_else(|| "it ended without a word".to_owned(), |line| shortened(line, &cluster.settings));
    SparkError::Failed { cause }
}

pub(super) fn kind(name: &str) -> &str {
    match name {
        "string" => "text",
        "int" => "integers",
        "float" => "floats",
        "bool" => "true or false",
        other => other,
    }
}

fn shortened(message: &str, settings: &[Setting]) -> String {
    let innermost = message.lines().rfind(|line| line.starts_with("Caused by: "));
    let line = innermost.or_else(|| message.lines().find(|line| !line.trim().is_empty())).unwrap_or_default();
    let line = line.trim().trim_start_matches("Caused by: ").trim_start_matches("Exception in thread \"main\" ");
    // Drops the location in the statement, which is generated.
    let line = line.split("; line ").next().unwrap_or_default();
    let line = line.split(" SQLSTATE: ").next().unwrap_or_default();
    let line = without_class(line);
    let mut words: Vec<String> = line.split(' ').map(without_users).collect();
    for secret in settings.iter().filter(|setting| setting.is_secret() && !setting.value().is_empty()) {
        words = words.into_iter().map(|word| word.replace(secret.value(), "***")).collect();
    }
    let text = words.join(" ");
    let cut = text.char_indices().nth(LONGEST).map(|(at, _)| at);
    cut.map_or_else(|| text.clone(), |at| format!("{}...", &text[..at]))
}

/// `java.io.IOException: no` without the class name.
fn without_class(line: &str) -> &str {
    match line.split_once(": ") {
        Some((class, rest)) if class.contains('.') && !class.contains([' ', '/', '[']) && !rest.is_empty() => rest,
        _ => line,
    }
}

fn without_users(word: &str) -> String {
    let start = word.find(|c: char| c.is_ascii_alphanumeric()).unwrap_or(0);
    format!("{}{}", &word[..start], without_user(&word[start..]))
}

#[cfg(test)]
mod tests {
    use super::{Setting, SparkError, of_log, shortened};
    use crate::spark::Cluster;

    #[test]
    fn a_cause_is_shortened_to_its_message() {
        for (message, expected) in [
            (
                "[UNRESOLVED_COLUMN] A column `x` cannot be resolved. SQLSTATE: 42703; line 3 pos 4;\n'Project",
                "[UNRESOLVED_COLUMN] A column `x` cannot be resolved.",
            ),
            ("Job aborted\n\tat a.b\nCaused by: java.io.IOException: disk full\n\tat c.d", "disk full"),
            ("\n java.lang.OutOfMemoryError: Java heap space", "Java heap space"),
            ("Path does not exist: s3a://k:s@bucket/x", "Path does not exist: s3a://bucket/x"),
            ("", ""),
        ] {
            assert_eq!(shortened(message, &[]), expected);
        }
        assert_eq!(shortened(&"é".repeat(1000), &[]).chars().count(), 403);
    }

    #[test]
    fn secrets_are_blotted_out() {
        let secret: Setting = "spark.hadoop.fs.s3a.secret.key=hush".parse().unwrap();
        assert_eq!(shortened("signed with hush, refused", &[secret]), "signed with ***, refused");
    }

    #[test]
    fn the_log_of_a_spark_that_never_started_is_understood() {
        let about = |log: &str| of_log(log.as_bytes(), &Cluster::default());
        assert!(
            matches!(about("load\nJAVA_HOME is not set\n"), SparkError::Java { words } if words == "JAVA_HOME is not set")
        );
        let refused = "INFO x\nException in thread \"main\" org.apache.spark.SparkException: Could not parse Master URL: 'x'\n\tat y\n";
        assert!(matches!(about(refused), SparkError::Failed { cause } if cause == "Could not parse Master URL: 'x'"));
        assert!(matches!(about(""), SparkError::Failed { cause } if cause == "it ended without a word"));
        assert!(matches!(about("ERROR All masters are unresponsive! Giving up."), SparkError::Master { .. }));
    }
}
