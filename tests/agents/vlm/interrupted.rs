//! A signal before the first whole episode leaves the journal, from which the same command continues.

use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use mirrorstats_vlm::wire_format::WireFormat;

use super::recordings::{Folder, counting, rows};
use super::server::{Conduct, Server, whole};
use crate::harness::program::{stderr, succeeds};

#[test]
fn a_signal_before_the_first_whole_episode_loses_no_answer() {
    for (signal, code) in [("-INT", Some(130)), ("-TERM", None)] {
        let server = Server::start(|at, request| {
            let answer = whole(WireFormat::OpenaiCompatible, &counting(request, 12, at));
            Conduct::dripping(answer, 1 << 20, Duration::from_millis(50))
        });
        let folder = Folder::new();
        let words = "--seeds 1 --runs 2 --threads 1";
        let mut command = folder.record(&server, "own", words);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        while server.count() < 6 && child.try_wait().unwrap().is_none() {
            sleep(Duration::from_millis(2));
        }
        succeeds(Command::new("kill").args([signal, &child.id().to_string()]));
        let output = child.wait_with_output().unwrap();
        let told = stderr(&output);
        if code.is_some() {
            assert_eq!(output.status.code(), code, "{told}");
            assert!(
                told.contains("2 episodes to go: the same command continues") && !told.contains("again:"),
                "{told}"
            );
        }
        assert_eq!(folder.journals().len(), 2, "{signal}: {told}");
        succeeds(&mut folder.record(&server, "own", words));
        assert_eq!(rows(&folder, "runs").len(), 24, "{signal}");
        // At most the requests under way at the signal were sent again.
        assert!((24..=26).contains(&server.count()), "{signal}: {}", server.count());
    }
}
