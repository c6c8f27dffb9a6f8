//! Changes to bytes without regard to their format.
//!
//! In: bytes, those of another seed. Out: bits flipped, numbers overwritten, parts removed, repeated, or inserted from
//! the other seed.

use super::numbers;
use crate::support::random::Random;

/// Most bytes of an input.
pub const MOST: usize = 1 << 22;

/// Makes one to four changes.
pub fn change(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    for _ in 0..=random.below(4) {
        change_once(bytes, other, random);
    }
    bytes.truncate(MOST);
}

/// Overwrites one to four numbers of four bytes each, at multiples of four bytes.
pub fn change_numbers(bytes: &mut [u8], random: &mut Random) {
    for _ in 0..=random.below(4) {
        let at = random.below(bytes.len() / 4) * 4;
        let number = if random.one_in(3) { numbers::whole(random) as u32 } else { numbers::float(random).to_bits() };
        for (byte, new) in bytes.iter_mut().skip(at).zip(number.to_le_bytes()) {
            *byte = new;
        }
    }
}

fn change_once(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    let at = random.below(bytes.len());
    let (part, foreign) = (random.part(bytes.len()), random.part(other.len()));
    match random.below(9) {
        0 | 1 => {
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1u8 << random.below(8);
            }
        }
        2 => {
            if let Some(byte) = bytes.get_mut(at) {
                *byte = random.bits() as u8;
            }
        }
        3 => {
            let number = number(random);
            for (byte, new) in bytes.iter_mut().skip(at).zip(number) {
                *byte = new;
            }
        }
        4 => bytes.truncate(at),
        5 => drop(bytes.drain(part)),
        6 => {
            let copies = bytes[part].repeat(*random.pick(&[1, 1, 2, 100]));
            bytes.splice(at..at, copies);
        }
        7 => {
            bytes.splice(at..at, other[foreign].iter().copied());
        }
        _ => {
            bytes.truncate(at);
            bytes.extend_from_slice(&other[foreign.start..]);
        }
    }
}

/// Returns the bytes of a number of any width, in either order.
fn number(random: &mut Random) -> Vec<u8> {
    let whole = numbers::whole(random);
    let mut bytes = match random.below(5) {
        0 => vec![whole as u8],
        1 => (whole as u16).to_le_bytes().to_vec(),
        2 => (whole as u32).to_le_bytes().to_vec(),
        3 => whole.to_le_bytes().to_vec(),
        _ => numbers::float(random).to_le_bytes().to_vec(),
    };
    if random.one_in(2) {
        bytes.reverse();
    }
    bytes
}
