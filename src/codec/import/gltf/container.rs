//! The two containers of glTF: text, and binary with chunks.
//!
//! In: the bytes of a file. Out: its JSON and, of a binary file, its binary chunk.

use crate::codec::import::error::ImportError;
use crate::codec::start::Start;

/// The first bytes of a binary file.
const MAGIC: &[u8] = b"glTF";
/// The type of the chunk of JSON.
const JSON: u32 = 0x4e4f_534a;
/// The type of the chunk of binary data.
const BINARY: u32 = 0x004e_4942;

/// The parts of a file.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Container<'a> {
    /// The text of the document.
    pub json: &'a [u8],
    /// The binary chunk.
    pub binary: Option<&'a [u8]>,
}

/// Keys of which a document has at least one, beside `asset`.
const KEYS: [&str; 6] = ["\"accessors\"", "\"bufferViews\"", "\"buffers\"", "\"meshes\"", "\"nodes\"", "\"scenes\""];

/// Returns whether a file that starts so is a glTF file. Text is recognized by the name of the file, an early mention
/// of the extension, or the keys of glTF.
pub(crate) fn is_of(start: &Start) -> bool {
    let has_keys = || start.mentions("\"asset\"") && KEYS.iter().any(|key| start.mentions(key));
    let is_text = || start.extension == "gltf" || start.mentions("\"KHR_gaussian_splatting\"") || has_keys();
    start.bytes.starts_with(MAGIC) || (start.is_object() && is_text())
}

impl<'a> Container<'a> {
    /// Splits a file into its parts.
    ///
    /// # Errors
    /// A binary file that is cut, of another version, or without JSON.
    pub(super) fn of(file: &'a [u8]) -> Result<Self, ImportError> {
        if !file.starts_with(MAGIC) {
            return Ok(Self { json: file, binary: None });
        }
        let cut = || ImportError::damaged("it is cut: its length or that of a chunk exceeds the file");
        let (version, length) = (number(file, 4).ok_or_else(cut)?, number(file, 8).ok_or_else(cut)?);
        if version != 2 {
            return Err(ImportError::unsupported(format!("glTF version {version}, of which version 2 is read")));
        }
        let mut chunks = file.get(12..length as usize).ok_or_else(cut)?;
        let (mut json, mut binary) = (None, None);
        while !chunks.is_empty() {
            let (length, kind) = (number(chunks, 0).ok_or_else(cut)?, number(chunks, 4).ok_or_else(cut)?);
            let (contents, rest) = chunks[8..].split_at_checked(length as usize).ok_or_else(cut)?;
            match kind {
                JSON if json.is_none() => json = Some(contents),
                BINARY if binary.is_none() => binary = Some(contents),
                _ => {}
            }
            chunks = rest;
        }
        let json = json.ok_or_else(|| ImportError::damaged("a binary glTF file without a chunk of JSON"))?;
        Ok(Self { json, binary })
    }
}

fn number(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().copied().map(u32::from_le_bytes)
}
