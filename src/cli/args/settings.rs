//! The flags for the settings that methods and solvers list.

use std::marker::PhantomData;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser, ValueParser};
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};

use crate::form_factor;
use crate::setting::{Kind, Setting, Use, Value, Values};
use crate::solver;

/// The settings of a registry, each with its users and their uses.
type Listed = Vec<(&'static Setting, Vec<(&'static str, Use)>)>;

/// A registry whose settings are flags.
pub(crate) trait Registry {
    /// Returns the settings that are flags of every command.
    fn settings() -> Listed;
}

/// The settings of form-factor methods; the tolerance has flags of its own, as a solver has one too.
#[derive(Clone, Debug)]
pub(crate) struct OfMethods;

impl Registry for OfMethods {
    fn settings() -> Listed {
        let mut settings = form_factor::registry::settings();
        settings.retain(|(setting, _)| *setting != &form_factor::TOLERANCE);
        settings
    }
}

/// Returns the flags for the computation of form factors, which do not apply to those read from a file.
pub(super) fn of_computation() -> Vec<&'static str> {
    let own = OfMethods::settings().into_iter().map(|(setting, _)| setting.name);
    own.chain(["method", "seed", "form_factor_tolerance"]).collect()
}

/// The settings of solvers.
#[derive(Clone, Debug)]
pub(crate) struct OfSolvers;

impl Registry for OfSolvers {
    fn settings() -> Listed {
        solver::registry::settings()
    }
}

/// The values that flags give to the settings of a registry.
#[derive(Clone, Debug)]
pub(crate) struct SettingFlags<R> {
    /// The values.
    pub values: Values,
    registry: PhantomData<R>,
}

fn flag(setting: &'static Setting, users: &[(&'static str, Use)]) -> Arg {
    let arg = Arg::new(setting.name)
        .long(setting.name.replace('_', "-"))
        .help(setting.described(users));
    match setting.kind {
        Kind::Flag => arg.action(ArgAction::SetTrue),
        _ => arg.value_name(setting.letter).value_parser(parser(setting)),
    }
}

fn parser(setting: &'static Setting) -> ValueParser {
    match setting.kind {
        Kind::Choice(words) => {
            let values = words.iter().map(|(word, help)| PossibleValue::new(*word).help(*help));
            PossibleValuesParser::new(values)
                .try_map(|word| setting.parse(&word))
                .into()
        }
        _ => ValueParser::new(|text: &str| setting.parse(text)),
    }
}

impl<R: Registry> Args for SettingFlags<R> {
    fn augment_args(command: Command) -> Command {
        let settings = R::settings();
        command.args(settings.iter().map(|(setting, users)| flag(setting, users)))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<R: Registry> FromArgMatches for SettingFlags<R> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut flags = Self {
            values: Values::default(),
            registry: PhantomData,
        };
        flags.update_from_arg_matches(matches)?;
        Ok(flags)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        for (setting, _) in R::settings() {
            let given = match setting.kind {
                Kind::Flag => matches.get_flag(setting.name).then_some(Value::Flag(true)),
                _ => matches.get_one::<Value>(setting.name).copied(),
            };
            if let Some(value) = given {
                self.values.set(setting, value);
            }
        }
        Ok(())
    }
}
