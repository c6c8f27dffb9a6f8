//! Texts from files, as they can be shown.
//!
//! In: a text that a file holds. Out: the same text without the characters that a terminal would obey instead of showing.

/// Most characters of a name that are shown.
const LONGEST: usize = 240;

/// Returns whether a terminal may obey a character instead of showing it: control characters, and those that change the
/// direction or the line of what follows.
pub fn is_obeyed(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Returns the text with an escape, `\u{1b}`, in place of each character that a terminal may obey; line breaks too.
pub fn escaped(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if is_obeyed(c) {
            shown.extend(c.escape_unicode());
        } else {
            shown.push(c);
        }
    }
    shown
}

/// Returns the beginning of a text from a file, [`escaped`]: errors must not be as long as a file can make them.
pub fn printable(text: &str) -> String {
    let end = text.char_indices().nth(LONGEST).map_or(text.len(), |(at, _)| at);
    escaped(&text[..end])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_obeys_is_escaped() {
        assert_eq!(escaped("a\u{1b}[2Jb\nc\u{9b}d\u{202e}e"), r"a\u{1b}[2Jb\u{a}c\u{9b}d\u{202e}e", "each of them");
        assert_eq!(escaped("Überblick, 'x' \\ \"y\""), "Überblick, 'x' \\ \"y\"", "and nothing else");
    }

    #[test]
    fn long_texts_are_cut() {
        assert_eq!(printable(&"ä".repeat(1 << 20)).chars().count(), LONGEST, "whole characters");
        assert_eq!(printable("short"), "short", "short ones stay");
    }
}
