//! JSON of camera files.
//!
//! In: bytes, possibly after a byte order mark, and with `NaN` and `Infinity`, as Python writes them. Out: the value,
//! or the fault. Numbers that JSON does not have become texts with their name and line, which are refused where a
//! number is needed, and harmless elsewhere.

use crate::offline::dataset::DatasetError;
use serde_json::Value;
use std::borrow::Cow;
use std::fs;
use std::path::Path;

/// The byte order mark that programs on Windows write before UTF-8.
const MARK: &[u8] = b"\xef\xbb\xbf";
/// The byte order marks of UTF-16.
const WIDE: [&[u8]; 2] = [b"\xff\xfe", b"\xfe\xff"];
/// The names under which Python writes numbers that JSON does not have.
const NO_NUMBERS: [&str; 3] = ["NaN", "Infinity", "-Infinity"];

/// Reads a file.
///
/// # Errors
/// A file that cannot be read, or is not JSON in UTF-8.
pub(crate) fn read(path: &Path) -> Result<Value, DatasetError> {
    let bytes = fs::read(path).map_err(|reason| DatasetError::Read { path: path.to_owned(), reason })?;
    if WIDE.iter().any(|mark| bytes.starts_with(mark)) {
        let reason = "it is a text in UTF-16, and JSON is read in UTF-8: save it in that encoding".to_owned();
        return Err(DatasetError::Unusable { path: path.to_owned(), reason });
    }
    parse(&bytes).map_err(|reason| DatasetError::Json { path: path.to_owned(), reason })
}

fn parse(bytes: &[u8]) -> serde_json::Result<Value> {
    serde_json::from_slice(&named(bytes.strip_prefix(MARK).unwrap_or(bytes)))
}

/// Returns JSON with a text in place of each number that JSON does not have.
fn named(bytes: &[u8]) -> Cow<'_, [u8]> {
    let (mut changed, mut copied) = (Vec::new(), 0);
    let (mut in_text, mut line, mut at) = (false, 1, 0);
    while let Some(&byte) = bytes.get(at) {
        let mut length = 1;
        match byte {
            b'\n' => line += 1,
            b'"' => in_text = !in_text,
            // The character after it does not end the text.
            b'\\' if in_text => length = 2,
            b'N' | b'I' | b'-' if !in_text => {
                if let Some(word) = NO_NUMBERS.iter().find(|word| bytes[at..].starts_with(word.as_bytes())) {
                    changed.extend_from_slice(&bytes[copied..at]);
                    changed.extend(format!("\"{word} in line {line}\"").bytes());
                    (length, copied) = (word.len(), at + word.len());
                }
            }
            _ => {}
        }
        at += length;
    }
    if copied == 0 {
        return Cow::Borrowed(bytes);
    }
    changed.extend_from_slice(&bytes[copied..]);
    Cow::Owned(changed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_byte_order_mark_is_skipped() {
        let marked = [MARK, b"{\"a\": 1}"].concat();
        assert_eq!(parse(&marked).expect("JSON after a mark"), json!({"a": 1}), "the value");
        assert!(parse(b"\xef\xbb{}").is_err(), "half a mark is no JSON");
    }

    #[test]
    fn numbers_that_json_does_not_have_become_texts_with_their_line() {
        let text = "{\"a\": NaN,\n \"b\": [-Infinity,\n Infinity, -1], \"NaN\": \"Infinity \\\" NaN\"}";
        let expected = json!({
            "a": "NaN in line 1", "b": ["-Infinity in line 2", "Infinity in line 3", -1], "NaN": "Infinity \" NaN",
        });
        assert_eq!(parse(text.as_bytes()).expect("as Python writes it"), expected, "texts stay as they are");
        for wrong in ["NaNs", "[Inf]", "{\"a\": nan}", "- Infinity", "\"\\"] {
            assert!(parse(wrong.as_bytes()).is_err(), "{wrong} is no JSON");
        }
        assert!(matches!(named(b"{\"NaN\": -1}"), Cow::Borrowed(_)), "a file without any is not copied");
    }
}
