//! The check that a JPEG is complete. Decoders fill missing data with gray and report success: the strict mode of
//! zune-jpeg 0.5.15 accepts each of the 5,725 beginnings of a picture of 64 × 48 pixels that end in an end marker.
//!
//! In: the bytes of a JPEG. Out: an error that describes the missing data, if any.
//!
//! Markers are read up to the end of the image. In sequential pictures the Huffman codes of every scan are counted,
//! since each block of 8 × 8 values has its own codes. A progressive picture may end after any of its scans: it needs
//! the end of the image, and a scan of each color component.

use super::huffman::{Bits, Table};

/// Starts of frames: baseline, extended sequential, progressive. Decoders read no other frames.
const FRAMES: [u8; 3] = [0xc0, 0xc1, 0xc2];
const PROGRESSIVE: u8 = 0xc2;
const HUFFMAN_TABLES: u8 = 0xc4;
const FIRST_RESTART: u8 = 0xd0;
const LAST_RESTART: u8 = 0xd7;
const START_OF_IMAGE: u8 = 0xd8;
const END_OF_IMAGE: u8 = 0xd9;
const SCAN: u8 = 0xda;
const RESTART_INTERVAL: u8 = 0xdd;
/// A marker without a segment, which is skipped.
const TEMPORARY: u8 = 0x01;

const CUT_OFF: &str = "it is cut off before its end; copy or download it again";
const TOO_SHORT: &str = "its data ends before the picture does; copy or download it again";
const DAMAGED: &str = "its headers contradict each other; copy or download it again";

/// Checks that the picture has data to its end.
///
/// # Errors
/// What is missing, and the remedy.
pub(super) fn check(bytes: &[u8]) -> Result<(), &'static str> {
    let (mut picture, mut at) = (Jpeg::default(), 0);
    loop {
        let (marker, after) = next_marker(bytes, at).ok_or(CUT_OFF)?;
        at = after;
        match marker {
            END_OF_IMAGE => return picture.finish(),
            START_OF_IMAGE | TEMPORARY | FIRST_RESTART..=LAST_RESTART => continue,
            _ => {}
        }
        let segment = segment(bytes, at).ok_or(CUT_OFF)?;
        at += 2 + segment.len();
        match marker {
            HUFFMAN_TABLES => picture.read_tables(segment).ok_or(DAMAGED)?,
            RESTART_INTERVAL => {
                let &[high, low, ..] = segment else { return Err(DAMAGED) };
                picture.restart_interval = usize::from(u16::from_be_bytes([high, low]));
            }
            SCAN => {
                let end = end_of_scan(bytes, at).ok_or(CUT_OFF)?;
                picture.read_scan(segment, &bytes[at..end])?;
                at = end;
            }
            frame if FRAMES.contains(&frame) => {
                picture.frame = Some(Frame::read(segment, frame != PROGRESSIVE).ok_or(DAMAGED)?);
            }
            _ => {}
        }
    }
}

/// Returns the next marker at or after `at`, and the end of the marker; `None` if there is none.
fn next_marker(bytes: &[u8], mut at: usize) -> Option<(u8, usize)> {
    loop {
        at += bytes.get(at..)?.iter().position(|&byte| byte == 0xff)? + 1;
        match *bytes.get(at)? {
            // A byte of 255 in the data, or a fill byte before a marker.
            0 | 0xff => {}
            marker => return Some((marker, at + 1)),
        }
    }
}

/// Returns the contents of the segment whose length is at `at`; `None` if the segment is cut off.
fn segment(bytes: &[u8], at: usize) -> Option<&[u8]> {
    let length = u16::from_be_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]);
    bytes.get(at + 2..at + usize::from(length).max(2))
}

/// Returns the end of the data of a scan: the first marker that is not a restart.
fn end_of_scan(bytes: &[u8], mut at: usize) -> Option<usize> {
    loop {
        let (marker, after) = next_marker(bytes, at)?;
        if !(FIRST_RESTART..=LAST_RESTART).contains(&marker) {
            return Some(after - 2);
        }
        at = after;
    }
}

/// The headers that have been read.
#[derive(Default)]
struct Jpeg {
    frame: Option<Frame>,
    /// Four tables for first coefficients, four for further coefficients.
    tables: [[Option<Table>; 4]; 2],
    /// Number of units between restarts; 0 without restarts.
    restart_interval: usize,
}

/// The picture as its header describes it.
struct Frame {
    sequential: bool,
    /// Width and height, pixels.
    size: [usize; 2],
    components: Vec<Component>,
}

/// A color component.
struct Component {
    id: u8,
    /// Blocks across and down in a unit of the picture.
    blocks: [usize; 2],
    /// Whether it is part of a scan.
    scanned: bool,
}

impl Jpeg {
    /// Reads the tables of a segment; `None` if they are not valid.
    fn read_tables(&mut self, mut segment: &[u8]) -> Option<()> {
        while let Some((&[place, ref counts @ ..], rest)) = segment.split_first_chunk::<17>() {
            let count: usize = counts.iter().map(|&count| usize::from(count)).sum();
            let (symbols, rest) = rest.split_at_checked(count)?;
            let tables = self.tables.get_mut(usize::from(place >> 4))?;
            *tables.get_mut(usize::from(place & 15))? = Some(Table::new(counts, symbols)?);
            segment = rest;
        }
        Some(())
    }

    /// Marks the components of a scan as scanned. In a sequential picture, counts the codes of the scan.
    fn read_scan(&mut self, header: &[u8], data: &[u8]) -> Result<(), &'static str> {
        let frame = self.frame.as_mut().ok_or(DAMAGED)?;
        let (&count, chosen) = header.split_first().ok_or(DAMAGED)?;
        let chosen = chosen.as_chunks::<2>().0.get(..usize::from(count)).ok_or(DAMAGED)?;
        let mut parts = Vec::new();
        for &[id, tables] in chosen {
            let component = frame.components.iter_mut().find(|component| component.id == id).ok_or(DAMAGED)?;
            component.scanned = true;
            parts.push((component.blocks, tables));
        }
        if parts.is_empty() {
            return Err(DAMAGED);
        }
        if !frame.sequential {
            return Ok(());
        }
        let alone = parts.len() == 1;
        let [width, height] = if alone { frame.blocks_of(parts[0].0) } else { frame.units() };
        let known = &self.tables;
        let with_tables = |([across, down], tables): ([usize; 2], u8)| {
            let table = |class: usize, place: u8| known[class].get(usize::from(place))?.as_ref();
            let blocks = if alone { 1 } else { across * down };
            Some((blocks, table(0, tables >> 4)?, table(1, tables & 15)?))
        };
        // Motion JPEG omits the standard tables.
        let Some(parts) = parts.into_iter().map(with_tables).collect::<Option<Vec<_>>>() else { return Ok(()) };
        let mut bits = Bits::new(data);
        for unit in 0..width * height {
            if self.restart_interval > 0 && unit > 0 && unit % self.restart_interval == 0 {
                bits.restart().ok_or(TOO_SHORT)?;
            }
            for &(blocks, first, others) in &parts {
                for _ in 0..blocks {
                    bits.skip_block(first, others).ok_or(TOO_SHORT)?;
                }
            }
        }
        Ok(())
    }

    /// Checks, at the end of the image, that every component has a scan.
    fn finish(&self) -> Result<(), &'static str> {
        match &self.frame {
            Some(frame) if frame.components.iter().all(|component| component.scanned) => Ok(()),
            Some(_) => Err(TOO_SHORT),
            None => Err(DAMAGED),
        }
    }
}

impl Frame {
    /// Reads the header of a frame; `None` if it is not valid.
    fn read(segment: &[u8], sequential: bool) -> Option<Self> {
        let (&[_, height_high, height_low, width_high, width_low, count], rest) = segment.split_first_chunk::<6>()?;
        let side = |bytes| usize::from(u16::from_be_bytes(bytes));
        let component = |&[id, sampling, _]: &[u8; 3]| {
            let blocks = [sampling >> 4, sampling & 15].map(usize::from);
            Component { id, blocks, scanned: false }
        };
        let components: Vec<Component> = rest.as_chunks::<3>().0.iter().map(component).collect();
        let is_sampled = |component: &Component| component.blocks.iter().all(|blocks| (1..=4).contains(blocks));
        let is_sound = components.len() == usize::from(count) && components.iter().all(is_sampled);
        let size = [side([width_high, width_low]), side([height_high, height_low])];
        is_sound.then_some(Self { sequential, size, components })
    }

    /// Returns the largest number of blocks across and down of a component in a unit.
    fn most_blocks(&self) -> [usize; 2] {
        let most = |axis: usize| self.components.iter().map(|component| component.blocks[axis]).max().unwrap_or(1);
        [most(0), most(1)]
    }

    /// Returns the number of units across and down; a unit has the blocks of all components.
    fn units(&self) -> [usize; 2] {
        let most = self.most_blocks();
        [0, 1].map(|axis| self.size[axis].div_ceil(8 * most[axis]))
    }

    /// Returns the number of blocks across and down of a component that is alone in its scan, which has no blocks
    /// beyond its edge.
    fn blocks_of(&self, blocks: [usize; 2]) -> [usize; 2] {
        let most = self.most_blocks();
        [0, 1].map(|axis| (self.size[axis] * blocks[axis]).div_ceil(most[axis]).div_ceil(8))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::jpeg::JpegEncoder;
    use image::{GrayImage, RgbImage};

    /// Returns bytes of a linear congruential generator.
    fn noise(count: u32) -> Vec<u8> {
        let mut state = 7u32;
        let next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        std::iter::repeat_with(next).take(count as usize).collect()
    }

    fn color(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        let image = RgbImage::from_raw(width, height, noise(width * height * 3)).expect("enough bytes");
        image.write_with_encoder(JpegEncoder::new_with_quality(&mut bytes, 60)).expect("it can be encoded");
        bytes
    }

    fn gray(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        let image = GrayImage::from_raw(width, height, noise(width * height)).expect("enough bytes");
        image.write_with_encoder(JpegEncoder::new_with_quality(&mut bytes, 60)).expect("it can be encoded");
        bytes
    }

    fn place(bytes: &[u8], marker: u8) -> usize {
        bytes.windows(2).position(|pair| pair == [0xff, marker]).expect("the marker is there")
    }

    #[test]
    fn complete_pictures_are_accepted() {
        for bytes in [color(37, 21), color(8, 8), color(1, 1), gray(37, 21), gray(16, 8)] {
            assert_eq!(check(&bytes), Ok(()), "the encoded picture is complete");
            assert_eq!(check(&[&bytes[..], b"more"].concat()), Ok(()), "bytes after the end are ignored");
        }
    }

    #[test]
    fn a_picture_that_is_cut_off_is_refused() {
        for bytes in [color(37, 21), gray(37, 21)] {
            for length in 0..bytes.len() {
                assert!(check(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
            }
        }
    }

    #[test]
    fn a_cut_picture_with_an_end_marker_is_refused() {
        for bytes in [color(37, 21), gray(37, 21)] {
            for length in 2..bytes.len() - 2 {
                let ended = [&bytes[..length], &[0xff, END_OF_IMAGE]].concat();
                assert!(check(&ended).is_err(), "{length} of {} bytes and an end", bytes.len());
            }
        }
    }

    #[test]
    fn codes_continue_after_restart_markers() {
        let one = gray(8, 8);
        let (frame, scan) = (place(&one, FRAMES[0]), place(&one, SCAN));
        let data = scan + 2 + usize::from(u16::from_be_bytes([one[scan + 2], one[scan + 3]]));
        // The same block twice, each after a restart.
        let mut header = one[..data].to_vec();
        header[frame + 7..frame + 9].copy_from_slice(&[0, 16]);
        header.splice(scan..scan, [0xff, RESTART_INTERVAL, 0, 4, 0, 1]);
        let block = &one[data..one.len() - 2];
        let two = |between: &[u8]| [&header[..], block, between, block, &[0xff, END_OF_IMAGE]].concat();
        assert_eq!(check(&two(&[0xff, FIRST_RESTART])), Ok(()), "a restart marker separates the blocks");
        assert_eq!(check(&two(&[])), Err(TOO_SHORT), "a missing restart marker is found");
        let half = [&header[..], block, &[0xff, FIRST_RESTART, 0xff, END_OF_IMAGE]].concat();
        assert_eq!(check(&half), Err(TOO_SHORT), "a missing block is found");
    }

    #[test]
    fn damaged_bytes_never_panic() {
        let good = color(24, 24);
        for seed in 0..400 {
            let mut bytes = good.clone();
            for at in [seed * 31, seed * 57 + 5, seed * 113 + 2] {
                let at = at % bytes.len();
                bytes[at] = bytes[at].wrapping_add((seed % 251) as u8 + 1);
            }
            // Either result is right.
            let found = check(&bytes);
            assert!(found.is_ok() || found.is_err_and(|reason| reason.ends_with("again")), "seed {seed}: {found:?}");
        }
    }
}
