//! What the decoder of PNG does not check: that the palette is one of whole colors.
//!
//! In: the bytes of a file. Out: whether its palette can be used; the decoder panics if not.

/// Bytes of the signature, and of a chunk besides its contents: length, type and checksum.
const SIGNATURE: usize = 8;
const LENGTH: usize = 4;
const TYPE: usize = 4;
const CHECKSUM: usize = 4;

/// Returns whether every palette has from 1 to 256 whole colors. Chunks after the first that is cut off are not looked at.
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
    fn palettes_have_whole_colors() {
        assert!(has_whole_palette(&file(&[(b"IHDR", 13), (b"IDAT", 7)])), "no palette");
        assert!(has_whole_palette(&file(&[(b"IHDR", 13), (b"PLTE", 768), (b"IDAT", 7)])), "256 colors");
        for length in [0, 1, 4, 771] {
            assert!(!has_whole_palette(&file(&[(b"IHDR", 13), (b"PLTE", length)])), "{length} bytes");
        }
        assert!(has_whole_palette(b"short"), "what is no picture is for the decoder to refuse");
    }
}
