//! What a file that is no capture looks like.
//!
//! In: the start of a file. Out: words that say what it is by its first bytes, with the remedy if there is one.

use super::start::{Start, ZIP};
use super::text::{is_utf_16, printable, without_mark};

/// The first bytes of gzip.
pub(super) const GZIP: &[u8] = b"\x1f\x8b\x08";
/// The beginning of a pointer of Git LFS.
const LFS: &str = "version https://git-lfs";
/// Most characters of a text that are shown.
const SHOWN: usize = 60;
/// Most bytes that are shown.
const BYTES: usize = 8;

/// Kinds of files: where the bytes are that tell them, these bytes, and what it is.
const SIGNATURES: &[(usize, &[u8], &str)] = &[
    (0, b"\x89PNG\r\n\x1a\n", "a PNG picture"),
    (0, b"\xff\xd8\xff", "a JPEG picture"),
    (0, b"GIF8", "a GIF picture"),
    (0, b"II*\0", "a TIFF picture"),
    (0, b"MM\0*", "a TIFF picture"),
    (0, b"v/1\x01", "an OpenEXR picture"),
    (0, b"#?RADIANCE", "a Radiance picture"),
    (0, b"8BPS", "a Photoshop picture"),
    (8, b"WEBPVP8", "a WebP picture"),
    (4, b"ftypavif", "an AVIF picture"),
    (4, b"ftyphei", "a HEIF picture"),
    (4, b"ftypmif1", "a HEIF picture"),
    (4, b"ftyp", "a video (MP4 or MOV)"),
    (8, b"AVI LIST", "a video (AVI)"),
    (0, b"\x1a\x45\xdf\xa3", "a video (Matroska or WebM)"),
    (0, b"OggS", "a sound or a video (Ogg)"),
    (8, b"WAVEfmt", "a sound (WAV)"),
    (0, b"7z\xbc\xaf\x27\x1c", "a 7z archive: unpack it first"),
    (0, b"Rar!\x1a\x07", "a RAR archive: unpack it first"),
    (0, b"\xfd7zXZ\0", "a file packed by xz: unpack it first"),
    (0, b"BZh91AY", "a file packed by bzip2: unpack it first"),
    (0, b"\x28\xb5\x2f\xfd", "a file packed by zstd: unpack it first"),
    (257, b"ustar", "a tar archive: unpack it first"),
    (0, b"PK\x05\x06", "a zip archive without entries"),
    (0, ZIP, "a zip archive: unpack it first"),
    (0, GZIP, "a file packed by gzip: unpack it first"),
    (0, b"%PDF-", "a PDF document"),
    (0, b"\x7fELF", "a program"),
    (0, b"SQLite format 3\0", "an SQLite database"),
    (0, b"\x89HDF\r\n\x1a\n", "an HDF5 file"),
    (0, b"\x93NUMPY", "a NumPy array (.npy)"),
    (0, b"Kaydara FBX Binary", "an FBX model"),
    (0, b"PXR-USDC", "a USD file"),
    (0, b"LASF", "a LAS point cloud"),
    (0, b"ASTM-E57", "an E57 point cloud"),
];

/// Kinds of files that too few bytes tell to exclude numbers.
const WEAK: &[(usize, &[u8], &str)] = &[
    (0, b"BM", "a BMP picture"),
    (0, b"MZ", "a program"),
    (0, b"\x80\x02", "a Python pickle"),
    (0, b"\x80\x03", "a Python pickle"),
    (0, b"\x80\x04", "a Python pickle"),
    (0, b"\x80\x05", "a Python pickle"),
];

/// Returns a sentence about a file that no person took for a capture: one that stands in its place. `None` for other files.
pub(super) fn stand_in(start: &Start) -> Option<String> {
    let text = text(&start.bytes)?;
    if text.starts_with(LFS) {
        let size = text.lines().find_map(|line| line.strip_prefix("size "));
        let size = size.filter(|size| size.bytes().all(|byte| byte.is_ascii_digit()));
        let size = size.map(|size| format!(" of {} bytes", printable(size))).unwrap_or_default();
        return Some(format!(
            "is a pointer of Git LFS, not the file{size} that it stands for: run git lfs pull in the folder of its repository"
        ));
    }
    is_html(text).then(|| {
        "is a page of HTML, as servers send in place of a file (for a login, an error or a preview): download the file itself again"
            .to_owned()
    })
}

/// Returns whether a file that starts so is certainly something else than numbers.
pub(crate) fn is_other(start: &Start) -> bool {
    signature(&start.bytes, SIGNATURES).is_some() || is_utf_16(&start.bytes) || text(&start.bytes).is_some()
}

/// Returns what a file looks like: "it looks like a PNG picture".
pub(super) fn described(start: &Start) -> String {
    let bytes = &start.bytes[..];
    if bytes.is_empty() {
        return "it is empty".to_owned();
    }
    if let Some(name) = signature(bytes, SIGNATURES) {
        return format!("it looks like {name}");
    }
    if is_utf_16(bytes) {
        return "it is text in UTF-16: if it is the JSON of a capture, save it as UTF-8".to_owned();
    }
    match (text(bytes), signature(bytes, WEAK)) {
        (Some(text), _) => described_text(text),
        (None, Some(name)) => format!("it looks like {name}"),
        (None, None) if is_latin_1(bytes) => "it is text, but not in UTF-8".to_owned(),
        (None, None) => {
            let shown: Vec<String> = bytes.iter().take(BYTES).map(|byte| format!("{byte:02x}")).collect();
            format!("it is binary data that begins with {}", shown.join(" "))
        }
    }
}

/// Returns what a text looks like.
fn described_text(text: &str) -> String {
    let trimmed = text.trim_start();
    let line = trimmed.lines().next().unwrap_or_default();
    let shown: String = line.chars().take(SHOWN).collect();
    let shown = printable(shown.trim_end());
    match trimmed.chars().next() {
        None => "it is blank text".to_owned(),
        Some('{' | '[') if trimmed.contains("\"frames\"") || trimmed.contains("\"cameras\"") => {
            "it is JSON with cameras: a dataset is the folder in which it is".to_owned()
        }
        Some('{' | '[') => format!("it is JSON that begins with {shown}"),
        Some('<') => format!("it is XML that begins with {shown}"),
        Some(_) => format!("it is text that begins with {shown}"),
    }
}

/// Returns the name of the first kind whose bytes a file has.
fn signature(bytes: &[u8], of: &'static [(usize, &'static [u8], &'static str)]) -> Option<&'static str> {
    let found = of.iter().find(|(at, expected, _)| bytes.get(*at..).is_some_and(|rest| rest.starts_with(expected)));
    found.map(|&(_, _, name)| name)
}

/// Returns the first bytes as text: in UTF-8, with no control characters but those between words and lines. The last character may be cut.
fn text(bytes: &[u8]) -> Option<&str> {
    let bytes = without_mark(bytes);
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) if error.error_len().is_none() => std::str::from_utf8(bytes.get(..error.valid_up_to())?).ok()?,
        Err(_) => return None,
    };
    let is_shown = |c: char| !c.is_control() || matches!(c, '\n' | '\r' | '\t' | '\x0c');
    (!text.is_empty() && text.chars().all(is_shown)).then_some(text)
}

/// Returns whether bytes are printable characters of Latin-1, with some below 128.
fn is_latin_1(bytes: &[u8]) -> bool {
    let is_shown = |byte: u8| matches!(byte, b'\n' | b'\r' | b'\t' | 0x20..=0x7e | 0xa0..);
    let plain = bytes.iter().filter(|byte| byte.is_ascii()).count();
    bytes.iter().all(|&byte| is_shown(byte)) && plain > bytes.len() / 2
}

fn is_html(text: &str) -> bool {
    let start: String = text.trim_start().chars().take(2000).collect::<String>().to_ascii_lowercase();
    start.starts_with("<!doctype html") || (start.starts_with('<') && start.contains("<html"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start(bytes: &[u8]) -> Start {
        Start { bytes: bytes.to_vec(), length: bytes.len() as u64, ..Start::default() }
    }

    #[test]
    fn other_files_are_named_by_their_first_bytes() {
        let mut tar = vec![0; 300];
        tar[257..262].copy_from_slice(b"ustar");
        for (bytes, expected) in [
            (&b""[..], "it is empty"),
            (b"\x89PNG\r\n\x1a\n\0\0", "it looks like a PNG picture"),
            (b"\xff\xd8\xff\xe0", "it looks like a JPEG picture"),
            (b"\0\0\0\x20ftypisom", "it looks like a video (MP4 or MOV)"),
            (b"RIFF\0\0\0\0WEBPVP8L", "it looks like a WebP picture"),
            (&tar, "it looks like a tar archive: unpack it first"),
            (b"\x80\x02}q\0.", "it looks like a Python pickle"),
            (b"\xff\xfe{\0", "it is text in UTF-16: if it is the JSON of a capture, save it as UTF-8"),
            (b"na\xefve caf\xe9", "it is text, but not in UTF-8"),
            (b"\n v 0 0 0\nv 1 0 0\n", "it is text that begins with v 0 0 0"),
            (b"<?xml version=\"1.0\"?><a/>", "it is XML that begins with <?xml version=\"1.0\"?><a/>"),
            (b"{\"name\": 1}", "it is JSON that begins with {\"name\": 1}"),
            (b"{\"frames\": []}", "it is JSON with cameras: a dataset is the folder in which it is"),
            (b"  \n", "it is blank text"),
            (b"\x01\x02\x03\xff\x7f\0\0\0\0\0", "it is binary data that begins with 01 02 03 ff 7f 00 00 00"),
        ] {
            assert_eq!(described(&start(bytes)), expected, "{bytes:?}");
        }
        let cut = format!("{}é", "a".repeat(10));
        assert!(described(&start(&cut.as_bytes()[..11])).starts_with("it is text"), "a character that is cut");
    }

    #[test]
    fn files_in_place_of_others_are_named_with_the_remedy() {
        let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n";
        let message = stand_in(&start(pointer)).expect("a pointer");
        assert!(message.contains("Git LFS") && message.contains("12345 bytes"), "{message}");
        assert!(message.contains("git lfs pull"), "the remedy: {message}");
        for page in [&b"<!DOCTYPE html><html>"[..], b"\n<!-- saved -->\n<HTML lang=\"en\">", b"\xef\xbb\xbf<html>"] {
            let message = stand_in(&start(page)).expect("a page");
            assert!(message.contains("a page of HTML"), "{message}");
        }
        for other in [&b"<?xml version=\"1.0\"?><Error/>"[..], b"version 1", b"\0\0", b""] {
            assert_eq!(stand_in(&start(other)), None, "{other:?} is named by what it looks like");
        }
    }

    #[test]
    fn numbers_are_nothing_else() {
        for numbers in [&[0.5_f32, -1.0, 2.0, 0.01, 0.01, 0.01][..], &[0.0; 8]] {
            let bytes: Vec<u8> = numbers.iter().flat_map(|value| value.to_le_bytes()).collect();
            assert!(!is_other(&start(&bytes)), "{numbers:?}");
        }
        assert!(is_other(&start(b"Not found")) && is_other(&start(b"\x89PNG\r\n\x1a\n")), "text and pictures");
    }
}
