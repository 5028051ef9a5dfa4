//! Defaults of options from `mirrorstats.toml`.
//!
//! A setting is a default of an option, for one command or for all that have it. Typed options take precedence, and the
//! setting of one command precedes that of all.
//!
//! Rule: an unknown setting, or one with an invalid value, is refused before anything runs.

use std::env;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Arg, Command};
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use crate::cli::outcome::Failure;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::{input, suggest};
use mirrorstats_toml_spec::{Fault, Faults, Place, Source, parse_toml};

const FILE: &str = "mirrorstats.toml";
/// The variable that names another file; if it is empty, no file is read.
const FILE_VARIABLE: &str = "MIRRORSTATS_CONFIG_FILE";
const LARGEST: Limit = Limit::new("bytes of a configuration file", 1 << 20);

/// A default of an option.
pub struct Setting {
    /// The command, such as `definitions check`; none for every command that has the option.
    command: Option<String>,
    /// The option's long name.
    pub option: String,
    pub values: Vec<String>,
}

/// An option of a command.
pub struct Choice<'a> {
    pub command: String,
    pub arg: &'a Arg,
}

/// The settings of the file that applies here, in its order; none without a file.
pub fn load(command: &Command) -> Result<Vec<Setting>, Failure> {
    file()?.map_or_else(|| Ok(Vec::new()), |path| of_file(&path, &choices(command, "")))
}

/// A command whose subcommands have these defaults. `path` is its own name, empty for the program.
pub fn with_defaults(command: Command, path: &str, settings: &[Setting]) -> Command {
    let inner: Vec<String> = command.get_subcommands().map(|inner| inner.get_name().to_owned()).collect();
    let command = inner.into_iter().fold(command, |command, name| {
        let path = joined(path, &name);
        command.mut_subcommand(name, |inner| with_defaults(inner, &path, settings))
    });
    if path.is_empty() {
        return command;
    }
    let is_meant = |setting: &&Setting| setting.command.as_deref().is_none_or(|own| own == path);
    command.mut_args(|arg| {
        let own = settings.iter().filter(is_meant).filter(|setting| arg.get_long() == Some(setting.option.as_str()));
        match own.max_by_key(|setting| setting.command.is_some()) {
            Some(setting) => arg.default_values(setting.values.clone()),
            None => arg,
        }
    })
}

fn file() -> Result<Option<PathBuf>, Failure> {
    if let Some(named) = env::var_os(FILE_VARIABLE) {
        return Ok(Some(PathBuf::from(named)).filter(|path| !path.as_os_str().is_empty()));
    }
    let here = env::current_dir().map_err(|error| Failure::input(format!("the current folder: {error}")))?;
    let mut relative = PathBuf::new();
    for folder in here.ancestors() {
        if folder.join(FILE).is_file() {
            return Ok(Some(relative.join(FILE)));
        }
        relative.push("..");
    }
    Ok(None)
}

/// The options of the commands below this one.
pub fn choices<'a>(command: &'a Command, path: &str) -> Vec<Choice<'a>> {
    let mut all = Vec::new();
    for inner in command.get_subcommands() {
        let path = joined(path, inner.get_name());
        let options =
            inner.get_arguments().filter(|arg| arg.get_long().is_some_and(|long| long != "help" && long != "version"));
        all.extend(options.map(|arg| Choice { command: path.clone(), arg }));
        all.extend(choices(inner, &path));
    }
    all
}

fn joined(path: &str, name: &str) -> String {
    format!("{path} {name}").trim_start().to_owned()
}

fn of_file(path: &Path, choices: &[Choice<'_>]) -> Result<Vec<Setting>, Failure> {
    let name = path.display().to_string();
    let text = input::text(path, LARGEST).map_err(|error| {
        Failure::input(format!(
            "cannot read the configuration file `{name}`: {error}\n  help: `{FILE_VARIABLE}=` reads none"
        ))
    })?;
    let source = Arc::new(Source { name, text });
    let (table, faults) = parse_toml(&source);
    let mut reader = OptionFile::new(&source, choices, faults);
    let mut found = Vec::new();
    if reader.faults.is_empty() {
        reader.table(table.get_ref(), "", &mut found);
    }
    reader.finish(found)
}

/// A TOML file with options as keys; reports all faults at once, underlined.
pub struct OptionFile<'a> {
    source: &'a Arc<Source>,
    choices: &'a [Choice<'a>],
    faults: Vec<Fault>,
}

impl<'a> OptionFile<'a> {
    /// A reader of a file with some faults so far, for the options of these commands.
    pub const fn new(source: &'a Arc<Source>, choices: &'a [Choice<'a>], faults: Vec<Fault>) -> Self {
        Self { source, choices, faults }
    }

    pub fn finish<T>(self, result: T) -> Result<T, Failure> {
        if self.faults.is_empty() { Ok(result) } else { Err(Failure::Faults(Faults(self.faults).in_order())) }
    }

    pub fn fault(&mut self, span: Range<usize>, message: String, help: Option<String>) {
        let place = Place { source: self.source.clone(), span };
        self.faults.push(Fault::new(place, message).help_if(help));
    }

    fn table(&mut self, table: &DeTable<'_>, path: &str, found: &mut Vec<Setting>) {
        for (key, value) in table {
            let DeValue::Table(inner) = value.get_ref() else {
                found.extend(self.setting(key, value, Some(path).filter(|path| !path.is_empty())));
                continue;
            };
            let name = key.get_ref().as_ref();
            let path = joined(path, name);
            if self.choices.iter().any(|choice| is_within(&choice.command, &path)) {
                self.table(inner, &path, found);
            } else {
                let known = self.choices.iter().map(|choice| choice.command.as_str());
                let near = suggest::nearest(&path, known).map(|near| format!("did you mean `[{near}]`?"));
                self.fault(key.span(), format!("no command `{path}`"), near);
            }
        }
    }

    /// The setting of a key, for one command or for every command with that option.
    pub fn setting(
        &mut self,
        key: &Spanned<DeString<'_>>,
        value: &Spanned<DeValue<'_>>,
        command: Option<&str>,
    ) -> Option<Setting> {
        let Some(values) = values(value.get_ref()) else {
            let found = value.get_ref().type_str();
            let message = format!("expected a text, a number, true, false, or a list of them, found {found}");
            self.fault(value.span(), message, None);
            return None;
        };
        let setting = Setting { command: command.map(str::to_owned), option: key.get_ref().to_string(), values };
        match check(&setting, self.choices) {
            Ok(()) => return Some(setting),
            Err(Refusal::Option(message, help)) => self.fault(key.span(), message, help),
            Err(Refusal::Value(message)) => self.fault(value.span(), message, None),
        }
        None
    }
}

fn is_within(command: &str, path: &str) -> bool {
    command.strip_prefix(path).is_some_and(|rest| rest.is_empty() || rest.starts_with(' '))
}

fn values(value: &DeValue<'_>) -> Option<Vec<String>> {
    match value {
        DeValue::Array(all) => {
            let each = all.iter().map(|one| values(one.get_ref()).and_then(|mut one| one.pop()));
            each.collect()
        }
        DeValue::String(text) => Some(vec![text.to_string()]),
        DeValue::Boolean(truth) => Some(vec![truth.to_string()]),
        DeValue::Integer(number) => Some(vec![number.to_string()]),
        DeValue::Float(number) => Some(vec![number.to_string()]),
        DeValue::Datetime(_) | DeValue::Table(_) => None,
    }
}

enum Refusal {
    /// The option does not exist: its name, and a remedy.
    Option(String, Option<String>),
    /// The option refuses the value.
    Value(String),
}

fn check(setting: &Setting, choices: &[Choice<'_>]) -> Result<(), Refusal> {
    let of_command = |choice: &&Choice<'_>| setting.command.as_ref().is_none_or(|command| *command == choice.command);
    let meant: Vec<&Choice<'_>> = choices.iter().filter(of_command).collect();
    let taken: Vec<&&Choice<'_>> =
        meant.iter().filter(|choice| choice.arg.get_long() == Some(setting.option.as_str())).collect();
    if taken.is_empty() {
        let near = suggest::nearest(&setting.option, meant.iter().filter_map(|choice| choice.arg.get_long()));
        let of = setting.command.as_ref().map_or("any command".to_owned(), |command| format!("`{command}`"));
        let message = format!("no option `--{}` of {of}", visible(&setting.option));
        return Err(Refusal::Option(message, near.map(|near| format!("did you mean `{near}`?"))));
    }
    taken.into_iter().try_for_each(|choice| takes(choice, setting))
}

fn takes(choice: &Choice<'_>, setting: &Setting) -> Result<(), Refusal> {
    let own = choice.arg;
    if !own.get_action().takes_values() {
        return match setting.values.as_slice() {
            [one] if ["true", "false"].contains(&one.as_str()) => Ok(()),
            _ => Err(Refusal::Value("expected true or false".to_owned())),
        };
    }
    let mut twin = Arg::new(own.get_id().clone())
        .long(setting.option.clone())
        .action(own.get_action().clone())
        .value_parser(own.get_value_parser().clone());
    if let Some(delimiter) = own.get_value_delimiter() {
        twin = twin.value_delimiter(delimiter);
    }
    let typed = setting.values.iter().flat_map(|value| [format!("--{}={value}", setting.option)]);
    let command = Command::new("mirrorstats").arg(twin).disable_help_flag(true).disable_version_flag(true);
    match command.try_get_matches_from(std::iter::once("mirrorstats".to_owned()).chain(typed)) {
        Ok(_) => Ok(()),
        Err(error) => {
            let words = error.to_string();
            let first = words.lines().next().unwrap_or_default();
            Err(Refusal::Value(first.trim_start_matches("error: ").to_owned()))
        }
    }
}
