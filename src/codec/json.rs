//! The JSON of captures.
//!
//! In: the bytes of a file. Out: a value, or why they are none: in words that name what other programs write in place of JSON. A mark of UTF-8 before
//! the text is skipped.

use super::text::{is_utf_16, printable, without_mark};
use serde::Deserialize;

/// The numbers that Python writes although JSON does not have them.
const NO_NUMBERS: [&str; 2] = ["NaN", "Infinity"];

/// Parses the bytes of a file.
///
/// # Errors
/// What is wrong with them: text in UTF-16, a number that JSON does not have, another fault of the syntax or a missing field, with its place.
pub(crate) fn parse<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, String> {
    let text = without_mark(bytes);
    serde_json::from_slice(text).map_err(|error| {
        if is_utf_16(text) {
            return "it is text in UTF-16, and JSON is UTF-8: save it as UTF-8".to_owned();
        }
        match no_number(text).filter(|&(_, line)| line <= error.line() && error.is_syntax()) {
            Some((word, line)) => format!(
                "line {line} has {word}, which JSON does not have: its writer had a value that is not a number; export the capture again"
            ),
            None => printable(&error.to_string()),
        }
    })
}

/// Returns the first number outside of texts that JSON does not have, and its line, counted from 1.
fn no_number(text: &[u8]) -> Option<(&'static str, usize)> {
    let (mut line, mut is_text, mut is_escaped) = (1, false, false);
    for (at, &byte) in text.iter().enumerate() {
        match byte {
            b'\n' => line += 1,
            _ if is_escaped => is_escaped = false,
            b'\\' if is_text => is_escaped = true,
            b'"' => is_text = !is_text,
            b'N' | b'I' if !is_text => {
                let found = NO_NUMBERS.into_iter().find(|word| text[at..].starts_with(word.as_bytes()));
                if let Some(word) = found {
                    return Some((word, line));
                }
            }
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    #[test]
    fn a_mark_before_the_text_is_skipped() {
        let found: Value = parse(b"\xef\xbb\xbf{\"a\": 1}").expect("JSON");
        assert_eq!(found, json!({"a": 1}), "the value behind the mark");
    }

    #[test]
    fn what_is_no_json_is_named() {
        for (text, expected) in [
            (&b"{\"NaN\": \"NaN \\\" NaN\",\n\"b\": [1, NaN]}"[..], "line 2 has NaN"),
            (b"{\"a\": -Infinity}", "line 1 has Infinity"),
            (b"\xff\xfe{\0}\0", "UTF-16"),
            (b"{\0\"\0a\0", "UTF-16"),
            (b"{\"a\": 1,}", "line 1 column 9"),
            (b"{\"a\": ", "EOF"),
        ] {
            let reason = parse::<Value>(text).expect_err("no JSON");
            assert!(reason.contains(expected), "{expected}: {reason}");
        }
    }
}
