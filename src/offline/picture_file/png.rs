//! The chunks of a PNG, before they are decoded.
//!
//! In: the bytes of a file. Out: the file without the chunks that change no pixel, since the decoder unpacks color
//! profiles of any size; whether its palette has complete colors, since the decoder panics if it has not.

/// Bytes of the signature.
const SIGNATURE: usize = 8;
/// The signature.
const START: &[u8] = b"\x89PNG\r\n\x1a\n";
/// The chunk of transparent colors, which changes pixels although readers may skip it.
const TRANSPARENCY: [u8; TYPE] = *b"tRNS";
/// The bit of the first letter of a type that marks a chunk as ancillary: readers may skip it.
const ANCILLARY: u8 = 0x20;
/// Bytes of the length of a chunk.
const LENGTH: usize = 4;
/// Bytes of the type of a chunk.
const TYPE: usize = 4;
/// Bytes of the checksum of a chunk.
const CHECKSUM: usize = 4;

/// Removes the chunks that change no pixel: color profiles, texts, and so on. A chunk that is cut off stays; files of
/// other formats are unchanged.
pub(super) fn remove_others(bytes: &mut Vec<u8>) {
    if !bytes.starts_with(START) {
        return;
    }
    let (mut from, mut to) = (SIGNATURE, SIGNATURE);
    while let Some((kind, length)) = chunk(bytes, from) {
        if kind == TRANSPARENCY || kind[0] & ANCILLARY == 0 {
            bytes.copy_within(from..from + length, to);
            to += length;
        }
        from += length;
    }
    bytes.drain(to..from);
}

/// Returns the type of the chunk at a place and its whole length, with type and checksum; `None` if the chunk is cut
/// off.
fn chunk(bytes: &[u8], at: usize) -> Option<([u8; TYPE], usize)> {
    let (length, after) = bytes.get(at..)?.split_first_chunk::<LENGTH>()?;
    let (kind, after) = after.split_first_chunk::<TYPE>()?;
    let contents = (u32::from_be_bytes(*length) as usize).checked_add(CHECKSUM)?;
    after.get(..contents)?;
    Some((*kind, LENGTH + TYPE + contents))
}

/// Returns whether every palette has from 1 to 256 complete colors. Chunks after the first chunk that is cut off are
/// not read.
pub(super) fn has_whole_palette(bytes: &[u8]) -> bool {
    let mut rest = bytes.get(SIGNATURE..).unwrap_or_default();
    while let Some((length, after)) = rest.split_first_chunk::<LENGTH>() {
        let length = u32::from_be_bytes(*length) as usize;
        let Some((kind, after)) = after.split_first_chunk::<TYPE>() else { break };
        if kind == b"PLTE" && !(length.is_multiple_of(3) && (3..=768).contains(&length)) {
            return false;
        }
        let Some(next) = length.checked_add(CHECKSUM).and_then(|size| after.get(size..)) else { break };
        rest = next;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(chunks: &[(&[u8; TYPE], usize)]) -> Vec<u8> {
        let mut bytes = vec![0; SIGNATURE];
        for (kind, length) in chunks {
            bytes.extend((*length as u32).to_be_bytes());
            bytes.extend_from_slice(*kind);
            bytes.extend(vec![0; length + CHECKSUM]);
        }
        bytes
    }

    #[test]
    fn chunks_that_change_no_pixel_are_removed() {
        let with = |kinds: &[(&[u8; TYPE], usize)]| [START, &file(kinds)[SIGNATURE..]].concat();
        let needed = [(b"IHDR", 13), (b"PLTE", 3), (b"tRNS", 1), (b"IDAT", 5), (b"IEND", 0)];
        let mut all = needed.to_vec();
        all.insert(1, (b"iCCP", 900));
        all.insert(4, (b"zTXt", 70));
        all.insert(6, (b"eXIf", 8));
        let mut found = with(&all);
        remove_others(&mut found);
        assert!(found == with(&needed), "the profile, the text and the data of the camera are gone");
        let mut cut = with(&all);
        cut.truncate(cut.len() - 30);
        remove_others(&mut cut);
        assert!(cut == [&with(&needed[..4])[..], &[0, 0]].concat(), "what is cut off stays: two bytes of a length");
        let other = [&b"other"[..], &with(&all)].concat();
        let mut found = other.clone();
        remove_others(&mut found);
        assert!(found == other, "a file of another format is not changed");
    }

    #[test]
    fn palettes_with_incomplete_colors_are_refused() {
        assert!(has_whole_palette(&file(&[(b"IHDR", 13), (b"IDAT", 7)])), "a file without a palette is accepted");
        assert!(
            has_whole_palette(&file(&[(b"IHDR", 13), (b"PLTE", 768), (b"IDAT", 7)])),
            "a palette of 256 colors is accepted"
        );
        for length in [0, 1, 4, 771] {
            assert!(
                !has_whole_palette(&file(&[(b"IHDR", 13), (b"PLTE", length)])),
                "a palette of {length} bytes is refused"
            );
        }
        assert!(has_whole_palette(b"short"), "a file that is not a picture is refused by the decoder, not here");
    }
}
