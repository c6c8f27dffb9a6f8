//! Changes to texts that consist of brackets, commas, names and values: JSON, RON, and the `Namespace(..)` of Python.
//!
//! In: a text, that of another seed. Out: a text whose brackets mostly match, with a value replaced by one of another
//! type or size, an item removed, repeated, moved or taken from the other text, or deeply nested brackets.

use super::bytes::{self, MOST};
use super::numbers;
use crate::support::random::Random;
use std::iter::repeat_n;
use std::ops::Range;

/// Most pieces that are inserted at once.
const PIECES: usize = 200_000;

/// Returns one of the seeds with changes, once in a while also of single bytes.
pub fn file(seeds: &[impl AsRef<str>], random: &mut Random) -> Vec<u8> {
    let (seed, other) = (random.pick(seeds).as_ref(), random.pick(seeds).as_ref());
    let mut file = change(seed, other, random).into_bytes();
    if random.one_in(16) {
        bytes::change(&mut file, other.as_bytes(), random);
    }
    file
}

/// Makes one to three changes.
pub fn change(text: &str, other: &str, random: &mut Random) -> String {
    let (mut changed, other) = (pieces(text), pieces(other));
    for _ in 0..=random.below(3) {
        change_once(&mut changed, &other, random);
    }
    let mut text = changed.concat();
    text.truncate(text.floor_char_boundary(MOST));
    text
}

fn change_once(pieces: &mut Vec<String>, other: &[String], random: &mut Random) {
    let (named, listed, foreign) = (values(pieces), items(pieces), items(other));
    if named.is_empty() || listed.is_empty() {
        pieces.push(value(random));
        return;
    }
    let (at, item) = (*random.pick(&named), random.pick(&listed).clone());
    match random.below(12) {
        0..=3 => pieces[at] = numbers::text(random),
        4 | 5 => pieces[at] = value(random),
        6 => {
            let comma = pieces.get(item.end).is_some_and(|piece| piece == ",");
            drop(pieces.drain(item.start..item.end + usize::from(comma)));
        }
        7 => {
            let copy = [&pieces[item.clone()], &[",".to_owned()]].concat();
            let count = (*random.pick(&[1, 1, 2, 30, 3000])).min(PIECES / copy.len());
            pieces.splice(item.start..item.start, repeat_n(copy, count).flatten());
        }
        8 => swap(pieces, &item, random.pick(&listed)),
        9 if !foreign.is_empty() => {
            let taken = random.pick(&foreign).clone();
            pieces.splice(item, other[taken].iter().cloned());
        }
        10 => {
            let (open, close) = *random.pick(&[("[", "]"), ("(", ")"), ("{", "}"), ("Some(", ")"), ("{\"a\":", "}")]);
            let depth = *random.pick(&[1, 2, 100, 129, 5000, 100_000]);
            let close = if random.one_in(2) { close.repeat(depth) } else { String::new() };
            pieces[at] = format!("{}{}{close}", open.repeat(depth), pieces[at]);
        }
        _ => pieces.truncate(at),
    }
}

/// Exchanges two items, unless one is inside the other.
fn swap(pieces: &mut Vec<String>, one: &Range<usize>, other: &Range<usize>) {
    let [a, b] = if one.start <= other.start { [one, other] } else { [other, one] };
    if a.end <= b.start {
        let parts = [0..a.start, b.clone(), a.end..b.start, a.clone(), b.end..pieces.len()];
        *pieces = parts.into_iter().flat_map(|part| pieces[part].to_vec()).collect();
    }
}

/// Returns a value that is not a number: a text, a name, an empty list.
fn value(random: &mut Random) -> String {
    const VALUES: [&str; 32] = [
        r#""""#,
        r#"".""#,
        r#""..""#,
        r#""/""#,
        r#""a/../../b""#,
        r#""a\u{1b}[2Jb""#,
        r#""a\u001b[2Jb""#,
        "\"a\u{1b}[2Jb\"",
        r#""a\u{0}b""#,
        r#""a\u0000b""#,
        r#""a\nerror: b""#,
        "\"\u{1f4a5}\"",
        r#""mean""#,
        r#""filter""#,
        "'",
        "\"",
        "null",
        "true",
        "false",
        "True",
        "False",
        "None",
        "Some(1)",
        "()",
        "[]",
        "{}",
        "[1]",
        "(1, 2)",
        "runtime",
        "packed(codebooks: None)",
        "trained(model: Static3d)",
        "/*",
    ];
    if random.one_in(12) {
        return format!("\"{}\"", "a".repeat(*random.pick(&[255, 256, 4097, 1 << 17])));
    }
    (*random.pick(&VALUES)).to_owned()
}

/// Splits a text into quoted texts, words and numbers, spaces, and single characters.
fn pieces(text: &str) -> Vec<String> {
    let mut pieces = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = match first {
            '"' | '\'' => quoted(rest, first),
            _ if is_word(first) => rest.find(|c: char| !is_word(c)).unwrap_or(rest.len()),
            _ if first.is_whitespace() => rest.find(|c: char| !c.is_whitespace()).unwrap_or(rest.len()),
            _ => first.len_utf8(),
        };
        let (piece, after) = rest.split_at(length);
        pieces.push(piece.to_owned());
        rest = after;
    }
    pieces
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '+' | '-' | '.')
}

/// Returns the length of the quoted text at the start of a text.
fn quoted(text: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        if c == quote && !escaped {
            return at + 1;
        }
        escaped = c == '\\' && !escaped;
    }
    text.len()
}

/// Returns the indices of the pieces that are names or values.
fn values(pieces: &[String]) -> Vec<usize> {
    let is_value = |piece: &String| piece.starts_with(|c: char| is_word(c) || matches!(c, '"' | '\''));
    (0..pieces.len()).filter(|&at| is_value(&pieces[at])).collect()
}

/// Returns the items between the brackets and commas of every pair of brackets, including inner pairs.
fn items(pieces: &[String]) -> Vec<Range<usize>> {
    let (mut open, mut items) = (Vec::new(), Vec::new());
    for (at, piece) in pieces.iter().enumerate() {
        match piece.as_str() {
            "(" | "[" | "{" => open.push(at + 1),
            "," => {
                if let Some(start) = open.last_mut() {
                    items.push(*start..at);
                    *start = at + 1;
                }
            }
            ")" | "]" | "}" => items.extend(open.pop().map(|start| start..at)),
            _ => {}
        }
    }
    items.retain(|item: &Range<usize>| !item.is_empty());
    items
}
