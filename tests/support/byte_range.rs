//! Byte ranges of HTTP, as servers of tests answer them.
//!
//! In: the value of a header `Range`, a file. Out: the part that is asked for, and the status of the answer.

/// Returns the first byte and the byte after the last of the header `Range: bytes=0-99` or `bytes=100-`, of a file of
/// this length.
pub fn parse_range(value: &str, length: usize) -> Option<(usize, usize)> {
    let (first, last) = value.trim().strip_prefix("bytes=")?.split_once('-')?;
    let end = if last.is_empty() { length } else { last.parse::<usize>().ok()? + 1 };
    Some((first.parse().ok()?, end.min(length)))
}

/// Returns the status of an answer with a part of a file, with the header that tells which part it is, and the part.
pub fn part_of(file: &[u8], (first, end): (usize, usize)) -> (String, &[u8]) {
    match file.get(first..end) {
        Some(part) if !part.is_empty() => {
            (format!("206 Partial Content\r\nContent-Range: bytes {first}-{}/{}", end - 1, file.len()), part)
        }
        _ => ("416 Range Not Satisfiable".to_owned(), b""),
    }
}
