//! The buffers of a glTF file.
//!
//! In: the document, the binary chunk, the files beside the file. Out: [`Buffers`], with the bytes of each buffer view.

use super::document::Document;
use crate::codec::import::error::ImportError;
use crate::codec::import::source::Beside;
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Base64 with or without padding: writers of data URIs differ.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The beginning of a URI that has the bytes itself.
const DATA: &str = "data:";

/// The bytes of all buffers.
pub(super) struct Buffers<'a> {
    document: &'a Document,
    /// Each different URI once: several buffers may have the same.
    loaded: BTreeMap<Option<&'a str>, Cow<'a, [u8]>>,
}

impl<'a> Buffers<'a> {
    /// Loads all buffers.
    ///
    /// # Errors
    /// A file that cannot be read or is outside of the folder; damaged base64; a buffer shorter than stated.
    pub(super) fn of(
        document: &'a Document,
        binary: Option<&'a [u8]>,
        beside: &dyn Beside,
    ) -> Result<Self, ImportError> {
        let files = document.buffers.iter().filter_map(|buffer| buffer.uri.as_deref());
        let files: Vec<String> = files.filter(|uri| !uri.starts_with(DATA)).map(unescaped).collect();
        beside.announce(&files)?;
        let mut loaded = BTreeMap::from([(None, Cow::Borrowed(binary.unwrap_or_default()))]);
        for (index, buffer) in document.buffers.iter().enumerate() {
            let uri = buffer.uri.as_deref();
            if let (Some(uri), false) = (uri, loaded.contains_key(&uri)) {
                loaded.insert(Some(uri), Cow::Owned(load(index, uri, beside)?));
            }
            let length = loaded.get(&uri).map_or(0, |bytes| bytes.len());
            if length < buffer.byte_length {
                let promised = buffer.byte_length;
                return Err(ImportError::damaged(format!("buffer {index} has {length} of {promised} bytes")));
            }
        }
        Ok(Self { document, loaded })
    }

    /// Returns the number of bytes of all buffers.
    pub(super) fn len(&self) -> usize {
        self.loaded.values().map(|bytes| bytes.len()).sum()
    }

    /// Returns the bytes of a buffer view.
    ///
    /// # Errors
    /// An index without a buffer view; a view that is compressed or exceeds its buffer.
    pub(super) fn view(&self, index: usize) -> Result<&[u8], ImportError> {
        let damaged = |reason: &str| ImportError::damaged(format!("buffer view {index} {reason}"));
        let view = self.document.buffer_views.get(index).ok_or_else(|| damaged("does not exist"))?;
        if let Some(name) = view.extensions.keys().next() {
            return Err(ImportError::unsupported(format!(
                "buffer view {index} is compressed by {}: export the file without this compression",
                name.escape_debug()
            )));
        }
        let buffer = self.document.buffers.get(view.buffer).ok_or_else(|| damaged("has no buffer"))?;
        let bytes = self.loaded.get(&buffer.uri.as_deref()).map(|bytes| &**bytes).unwrap_or_default();
        let end = view.byte_offset.checked_add(view.byte_length).filter(|&end| end <= buffer.byte_length);
        end.and_then(|end| bytes.get(view.byte_offset..end)).ok_or_else(|| damaged("exceeds its buffer"))
    }
}

/// Returns the bytes of a buffer with a URI.
fn load(index: usize, uri: &str, beside: &dyn Beside) -> Result<Vec<u8>, ImportError> {
    let Some(data) = uri.strip_prefix(DATA) else {
        return Ok(beside.read(&unescaped(uri))?);
    };
    let Some((_, text)) = data.split_once(";base64,") else {
        return Err(ImportError::unsupported(format!("buffer {index} is a data URI without base64")));
    };
    BASE64.decode(text).map_err(|error| ImportError::damaged(format!("the base64 of buffer {index}: {error}")))
}

/// Returns a URI with its percent signs and two digits replaced by their bytes.
fn unescaped(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, others @ ..] = rest {
        let digits = others.first_chunk::<2>().and_then(|digits| std::str::from_utf8(digits).ok());
        match digits.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(byte) if *first == b'%' => {
                bytes.push(byte);
                rest = &others[2..];
            }
            _ => {
                bytes.push(*first);
                rest = others;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_signs_with_two_digits_are_bytes() {
        for (uri, name) in [("a%20b.bin", "a b.bin"), ("%C3%A4", "ä"), ("100%", "100%"), ("%zz%2", "%zz%2")] {
            assert_eq!(unescaped(uri), name, "{uri}");
        }
    }
}
