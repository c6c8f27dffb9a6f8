//! PNG files, chunk by chunk, and changes to them.
//!
//! In: chunks. Out: a file in which every length and every checksum is right. Pixels are stored without being
//! compressed.

use super::{bytes, change_list, numbers};
use crate::support::random::Random;

/// A chunk: its type and contents; those of `IDAT` before compression.
#[derive(Clone)]
pub struct Chunk {
    kind: [u8; 4],
    body: Vec<u8>,
}

/// Returns the chunks of a picture of noise: of this size, color type (0 gray, 2 RGB, 3 palette, 4 gray and alpha, 6
/// RGBA) and depth, bits.
pub fn picture(width: u32, height: u32, color: u8, depth: u8, random: &mut Random) -> Vec<Chunk> {
    let channels = match color {
        2 => 3,
        4 => 2,
        6 => 4,
        _ => 1,
    };
    let row = (width as usize * channels * usize::from(depth)).div_ceil(8);
    // Each row begins with its filter.
    let pixel = |at: usize| if at.is_multiple_of(row + 1) { 0 } else { random.bits() as u8 };
    let pixels: Vec<u8> = (0..height as usize * (row + 1)).map(pixel).collect();
    let mut header = [width.to_be_bytes(), height.to_be_bytes()].concat();
    header.extend([depth, color, 0, 0, 0]);
    let mut chunks = vec![Chunk { kind: *b"IHDR", body: header }];
    if color == 3 {
        chunks.push(Chunk { kind: *b"PLTE", body: (0..=u8::MAX).flat_map(|at| [at, 255 - at, 7]).collect() });
        chunks.push(Chunk { kind: *b"tRNS", body: (0..=u8::MAX).collect() });
    }
    chunks.push(Chunk { kind: *b"IDAT", body: pixels });
    chunks.push(Chunk { kind: *b"IEND", body: Vec::new() });
    chunks
}

/// Makes one to three changes.
pub fn change(chunks: &mut Vec<Chunk>, others: &[Chunk], random: &mut Random) {
    const KINDS: [&[u8; 4]; 10] =
        [b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND", b"gAMA", b"iCCP", b"zTXt", b"acTL", b"fdAT"];
    for _ in 0..=random.below(3) {
        let at = random.below(chunks.len());
        match random.below(7) {
            0..=2 => change_header(chunks, random),
            3 | 4 => {
                if let Some(chunk) = chunks.get_mut(at) {
                    bytes::change(&mut chunk.body, &[], random);
                }
            }
            5 => {
                let body = (0..random.below(64)).map(|_| random.bits() as u8).collect();
                chunks.insert(at, Chunk { kind: **random.pick(&KINDS), body });
            }
            _ => change_list(chunks, others, random),
        }
    }
}

/// Changes one number of the header: a side, the depth, the color type, compression, filter or interlacing.
fn change_header(chunks: &mut [Chunk], random: &mut Random) {
    let header = chunks.iter_mut().find(|chunk| chunk.kind == *b"IHDR" && chunk.body.len() >= 13);
    let Some(Chunk { body, .. }) = header else { return };
    match random.below(7) {
        field @ (0 | 1) => body[4 * field..][..4].copy_from_slice(&(numbers::whole(random) as u32).to_be_bytes()),
        field => body[6 + field] = *random.pick(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 16, 32, 255]),
    }
}

/// Returns the file.
pub fn file(chunks: &[Chunk]) -> Vec<u8> {
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    for Chunk { kind, body } in chunks {
        let body = if kind == b"IDAT" { stored(body) } else { body.clone() };
        let named = [&kind[..], &body].concat();
        file.extend((body.len() as u32).to_be_bytes());
        file.extend(&named);
        file.extend(crc32fast::hash(&named).to_be_bytes());
    }
    file
}

/// Returns a zlib stream of these bytes that are not compressed.
fn stored(bytes: &[u8]) -> Vec<u8> {
    let mut stream = vec![0x78, 0x01];
    let count = bytes.chunks(0xffff).len();
    for (block, number) in bytes.chunks(0xffff).zip(1..) {
        let length = block.len() as u16;
        stream.push(u8::from(number == count));
        stream.extend([length.to_le_bytes(), (!length).to_le_bytes()].concat());
        stream.extend(block);
    }
    let (mut a, mut b) = (1u32, 0u32);
    for &byte in bytes {
        a = (a + u32::from(byte)) % 65521;
        b = (b + a) % 65521;
    }
    stream.extend((b << 16 | a).to_be_bytes());
    stream
}
