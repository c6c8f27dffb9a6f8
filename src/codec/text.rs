//! Texts from files, made safe to print.
//!
//! In: a text from a file. Out: the same text with escapes for the characters that control a terminal; the bytes of a text without its mark, and
//! whether they are UTF-16.

/// Largest number of characters of a name that is printed.
const LONGEST: usize = 240;

/// The mark of UTF-8, which some editors of Windows write before a text.
const MARK: &[u8] = b"\xef\xbb\xbf";

/// Returns the bytes of a text without the mark of UTF-8 (byte order mark) before it.
pub(crate) fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(MARK).unwrap_or(bytes)
}

/// Returns whether bytes begin like a text in UTF-16: with its mark, or with two characters below 128.
pub(crate) fn is_utf_16(bytes: &[u8]) -> bool {
    let is_plain = |byte: u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    match bytes {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => true,
        [a, 0, b, 0, ..] | [0, a, 0, b, ..] => is_plain(*a) && is_plain(*b),
        _ => false,
    }
}

/// Returns whether a character may control a terminal: control characters, and characters that change the direction or
/// the line of the text after them.
pub(crate) fn is_obeyed(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Returns the text with an escape, `\u{1b}`, in place of each character that may control a terminal, including line
/// breaks.
pub(crate) fn escaped(text: &str) -> String {
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

/// Returns the beginning of a text from a file, [`escaped`], so that the length of errors is limited.
pub(crate) fn printable(text: &str) -> String {
    let end = text.char_indices().nth(LONGEST).map_or(text.len(), |(at, _)| at);
    escaped(&text[..end])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn characters_that_control_a_terminal_are_escaped() {
        assert_eq!(
            escaped("a\u{1b}[2Jb\nc\u{9b}d\u{202e}e"),
            r"a\u{1b}[2Jb\u{a}c\u{9b}d\u{202e}e",
            "every control character is escaped"
        );
        assert_eq!(escaped("Überblick, 'x' \\ \"y\""), "Überblick, 'x' \\ \"y\"", "other characters are unchanged");
    }

    #[test]
    fn marks_and_wide_characters_are_recognized() {
        assert_eq!(without_mark(b"\xef\xbb\xbf{}"), b"{}", "a text without its mark");
        assert_eq!(without_mark(b"{}"), b"{}", "a text without a mark is unchanged");
        for wide in [&b"\xff\xfe{\0"[..], b"\xfe\xff\0{", b"{\0\"\0", b"\0{\0\n"] {
            assert!(is_utf_16(wide), "{wide:?} is UTF-16");
        }
        for other in [&b"{}"[..], b"\0\0\0\0", b"\x01\0\x02\0", b""] {
            assert!(!is_utf_16(other), "{other:?} is not UTF-16");
        }
    }

    #[test]
    fn long_texts_are_cut() {
        assert_eq!(printable(&"ä".repeat(1 << 20)).chars().count(), LONGEST, "the limit counts whole characters");
        assert_eq!(printable("short"), "short", "short texts are unchanged");
    }
}
