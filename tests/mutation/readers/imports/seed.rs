//! A file of another make, and how it is changed.
//!
//! In: the bytes of a file. Out: its parts by their structure ([`Seed`]), and files with some of these changed, behind
//! compression, lengths and checksums that are right.

use super::unpacked;
use crate::change::archive::{self, Entry};
use crate::change::{bytes, text, words};
use crate::support::gzip::gzip;
use crate::support::random::Random;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::read::GzDecoder;
use image_webp::{ColorType, WebPEncoder};
use std::io::Read;

/// What stands for the binary data in the JSON of a text file.
const BINARY: &str = "BINARY";
/// Bytes of the header of an SPZ file up to version 3, and in version 4.
const SPZ: [usize; 2] = [16, 32];
/// Most texels of a side of a texture that replaces another.
const SIDE: usize = 12;

/// A file, and how it is changed.
pub enum Seed {
    Bytes(Vec<u8>),
    /// A header of lines, then numbers.
    Headed(String, Vec<u8>),
    /// Lines of words.
    Lines(String),
    /// Bytes in gzip.
    Zipped(Vec<u8>),
    /// The header of an SPZ file of version 4, then columns that are compressed one by one.
    Columns(Vec<u8>, Vec<Vec<u8>>),
    /// A magic number, then records with their lengths: .4dgs.
    Records(Vec<u8>, Vec<(u8, Vec<u8>)>),
    Archive(Vec<Entry>),
    /// JSON and binary data: in chunks, or as text.
    Gltf {
        json: String,
        binary: Vec<u8>,
        is_text: bool,
    },
}

impl Seed {
    /// Parts a file.
    pub fn of(file: Vec<u8>) -> Self {
        if file.starts_with(b"PK\x03\x04") {
            let entries = unpacked(&file).into_iter().map(|(name, body)| Entry::new(name, body));
            return Self::Archive(entries.collect());
        }
        if file.starts_with(b"ply\n") {
            const END: &[u8] = b"end_header\n";
            let end = file.windows(END.len()).position(|window| window == END).expect("a header") + END.len();
            let header = String::from_utf8(file[..end].to_vec()).expect("text");
            if header.contains("ascii") {
                return Self::Lines(String::from_utf8(file).expect("text"));
            }
            return Self::Headed(header, file[end..].to_vec());
        }
        if file.starts_with(&[0x1f, 0x8b]) {
            let mut inner = Vec::new();
            GzDecoder::new(&file[..]).read_to_end(&mut inner).expect("whole gzip");
            return Self::Zipped(inner);
        }
        if file.starts_with(b"glTF") {
            let (json, binary) = chunks(&file);
            let json = String::from_utf8(json.to_vec()).expect("text");
            return Self::Gltf { json, binary: binary.to_vec(), is_text: false };
        }
        if file.starts_with(&fourdgs::MAGIC) {
            let (magic, mut rest) = file.split_at(fourdgs::MAGIC.len());
            let mut records = Vec::new();
            while let Some((&[opcode, ref length @ ..], after)) = rest.split_first_chunk::<9>() {
                let length = u64::from_le_bytes(*length) as usize;
                let Some((content, after)) = after.split_at_checked(length) else { break };
                records.push((opcode, content.to_vec()));
                rest = after;
            }
            assert!(rest == magic, "the file ends with its magic number");
            return Self::Records(magic.to_vec(), records);
        }
        Self::Bytes(file)
    }

    /// Returns the same SPZ file, of version 3, in versions 2 and 4.
    pub fn other_versions(&self) -> [Self; 2] {
        let Self::Zipped(inner) = self else { panic!("SPZ of version 3 is in gzip") };
        let (head, body) = inner.split_at(SPZ[0]);
        let count = u32::from_le_bytes([head[8], head[9], head[10], head[11]]) as usize;
        let rest = (usize::from(head[12]) + 1).pow(2) * 3 - 3;
        let mut left = body;
        let mut columns = Vec::new();
        for width in [9, 1, 3, 3, 4, rest] {
            let (column, after) = left.split_at(width * count);
            columns.push(column.to_vec());
            left = after;
        }
        let versioned = |version: u8| [&head[..4], &[version], &head[5..]].concat();
        let mut second = columns.clone();
        second[4] = columns[4].chunks_exact(4).flat_map(|four| [four[0], four[1], four[2]]).collect();
        let second = Self::Zipped([versioned(2), second.concat()].concat());
        columns.retain(|column| !column.is_empty());
        let mut fourth = versioned(4);
        fourth[15] = columns.len() as u8;
        fourth.extend((SPZ[1] as u32).to_le_bytes());
        fourth.resize(SPZ[1], 0);
        [second, Self::Columns(fourth, columns)]
    }

    /// Returns the same glTF file as text.
    pub fn into_text(self) -> Self {
        let Self::Gltf { json, binary, .. } = self else { panic!("a glTF file") };
        let json = json.replacen(r#""buffers":[{"#, &format!(r#""buffers":[{{"uri":"{BINARY}","#), 1);
        Self::Gltf { json, binary, is_text: true }
    }

    /// Returns the file.
    pub fn file(&self) -> Vec<u8> {
        match self {
            Self::Bytes(file) => file.clone(),
            Self::Headed(header, body) => [header.as_bytes(), body].concat(),
            Self::Lines(text) => text.clone().into_bytes(),
            Self::Zipped(inner) => gzip(inner),
            Self::Columns(head, columns) => framed(head, columns),
            Self::Records(magic, records) => recorded(magic, records),
            Self::Archive(entries) => archive::file(entries),
            Self::Gltf { json, binary, is_text: true } => as_uri(json, binary),
            Self::Gltf { json, binary, is_text: false } => chunked(json, binary),
        }
    }

    /// Returns a changed file; `other` is another one.
    pub fn changed(&self, other: &[u8], random: &mut Random) -> Vec<u8> {
        let mut file = match self {
            Self::Bytes(file) => return changed(file, other, random),
            Self::Headed(header, body) => {
                let header = match random.below(4) {
                    0 => text::change(header, header, random),
                    1 => words::change(header, header, random),
                    _ => header.clone(),
                };
                let body = if random.one_in(2) { changed(body, other, random) } else { body.clone() };
                [header.as_bytes(), &body].concat()
            }
            Self::Lines(text) => words::change(text, text, random).into_bytes(),
            Self::Zipped(inner) => gzip(&changed(inner, other, random)),
            Self::Columns(head, columns) => {
                let (mut head, mut columns) = (head.clone(), columns.clone());
                let at = random.below(columns.len() + 1);
                let part = columns.get_mut(at).unwrap_or(&mut head);
                *part = changed(part, other, random);
                framed(&head, &columns)
            }
            Self::Records(magic, records) => {
                let mut records = records.clone();
                for _ in 0..=random.below(2) {
                    let at = random.below(records.len());
                    let content = &mut records[at].1;
                    *content = changed(content, other, random);
                }
                recorded(magic, &records)
            }
            Self::Archive(entries) => {
                let mut entries = entries.clone();
                for _ in 0..=random.below(2) {
                    change_entry(&mut entries, other, random);
                }
                archive::file(&entries)
            }
            Self::Gltf { json, binary, is_text } => {
                let new = if random.one_in(4) { json.clone() } else { text::change(json, json, random) };
                let binary = if random.one_in(2) { changed(binary, other, random) } else { binary.clone() };
                if *is_text { as_uri(&new, &binary) } else { chunked(&new, &binary) }
            }
        };
        if random.one_in(16) {
            file = changed(&file, other, random);
        }
        file
    }
}

/// Changes numbers of four bytes, or any bytes.
fn changed(file: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut file = file.to_vec();
    if random.one_in(3) {
        bytes::change_numbers(&mut file, random);
    } else {
        bytes::change(&mut file, other, random);
    }
    file
}

/// Changes the list of entries, an entry, its JSON or its texture.
fn change_entry(entries: &mut Vec<Entry>, other: &[u8], random: &mut Random) {
    let at = random.below(entries.len());
    let next = |extension: &str| {
        let mut from_here = (at..entries.len()).chain(0..at);
        from_here.find(|&at| entries[at].name.ends_with(extension))
    };
    match (random.below(8), next(".json"), next(".webp")) {
        (0, ..) => archive::change(entries, &[], random),
        (1..=4, Some(at), _) => {
            let entry = &mut entries[at];
            let json = String::from_utf8_lossy(&entry.body).into_owned();
            entry.body = text::change(&json, &json, random).into_bytes();
        }
        (5 | 6, _, Some(at)) => entries[at].body = texture(random),
        _ => {
            if let Some(entry) = entries.get_mut(at) {
                entry.body = changed(&entry.body, other, random);
            }
        }
    }
}

/// Returns a texture of random texels; alpha is often one that rotations have.
fn texture(random: &mut Random) -> Vec<u8> {
    let [width, height] = [(); 2].map(|()| 1 + random.below(SIDE));
    let of_rotations = random.one_in(2);
    let texels: Vec<u8> = (0..width * height)
        .flat_map(|_| {
            let [red, green, blue, alpha, ..] = random.bits().to_le_bytes();
            [red, green, blue, if of_rotations { 252 + alpha % 4 } else { alpha }]
        })
        .collect();
    let mut file = Vec::new();
    let encoder = WebPEncoder::new(&mut file);
    encoder.encode(&texels, width as u32, height as u32, ColorType::Rgba8).expect("a small picture");
    file
}

/// Returns an SPZ file of version 4.
fn framed(head: &[u8], columns: &[Vec<u8>]) -> Vec<u8> {
    let mut file = head.to_vec();
    let frames: Vec<Vec<u8>> =
        columns.iter().map(|column| zstd::bulk::compress(column, 1).expect("bytes can be compressed")).collect();
    for (frame, column) in frames.iter().zip(columns) {
        file.extend([frame.len(), column.len()].into_iter().flat_map(|length| (length as u64).to_le_bytes()));
    }
    file.extend(frames.concat());
    file
}

fn recorded(magic: &[u8], records: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let mut file = magic.to_vec();
    for (opcode, content) in records {
        file.push(*opcode);
        file.extend((content.len() as u64).to_le_bytes());
        file.extend(content);
    }
    file.extend(magic);
    file
}

/// Returns the JSON and the binary chunk of a file.
pub fn chunks(file: &[u8]) -> (&[u8], &[u8]) {
    let length = u32::from_le_bytes([file[12], file[13], file[14], file[15]]) as usize;
    let (json, binary) = file[20..].split_at(length);
    (json, &binary[8..])
}

/// Returns a binary glTF file.
pub fn chunked(json: &str, binary: &[u8]) -> Vec<u8> {
    let padded = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (json, binary) = (padded(json.as_bytes(), b' '), padded(binary, 0));
    let numbers =
        |numbers: &[usize]| numbers.iter().flat_map(|&number| (number as u32).to_le_bytes()).collect::<Vec<_>>();
    let head = numbers(&[2, 28 + json.len() + binary.len(), json.len()]);
    [b"glTF", &head[..], b"JSON", &json, &numbers(&[binary.len()]), b"BIN\0", &binary].concat()
}

/// Returns a glTF file as text.
fn as_uri(json: &str, binary: &[u8]) -> Vec<u8> {
    let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(binary));
    json.replace(BINARY, &uri).into_bytes()
}
