//! People as agents: their arguments, and the player that they make.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::cli::outcome::Failure;
use crate::cli::output;
use exact::budget::Limit;
use exact::input;
use web::{self, Guard};
use world::agent::human::hub::Hub;
use world::agent::human::journal::Journal;
use world::agent::human::{Human, server};

/// Words of consent are read by people.
const LONGEST_CONSENT: Limit = Limit::new("bytes of the words of consent", 1 << 20);

/// The people that play in the browser.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "With --agent human")]
pub struct HumanArgs {
    /// The codes of the people who play, each with a link of their own; no names
    #[arg(long, value_name = "CODES", value_delimiter = ',', default_value = "P1", value_parser = code)]
    participants: Vec<String>,
    /// A text file with what people agree to before they begin
    #[arg(long, value_name = "FILE")]
    consent: Option<PathBuf>,
    /// The port of their pages; 0 for any that is free
    #[arg(long, value_name = "PORT", default_value_t = 7432)]
    human_port: u16,
    /// The address or name that their browsers reach this machine by [default: this machine alone]
    #[arg(long, value_name = "HOST")]
    human_host: Option<String>,
}

impl HumanArgs {
    /// The player of the people, whose pages are served from now on; `serves` is not set where nothing is recorded.
    pub fn player(&self, model: Option<&str>, out: &Path, serves: bool) -> Result<Human, Failure> {
        let own: BTreeSet<&String> = self.participants.iter().collect();
        if own.len() < self.participants.len() {
            return Err(Failure::input("--participants: a code stands twice"));
        }
        let consent = self.consent.as_deref().map(words).transpose()?;
        let tokens = self.participants.iter().map(|code| web::new_token().map(|token| (code.clone(), token)));
        let people: Vec<(String, String)> = tokens.collect::<Result<_, _>>()?;
        let model = model.unwrap_or("human");
        if !serves {
            return Ok(Human::new(model, Arc::new(Hub::new(people, consent, Journal::none()))));
        }
        let unwritable = |error| Failure::input(format!("the journal in {} cannot be opened: {error}", out.display()));
        let journal = Journal::open(out).map_err(unwritable)?;
        let hub = Arc::new(Hub::new(people.clone(), consent, journal));
        self.serve(&hub, &people)?;
        Ok(Human::new(model, hub))
    }

    fn serve(&self, hub: &Arc<Hub>, people: &[(String, String)]) -> Result<(), Failure> {
        let host = self.human_host.as_deref().unwrap_or("127.0.0.1");
        let taken = |error| {
            let help = "--human-port 0 takes any port that is free";
            Failure::Rendered(format!("error: cannot listen on {host}:{}: {error}\n  help: {help}", self.human_port))
        };
        let listener = std::net::TcpListener::bind((host, self.human_port)).map_err(taken)?;
        let guard = Guard::new(listener.local_addr().map_err(taken)?, self.human_host.as_deref(), None);
        let link = guard.link();
        server::start(Arc::clone(hub), listener, guard).map_err(taken)?;
        for (code, token) in people {
            output::say(&format!("{code} plays at {link}?p={token}"));
        }
        Ok(())
    }
}

/// A code is no name: letters, digits, `-` and `_`.
fn code(text: &str) -> Result<String, String> {
    let is_plain = text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte));
    if text.is_empty() || text.len() > 40 || !is_plain {
        return Err("expected a code of up to 40 letters, digits, `-` or `_`, such as P01".to_owned());
    }
    Ok(text.to_owned())
}

fn words(path: &Path) -> Result<String, Failure> {
    let failed = |error: std::io::Error| Failure::input(format!("--consent: cannot read {}: {error}", path.display()));
    input::text(path, LONGEST_CONSENT).map_err(failed)
}
