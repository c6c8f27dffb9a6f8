//! Packages that are split into parts, changed and written again.
//!
//! In: the bytes of a package. Out: the header as text and the bodies of the sections; and a package of these parts
//! with a valid checksum.

use bevy_gs4d::codec::package::{MAGIC, VERSION};

/// The parts of a package. [`seal`](Self::seal) joins them, with the checksum of the current header.
#[derive(Clone)]
pub struct Parts {
    pub header: String,
    pub bodies: Vec<Vec<u8>>,
}

impl Parts {
    /// Splits a package into its parts.
    pub fn of(file: &[u8]) -> Self {
        let number = |at: usize| u64::from_le_bytes(file[at..at + 8].try_into().expect("eight bytes")) as usize;
        let mut at = 20 + number(8);
        let header = String::from_utf8(file[20..at].to_vec()).expect("the header is UTF-8");
        let mut bodies = Vec::new();
        while at < file.len() {
            let end = at + 8 + number(at);
            bodies.push(file[at + 8..end].to_vec());
            at = end;
        }
        Self { header, bodies }
    }

    /// Joins the parts to a package.
    pub fn seal(&self) -> Vec<u8> {
        let mut start = MAGIC.to_vec();
        start.extend(VERSION.to_le_bytes());
        start.extend((self.header.len() as u64).to_le_bytes());
        let checksum = crc32fast::hash(&[&start[..], self.header.as_bytes()].concat());
        let mut file = [&start[..], &checksum.to_le_bytes()[..], self.header.as_bytes()].concat();
        for body in &self.bodies {
            file.extend((body.len() as u64).to_le_bytes());
            file.extend(body);
        }
        file
    }

    /// Replaces the first occurrence of `from` in the header.
    pub fn swap(mut self, from: &str, to: &str) -> Self {
        assert!(self.header.contains(from), "the header contains {from:?}:\n{}", self.header);
        self.header = self.header.replacen(from, to, 1);
        self
    }
}
