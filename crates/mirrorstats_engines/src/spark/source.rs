//! The inputs of Spark: local files, or URIs that only Spark understands.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;

use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::{TraceFile, TraceSet};
use mirrorstats_trace::schema::colors::palette::Palette;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sources {
    /// Without users and passwords.
    pub(super) names: Vec<String>,
    pub(super) groups: Vec<Group>,
    /// The rows by the footers of local files.
    pub(super) rows: Option<u64>,
    pub(super) palette: Option<Palette>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Group {
    /// URIs; for local files, `file://` without wildcards.
    pub(super) paths: Vec<String>,
    /// Columns that are declared to hold only nulls, so that they have no type to be read as.
    pub(super) void: Vec<String>,
}

impl Sources {
    /// Local files. `traces` are these inputs, opened.
    pub fn files(inputs: &[Input], traces: &TraceSet) -> io::Result<Self> {
        let mut groups: BTreeMap<Vec<String>, Vec<String>> = BTreeMap::new();
        for (input, file) in inputs.iter().zip(traces.files()) {
            let void = file.columns().iter().filter(|column| column.kind.is_none()).map(|column| column.name.clone());
            groups.entry(void.collect()).or_default().push(literal(&local_uri(&input.path)?));
        }
        Ok(Self {
            names: inputs.iter().map(|input| input.name.clone()).collect(),
            groups: groups.into_iter().map(|(void, paths)| Group { paths, void }).collect(),
            rows: Some(traces.files().iter().map(TraceFile::rows).sum()),
            palette: Palette::of_all(traces.files().iter().map(TraceFile::palette)),
        })
    }

    pub fn uris(uris: Vec<String>) -> Self {
        let names = uris.iter().map(|uri| without_user(uri)).collect();
        Self { names, groups: vec![Group { paths: uris, void: Vec::new() }], rows: None, palette: None }
    }

    pub(super) fn name(&self) -> String {
        match self.names.as_slice() {
            [one] => one.clone(),
            [first, others @ ..] => format!("{first} and {} more", others.len()),
            [] => "no trace".to_owned(),
        }
    }
}

/// Returns true if an argument is a URI for Spark (`s3a://bucket/runs`, `hdfs:/runs`, `file:///runs`), not a local
/// file.
pub fn is_uri(argument: &str) -> bool {
    let scheme = argument.split_once(":/").map_or("", |(scheme, _)| scheme);
    // A single letter is a drive.
    scheme.len() > 1
        && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
        && !Path::new(argument).exists()
}

pub(super) fn local_uri(path: &Path) -> io::Result<String> {
    let absolute: PathBuf = std::path::absolute(path)?;
    let text = absolute.to_str().ok_or_else(|| io::Error::other("the path is not UTF-8, as Spark needs it"))?;
    Ok(format!("file://{text}"))
}

fn literal(path: &str) -> String {
    let mut text = String::with_capacity(path.len());
    for c in path.chars() {
        if r"\*?[]{}".contains(c) {
            text.push('\\');
        }
        text.push(c);
    }
    text
}

pub(super) fn without_user(uri: &str) -> String {
    let Some((scheme, rest)) = uri.split_once("://") else { return uri.to_owned() };
    let (authority, path) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
    match authority.rsplit_once('@') {
        Some((_, host)) => format!("{scheme}://{host}{path}"),
        None => uri.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::{is_uri, literal, without_user};

    #[test]
    fn a_uri_has_a_scheme() {
        for uri in ["s3a://bucket/runs", "hdfs:/runs/*.parquet", "file:///runs", "abfss://a@b.net/x"] {
            assert!(is_uri(uri), "{uri}");
        }
        for path in ["runs", "./a:b/c", "C:/runs", "runs/x:/y", "-", "://x", "/a/b"] {
            assert!(!is_uri(path), "{path}");
        }
    }

    #[test]
    fn glob_characters_of_a_file_name_are_escaped() {
        assert_eq!(literal("file:///a/x[1]{b}*.parquet"), r"file:///a/x\[1\]\{b\}\*.parquet");
    }

    #[test]
    fn users_and_passwords_are_left_out() {
        assert_eq!(without_user("s3a://KEY:SECRET@bucket/x@y"), "s3a://bucket/x@y");
        assert_eq!(without_user("s3a://bucket/x@y"), "s3a://bucket/x@y");
    }
}
