//! Zip archives of stored entries, and changes to them.
//!
//! In: entries. Out: an archive whose directory is right, except for the fields that an entry overrides.

use super::{bytes, change_list, numbers};
use crate::support::random::Random;

/// An entry of an archive.
#[derive(Clone, Default)]
pub struct Entry {
    pub name: String,
    pub body: Vec<u8>,
    /// Compression method in both headers, 0 for none; bit 0 of the flags, encrypted.
    method: u16,
    flags: u16,
    /// Overrides of the headers: checksum, compressed size, size, offset of the local header.
    claims: [Option<u32>; 4],
}

impl Entry {
    /// Returns an entry whose headers are right.
    pub fn new(name: String, body: Vec<u8>) -> Self {
        Self { name, body, ..Self::default() }
    }
}

/// Changes the list of entries, a field of the headers of an entry, or its name.
pub fn change(entries: &mut Vec<Entry>, others: &[Entry], random: &mut Random) {
    let at = random.below(entries.len());
    let Some(entry) = entries.get_mut(at).filter(|_| !random.one_in(3)) else {
        return change_list(entries, others, random);
    };
    match random.below(6) {
        0 => entry.method = *random.pick(&[1, 8, 9, 12, 93, 99, u16::MAX]),
        1 => entry.flags = random.bits() as u16,
        2 | 3 => entry.claims[random.below(4)] = Some(numbers::whole(random) as u32),
        4 => {
            const NAMES: [&str; 7] =
                ["", "a/data.pkl", "archive/data.pkl", "archive/byteorder", "archive/data/0", "../x", "\u{1b}[2J"];
            entry.name = (*random.pick(&NAMES)).to_owned();
        }
        _ => bytes::change(&mut entry.body, &[], random),
    }
}

/// Returns the archive as a file.
pub fn file(entries: &[Entry]) -> Vec<u8> {
    let (mut file, mut directory) = (Vec::new(), Vec::new());
    for Entry { name, body, method, flags, claims } in entries {
        let truth = [crc32fast::hash(body), body.len() as u32, body.len() as u32, file.len() as u32];
        let [checksum, packed, size, offset] = [0, 1, 2, 3].map(|field| claims[field].unwrap_or(truth[field]));
        let mut common = words(&[20, *flags, *method, 0, 33]);
        common.extend([checksum, packed, size].into_iter().flat_map(u32::to_le_bytes));
        common.extend(words(&[name.len() as u16, 0]));
        file.extend([&b"PK\x03\x04"[..], &common, name.as_bytes(), body].concat());
        let own = [&b"PK\x01\x02"[..], &words(&[20]), &common, &words(&[0; 5]), &offset.to_le_bytes()];
        directory.extend([&own.concat()[..], name.as_bytes()].concat());
    }
    let count = entries.len() as u16;
    let mut end = words(&[0, 0, count, count]);
    end.extend([directory.len() as u32, file.len() as u32].into_iter().flat_map(u32::to_le_bytes));
    [&file[..], &directory, b"PK\x05\x06", &end, &words(&[0])].concat()
}

fn words(words: &[u16]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}
