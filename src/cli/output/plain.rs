//! Escapes of control characters in printed text.
//!
//! In: reports and notes, which may contain names from files. Out: the same text with escapes in place of characters
//! that control a terminal. All output of the command passes through this module.

use crate::codec::text::{escaped, is_obeyed};

/// Returns lines for a terminal.
pub(crate) fn lines(text: &str) -> String {
    text.split('\n').map(escaped).collect::<Vec<_>>().join("\n")
}

/// Returns a JSON document for a terminal. Control characters occur only in its strings, where JSON allows escapes.
pub(crate) fn json(document: &str) -> String {
    let mut plain = String::with_capacity(document.len());
    for c in document.chars() {
        if is_obeyed(c) && c != '\n' {
            // No control character is above U+FFFF.
            plain += &format!("\\u{:04x}", u32::from(c));
        } else {
            plain.push(c);
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    #[test]
    fn control_characters_other_than_line_breaks_are_escaped() {
        assert_eq!(lines("a\u{1b}[2Jb\nc\td\n"), "a\\u{1b}[2Jb\nc\\u{9}d\n", "the line break is unchanged");
    }

    #[test]
    fn an_escaped_document_has_the_same_value() {
        let value = Value::from("\u{1b}[2J\u{9b}1m\u{202e}\u{7f}ä");
        let shown = json(&format!("{value:#}\n"));
        assert!(shown.chars().all(|c| c == '\n' || !is_obeyed(c)), "no control character is left: {shown:?}");
        assert_eq!(serde_json::from_str::<Value>(&shown).expect("it is JSON"), value, "the value is unchanged");
    }
}
