//! A standalone master and two workers on loopback, each in its own process, killed at the end of the test.

use std::fs::{self, File};
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::harness::need;
use crate::harness::program::{Running, wait_for};

/// A running cluster with one core per worker.
pub struct Cluster {
    /// `spark://127.0.0.1:PORT`
    pub master: String,
    /// The `PYTHONPATH` of its Spark.
    pub packages: PathBuf,
    page: String,
    workers: Vec<Running>,
    _master: Running,
    folder: tempfile::TempDir,
}

impl Cluster {
    /// Starts a cluster and waits until both workers have registered.
    pub fn start() -> Self {
        let packages = need::spark();
        let folder = tempfile::tempdir().unwrap();
        let home = packages.join("pyspark");
        let at = folder.path();
        let master = daemon(&home, at, "master", &["org.apache.spark.deploy.master.Master"]);
        let log = at.join("master");
        let url = wait_for("the master", || word_after(&log, "Starting Spark master at "));
        let page =
            wait_for("the master's page", || word_after(&log, "Bound MasterWebUI to 127.0.0.1, and started at "));
        let worker = |name: &str| {
            let work = at.join(format!("{name}-work")).display().to_string();
            let class = "org.apache.spark.deploy.worker.Worker";
            daemon(&home, at, name, &[class, "--cores", "1", "--memory", "1g", "--work-dir", &work, &url])
        };
        let workers = vec![worker("worker-1"), worker("worker-2")];
        let cluster = Self { master: url.clone(), packages, page, workers, _master: master, folder };
        wait_for("two workers", || (cluster.state()["aliveworkers"] == 2).then_some(()));
        cluster
    }

    /// The state of the master.
    pub fn state(&self) -> Value {
        get(&format!("{}/json/", self.page.trim_end_matches('/'))).unwrap_or_default()
    }

    /// Kills the first worker, like a machine that loses power.
    pub fn kill_a_worker(&mut self) {
        drop(self.workers.remove(0));
    }

    /// A folder that is removed with the cluster.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }
}

fn daemon(home: &Path, folder: &Path, name: &str, arguments: &[&str]) -> Running {
    let log = File::create(folder.join(name)).unwrap();
    let mut command = Command::new(home.join("bin/spark-class"));
    command
        .args(&arguments[..1])
        .args(["--host", "127.0.0.1", "--port", "0", "--webui-port", "0"])
        .args(&arguments[1..]);
    // Ignore any other Spark that this machine is configured for.
    for (variable, _) in std::env::vars_os().filter(|(name, _)| name.to_string_lossy().starts_with("SPARK_")) {
        command.env_remove(variable);
    }
    command.env("SPARK_HOME", home).env("SPARK_LOCAL_IP", "127.0.0.1").env("SPARK_DAEMON_MEMORY", "256m");
    command.env("SPARK_DAEMON_JAVA_OPTS", "-XX:TieredStopAtLevel=1 -XX:+UseSerialGC");
    let child = command.stdin(Stdio::null()).stdout(log.try_clone().unwrap()).stderr(log).spawn();
    Running(child.unwrap())
}

/// The word after `words` in a log, once its line is complete.
pub fn word_after(log: &Path, words: &str) -> Option<String> {
    let text = fs::read_to_string(log).ok()?;
    let (_, rest) = text.split_once(words)?;
    let (line, _) = rest.split_once('\n')?;
    Some(line.split_whitespace().next()?.trim_end_matches('.').to_owned())
}

/// The JSON at `http://host:port/path`.
pub fn get(url: &str) -> Option<Value> {
    let (host, path) = url.strip_prefix("http://")?.split_once('/')?;
    let mut stream = TcpStream::connect(host).ok()?;
    write!(stream, "GET /{path} HTTP/1.0\r\nHost: {host}\r\n\r\n").ok()?;
    let mut response = String::new();
    stream.read_to_string(&mut response).ok()?;
    serde_json::from_str(response.split_once("\r\n\r\n")?.1).ok()
}
