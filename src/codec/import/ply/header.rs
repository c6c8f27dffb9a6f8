//! The header of a PLY file.
//!
//! In: the bytes of a file. Out: [`Header`]: how its numbers are written, its comments, its elements with their
//! properties, where the body begins.

use super::scalar::Scalar;
use crate::codec::import::error::ImportError;

/// Longest header, in bytes.
const LONGEST: usize = 1 << 20;

/// How the numbers of a body are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A header.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    pub encoding: Encoding,
    pub comments: Comments,
    pub elements: Vec<Element>,
    /// Number of bytes before the body.
    pub length: usize,
}

/// The comments of a header, in order, without the word `comment`.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Comments(pub Vec<String>);

/// An element: a table of the body.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Element {
    pub name: String,
    /// Number of rows that the header promises.
    pub count: usize,
    pub properties: Vec<Property>,
}

/// A property: a column of an element.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Property {
    pub name: String,
    pub kind: Kind,
}

/// The kind of values of a property.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    One(Scalar),
    /// A number of items, then the items.
    List(Scalar, Scalar),
}

/// Returns whether a file that starts so is a PLY file.
pub(crate) fn is_ply(start: &[u8]) -> bool {
    start.starts_with(b"ply\n") || start.starts_with(b"ply\r\n")
}

impl Comments {
    /// Returns what follows a key in the last comment that begins with it: `antialiased 1`, `SplatRenderMode: mip`.
    pub(crate) fn value(&self, key: &str) -> Option<&str> {
        self.0.iter().rev().find_map(|comment| {
            let rest = comment.strip_prefix(key)?;
            let value = rest.trim_start_matches([' ', '\t', ':', '=']);
            (value.len() < rest.len() || rest.is_empty()).then(|| value.trim_end())
        })
    }

    /// Returns the number after a key; `None` without such a comment.
    ///
    /// # Errors
    /// A comment with the key and no finite number.
    pub(crate) fn number(&self, key: &str) -> Result<Option<f32>, ImportError> {
        let Some(value) = self.value(key) else { return Ok(None) };
        match value.parse::<f32>() {
            Ok(number) if number.is_finite() => Ok(Some(number)),
            _ => Err(ImportError::damaged(format!("its comment {key} has \"{}\", not a number", value.escape_debug()))),
        }
    }
}

impl Header {
    /// Reads the header of a file.
    ///
    /// # Errors
    /// A file that is cut inside the header; a line or a type that PLY does not have.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, ImportError> {
        let mut lines = Lines { bytes: bytes.get(..LONGEST).unwrap_or(bytes), at: 0 };
        if !is_ply(bytes) {
            return Err(ImportError::damaged("does not start with the line \"ply\""));
        }
        let mut header =
            Self { encoding: Encoding::Ascii, comments: Comments::default(), elements: Vec::new(), length: 0 };
        let mut has_format = false;
        lines.next();
        loop {
            let Some(line) = lines.next() else {
                return Err(ImportError::damaged("its header does not end: the file is cut or damaged"));
            };
            let unknown = || ImportError::damaged(format!("its header has the line \"{}\"", line.escape_debug()));
            let mut words = line.split_ascii_whitespace();
            match (words.next(), words.next()) {
                (Some("end_header"), None) => break,
                (Some("format"), Some(name)) => {
                    header.encoding = match name {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::LittleEndian,
                        "binary_big_endian" => Encoding::BigEndian,
                        _ => return Err(unknown()),
                    };
                    has_format = true;
                }
                (Some("comment" | "obj_info"), _) => {
                    let text = line.split_once([' ', '\t']).map_or("", |(_, text)| text.trim());
                    header.comments.0.push(text.to_owned());
                }
                (Some("element"), Some(name)) => {
                    let count = words.next().and_then(|count| count.parse().ok()).ok_or_else(unknown)?;
                    header.elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
                }
                (Some("property"), Some(kind)) => {
                    let scalar = |name: Option<&str>| name.and_then(Scalar::named).ok_or_else(unknown);
                    let kind = match kind {
                        "list" => Kind::List(scalar(words.next())?, scalar(words.next())?),
                        name => Kind::One(scalar(Some(name))?),
                    };
                    let name = words.next().ok_or_else(unknown)?.to_owned();
                    let element = header.elements.last_mut().ok_or_else(unknown)?;
                    element.properties.push(Property { name, kind });
                }
                (None, _) => {}
                _ => return Err(unknown()),
            }
        }
        if !has_format {
            return Err(ImportError::damaged("its header has no line \"format\""));
        }
        header.length = lines.at;
        Ok(header)
    }
}

impl Element {
    /// Returns the number of bytes of a row in a binary body; `None` if rows differ, since a property is a list.
    pub(super) fn stride(&self) -> Option<usize> {
        self.properties.iter().try_fold(0, |sum: usize, property| match property.kind {
            Kind::One(scalar) => sum.checked_add(scalar.size()),
            Kind::List(..) => None,
        })
    }
}

/// The lines of a header.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Iterator for Lines<'_> {
    type Item = String;

    /// Returns the next line that ends, without its end.
    fn next(&mut self) -> Option<String> {
        let rest = self.bytes.get(self.at..)?;
        let length = rest.iter().position(|&byte| byte == b'\n')?;
        self.at += length + 1;
        let line = rest.get(..length)?;
        Some(String::from_utf8_lossy(line.strip_suffix(b"\r").unwrap_or(line)).into_owned())
    }
}
