//! People as agents: their arguments and their player.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::cli::args::one_of;
use crate::cli::{Failure, output};
use mirrorstats_agents::human::Human;
use mirrorstats_agents::human::design::{Design, Schedule};
use mirrorstats_agents::human::hub::{Eraser, Hub};
use mirrorstats_agents::human::journal::ParticipantJournal;
use mirrorstats_agents::human::seat::Terms;
use mirrorstats_agents::human::server::{self, Server};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;
use mirrorstats_record::participants::remove_episodes;
use mirrorstats_record::plan::Plan;
use mirrorstats_web::{cannot_listen, listen, new_token};

/// The limit for the text of consent, which people read.
const LONGEST_CONSENT: Limit = Limit::new("bytes of the words of consent", 1 << 20);

/// The most repetitions of a scene, and the most seeds: the times of frames cannot distinguish more.
const MOST_REPEATS: i32 = 999;
const MOST_SEEDS: i32 = 4_000;

/// Who plays in the browser.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "With --agent human")]
pub struct HumanArgs {
    /// Codes of the participants, not their names; each code has its own permanent link
    #[arg(long, value_name = "CODES", value_delimiter = ',', default_value = "P1", value_parser = code)]
    participants: Vec<String>,
    /// Who plays what: split, each episode is played by one participant; crossed, everyone plays every scene; own-seeds,
    /// everyone plays --seeds seeds of their own
    #[arg(long, value_name = "DESIGN", default_value = "split", hide_possible_values = true, value_parser = one_of(&Design::ALL, Design::name))]
    design: Design,
    /// A text that participants agree to before they begin
    #[arg(long, value_name = "FILE")]
    consent: Option<PathBuf>,
    /// A contact for questions, such as a name and a telephone number; shown on every page
    #[arg(long, value_name = "TEXT")]
    contact: Option<String>,
    /// Keep an identification in its field from step to step of an episode; a model has no such memory
    #[arg(long)]
    prefill_identification: bool,
    /// The port of their pages; 0 for any that is free
    #[arg(long, value_name = "PORT", default_value_t = 7432)]
    human_port: u16,
    /// The address or name under which browsers reach this machine [default: this machine only]
    #[arg(long, value_name = "HOST")]
    human_host: Option<String>,
}

impl HumanArgs {
    /// The player for people, whose pages are served from now on, unless `plays` is false since nothing is recorded.
    /// Each person plays `seeds` own seeds, each scene `repeats` times.
    pub fn player(
        &self,
        model: Option<&str>,
        (seeds, repeats): (i32, i32),
        out: &Path,
        plays: bool,
    ) -> Result<Human, Failure> {
        let own: BTreeSet<&String> = self.participants.iter().collect();
        if own.len() < self.participants.len() {
            return Err(Failure::input("--participants: a code occurs twice"));
        }
        let terms = Terms {
            consent: self.consent.as_deref().map(words).transpose()?,
            contact: self.contact.clone(),
            prefills: self.prefill_identification,
        };
        let unwritable = |error| Failure::input(format!("the journal in {} cannot be opened: {error}", out.display()));
        let journal =
            if plays { ParticipantJournal::open(out).map_err(unwritable)? } else { ParticipantJournal::none() };
        let mut people = Vec::new();
        for (code, place) in self.participants.iter().zip(1..) {
            self.check_place(&journal, code, place)?;
            people.push((code.clone(), enrol(&journal, code, place).map_err(unwritable)?));
        }
        let eraser: Eraser = |folder, code| {
            remove_episodes(folder, code).map(|removed| removed.episodes).map_err(|error| error.to_string())
        };
        let schedule = Schedule { design: self.design, seeds, repeats };
        let hub = Arc::new(Hub::new(people.clone(), terms, schedule, journal, eraser));
        if plays {
            hub.delete_due().map_err(Failure::input)?;
        }
        let server = plays.then(|| self.serve(&hub, &people)).transpose()?;
        Ok(Human::new(model.unwrap_or("human"), hub, server))
    }

    /// The joint plan of all participants.
    pub fn spread(&self, plan: Plan) -> Result<Plan, Failure> {
        let people = i32::try_from(self.participants.len()).unwrap_or(i32::MAX);
        let within = |what: &str, each: i32, most: i32| {
            let all = each.checked_mul(people).filter(|all| *all <= most);
            all.ok_or_else(|| {
                Failure::input(format!(
                    "--design {}: {people} participants with {each} {what} each are more than {most}; record in several folders",
                    self.design.name()
                ))
            })
        };
        Ok(match self.design {
            Design::Split => plan,
            Design::Crossed => Plan { repeats: within("repeats", plan.repeats, MOST_REPEATS)?, ..plan },
            Design::OwnSeeds => Plan { seeds: within("seeds", plan.seeds, MOST_SEEDS)?, ..plan },
        })
    }

    fn check_place(&self, journal: &ParticipantJournal, code: &str, place: usize) -> Result<(), Failure> {
        match journal.enrolled(code) {
            Some((before, _)) if before != place && self.design != Design::Split => Err(Failure::input(format!(
                "--participants: `{code}` has place {place}, and had place {before} when this recording began\n  help: keep \
                 the order of the codes, since it says who plays what, and add new codes at the end"
            ))),
            _ => Ok(()),
        }
    }

    fn serve(&self, hub: &Arc<Hub>, people: &[(String, String)]) -> Result<Server, Failure> {
        let (host, port) = (self.human_host.as_deref(), self.human_port);
        let taken = |error: io::Error| {
            let help = "--human-port 0 takes any port that is free";
            Failure::input(format!("{}\n  help: {help}", cannot_listen(host, port, &error)))
        };
        let (listener, guard) = listen(host, port, None).map_err(taken)?;
        let link = guard.link();
        let server = server::start(Arc::clone(hub), listener, guard).map_err(taken)?;
        for (code, token) in people {
            output::say(&format!("{code} plays at {link}?p={token}"));
        }
        Ok(server)
    }
}

/// The token of a participant's link: that of the previous start, or a new one.
fn enrol(journal: &ParticipantJournal, code: &str, place: usize) -> io::Result<String> {
    if let Some((_, token)) = journal.enrolled(code) {
        return Ok(token.to_owned());
    }
    let token = new_token()?;
    journal.enrol(code, place, &token)?;
    Ok(token)
}

/// Parses a code, which is not a name: letters, digits, `-` and `_`.
fn code(text: &str) -> Result<String, String> {
    let is_plain = text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte));
    if text.is_empty() || text.len() > 40 || !is_plain {
        return Err("expected a code of up to 40 letters, digits, `-` or `_`, such as P01".to_owned());
    }
    Ok(text.to_owned())
}

fn words(path: &Path) -> Result<String, Failure> {
    let failed = |error: io::Error| Failure::input(format!("--consent: cannot read {}: {error}", path.display()));
    input::text(path, LONGEST_CONSENT).map_err(failed)
}
