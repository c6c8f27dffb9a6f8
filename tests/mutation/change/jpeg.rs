//! JPEG files, segment by segment, and changes to them.
//!
//! In: a file. Out: a file in which the lengths of all segments are right.

use super::{bytes, change_list, numbers};
use crate::support::random::Random;

/// A segment: its marker, its contents without the length, and the entropy-coded pixels that follow it up to the next
/// marker.
#[derive(Clone)]
pub struct Segment {
    marker: u8,
    body: Vec<u8>,
    after: Vec<u8>,
}

/// The marker of a frame: the size of the picture and its components.
const FRAME: u8 = 0xc0;
/// The marker of a scan, whose pixels follow.
const SCAN: u8 = 0xda;

/// Splits a valid file into segments. The pixels end at the end of the file, including its end marker.
pub fn segments(file: &[u8]) -> Vec<Segment> {
    let mut segments = Vec::new();
    // After the marker at the start.
    let mut rest = &file[2..];
    while let [0xff, marker, high, low, ..] = *rest {
        let length = 2 + usize::from(u16::from_be_bytes([high, low]));
        let (segment, after) = rest.split_at(length);
        let pixels = if marker == SCAN { after.len() } else { 0 };
        segments.push(Segment { marker, body: segment[4..].to_vec(), after: after[..pixels].to_vec() });
        rest = &after[pixels..];
    }
    segments
}

/// Makes one to three changes.
pub fn change(segments: &mut Vec<Segment>, others: &[Segment], random: &mut Random) {
    for _ in 0..=random.below(3) {
        let at = random.below(segments.len());
        match random.below(8) {
            0..=2 => change_frame(segments, random),
            3..=5 => {
                if let Some(segment) = segments.get_mut(at) {
                    change_segment(segment, random);
                }
            }
            6 => {
                // The restart interval: number of units after which decoding restarts.
                let body = (numbers::whole(random) as u16).to_be_bytes().to_vec();
                segments.insert(at, Segment { marker: 0xdd, body, after: Vec::new() });
            }
            _ => change_list(segments, others, random),
        }
    }
}

/// Changes the contents of a segment, the pixels after it, or its marker.
fn change_segment(segment: &mut Segment, random: &mut Random) {
    match random.below(3) {
        0 => bytes::change(&mut segment.body, &[], random),
        1 => bytes::change(&mut segment.after, &[], random),
        _ => segment.marker = *random.pick(&[0xc0, 0xc1, 0xc2, 0xc3, 0xc4, 0xd0, 0xdb, 0xdd, 0xe1, 0xee]),
    }
}

/// Changes the size of the picture, or a byte of its components.
fn change_frame(segments: &mut [Segment], random: &mut Random) {
    let frame = segments.iter_mut().find(|segment| segment.marker == FRAME && segment.body.len() >= 9);
    let Some(Segment { body, .. }) = frame else { return };
    match random.below(4) {
        field @ (0 | 1) => {
            let side = *random.pick(&[0, 1, 8, 17, 255, 4096, 9758, 15_520, 16_384, 16_385, u16::MAX]);
            body[1 + 2 * field..][..2].copy_from_slice(&side.to_be_bytes());
        }
        2 => body[0] = *random.pick(&[0, 1, 7, 8, 12, 16, 255]),
        _ => {
            let at = 5 + random.below(body.len() - 5);
            body[at] = *random.pick(&[0, 1, 2, 3, 4, 0x11, 0x12, 0x14, 0x22, 0x41, 0x44, 255]);
        }
    }
}

/// Returns the file.
pub fn file(segments: &[Segment]) -> Vec<u8> {
    let mut file = vec![0xff, 0xd8];
    for Segment { marker, body, after } in segments {
        file.extend([0xff, *marker]);
        file.extend((body.len() as u16).saturating_add(2).to_be_bytes());
        file.extend(body);
        file.extend(after);
    }
    file
}
