//! What is printed, without characters that a terminal would obey instead of showing.
//!
//! In: reports and notes, with names from files in them. Out: the same with escapes in place of those characters. All that
//! the command prints goes through here.

use crate::codec::text::{escaped, is_obeyed};

/// Returns lines for a terminal.
pub fn lines(text: &str) -> String {
    text.split('\n').map(escaped).collect::<Vec<_>>().join("\n")
}

/// Returns a JSON document for a terminal. Only its strings can have such characters, where escapes stand for them.
pub fn json(document: &str) -> String {
    let mut plain = String::with_capacity(document.len());
    for c in document.chars() {
        if is_obeyed(c) && c != '\n' {
            // None of them is above U+FFFF.
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
    fn line_breaks_are_all_that_stays() {
        assert_eq!(lines("a\u{1b}[2Jb\nc\td\n"), "a\\u{1b}[2Jb\nc\\u{9}d\n", "in text");
    }

    #[test]
    fn a_document_says_the_same() {
        let value = Value::from("\u{1b}[2J\u{9b}1m\u{202e}\u{7f}ä");
        let shown = json(&format!("{value:#}\n"));
        assert!(shown.chars().all(|c| c == '\n' || !is_obeyed(c)), "nothing is obeyed: {shown:?}");
        assert_eq!(serde_json::from_str::<Value>(&shown).expect("still JSON"), value, "and nothing is lost");
    }
}
