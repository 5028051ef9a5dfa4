//! The child process: `spark-submit` with the driver, in its own folder, which is deleted afterwards.
//!
//! Spark's log never reaches the terminal. The driver ends when this process ends, for any reason; when this process
//! stops waiting, it ends the child.

use std::fs::{self, File};
use std::io;
use std::net::{TcpStream, ToSocketAddrs as _};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use super::answer::Answer;
use super::locate::{Spark, locate};
use super::request::{ANSWER, Place, Request};
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

pub(super) fn submit(request: &Request, cluster: &Cluster, place: &Place) -> Result<Answer, SparkError> {
    let spark = locate()?;
    reach(cluster)?;
    let request = serde_json::to_vec(request).map_err(|error| SparkError::Answer { words: error.to_string() })?;
    let log = cluster.log.clone().unwrap_or_else(|| place.path("log"));
    let open = |what: &str| {
        let file = File::create(&log).and_then(|file| Ok((file.try_clone()?, file)));
        file.map_err(|source| SparkError::System { what: format!("write {what}"), source })
    };
    let (out, err) = open("Spark's log (--spark-log)")?;
    let mut command = command(&spark, cluster);
    command.arg(place.file("driver.py", DRIVER.as_bytes())?).arg(place.file("request.json", &request)?);
    let child = command.stdin(Stdio::null()).stdout(out).stderr(err).spawn();
    let started = |source| SparkError::System { what: format!("start `{}`", spark.program.display()), source };
    Running(child.map_err(started)?).wait().map_err(started)?;
    match fs::read(place.path(ANSWER)) {
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
    let mut last = None;
    for address in addresses.split(',') {
        match connect(address) {
            Ok(()) => return Ok(()),
            Err(error) => last = Some(error),
        }
    }
    let words = last.map_or_else(|| "no address".to_owned(), |error| error.to_string());
    Err(SparkError::Master { master: master.clone(), words })
}

fn connect(address: &str) -> io::Result<()> {
    let mut last = io::Error::new(io::ErrorKind::InvalidInput, "expected spark://HOST:PORT");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(_) => return Ok(()),
            Err(error) => last = error,
        }
    }
    Err(last)
}
