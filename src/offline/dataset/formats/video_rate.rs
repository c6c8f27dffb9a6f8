//! The rate of frames of a video.
//!
//! In: the path of an MP4 or MOV file. Out: its frames a second, by the durations of its samples, or `None` if they are
//! not there. Only the boxes of the header are read, from a file of any length. No number of the file is used before
//! as many bytes are known to be there.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::RangeInclusive;
use std::path::Path;

/// Most bytes of the box `moov`: eight hours at 60 frames a second take 30 MB.
const MAX_MOVIE: u64 = 1 << 26;
/// Most boxes before `moov`.
const MAX_BOXES: usize = 1 << 12;
/// Rates that a camera may have, frames a second.
const RATES: RangeInclusive<f64> = 0.1..=10_000.0;

/// Returns the frames a second of the first track of pictures.
pub(crate) fn of(path: &Path) -> Option<f64> {
    let movie = movie(File::open(path).ok()?)?;
    boxes(&movie).filter(|(kind, _)| kind == b"trak").find_map(|(_, track)| of_track(track))
}

/// Returns the contents of the box `moov`, which may be behind the pictures.
fn movie(mut file: impl Read + Seek) -> Option<Vec<u8>> {
    let length = file.seek(SeekFrom::End(0)).ok()?;
    let mut at = 0;
    for _ in 0..MAX_BOXES {
        file.seek(SeekFrom::Start(at)).ok()?;
        let mut header = [0; 16];
        file.read_exact(&mut header[..8]).ok()?;
        if u32::from_be_bytes(*header.first_chunk()?) == 1 {
            file.read_exact(&mut header[8..]).ok()?;
        }
        let (start, size) = extent(&header, length - at)?;
        if header[4..8] == *b"moov" {
            let mut contents = Vec::new();
            file.seek(SeekFrom::Start(at + start)).ok()?;
            file.take((size - start).min(MAX_MOVIE)).read_to_end(&mut contents).ok()?;
            return Some(contents);
        }
        at += size;
    }
    None
}

/// Returns the offset of the contents of a box and its size, bytes, of at most `left`, from its first 16 bytes.
fn extent(header: &[u8; 16], left: u64) -> Option<(u64, u64)> {
    let (start, size) = match u32::from_be_bytes(*header.first_chunk()?) {
        0 => (8, left),
        1 => (16, u64::from_be_bytes(*header.last_chunk()?)),
        size => (8, u64::from(size)),
    };
    (start <= size && size <= left).then_some((start, size))
}

/// Returns the boxes inside of a box: their kinds and contents, up to the first that is not whole.
fn boxes(mut bytes: &[u8]) -> impl Iterator<Item = ([u8; 4], &[u8])> {
    std::iter::from_fn(move || {
        let mut header = [0; 16];
        let there = bytes.len().min(16);
        header[..there].copy_from_slice(&bytes[..there]);
        let kind = *header[4..].first_chunk()?;
        let (start, size) = extent(&header, bytes.len() as u64)?;
        let (whole, rest) = bytes.split_at_checked(usize::try_from(size).ok()?)?;
        bytes = rest;
        Some((kind, whole.get(start as usize..)?))
    })
}

/// Returns the contents of the first box of a kind.
fn inside<'a>(bytes: &'a [u8], kind: &[u8; 4]) -> Option<&'a [u8]> {
    boxes(bytes).find(|(found, _)| found == kind).map(|(_, contents)| contents)
}

/// Returns the frames a second of a track; `None` if it has no pictures.
fn of_track(track: &[u8]) -> Option<f64> {
    let media = inside(track, b"mdia")?;
    let handler = inside(media, b"hdlr")?;
    if handler.get(8..12)? != b"vide" {
        return None;
    }
    // Two dates before the unit of time have four or eight bytes each.
    let header = inside(media, b"mdhd")?;
    let unit = u32_at(header, if *header.first()? == 1 { 20 } else { 12 })?;
    let durations = inside(inside(inside(media, b"minf")?, b"stbl")?, b"stts")?;
    let (mut frames, mut units) = (0.0, 0.0);
    for run in durations.get(8..)?.as_chunks::<8>().0.iter().take(u32_at(durations, 4)? as usize) {
        let [count, duration] = [0, 4].map(|at| u32_at(run, at).map_or(0.0, f64::from));
        frames += count;
        units += count * duration;
    }
    Some(frames * f64::from(unit) / units).filter(|rate| RATES.contains(rate))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|bytes| u32::from_be_bytes(*bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a box.
    fn boxed(kind: &[u8; 4], contents: &[u8]) -> Vec<u8> {
        [&(contents.len() as u32 + 8).to_be_bytes()[..], kind, contents].concat()
    }

    /// Returns a box with these numbers in it.
    fn numbers(kind: &[u8; 4], numbers: &[u32]) -> Vec<u8> {
        boxed(kind, &numbers.iter().flat_map(|number| number.to_be_bytes()).collect::<Vec<u8>>())
    }

    /// Returns a track of this kind, in units of 1/15360 s, with these runs of frames and their durations.
    fn track(handler: &[u8; 4], version: u32, runs: &[u32]) -> Vec<u8> {
        let dates = if version == 0 { 2 } else { 4 };
        let header = [&[version << 24][..], &vec![0; dates], &[15360, 99]].concat();
        let times = [&[0, runs.len() as u32 / 2][..], runs].concat();
        let table = boxed(b"minf", &boxed(b"stbl", &numbers(b"stts", &times)));
        let handler = boxed(b"hdlr", &[&[0; 8][..], handler, &[0; 12]].concat());
        boxed(b"trak", &boxed(b"mdia", &[numbers(b"mdhd", &header), handler, table].concat()))
    }

    fn rate(file: &[u8]) -> Option<f64> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.mp4");
        std::fs::write(&path, file).expect("the folder can be written to");
        of(&path)
    }

    #[test]
    fn rates_follow_from_the_durations_of_frames() {
        let sound = track(b"soun", 0, &[75, 1024]);
        for version in [0, 1] {
            let movie = boxed(b"moov", &[sound.clone(), track(b"vide", version, &[99, 256, 1, 256])].concat());
            let file = [boxed(b"ftyp", b"isom"), movie.clone(), boxed(b"mdat", &[7; 100])].concat();
            assert_eq!(rate(&file), Some(60.0), "256 units of 1/15360 s, version {version}");
            let large = [&1u32.to_be_bytes()[..], b"mdat", &116u64.to_be_bytes(), &[7; 100]].concat();
            let mut last = [large, movie].concat();
            assert_eq!(rate(&last), Some(60.0), "behind pictures whose length has 64 bits");
            let at = last.len() - boxed(b"moov", b"").len() - 4;
            last.truncate(at);
            assert_eq!(rate(&last), None, "cut off");
        }
        let mixed = boxed(b"moov", &track(b"vide", 0, &[60, 256, 30, 512]));
        assert_eq!(rate(&mixed), Some(45.0), "90 frames in two seconds");
    }

    #[test]
    fn videos_without_a_rate_have_none() {
        let movie = |runs: &[u32]| boxed(b"moov", &track(b"vide", 0, runs));
        for runs in [&[][..], &[0, 256], &[100, 0], &[1, u32::MAX], &[u32::MAX, 1]] {
            assert_eq!(rate(&movie(runs)), None, "{runs:?}");
        }
        assert_eq!(rate(&boxed(b"moov", &track(b"soun", 0, &[75, 1024]))), None, "sound alone");
        assert_eq!(rate(b"RIFF\x10\0\0\0AVI LIST"), None, "another kind of file");
        assert_eq!(rate(b""), None, "an empty file");
        let whole = movie(&[100, 256]);
        for length in 0..whole.len() {
            assert_eq!(rate(&whole[..length]), None, "cut off at {length} bytes");
        }
        let mut changed = whole.clone();
        for at in 0..whole.len() {
            for byte in [0, 1, 0x7f, 0xff] {
                changed[at] = byte;
                // Any rate, and no panic.
                let found = rate(&changed);
                assert!(found.is_none_or(|rate| RATES.contains(&rate)), "byte {at} is {byte}: {found:?}");
            }
            changed[at] = whole[at];
        }
    }
}
