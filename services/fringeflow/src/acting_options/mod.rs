//! Which options of a command act in which of its modes. An option that would be ignored is refused.
//!
//! Every command lists its options in a table. A choice has several modes, such as `--sweep` and an input, and exactly
//! one of them is chosen. An option listed in modes of a choice acts only in those. An option that is in no list is
//! refused, so that a new option cannot be ignored by mistake. The parser itself refuses two options that contradict
//! each other.

#[cfg(test)]
mod tests;

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches};

/// The options of a command with arguments `A`, by the identifiers of the parser.
pub(crate) struct ActingOptions<A: 'static> {
    /// Options that act in every mode.
    pub(crate) always: &'static [&'static str],
    /// The choices between modes.
    pub(crate) choices: &'static [&'static [Mode<A>]],
}

/// A mode of a command.
pub(crate) struct Mode<A> {
    /// How it is chosen: "with --sweep".
    pub(crate) name: &'static str,
    /// Whether the arguments choose it. The first mode of a choice for which this holds is chosen.
    pub(crate) is_chosen: fn(&A) -> bool,
    /// Options that act in this mode, but not in every mode of its choice.
    pub(crate) options: &'static [&'static str],
}

impl<A> ActingOptions<A> {
    /// The options of a command without modes.
    pub(crate) const fn all(always: &'static [&'static str]) -> Self {
        Self { always, choices: &[] }
    }

    /// Checks that all given options act.
    ///
    /// # Errors
    /// Names an option that would be ignored, and tells why and when it acts.
    pub(crate) fn check(&self, arguments: &A, command: &clap::Command, matches: &ArgMatches) -> Result<(), String> {
        given(command, matches).into_iter().try_for_each(|argument| self.check_option(argument, arguments, command))
    }

    fn check_option(&self, argument: &Arg, arguments: &A, command: &clap::Command) -> Result<(), String> {
        let id = argument.get_id().as_str();
        let mut is_listed = self.always.contains(&id);
        for modes in self.choices {
            let acting: Vec<&str> =
                modes.iter().filter(|mode| mode.options.contains(&id)).map(|mode| mode.name).collect();
            is_listed |= !acting.is_empty();
            let chosen = modes.iter().find(|mode| (mode.is_chosen)(arguments));
            if let Some(chosen) = chosen.filter(|chosen| !acting.is_empty() && !chosen.options.contains(&id)) {
                let (option, chosen, acting) = (name(argument), chosen.name, acting.join(" or "));
                return Err(format!("{option} has no effect {chosen}: leave it out, or use it {acting}"));
            }
        }
        if is_listed {
            return Ok(());
        }
        Err(format!("{} has no effect on `fringeflow {}`: leave it out", name(argument), command.get_name()))
    }
}

/// The arguments that the command line gives, those of nested commands included.
fn given<'a>(command: &'a clap::Command, matches: &ArgMatches) -> Vec<&'a Arg> {
    let is_given = |argument: &&Arg| {
        let id = argument.get_id().as_str();
        matches.try_contains_id(id).is_ok() && matches.value_source(id) == Some(ValueSource::CommandLine)
    };
    let mut given: Vec<&Arg> = command.get_arguments().filter(is_given).collect();
    if let Some((name, nested)) = matches.subcommand()
        && let Some(command) = command.find_subcommand(name)
    {
        given.extend(self::given(command, nested));
    }
    given
}

/// The name of an argument as the command line writes it.
fn name(argument: &Arg) -> String {
    let value = || argument.get_value_names().and_then(<[_]>::first).map(ToString::to_string);
    argument.get_long().map(|long| format!("--{long}")).or_else(value).unwrap_or_default()
}
