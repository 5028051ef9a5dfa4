//! The child process: `spark-submit` with the driver, in its own folder, which is deleted afterwards.
//!
//! Spark's log never reaches the terminal. The driver ends when this process ends, for any reason; when this process
//! stops waiting, it ends the child.

use std::fs::{self, File};
use std::io;
use std::net::{TcpStream, ToSocketAddrs as _};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use super::answer::Answer;
use super::locate::{Spark, locate};
use super::request::{ANSWER, Request};
use super::{Cluster, SparkError, cause};

const DRIVER: &str = include_str!("../../../../assets/spark/driver.py");
/// The time that a master has to accept a connection.
const PATIENCE: Duration = Duration::from_secs(10);

/// The child, which does not outlive its owner.
struct Running(Child);

impl Running {
    fn wait(mut self) -> io::Result<ExitStatus> {
        self.0.wait()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Fails if the child has already ended, which is fine.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

pub(super) fn submit(request: &Request<'_>, cluster: &Cluster, place: &Path) -> Result<Answer, SparkError> {
    let spark = locate()?;
    reach(cluster)?;
    let request = serde_json::to_vec(request).map_err(|error| SparkError::Answer { words: error.to_string() })?;
    let log = cluster.log.clone().unwrap_or_else(|| place.join("log"));
    let opened = File::create(&log).and_then(|file| Ok((file.try_clone()?, file)));
    let (out, err) = opened.map_err(SparkError::system("write Spark's log (--spark-log)"))?;
    let mut command = command(&spark, cluster);
    for (name, bytes) in [("driver.py", DRIVER.as_bytes()), ("request.json", &request)] {
        fs::write(place.join(name), bytes).map_err(SparkError::system("write a temporary file"))?;
        command.arg(place.join(name));
    }
    let child = command.stdin(Stdio::null()).stdout(out).stderr(err).spawn();
    child
        .and_then(|child| Running(child).wait())
        .map_err(SparkError::system(format!("start `{}`", spark.program.display())))?;
    match fs::read(place.join(ANSWER)) {
        Ok(answer) => serde_json::from_slice(&answer).map_err(|error| SparkError::Answer { words: error.to_string() }),
        Err(_) => Err(cause::of_log(&fs::read(&log).unwrap_or_default(), cluster)),
    }
}

fn command(spark: &Spark, cluster: &Cluster) -> Command {
    let mut command = Command::new(&spark.program);
    if let Some(home) = &spark.home {
        command.env("SPARK_HOME", home);
    }
    if let Some(master) = &cluster.master {
        command.args(["--master", master]);
    }
    command.args(["--deploy-mode", "client"]);
    for setting in cluster.settings.iter().filter(|setting| !setting.is_secret()) {
        command.arg("--conf").arg(format!("{}={}", setting.key(), setting.value()));
    }
    command
}

/// Fails fast if the master is unreachable: Spark itself would retry for a minute.
fn reach(cluster: &Cluster) -> Result<(), SparkError> {
    let Some(master) = &cluster.master else { return Ok(()) };
    let Some(addresses) = master.strip_prefix("spark://") else { return Ok(()) };
    let connect = |address: &str| {
        first_ok(address.to_socket_addrs()?.map(|address| TcpStream::connect_timeout(&address, PATIENCE)))
    };
    let failed = |error: io::Error| SparkError::Master { master: master.clone(), words: error.to_string() };
    first_ok(addresses.split(',').map(connect)).map(drop).map_err(failed)
}

fn first_ok<T>(attempts: impl Iterator<Item = io::Result<T>>) -> io::Result<T> {
    let mut last = Err(io::Error::new(io::ErrorKind::InvalidInput, "expected spark://HOST:PORT"));
    for attempt in attempts {
        last = attempt;
        if last.is_ok() {
            break;
        }
    }
    last
}
