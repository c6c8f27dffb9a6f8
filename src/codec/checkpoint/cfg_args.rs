//! `cfg_args`, the text file that the trainer writes next to its checkpoints.
//!
//! In: the files beside a checkpoint, and the text `Namespace(sh_degree=3, ..., white_background=False,
//! prefilter_var=-1.0)` of the file in the same folder. Out: the entries that drawing depends on.

use crate::codec::import::source::Beside;
use std::io;

/// Largest number of bytes that is used of the file, which has about 300.
const LIMIT: usize = 1 << 16;

/// Returns the text of the file among those beside a checkpoint; `None` if it cannot be read, since it is optional.
///
/// # Errors
/// A file that has yet to be fetched: reading begins anew when it is there.
pub(super) fn read(beside: &dyn Beside) -> io::Result<Option<String>> {
    match beside.read("cfg_args") {
        Ok(mut text) => {
            text.truncate(LIMIT);
            Ok(Some(String::from_utf8_lossy(&text).into_owned()))
        }
        Err(error) if error.kind() == io::ErrorKind::WouldBlock => Err(error),
        Err(_) => Ok(None),
    }
}

/// The entries of `cfg_args` that are used; `None` if absent or invalid.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct CfgArgs {
    /// Whether the background in training was white instead of black.
    pub white_background: Option<bool>,
    /// Added to the temporal variance in the marginal, if positive.
    pub prefilter_var: Option<f32>,
}

impl CfgArgs {
    /// Parses the text. All entries are `None` if it is not a `Namespace(...)`.
    pub(super) fn parse(text: &str) -> Self {
        let mut found = Self::default();
        let Some(inside) = text.trim().strip_prefix("Namespace(").and_then(|rest| rest.strip_suffix(')')) else {
            return found;
        };
        for (name, value) in entries(inside).filter_map(|entry| entry.split_once('=')) {
            match (name.trim(), value.trim()) {
                ("white_background", "True") => found.white_background = Some(true),
                ("white_background", "False") => found.white_background = Some(false),
                ("prefilter_var", number) => found.prefilter_var = number.parse().ok().filter(|v: &f32| v.is_finite()),
                _ => {}
            }
        }
        found
    }
}

/// Splits at the commas that are neither in quotes nor in brackets.
fn entries(text: &str) -> impl Iterator<Item = &str> {
    let (mut depth, mut quote, mut escaped) = (0usize, None, false);
    text.split(move |c: char| {
        match (quote, c) {
            (Some(_), _) if escaped => escaped = false,
            (Some(_), '\\') => escaped = true,
            (Some(open), _) if c == open => quote = None,
            (Some(_), _) => {}
            (None, '\'' | '"') => quote = Some(c),
            (None, '(' | '[' | '{') => depth += 1,
            (None, ')' | ']' | '}') => depth = depth.saturating_sub(1),
            (None, _) => return c == ',' && depth == 0,
        }
        false
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_in_quotes_and_brackets_are_ignored() {
        let text = r#"Namespace(sh_degree=3, source_path='/a, white_background=True, \'b', model_path="it's", loaded_pth='',
            extra=[1, (2, 3)], white_background=False, eval=True, prefilter_var=0.25)"#;
        let expected = CfgArgs { white_background: Some(false), prefilter_var: Some(0.25) };
        assert_eq!(CfgArgs::parse(text), expected, "only the outermost entries are used");
    }

    #[test]
    fn unknown_values_are_ignored() {
        for text in [
            "",
            "Namespace(",
            "{white_background: True}",
            "Namespace(white_background=1, prefilter_var=inf)",
            "Namespace(')",
        ] {
            assert_eq!(CfgArgs::parse(text), CfgArgs::default(), "no entry is used from {text}");
        }
    }
}
