//! URLs among the arguments of the command.
//!
//! In: the values of a command line. Out: those that are URLs, as inputs and outputs of the verb.

use clap::ArgMatches;
use std::collections::BTreeMap;
use std::ffi::OsString;

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

/// Returns arguments with a path in place of a URL, which is an argument of its own or the end of an option's.
pub(crate) fn replaced(arguments: &[OsString], url: &str, path: &str) -> Vec<OsString> {
    let replaced = |argument: &OsString| {
        let before = argument.to_str().and_then(|text| text.strip_suffix(url));
        match before.filter(|before| before.is_empty() || before.starts_with('-')) {
            Some(before) => format!("{before}{path}").into(),
            None => argument.clone(),
        }
    };
    arguments.iter().map(replaced).collect()
}

/// Returns whether a value begins as a URL does.
fn is_url(value: &str) -> bool {
    let is_of_scheme = |c: char| c.is_ascii_alphanumeric() || "+-.".contains(c);
    value.split_once("://").is_some_and(|(scheme, _)| !scheme.is_empty() && scheme.chars().all(is_of_scheme))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_are_replaced_wherever_options_end_in_them() {
        let all = ["gs4d", "s3://a/b", "--data=s3://a/b", "-os3://a/b", "s3://a/b.pth", "x-s3://a/b"];
        let expected = ["gs4d", "/p", "--data=/p", "-o/p", "s3://a/b.pth", "x-s3://a/b"].map(OsString::from);
        assert_eq!(replaced(&all.map(OsString::from), "s3://a/b", "/p"), expected, "whole values alone");
    }
}
