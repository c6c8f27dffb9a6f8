//! Parsing of the command line, and errors of usage.
//!
//! In: the arguments of the process. Out: the options; or the exit code, after help or an error has been printed. With
//! `--json` the error is one JSON document.

use super::output::failure::{FAILED, Failure};
use super::output::report::Report;
use clap::Parser;
use std::ffi::OsString;
use std::process::ExitCode;

/// Parses the arguments of the process. Returns the options.
///
/// # Errors
/// The exit code, if help is requested or the arguments are invalid. Help or the error has been printed.
pub(super) fn parse<C: Parser>(arguments: &[OsString]) -> Result<C, ExitCode> {
    C::try_parse_from(arguments).map_err(|error| {
        let failed = error.use_stderr();
        // The exit code does not depend on whether printing succeeds.
        if failed && arguments.iter().any(|argument| argument == "--json") {
            let _ = Report::of_failure(Failure::new(in_short(&error.render().to_string()))).print(true);
        } else {
            let _ = error.print();
        }
        if failed { ExitCode::from(FAILED) } else { ExitCode::SUCCESS }
    })
}

/// Returns the message of an error in one line, without the usage that follows it.
fn in_short(text: &str) -> String {
    let text = ["\nUsage:", "\nFor more information"].iter().fold(text, |text, part| before(text, part));
    let words: Vec<&str> = text.strip_prefix("error:").unwrap_or(text).split_whitespace().collect();
    words.join(" ")
}

/// Returns the text before `part`; the whole text if it does not contain `part`.
fn before<'a>(text: &'a str, part: &str) -> &'a str {
    text.split_once(part).map_or(text, |(before, _)| before)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_usage_fit_one_line() {
        let text = "error: unexpected argument '--cout' found\n\n  tip: a similar argument exists: '--count'\n\n\
                    Usage: gs4d synth --count <N> <OUT>\n\nFor more information, try '--help'.\n";
        let short = "unexpected argument '--cout' found tip: a similar argument exists: '--count'";
        assert_eq!(in_short(text), short, "the message has no usage");
        assert_eq!(
            in_short("error: no verb\n\nFor more information, try '--help'.\n"),
            "no verb",
            "the message has no hint to --help"
        );
    }
}
