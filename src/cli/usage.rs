//! The command line, and what is wrong with one that cannot be understood.
//!
//! In: the arguments of the process. Out: the options; or the exit code, after help or the error has been printed, with `--json` as
//! one JSON document.

use super::failure::{FAILED, Failure};
use super::report::Report;
use clap::Parser;
use std::env;
use std::process::ExitCode;

/// Parses the arguments of the process.
///
/// # Errors
/// The exit code, if help was asked for or the arguments cannot be understood. What is to be said about it has been printed.
pub fn parse<C: Parser>() -> Result<C, ExitCode> {
    C::try_parse().map_err(|error| {
        let failed = error.use_stderr();
        // The exit code does not depend on whether somebody listens.
        if failed && env::args_os().any(|argument| argument == "--json") {
            let _ = Report::of_failure(Failure::new(in_short(&error.render().to_string()))).print(true);
        } else {
            let _ = error.print();
        }
        if failed { ExitCode::from(FAILED) } else { ExitCode::SUCCESS }
    })
}

/// Returns what is wrong in one line, without the usage that follows it.
fn in_short(text: &str) -> String {
    let text = ["\nUsage:", "\nFor more information"].iter().fold(text, |text, part| before(text, part));
    let words: Vec<&str> = text.strip_prefix("error:").unwrap_or(text).split_whitespace().collect();
    words.join(" ")
}

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
        assert_eq!(in_short(text), short, "no usage");
        assert_eq!(in_short("error: no verb\n\nFor more information, try '--help'.\n"), "no verb", "nothing else");
    }
}
