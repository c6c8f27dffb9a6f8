//! Text in HTML.
//!
//! In: any text. Out: the text with the special characters of HTML escaped.

/// Escapes the special characters of HTML.
pub(in crate::offline) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
