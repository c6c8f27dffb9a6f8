//! The options that a command line names, and the refusal of those that have no effect.
//!
//! In: the arguments of a verb. Out: an error that names the first option without an effect, and why it has none. What can be said about two
//! options whatever their values is said to clap (`conflicts_with`, `requires`); what depends on a value is checked here.

use crate::cli::failure::Failure;
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, Command, FromArgMatches};

/// The options that the command line names, without those that have their default values. It must be the first field of the options of a verb:
/// the fields before it have taken their values out of the matches.
#[derive(Debug, Clone, Default)]
pub struct Given(Vec<String>);

/// Why a time degree has no effect beside a low spatial degree.
pub const WITHOUT_TIME: &str = "with --sh-degree below 3: only color of degree 3 depends on time";

impl Given {
    /// Checks that none of these options (`--name`) is named; `reason` completes the sentence "OPTION has no effect ...".
    ///
    /// # Errors
    /// The first of the options that is named.
    pub fn none_of(&self, options: &[&str], reason: &str) -> Result<(), Failure> {
        match options.iter().find(|option| self.has(option)) {
            Some(option) => Err(Failure::new(format!("{option} has no effect {reason}; leave it out"))),
            None => Ok(()),
        }
    }

    /// Returns whether an option (`--name`) is named.
    fn has(&self, option: &str) -> bool {
        self.0.iter().any(|named| named == option)
    }
}

impl FromArgMatches for Given {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let ids = matches.ids().map(clap::Id::as_str);
        let named = ids.filter(|id| matches.value_source(id) == Some(ValueSource::CommandLine));
        // The id of an option is the name of its field.
        Ok(Self(named.map(|id| format!("--{}", id.replace('_', "-"))).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// No arguments of its own.
impl Args for Given {
    fn augment_args(command: Command) -> Command {
        command
    }

    fn augment_args_for_update(command: Command) -> Command {
        command
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Options {
        #[command(flatten)]
        given: Given,
        #[arg(long, default_value_t = 3)]
        mean_bits: u32,
        #[arg(long)]
        sparse: bool,
    }

    #[test]
    fn options_with_default_values_are_not_given() {
        let of = |arguments: &[&str]| Options::try_parse_from([&["gs4d"], arguments].concat()).expect("valid options");
        let options = of(&["--mean-bits", "3"]);
        assert_eq!((options.mean_bits, options.sparse), (3, false), "values are parsed as without the list");
        let refused = options.given.none_of(&["--sparse", "--mean-bits"], "here").expect_err("it is named");
        assert_eq!(refused.message(), "--mean-bits has no effect here; leave it out", "the option and the reason");
        of(&["--sparse"]).given.none_of(&["--mean-bits"], "here").expect("a default value is not refused");
        assert!(of(&["--sparse"]).given.none_of(&["--sparse"], "here").is_err(), "flags are options");
    }
}
