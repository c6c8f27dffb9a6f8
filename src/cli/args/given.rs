//! The options that a command line names, and the refusal of those that have no effect.
//!
//! In: the arguments of a verb, and what its input or its other options lack. Out: an error that names the first option
//! without an effect, the reason, and the remedy, by the table of [`effects`](super::effects).

use super::effects::{Need, RULES};
use crate::cli::output::failure::Failure;
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, Command, FromArgMatches};

/// The options that the command line names, without those that have their default values. It must be the first field of
/// the options of a verb, or of a group of options: fields before it have taken their values out of the matches.
#[derive(Debug, Clone, Default)]
pub(crate) struct Given(Vec<String>);

impl Given {
    /// Checks that no option is named that has no effect, if a need of such options is not met.
    ///
    /// # Errors
    /// The first of the options that is named.
    pub(crate) fn require(&self, need: Need, is_met: bool) -> Result<(), Failure> {
        let unmet = RULES.iter().filter(|rule| rule.need == need && !is_met);
        let mut useless = unmet.flat_map(|rule| rule.options.iter().map(move |option| (*option, rule.reason)));
        match useless.find(|(option, _)| self.has(option)) {
            Some((option, reason)) => Err(Failure::new(format!("{option} has no effect {reason}; leave it out"))),
            None => Ok(()),
        }
    }

    /// Returns whether an option is named that has no effect unless a need is met.
    pub(crate) fn depends_on(&self, need: Need) -> bool {
        self.require(need, false).is_err()
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
        #[command(flatten)]
        group: Group,
    }

    /// Options with a list of their own.
    #[derive(clap::Args)]
    struct Group {
        #[command(flatten)]
        given: Given,
        #[arg(long)]
        fps: Option<u32>,
    }

    fn options(arguments: &[&str]) -> Options {
        Options::try_parse_from([&["gs4d"], arguments].concat()).expect("valid options")
    }

    #[test]
    fn options_with_default_values_are_not_given() {
        let given = options(&["--mean-bits", "3", "--sparse"]);
        assert_eq!((given.mean_bits, given.sparse), (3, true), "values are parsed as without the list");
        assert!(given.given.has("--mean-bits") && given.given.has("--sparse"), "options and flags that are named");
        assert!(!options(&["--sparse"]).given.has("--mean-bits"), "a default value is not named");
    }

    #[test]
    fn options_without_an_effect_are_refused_with_the_reason() {
        let given = options(&["--mean-bits", "3"]).given;
        let refused = given.require(Need::Quantized, false).expect_err("it is named");
        let sentence = "--mean-bits has no effect with --quality lossless, which changes no value; leave it out";
        assert_eq!(refused.message(), sentence, "the option, the reason and the remedy");
        given.require(Need::Quantized, true).expect("the need is met");
        given.require(Need::Gpu, false).expect("no option of a GPU is named");
        assert!(given.depends_on(Need::Quantized) && !given.depends_on(Need::Gpu), "some options depend on it");
    }

    #[test]
    fn a_group_of_options_has_a_list_of_its_own() {
        let parsed = options(&["--fps", "3", "--sparse"]);
        assert_eq!(parsed.group.fps, Some(3), "the value is parsed");
        for given in [&parsed.given, &parsed.group.given] {
            given.require(Need::FrameRate, false).expect_err("both lists have the option");
        }
    }
}
