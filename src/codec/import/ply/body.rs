//! The body of a PLY file.
//!
//! In: a header and the bytes after it. Out: a [`Table`] for each element without lists; elements with lists are
//! skipped. Bytes of a binary body are borrowed, numbers of an ASCII body are converted.

use super::header::{Element, Encoding, Header, Kind, Property};
use super::scalar::Scalar;
use super::table::Table;
use crate::codec::import::error::ImportError;
use std::borrow::Cow;

/// Returns the tables of a file.
///
/// # Errors
/// A body that is shorter than the header says; a word of an ASCII body that is not a number of its type.
pub(super) fn tables<'a>(header: &Header, bytes: &'a [u8]) -> Result<Vec<Table<'a>>, ImportError> {
    let body = bytes.get(header.length..).unwrap_or(&[]);
    let mut tables = Vec::new();
    if header.encoding == Encoding::Ascii {
        let mut words = body.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let mut left = body.len();
        for element in &header.elements {
            if let Some(rows) = ascii_rows(element, &mut words, &mut left)? {
                tables.push(table(element, Cow::Owned(rows), false));
            }
        }
    } else {
        let is_big = header.encoding == Encoding::BigEndian;
        let mut rest = body;
        for element in &header.elements {
            let length = match element.stride() {
                Some(stride) => element.count.checked_mul(stride),
                None => length_of_lists(element, rest, is_big),
            };
            let cut = || cut(element);
            let (rows, after) = rest.split_at_checked(length.ok_or_else(cut)?).ok_or_else(cut)?;
            if element.stride().is_some() {
                tables.push(table(element, Cow::Borrowed(rows), is_big));
            }
            rest = after;
        }
    }
    Ok(tables)
}

fn cut(element: &Element) -> ImportError {
    let Element { name, count, .. } = element;
    ImportError::damaged(format!(
        "ends before the last of its {count} rows of {}: the file is cut",
        name.escape_debug()
    ))
}

fn table<'a>(element: &Element, bytes: Cow<'a, [u8]>, is_big: bool) -> Table<'a> {
    let mut offset = 0;
    let mut properties = Vec::new();
    for Property { name, kind } in &element.properties {
        if let Kind::One(scalar) = *kind {
            properties.push((name.clone(), scalar, offset));
            offset += scalar.size();
        }
    }
    Table { name: element.name.clone(), count: element.count, stride: offset, bytes, is_big, properties }
}

/// Returns the number of bytes of an element with lists; `None` if it does not end.
fn length_of_lists(element: &Element, bytes: &[u8], is_big: bool) -> Option<usize> {
    let mut at = 0usize;
    for _ in 0..element.count {
        for property in &element.properties {
            at = match property.kind {
                Kind::One(scalar) => at.checked_add(scalar.size())?,
                Kind::List(count, item) => {
                    let items = count.value(bytes.get(at..at.checked_add(count.size())?)?, is_big);
                    // The number is at most 2³² − 1; a fraction or a negative number is no count.
                    let items =
                        (items >= 0.0 && items.fract() == 0.0 && items <= f64::from(u32::MAX)).then_some(items)?;
                    at.checked_add(count.size())?.checked_add((items as usize).checked_mul(item.size())?)?
                }
            };
        }
        if at > bytes.len() {
            return None;
        }
    }
    Some(at)
}

/// Converts the rows of an element of an ASCII body to little-endian bytes; `None` if it has lists, whose words are
/// skipped. `left` is the most bytes that the words may have.
fn ascii_rows<'a>(
    element: &Element,
    words: &mut impl Iterator<Item = &'a [u8]>,
    left: &mut usize,
) -> Result<Option<Vec<u8>>, ImportError> {
    let stride = element.stride();
    // A word has at least one byte, and a space after it unless it is the last.
    let fewest = element.count.checked_mul(element.properties.len()).filter(|&fewest| fewest <= left.div_ceil(2));
    if fewest.is_none() {
        return Err(cut(element));
    }
    let mut rows = Vec::with_capacity(element.count.saturating_mul(stride.unwrap_or(0)));
    let mut number = |scalar: Scalar, to: &mut Vec<u8>| {
        let word = words.next().ok_or_else(|| cut(element))?;
        *left = left.saturating_sub(word.len());
        let text = std::str::from_utf8(word).ok();
        text.and_then(|text| scalar.push_word(text, to)).ok_or_else(|| {
            let word = String::from_utf8_lossy(word.get(..40).unwrap_or(word));
            let (word, name) = (word.escape_debug(), element.name.escape_debug());
            ImportError::damaged(format!("has \"{word}\" in place of a number of its element {name}"))
        })
    };
    let mut list = Vec::new();
    // An element without properties has no words, whatever its number of rows.
    let count = if element.properties.is_empty() { 0 } else { element.count };
    for _ in 0..count {
        for property in &element.properties {
            match property.kind {
                Kind::One(scalar) => number(scalar, if stride.is_some() { &mut rows } else { &mut list })?,
                Kind::List(count, item) => {
                    list.clear();
                    number(count, &mut list)?;
                    for _ in 0..count.value(&list, false) as u32 {
                        list.clear();
                        number(item, &mut list)?;
                    }
                }
            }
            list.clear();
        }
    }
    Ok(stride.map(|_| rows))
}
