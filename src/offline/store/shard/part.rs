//! The result of one shard as a file.
//!
//! In: a [`Label`], the bytes of a result, a path. Out: the file, whole or not at all; its label; the same bytes; or an
//! error that names the file and its fault.
//!
//! | bytes | contents |
//! |---|---|
//! | 4 | `GS4P` |
//! | 4 | version, little-endian |
//! | 32 | BLAKE3 of all bytes after these |
//! | 4 | length of the label, little-endian |
//! | | the label as RON |
//! | | the result, compressed by zstd |

use super::Label;
use crate::codec::CodecError;
use crate::offline::store::StoreError;
use crate::offline::work::{FileError, write_beside};
use std::fs;
use std::io::{self, Read, Write};
use std::path::Path;

const MAGIC: [u8; 4] = *b"GS4P";
const VERSION: u32 = 1;
const HASH: usize = 32;
/// The zstd level: most bytes of sums are noise.
const LEVEL: i32 = 1;

/// Writes the result of a shard.
///
/// # Errors
/// A folder that cannot be written to, a full disk.
pub fn write(path: &Path, label: &Label, result: &[u8]) -> Result<(), StoreError> {
    let label = ron::to_string(label)?.into_bytes();
    let at = |error: io::Error| CodecError::at(path, error);
    let result = zstd::bulk::compress(result, LEVEL).map_err(at)?;
    let length = u32::try_from(label.len()).map_err(|error| at(io::Error::other(error)))?.to_le_bytes();
    let mut hasher = blake3::Hasher::new();
    let contents = [&length[..], &label, &result];
    for bytes in contents {
        hasher.update(bytes);
    }
    write_beside(path, |file| {
        let head = [&MAGIC[..], &VERSION.to_le_bytes(), hasher.finalize().as_bytes()].concat();
        [&head[..]].iter().chain(&contents).try_for_each(|bytes| file.write_all(bytes))
    })?;
    Ok(())
}

/// Reads the label of a part, after checking that its file is whole.
///
/// # Errors
/// A file that cannot be read, is no part, or is damaged.
pub fn label(path: &Path) -> Result<Label, StoreError> {
    Ok(read(path)?.0)
}

/// Reads the result of a part, of at most `most` bytes.
///
/// # Errors
/// As [`label`], and a result that is longer.
pub fn result(path: &Path, most: usize) -> Result<Vec<u8>, StoreError> {
    let (_, bytes, start) = read(path)?;
    let compressed = bytes.get(start..).unwrap_or_default();
    let mut result = Vec::new();
    let read =
        zstd::Decoder::new(compressed).and_then(|decoder| decoder.take(most as u64 + 1).read_to_end(&mut result));
    read.map_err(|error| FileError::at(path, error))?;
    if result.len() > most {
        return Err(FileError::at(path, "holds more than the result of a shard: make it again").into());
    }
    Ok(result)
}

/// Returns whether there is a whole part with this label at a path.
pub fn is_there(path: &Path, expected: &Label) -> bool {
    path.is_file() && label(path).is_ok_and(|label| label == *expected)
}

/// Reads a file. Returns its label, its bytes, and where in these the result begins.
fn read(path: &Path) -> Result<(Label, Vec<u8>, usize), StoreError> {
    let bytes = fs::read(path).map_err(|error| FileError::at(path, error))?;
    if !bytes.starts_with(&MAGIC) {
        return Err(StoreError::NotAPart { path: path.to_owned() });
    }
    let (label, start) = parse(&bytes).map_err(|fault| FileError::at(path, fault))?;
    Ok((label, bytes, start))
}

/// Returns the label of a part and where its result begins. The bytes begin with [`MAGIC`].
fn parse(bytes: &[u8]) -> Result<(Label, usize), String> {
    let cut = || "is cut off: make it again".to_owned();
    let (version, rest) = bytes.get(MAGIC.len()..).and_then(<[u8]>::split_first_chunk).ok_or_else(cut)?;
    match u32::from_le_bytes(*version) {
        VERSION => {}
        other => return Err(format!("is a part of version {other}, and this gs4d reads {VERSION}: make it again")),
    }
    let (hash, contents) = rest.split_first_chunk::<HASH>().ok_or_else(cut)?;
    if blake3::hash(contents).as_bytes() != hash {
        return Err("is damaged or cut off: make it again".to_owned());
    }
    let (length, rest) = contents.split_first_chunk().ok_or_else(cut)?;
    let length = u32::from_le_bytes(*length) as usize;
    let label = rest.get(..length).ok_or_else(cut)?;
    let label = ron::de::from_bytes(label).map_err(|error| format!("has a label that cannot be read: {error}"))?;
    Ok((label, bytes.len() - rest.len() + length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::store::shard::Shard;

    #[test]
    fn parts_are_read_as_they_were_written_or_not_at_all() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("part.gs4p");
        let (named, body) = (Label::new("score", Shard::WHOLE).with("scene", "abc"), vec![7; 1000]);
        write(&path, &named, &body).expect("the folder can be written to");
        assert_eq!(label(&path).expect("a part"), named, "the label");
        assert_eq!(result(&path, 1000).expect("a part"), body, "the result");
        assert!(is_there(&path, &named), "the part exists by its label");
        assert!(!is_there(&path, &named.clone().with("engine", "cpu")), "no part of another label exists");
        let longer = result(&path, 999).expect_err("longer than expected").to_string();
        assert!(longer.contains("part.gs4p: holds more"), "file and fault: {longer}");
        let whole = fs::read(&path).expect("the part");
        for (name, bytes) in [
            ("is cut off", whole[..whole.len() / 2].to_vec()),
            ("is no part", b"GS4D and so on".to_vec()),
            ("is no part", Vec::new()),
            ("is cut off", whole[..20].to_vec()),
            ("version 9", [&whole[..4], &[9, 0, 0, 0], &whole[8..]].concat()),
            ("is damaged", [&whole[..50], &[whole[50] ^ 1], &whole[51..]].concat()),
        ] {
            fs::write(&path, bytes).expect("the folder can be written to");
            let message = label(&path).expect_err("it is refused").to_string();
            assert!(message.contains("part.gs4p: "), "the file is named: {message}");
            assert!(message.contains(name.trim_start_matches("is ")), "{name}: {message}");
            assert!(!is_there(&path, &named), "{name}: it is not there");
        }
    }
}
