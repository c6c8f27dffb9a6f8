//! URLs among the arguments of the command.
//!
//! In: the values of a command line. Out: those that are URLs, as inputs and outputs of the verb.

use clap::ArgMatches;
use std::collections::BTreeMap;

/// The arguments of verbs that name outputs; all others name inputs.
pub(super) const OUTPUTS: [&str; 3] = ["out", "out_option", "csv"];
/// The outputs whose names are those of inputs of other verbs.
pub(super) const OUTPUTS_OF_VERBS: [(&str, &str); 1] = [("info", "cameras")];

/// A URL in a command line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct NamedUrl {
    /// The URL as it is spelled.
    pub url: String,
    /// Whether the verb writes to it; otherwise, it reads it.
    pub is_output: bool,
}

/// Returns the URLs among the values of a command line, each once.
///
/// # Errors
/// A URL that is an input and an output.
pub(crate) fn urls(matches: &ArgMatches) -> Result<Vec<NamedUrl>, String> {
    let Some((verb, matches)) = matches.subcommand() else { return Ok(Vec::new()) };
    let mut found = BTreeMap::new();
    for id in matches.ids().map(clap::Id::as_str) {
        let is_output = OUTPUTS.contains(&id) || OUTPUTS_OF_VERBS.contains(&(verb, id));
        let values = matches.try_get_raw(id).ok().flatten().into_iter().flatten();
        for url in values.filter_map(|value| value.to_str()).filter(|value| is_url(value)) {
            if found.insert(url.to_owned(), is_output).is_some_and(|other| other != is_output) {
                return Err(format!("{url}: is an input and an output: write to another place"));
            }
        }
    }
    Ok(found.into_iter().map(|(url, is_output)| NamedUrl { url, is_output }).collect())
}

/// Returns whether a value begins as a URL does.
fn is_url(value: &str) -> bool {
    let is_of_scheme = |c: char| c.is_ascii_alphanumeric() || "+-.".contains(c);
    value.split_once("://").is_some_and(|(scheme, _)| !scheme.is_empty() && scheme.chars().all(is_of_scheme))
}
